"""Unpack what a build needs from CUDA where no toolkit is installed.

Usage: fetch_cuda_parts.py FOLDER

Downloads one pinned wheel from PyPI with pip and takes from it
`libdevice.10.bc` (embedded into libwarp.so) and `ptxas` (assembles what
libwarp.so has for common GPUs).
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

REQUIREMENT = "nvidia-cuda-nvcc-cu12==12.9.86"
MEMBERS = {
    "nvidia/cuda_nvcc/nvvm/libdevice/libdevice.10.bc": 0o644,
    "nvidia/cuda_nvcc/bin/ptxas": 0o755,
}


def fetch(folder: Path) -> None:
    """Put the members of the pinned wheel into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps"]
        command += ["--only-binary=:all:", "--dest", scratch, REQUIREMENT]
        subprocess.run(command, check=True)
        (wheel,) = Path(scratch).glob("*.whl")
        with zipfile.ZipFile(wheel) as archive:
            for member, mode in MEMBERS.items():
                target = folder / Path(member).name
                partial = target.with_suffix(".partial")
                partial.write_bytes(archive.read(member))
                partial.chmod(mode)
                partial.replace(target)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    try:
        fetch(Path(sys.argv[1]))
    except (OSError, subprocess.CalledProcessError, KeyError, ValueError) as error:
        sys.exit(f"cannot unpack '{REQUIREMENT}': {error}")
