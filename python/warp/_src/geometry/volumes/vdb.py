"""OpenVDB files, by the component `libwarp_openvdb.so`."""

from __future__ import annotations

import ctypes
import functools
import importlib
import os
import pathlib
import tempfile

from warp import _native
from warp._src import errors

_LENGTH = 1024


def _places(name):
    """Paths of the component that are tried in turn, with the libraries to load before each."""
    yield pathlib.Path(_native.__file__).parent / name, ()
    try:
        wheel = importlib.import_module("warp_mlir_vdb")
        yield wheel.FOLDER / name, [wheel.FOLDER / library for library in wheel.LIBRARIES]
    except ModuleNotFoundError:
        pass
    yield name, ()


@functools.cache
def _library():
    """The component: beside the package, in a wheel of its own, or where the system looks."""
    name = "libwarp_openvdb.so"
    problem = "which is not in this package"
    for path, needed in _places(name):
        try:
            for library in needed:
                ctypes.CDLL(str(library))
            found = ctypes.CDLL(str(path))
            break
        except OSError as error:
            if path != name and path.exists():
                # A library that it needs is absent; the loader names it.
                problem = f"which cannot be loaded ({error})"
    else:
        raise ImportError(
            f"files of OpenVDB need the component '{name}', {problem}: install the wheel "
            "'warp-mlir-vdb', which 'make vdb' writes, or build from source where 'apt-get install "
            "libopenvdb-dev libnanovdb-dev' has been run, or convert with 'nanovdb_convert a.vdb "
            "a.nvdb' and use 'load_from_nvdb'"
        )
    text, size, pointer = ctypes.c_char_p, ctypes.c_size_t, ctypes.c_void_p
    found.warp_vdb_read.argtypes = [text, text, ctypes.POINTER(size), text, size]
    found.warp_vdb_read.restype = pointer
    found.warp_vdb_write.argtypes = [text, text, text, size, text, size]
    found.warp_vdb_free.argtypes = [pointer]
    found.warp_vdb_free.restype = None
    return found


def read(path, grid) -> bytes:
    """A grid of a file, as the bytes of a `.nvdb` file."""
    # An absent file is FileNotFoundError.
    with open(path, "rb") as file:
        if file.read(7) == b"NanoVDB":
            raise errors.WarpError(f"'{path}' is a file of NanoVDB: use 'load_from_nvdb'")
    library, size = _library(), ctypes.c_size_t()
    error = ctypes.create_string_buffer(_LENGTH)
    name = os.fsencode(os.fspath(path))
    at = library.warp_vdb_read(name, (grid or "").encode(), ctypes.byref(size), error, _LENGTH)
    if not at:
        raise errors.WarpError(f"'{path}': {error.value.decode(errors='replace')}")
    try:
        return ctypes.string_at(at, size.value)
    finally:
        library.warp_vdb_free(at)


def write(volume, path, grid) -> None:
    """Writes the grid of a volume to a file."""
    library, error = _library(), ctypes.create_string_buffer(_LENGTH)
    with tempfile.TemporaryDirectory() as folder:
        between = pathlib.Path(folder) / "grid.nvdb"
        volume.save_to_nvdb(between)
        data = between.read_bytes()
    name = os.fsencode(os.fspath(path))
    if library.warp_vdb_write(name, grid.encode(), data, len(data), error, _LENGTH):
        raise errors.WarpError(f"'{path}': {error.value.decode(errors='replace')}")
