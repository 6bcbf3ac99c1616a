"""Install wheels where nothing else is, and run programs from them.

    python scripts/check_wheel.py dist/*.whl [--pythons /usr/bin/python3.10 ...] [--no-index]

Makes an empty environment of the interpreter that a wheel is for (this one, or one of `--pythons`)
in a temporary folder, lets pip install the wheel with what it asks for (`--no-index`: with NumPy
of the running interpreter, where there is no network), and runs there
the program of README.md, an example, and a look at which libraries the machine has to have. Asks
auditwheel which systems it is for, at least all with glibc 2.28. Prints the size of the wheel, what
its files take, and how long each step took. The exit status is 1 if a step fails or the wheel has
more than 25,000,000 bytes.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MOST = 25_000_000
# Libraries that every Linux of the last years has.
SYSTEM = re.compile(r"^(linux-vdso|ld-linux|lib(c|m|dl|rt|pthread|gcc_s|stdc\+\+))(?=[.-])")
# The package comes from the environment, not from the tree that the script lies in.
ORIGIN = """
import pathlib, sys, warp
place = pathlib.Path(warp.__file__).resolve()
assert pathlib.Path(sys.prefix).resolve() in place.parents, place
print(place.parent)
"""


def readme_program() -> str:
    """The first program of README.md."""
    return re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.S)[1]


class Environment:
    """An empty environment, and what runs in it."""

    def __init__(self, folder: Path, python: str):
        self.folder = folder
        subprocess.run([python, "-m", "venv", folder / "venv"], check=True)
        self.python = folder / "venv" / "bin" / "python"
        # Nothing of the caller's: no modules, no kernels compiled before.
        self.variables = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
        self.variables["WARP_CACHE_PATH"] = str(folder / "cache")

    def lend_numpy(self) -> None:
        """Lets programs there import the NumPy of this interpreter, and nothing else of it."""
        import numpy

        lent = self.folder / "lent"
        lent.mkdir()
        for part in Path(numpy.__file__).parent.parent.glob("numpy*"):
            (lent / part.name).symlink_to(part)
        self.variables["PYTHONPATH"] = str(lent)

    def run(self, title: str, *arguments) -> str:
        """Runs Python there, says how long it took, and returns what it printed.

        Raises:
            SystemExit: it failed.
        """
        begin = time.perf_counter()
        done = subprocess.run(
            [self.python, *map(str, arguments)],
            cwd=self.folder,
            env=self.variables,
            capture_output=True,
            text=True,
        )
        print(f"{title:<24}{time.perf_counter() - begin:7.1f} s", flush=True)
        if done.returncode:
            raise SystemExit(f"{title}: exit status {done.returncode}\n{done.stdout}{done.stderr}")
        return done.stdout


def foreign_libraries(folder: Path) -> list[str]:
    """The libraries that the package needs and neither it nor the system has."""
    found = set()
    for library in folder.rglob("*.so*"):
        listed = subprocess.run(["ldd", library], capture_output=True, text=True).stdout
        for line in listed.splitlines():
            name = Path(line.split()[0]).name if line.split() else ""
            if name and not SYSTEM.match(name) and not (folder / name).exists():
                found.add(name)
    return sorted(found)


def oldest_platform(wheel: Path) -> str:
    """The oldest platform that auditwheel finds the wheel to be for, `manylinux_2_27` for one.

    Raises:
        SystemExit: it is for no release of Linux before glibc 2.29.
    """
    command = [sys.executable, "-m", "auditwheel", "show", wheel]
    shown = subprocess.run(command, capture_output=True, text=True)
    found = re.search(r'platform tag: "(\w+?_(\d+)_(\d+))_x86_64"', " ".join(shown.stdout.split()))
    if not found or (int(found[2]), int(found[3])) > (2, 28):
        raise SystemExit(f"auditwheel: {wheel.name} needs more than glibc 2.28\n{shown.stdout}")
    return found[1]


def tag_of(python: str) -> str:
    """The tag of an interpreter, `cp311` for one."""
    ask = "import sys; print('cp%d%d' % sys.version_info[:2])"
    return subprocess.run(
        [python, "-c", ask], check=True, capture_output=True, text=True
    ).stdout.strip()


def check(wheel: Path, python: str, no_index: bool) -> None:
    """Installs a wheel for an interpreter and runs programs.

    Raises:
        SystemExit: one fails, or the wheel is too large or needs more than systems have.
    """
    size = wheel.stat().st_size
    with zipfile.ZipFile(wheel) as archive:
        plain = sum(entry.file_size for entry in archive.infolist())
    print(f"{wheel.name}: {size:,} bytes, {plain:,} unpacked")
    print(f"auditwheel: {oldest_platform(wheel)}")
    with tempfile.TemporaryDirectory() as name:
        there = Environment(Path(name), python)
        install = ["-m", "pip", "install", "-q", "--disable-pip-version-check"]
        if no_index:
            install += ["--no-deps", "--no-index"]
            there.lend_numpy()
        there.run("pip install", *install, wheel.resolve())
        place = Path(there.run("import", "-c", ORIGIN).splitlines()[-1])
        program = there.folder / "first_kernel.py"
        program.write_text(readme_program())
        assert "[1. 3. 5. 7.]" in there.run("program of README.md", program)
        assert "[1. 3. 5. 7.]" in there.run("the same, cached", program)
        there.run("stability R1-R4", "-m", "warp.report", "stability", "R1-R4")
        foreign = foreign_libraries(place)
    if foreign:
        raise SystemExit(f"needs libraries that it does not bring: {', '.join(foreign)}")
    if size > MOST:
        raise SystemExit(f"{size:,} bytes are more than {MOST:,}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("wheels", type=Path, nargs="+")
    parser.add_argument("--pythons", nargs="*", default=[], help="interpreters for other wheels")
    parser.add_argument("--no-index", action="store_true", help="no network: NumPy from here")
    options = parser.parse_args()
    pythons = {tag_of(python): python for python in [*options.pythons, sys.executable]}
    for wheel in options.wheels:
        tag = re.search(r"-(cp\d+)-", wheel.name)[1]
        if tag not in pythons:
            raise SystemExit(f"{wheel.name}: no interpreter for it, name one by --pythons")
        check(wheel, pythons[tag], options.no_index)
    print("ok")


if __name__ == "__main__":
    sys.exit(main())
