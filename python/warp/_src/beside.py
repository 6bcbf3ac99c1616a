"""Two distributions in one folder: an error when files of NVIDIA Warp lie among ours.

`warp-lang` and `warp-mlir` both install the package `warp`. Files of one then hide those of the
other, and uninstalling one deletes what both have.
"""

from __future__ import annotations

import os
import sys

# A file of NVIDIA Warp that this package does not have.
_THEIRS = os.path.join("_src", "context.py")


def check(folder: str) -> None:
    """Looks for files of NVIDIA Warp in the folder of this package.

    Raises:
        ImportError: there are some, and the program is not `python -m warp.install`.
    """
    if not os.path.exists(os.path.join(folder, _THEIRS)) or "warp.install" in sys.orig_argv:
        return
    raise ImportError(
        f"warp-lang (NVIDIA Warp) and warp-mlir are both installed in '{folder}', where files of "
        "one hide those of the other: run `python -m warp.install --replace`, which removes "
        "warp-lang and restores warp-mlir",
        name="warp",
    )
