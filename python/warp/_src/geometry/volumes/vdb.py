"""OpenVDB files, by the component `libwarp_openvdb.so`.

OpenVDB trusts lengths and masks of a file, so a damaged one can end the process that reads it. A
process of its own reads (vdb_reader.py); its end is an error here.
"""

from __future__ import annotations

import ctypes
import functools
import importlib
import os
import pathlib
import signal
import subprocess
import sys
import sysconfig
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
def _component():
    """Paths of the libraries that the component needs and of itself, which is loaded: beside the
    package, in a wheel of its own, or where the system looks."""
    name = "libwarp_openvdb.so"
    problem = "which is not in this package"
    for path, needed in _places(name):
        try:
            for library in needed:
                ctypes.CDLL(str(library))
            ctypes.CDLL(str(path))
            return [str(library) for library in (*needed, path)]
        except OSError as error:
            if path != name and path.exists():
                # A library that it needs is absent; the loader names it.
                problem = f"which cannot be loaded ({error})"
    raise ImportError(
        f"files of OpenVDB need the component '{name}', {problem}: install the wheel "
        "'warp-mlir-vdb', which 'make vdb' writes, or build from source where 'apt-get install "
        "libopenvdb-dev libnanovdb-dev' has been run, or convert with 'nanovdb_convert a.vdb "
        "a.nvdb' and use 'load_from_nvdb'"
    )


def _interpreter():
    """A Python to start: programs that embed one name themselves as `sys.executable`."""
    scripts = pathlib.Path(sysconfig.get_path("scripts"))
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    for path in (pathlib.Path(sys.executable or ""), scripts / "python3", scripts / version):
        if path.name.startswith("python") and os.access(path, os.X_OK):
            return str(path)
    raise errors.WarpError(
        f"files of OpenVDB are read by a process of their own, but there is no '{version}' in "
        f"'{scripts}'; convert with 'nanovdb_convert a.vdb a.nvdb' and use 'load_from_nvdb'"
    )


def read(path, grid) -> bytes:
    """A grid of a file, as the bytes of a `.nvdb` file."""
    # An absent file is FileNotFoundError.
    with open(path, "rb") as file:
        if file.read(7) == b"NanoVDB":
            raise errors.WarpError(f"'{path}' is a file of NanoVDB: use 'load_from_nvdb'")
    component = _component()
    script = str(pathlib.Path(__file__).with_name("vdb_reader.py"))
    with open(os.memfd_create("grid"), "rb") as grids:
        out = grids.fileno()
        order = [str(out), os.fspath(path), grid or "", *component]
        # Isolated: it needs the standard library alone.
        command = [_interpreter(), "-I", "-S", script, *order]
        done = subprocess.run(command, pass_fds=[out], capture_output=True, check=False)
        said = done.stderr.decode(errors="replace").strip()
        if done.returncode < 0:
            name = signal.Signals(-done.returncode).name
            said = f"OpenVDB's reader was ended by {name}: the file is damaged"
        if done.returncode:
            raise errors.WarpError(f"'{path}': {said}")
        grids.seek(0)
        return grids.read()


def write(volume, path, grid) -> None:
    """Writes the grid of a volume to a file."""
    library, error = ctypes.CDLL(_component()[-1]), ctypes.create_string_buffer(_LENGTH)
    text, size = ctypes.c_char_p, ctypes.c_size_t
    library.warp_vdb_write.argtypes = [text, text, text, size, text, size]
    with tempfile.TemporaryDirectory() as folder:
        between = pathlib.Path(folder) / "grid.nvdb"
        volume.save_to_nvdb(between)
        data = between.read_bytes()
    name = os.fsencode(os.fspath(path))
    if library.warp_vdb_write(name, grid.encode(), data, len(data), error, _LENGTH):
        raise errors.WarpError(f"'{path}': {error.value.decode(errors='replace')}")
