"""What is in a buffer: coordinates of tiles and voxels, arrays stored beside the grid."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from warp._src import errors
from warp._src.geometry.volumes.checks import Nodes, header_of
from warp._src.geometry.volumes.layout import BLIND, INDICES, NAMES, ON_INDEX, ON_INDEX_MASK
from warp._src.types import dtypes

DTYPES = {
    "float": dtypes.float32,
    "double": dtypes.float64,
    "int16": dtypes.int16,
    "int32": dtypes.int32,
    "int64": dtypes.int64,
    "Vec3f": dtypes.vec3f,
    "Vec3d": dtypes.vec3d,
    "Half": dtypes.float16,
    "uint32": dtypes.uint32,
    "bool": dtypes.bool,
    "Vec4f": dtypes.vec4f,
    "Vec4d": dtypes.vec4d,
    "Vec3u8": dtypes.vec3ub,
    "Vec3u16": dtypes.vec3us,
    "uint8": dtypes.uint8,
}
# Types of arrays that are not types of grids.
_BLIND_NAMES = {**NAMES, 0: "Unknown", 11: "bool", 24: "Vec3u8", 25: "Vec3u16"}


class GridInfo(NamedTuple):
    """What a grid says about itself.

    Attributes:
        name, type_str: of the grid and of its values.
        size_in_bytes: of this grid's part of the buffer.
        grid_index, grid_count: which grid of the buffer it is, and how many there are.
        translation, transform_matrix: from index space to the world.
    """

    name: str
    size_in_bytes: int
    grid_index: int
    grid_count: int
    type_str: str
    translation: dtypes.vec3f
    transform_matrix: dtypes.mat33f


class FeatureArrayInfo(NamedTuple):
    """An array that is stored beside a grid: name, address, bytes and number of its values."""

    name: str
    ptr: int
    value_size: int
    value_count: int
    type_str: str


def text_of(name: bytes) -> str:
    """A name as files have it."""
    return bytes(name).partition(b"\0")[0].decode("utf-8", errors="replace")


def info_of(header) -> GridInfo:
    """What a header says."""
    return GridInfo(
        text_of(header["name"]),
        int(header["size"]),
        int(header["index"]),
        int(header["count"]),
        NAMES[int(header["type"])],
        dtypes.vec3f(*map(float, header["shift"])),
        dtypes.mat33f(*map(float, header["matrix"].ravel())),
    )


def has_numbers(header) -> bool:
    """Whether only active voxels have numbers."""
    return int(header["type"]) in (ON_INDEX, ON_INDEX_MASK)


def is_index(header) -> bool:
    """Whether voxels have numbers in place of values."""
    return int(header["type"]) in INDICES


def voxel_count(header, tree) -> int:
    """How many voxels have a number."""
    return int(tree["voxels"]) if has_numbers(header) else int(tree["counts"][0]) * 512


def tiles(buffer):
    """Coordinates of the lowest voxel of each leaf, of shape (n, 3)."""
    return _origins(Nodes(buffer).leaves)


def _origins(leaves):
    """A leaf's box may be that of its active voxels alone."""
    return (leaves["origin"] & ~7).astype(np.int32)


def voxels(buffer):
    """Coordinates of the voxels that have numbers, in their order, of shape (n, 3)."""
    nodes = Nodes(buffer)
    n = np.arange(512)
    inside = np.stack([n >> 6, n >> 3 & 7, n & 7], axis=-1)
    found = (_origins(nodes.leaves)[:, None, :] + inside[None]).astype(np.int32)
    if not has_numbers(header_of(buffer)):
        return found.reshape(-1, 3)
    active = np.unpackbits(nodes.leaves["values"], axis=1, bitorder="little").astype(bool)
    return found[active]


def feature_info(buffer, header, index, address) -> FeatureArrayInfo:
    """The array of a number beside a grid that starts at an address.

    Raises:
        WarpError: there is none of that number, or it is not within the buffer.
    """
    count = int(header["blind_count"])
    if not 0 <= index < count:
        raise errors.WarpError(f"the grid has {count} feature arrays, but number {index} was asked")
    start = int(header["blind_offset"]) + index * BLIND.itemsize
    size = int(header["size"])
    if start < 0 or start + BLIND.itemsize > size:
        raise errors.WarpError("the NanoVDB grid is damaged: feature arrays are not within it")
    about = buffer[start : start + BLIND.itemsize].view(BLIND)[0]
    data = start + int(about["offset"])
    length = int(about["count"]) * int(about["size"])
    if data < 0 or data + length > size:
        raise errors.WarpError("the NanoVDB grid is damaged: a feature array is not within it")
    kind = _BLIND_NAMES.get(int(about["type"]), "Unknown")
    value_size, values = int(about["size"]), int(about["count"])
    return FeatureArrayInfo(text_of(about["name"]), address + data, value_size, values, kind)
