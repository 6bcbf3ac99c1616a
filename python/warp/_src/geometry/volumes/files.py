"""`.nvdb` files: a header, what there is about each grid, then the grids, perhaps compressed."""

from __future__ import annotations

import struct
import zlib

import numpy as np

from warp._src import errors
from warp._src.geometry.volumes.checks import Nodes, check_grid, header_of, tree_of
from warp._src.geometry.volumes.layout import HEADER, MAJOR, VERSION
from warp._src.geometry.volumes.quantised import expanded

_MAGICS = (0x304244566F6E614E, 0x324244566F6E614E)
CODECS = {"none": 0, "zip": 1, "blosc": 2}
# What the format of zlib unpacks to at most.
_MOST_PER_BYTE = 1032
_FILE = struct.Struct("<QIHH")
ABOUT = np.dtype(
    [
        *(("size", "<u8"), ("file_size", "<u8"), ("name_key", "<u8"), ("voxels", "<u8")),
        *(("type", "<u4"), ("grid_class", "<u4"), ("world_box", "<f8", 6)),
        *(("index_box", "<i4", 6), ("voxel_size", "<f8", 3), ("name_size", "<u4")),
        *(("node_counts", "<u4", 4), ("tile_counts", "<u4", 3), ("codec", "<u2")),
        *(("padding", "<u2"), ("version", "<u4")),
    ]
)
assert ABOUT.itemsize == 176


def read(data) -> np.ndarray:
    """The grids of a file, one behind the other, as bytes.

    Raises:
        WarpError: the bytes are no such file, damaged, or in a codec that is not there.
    """
    data = memoryview(data).cast("B")
    if len(data) < _FILE.size:
        raise errors.WarpError("NanoVDB signature not found: the file is too short")
    magic, version, count, codec = _FILE.unpack(data[: _FILE.size])
    if magic not in _MAGICS:
        raise errors.WarpError("NanoVDB signature not found: this is no .nvdb file")
    if version >> 21 != MAJOR:
        raise errors.WarpError(
            f"Unsupported NanoVDB version {version >> 21}, but {MAJOR} is supported"
        )
    at, abouts = _FILE.size, []
    for _ in range(count):
        about = np.frombuffer(_take(data, at, ABOUT.itemsize), dtype=ABOUT)[0]
        at += ABOUT.itemsize + int(about["name_size"])
        abouts.append(about)
    grids = []
    for about in abouts:
        stored = int(about["file_size"])
        chunk = _take(data, at, stored) if codec == 0 else None
        if codec != 0:
            # The size that is stored counts, or does not count, its own eight bytes.
            (length,) = struct.unpack("<Q", _take(data, at, 8))
            chunk = _unpack(_take(data, at + 8, length), codec, int(about["size"]))
            stored = 8 + length
        at += stored
        grids.append(np.frombuffer(chunk, dtype=np.uint8))
    if not grids:
        raise errors.WarpError("the .nvdb file has no grid")
    buffer = aligned(expanded(np.concatenate(grids)))
    start = 0
    for _ in grids:
        nodes = check_grid(buffer[start:])
        start += nodes.buffer.size
    return buffer


def aligned(data) -> np.ndarray:
    """A copy of bytes in memory that grids may lie in."""
    space = np.empty(data.size + 32, dtype=np.uint8)
    start = -space.ctypes.data % 32
    space[start : start + data.size] = data
    return space[start : start + data.size]


def _take(data, start, size):
    if start + size > len(data):
        raise errors.WarpError(
            f"the .nvdb file ends after {len(data)} bytes, but {start + size} are needed"
        )
    return data[start : start + size]


def _unpack(chunk, codec, size):
    if codec == CODECS["zip"]:
        unpacker = zlib.decompressobj()
        if size > _MOST_PER_BYTE * len(chunk):
            raise errors.WarpError(
                f"the .nvdb file is damaged: {len(chunk)} bytes do not unpack to {size}"
            )
        try:
            # Never more than what was said: a small file may unpack to anything.
            grid = unpacker.decompress(chunk, size + 1)
        except zlib.error as problem:
            raise errors.WarpError(f"the .nvdb file is damaged: {problem}") from None
    elif codec == CODECS["blosc"]:
        try:
            grid = _blosc().decompress(bytes(chunk))
        except Exception as problem:
            if isinstance(problem, errors.WarpError):
                raise
            raise errors.WarpError(f"the .nvdb file is damaged: {problem}") from None
    else:
        raise errors.WarpError(f"Unsupported codec code: {codec}")
    if len(grid) != size:
        raise errors.WarpError(
            f"the .nvdb file is damaged: a grid of {size} bytes unpacks to another size"
        )
    return grid


def _blosc():
    try:
        import blosc
    except ImportError as problem:
        raise errors.WarpError(
            "the .nvdb file is compressed by blosc, but the Python package 'blosc' cannot be "
            f"imported: {problem}"
        ) from None
    return blosc


def write(path, buffer, codec) -> None:
    """Writes the grids of a buffer.

    Raises:
        WarpError: there is no such codec.
    """
    if codec not in CODECS:
        raise errors.WarpError(f"Unsupported codec requested: {codec!r}; there are {list(CODECS)}")
    number = CODECS[codec]
    grids = []
    for _ in range(int(header_of(buffer)["count"])):
        nodes = Nodes(buffer)
        grids.append((nodes, _pack(nodes.buffer, number)))
        buffer = buffer[nodes.buffer.size :]
    with open(path, "wb") as file:
        file.write(_FILE.pack(_MAGICS[0], VERSION, len(grids), number))
        for nodes, packed in grids:
            file.write(_about(nodes, len(packed), number))
        for _, packed in grids:
            if number:
                file.write(struct.pack("<Q", len(packed)))
            file.write(packed)


def _pack(grid, codec):
    if codec == CODECS["zip"]:
        return zlib.compress(grid)
    return _blosc().compress(grid.tobytes()) if codec else grid.tobytes()


def _about(nodes, packed, codec) -> bytes:
    """What a file says about a grid, and its name."""
    header, tree = header_of(nodes.buffer), tree_of(nodes.buffer)
    name = bytes(header["name"]) + b"\0"
    about = np.zeros(1, dtype=ABOUT)[0]
    about["size"], about["file_size"], about["voxels"] = nodes.buffer.size, packed, tree["voxels"]
    about["type"], about["grid_class"] = header["type"], header["grid_class"]
    about["world_box"], about["voxel_size"] = header["world_box"], header["voxel_size"]
    about["index_box"] = nodes.buffer[nodes.root_at : nodes.root_at + 24].view("<i4")
    about["name_size"], about["codec"], about["version"] = len(name), codec, VERSION
    about["node_counts"] = [*tree["counts"], 1]
    about["tile_counts"] = tree["tile_counts"]
    return about.tobytes() + name


def next_start(buffer) -> int:
    """Where the grid after the first one of a buffer starts; 0 if there is none."""
    header = header_of(buffer)
    size = int(header["size"])
    last = int(header["index"]) + 1 >= int(header["count"])
    return 0 if last or size + HEADER.itemsize > buffer.size else size
