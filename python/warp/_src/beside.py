"""Two distributions in one folder: an error when files of NVIDIA Warp lie among ours.

`warp-lang` and `warp-mlir` both install the package `warp`. Files of one then hide those of the
other, and uninstalling one deletes what both have.
"""

from __future__ import annotations

import os
import sys

# A file of NVIDIA Warp that this package does not have.
_THEIRS = os.path.join("_src", "context.py")


def check(folder: str, covered: bool = False) -> None:
    """Looks for files of NVIDIA Warp in the folder of this package.

    `covered` says that `__init__.py` of the folder is NVIDIA Warp's. Then `python -m` reaches no
    module of the package, and the repair has to be run as a file.

    Raises:
        ImportError: there are some, and the program is not `python -m warp.install`.
    """
    if not os.path.exists(os.path.join(folder, _THEIRS)):
        return
    if "warp.install" in sys.orig_argv and not covered:
        return
    program = f"-I '{os.path.join(folder, 'install.py')}'" if covered else "-m warp.install"
    raise ImportError(
        f"warp-lang (NVIDIA Warp) and warp-mlir are both installed in '{folder}', where files of "
        f"one hide those of the other: run `python {program} --replace`, which removes "
        "warp-lang and restores warp-mlir",
        name="warp",
    )
