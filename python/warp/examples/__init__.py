"""Asset folder of examples: programs of NVIDIA Warp read meshes and volumes from there.

Such files are not part of this package; the environment variable WARP_EXAMPLE_ASSETS names the
folder that has them, "warp/examples/assets" in a copy of that project.
"""

from __future__ import annotations

import os

from warp._src import errors

_VARIABLE = "WARP_EXAMPLE_ASSETS"


def get_asset_directory() -> str:
    """The folder of meshes, volumes and pictures.

    Raises:
        WarpError: the environment variable WARP_EXAMPLE_ASSETS names no folder.
    """
    folder = os.environ.get(_VARIABLE, "")
    if not os.path.isdir(folder):
        found = f"but it is '{folder}', which is none" if folder else "but it is not set"
        raise errors.WarpError(
            f"the files of examples are not in this package: the environment variable {_VARIABLE} "
            f"is to name their folder, {found}"
        )
    return os.path.realpath(folder)


def get_source_directory() -> str:
    """The folder that the one of `get_asset_directory` is in."""
    return os.path.dirname(get_asset_directory())
