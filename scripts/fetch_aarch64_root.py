"""Fetch Debian's packages for aarch64 that a build on another machine links with.

    python scripts/fetch_aarch64_root.py build/aarch64-root [--suite sid] [--mirror URL]

The folder becomes a root with the C and C++ libraries, LLVM's archives, Python and NumPy, which
cmake/aarch64-linux-gnu.cmake reads. Nothing is installed on this system. The suite needs the
version of LLVM that this machine has.
"""

from __future__ import annotations

import argparse
import os
import subprocess
from pathlib import Path

PACKAGES = [
    "libc6",
    "libc6-dev",
    "linux-libc-dev",
    "libcrypt1",
    "libcrypt-dev",
    "libgcc-s1",
    "libgcc-15-dev",
    "libstdc++6",
    "libstdc++-15-dev",
    "zlib1g",
    "zlib1g-dev",
    "libzstd1",
    "libzstd-dev",
    "llvm-22-dev",
    "libmlir-22-dev",
    "libeigen3-dev",
    "libgtest-dev",
    "libgmock-dev",
    "libpython3.14-minimal",
    "libpython3.14-stdlib",
    "libpython3.14-dev",
    "python3.14-minimal",
    "python3.14",
    "python3-numpy",
    "libblas3",
    "liblapack3",
    "libgfortran5",
    "libexpat1",
    "libffi8",
    "libssl3t64",
    "libbz2-1.0",
    "liblzma5",
]

SETTINGS = """
APT::Architecture "arm64";
APT::Architectures {{ "arm64"; }};
APT::Sandbox::User "root";
Dir::State "{folder}/state";
Dir::State::status "{folder}/state/status";
Dir::Cache "{folder}/cache";
Dir::Etc::sourcelist "{folder}/sources.list";
Dir::Etc::sourceparts "/dev/null";
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("root", type=Path)
    parser.add_argument("--suite", default="sid")
    parser.add_argument("--mirror", default="http://deb.debian.org/debian")
    options = parser.parse_args()
    root = options.root.resolve()
    apt, debs = root / "var/apt", root / "var/debs"
    for folder in (apt / "state/lists/partial", apt / "cache/archives/partial", debs):
        folder.mkdir(parents=True, exist_ok=True)
    (apt / "state/status").touch()
    (apt / "apt.conf").write_text(SETTINGS.format(folder=apt))
    key = "signed-by=/usr/share/keyrings/debian-archive-keyring.gpg"
    source = f"deb [arch=arm64 {key}] {options.mirror} {options.suite} main\n"
    (apt / "sources.list").write_text(source)

    environment = {**os.environ, "APT_CONFIG": str(apt / "apt.conf")}
    for command in (["apt-get", "-q", "update"], ["apt-get", "-q", "download", *PACKAGES]):
        subprocess.run(command, check=True, cwd=debs, env=environment)
    for package in sorted(debs.glob("*.deb")):
        subprocess.run(["dpkg", "-x", package, root], check=True)
        package.unlink()
    # Packages of base-files make these.
    for name in ("lib", "bin"):
        if not (root / name).exists():
            (root / name).symlink_to(f"usr/{name}")
    # The links that update-alternatives makes when packages are installed.
    libraries = root / "usr/lib/aarch64-linux-gnu"
    for name in ("blas", "lapack"):
        link = libraries / f"lib{name}.so.3"
        if not link.exists():
            link.symlink_to(f"{name}/lib{name}.so.3")
    print(root)


if __name__ == "__main__":
    main()
