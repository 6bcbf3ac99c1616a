"""Install build/python/warp into the running interpreter's environment.

`pip install .` compiles an optimised wheel in its own folder. A development
tree has already built the same files, so this packs them, as they are, into
a wheel and lets pip install that: seconds instead of minutes, and the
environment looks exactly as after a real installation.
"""

from __future__ import annotations

import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

from wheels import ROOT, pack_wheel, project_version

PACKAGE = ROOT / "build" / "python" / "warp"
REQUIREMENTS = ["numpy>=1.24"]


def write_wheel(folder: Path) -> Path:
    """Pack the built package."""
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    files = {
        f"warp/{path.relative_to(PACKAGE)}": path.read_bytes()
        for path in sorted(PACKAGE.rglob("*"))
        if path.is_file() and "__pycache__" not in path.parts
    }
    tag = f"{python}-{python}-{platform}"
    return pack_wheel(folder, "warp-mlir", project_version(), tag, REQUIREMENTS, files, pure=False)


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
