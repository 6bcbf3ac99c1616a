"""Write dist/warp_lang-*.whl, which lets pip find `warp-lang` where this package is installed.

    python scripts/make_shim.py [FOLDER]

Programs such as Newton and MuJoCo Warp require the distribution `warp-lang`. Without it pip fetches
NVIDIA's, whose files take the place of ours. This wheel holds no files. It depends on `warp-mlir`,
and its version is that of the API with the label `+mlir`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from wheels import ROOT, pack_wheel, project_version


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "dist"
    folder.mkdir(parents=True, exist_ok=True)
    version = project_version()
    requires = [f"warp-mlir=={version}"]
    print(pack_wheel(folder, "warp-lang", f"{version}+mlir", "py3-none-any", requires))


if __name__ == "__main__":
    main()
