"""Write dist/warp_mlir_tools-*.whl, which puts `warp-opt` beside the interpreter.

    python scripts/make_tools.py [FOLDER] [--tool build/release/bin/warp-opt] [--level 2]

The tool runs single passes, stops pipelines at a phase and emits PTX or assembly; it needs neither
`warp-mlir` nor Python. `make tools` builds it with the flags of a wheel, so that it is for the same
systems.
"""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

from wheels import ROOT, pack_wheel, packing_options, project_version, read_wheel, write_wheel

PLATFORM = "manylinux_2_28_x86_64"
SUMMARY = "warp-opt: the passes of Warp on MLIR on text"


def main() -> None:
    tool = ROOT / "build/release/bin/warp-opt"
    options = packing_options(__doc__, "--tool", tool, "'make tools' builds and packs it")
    version = project_version()
    stem = f"warp_mlir_tools-{version}"
    with tempfile.TemporaryDirectory() as folder:
        stripped = Path(folder) / "warp-opt"
        subprocess.run(["strip", "-o", stripped, options.tool], check=True)
        files = {f"{stem}.data/scripts/warp-opt": stripped.read_bytes()}
    for name in ("LICENSE", "THIRD_PARTY.md"):
        files[f"{stem}.dist-info/licenses/{name}"] = (ROOT / name).read_bytes()
    details = [f"Summary: {SUMMARY}", "License-Expression: Apache-2.0"]
    wheel = pack_wheel(
        options.folder,
        "warp-mlir-tools",
        version,
        f"py3-none-{PLATFORM}",
        files=files,
        pure=False,
        details=details,
    )
    write_wheel(wheel, read_wheel(wheel), options.level)


if __name__ == "__main__":
    main()
