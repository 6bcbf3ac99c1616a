"""Import of the extension module: errors that name what the system lacks."""

from __future__ import annotations

import importlib.util
import os
import platform
import re
import sys

_FOLDER = os.path.dirname(os.path.dirname(__file__))


def load():
    """The extension module.

    Raises:
        ImportError: the system or the interpreter is another one than the wheel is for, or there
            is no NumPy.
    """
    if "numpy" not in sys.modules and importlib.util.find_spec("numpy") is None:
        raise ImportError(
            "warp-mlir needs NumPy 1.24 or newer: run `pip install numpy`", name="numpy"
        )
    try:
        from warp import _native
    except ImportError as error:
        raise explained(error, os.listdir(_FOLDER)) from error
    return _native


def explained(error: ImportError, files: list[str]) -> ImportError:
    """The error of a load that failed, with its cause where files of the package show it."""
    found = re.search(r"version `(GLIBC|GLIBCXX|CXXABI)_([\d.]+)' not found", str(error))
    if found:
        library = "glibc" if found[1] == "GLIBC" else "libstdc++"
        here = f", and this system has glibc {platform.libc_ver()[1]}" if library == "glibc" else ""
        return ImportError(
            f"warp-mlir needs {library} with {found[1]}_{found[2]}{here}: take a newer system or "
            f"container (Debian 10, Ubuntu 18.10, RHEL 8), or build from source: {error}"
        )
    tags = [name[1] for file in files if (name := re.match(r"_native\.cpython-(\d+)-", file))]
    mine = f"{sys.version_info[0]}{sys.version_info[1]}"
    if tags and mine not in tags:
        built = ", ".join(f"{tag[0]}.{tag[1:]}" for tag in tags)
        return ImportError(
            f"warp-mlir is installed for Python {built}, and this is {mine[0]}.{mine[1:]}: run "
            f"`{sys.executable} -m pip install --force-reinstall warp-mlir`"
        )
    return error
