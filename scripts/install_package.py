"""Install build/python/warp into the running interpreter's environment.

`pip install .` compiles an optimised wheel in its own folder. A development
tree has already built the same files, so this packs them, as they are, into
a wheel and lets pip install that: seconds instead of minutes, and the
environment looks exactly as after a real installation.
"""

from __future__ import annotations

import base64
import hashlib
import subprocess
import sys
import sysconfig
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "build" / "python" / "warp"
REQUIREMENTS = ["numpy>=1.24"]


def project_version() -> str:
    """The version that pyproject.toml states."""
    for line in (ROOT / "pyproject.toml").read_text().splitlines():
        if line.startswith("version = "):
            return line.split('"')[1]
    raise SystemExit("pyproject.toml states no version")


def write_wheel(folder: Path) -> Path:
    """Pack the built package; entries are stored, not compressed."""
    version = project_version()
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    tag = f"{python}-{python}-{platform}"
    info = f"warp_mlir-{version}.dist-info"
    requires = "".join(f"Requires-Dist: {name}\n" for name in REQUIREMENTS)
    files = {
        f"{info}/METADATA": (
            f"Metadata-Version: 2.1\nName: warp-mlir\nVersion: {version}\n{requires}"
        ).encode(),
        f"{info}/WHEEL": (
            f"Wheel-Version: 1.0\nGenerator: install_package\nRoot-Is-Purelib: false\nTag: {tag}\n"
        ).encode(),
    }
    for path in sorted(PACKAGE.rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            files[f"warp/{path.relative_to(PACKAGE)}"] = path.read_bytes()

    record = []
    for name, data in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=")
        record.append(f"{name},sha256={digest.decode()},{len(data)}\n")
    record.append(f"{info}/RECORD,,\n")
    files[f"{info}/RECORD"] = "".join(record).encode()

    wheel = folder / f"warp_mlir-{version}-{tag}.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return wheel


def main() -> None:
    if not (PACKAGE / "__init__.py").is_file():
        raise SystemExit(f"'{PACKAGE}' holds no built package; run 'make build'")
    with tempfile.TemporaryDirectory() as folder:
        wheel = write_wheel(Path(folder))
        command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps"]
        command += ["--force-reinstall", "--disable-pip-version-check", str(wheel)]
        subprocess.run(command, check=True)


if __name__ == "__main__":
    main()
