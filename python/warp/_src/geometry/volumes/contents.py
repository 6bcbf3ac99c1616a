"""Types of values, and what volumes say about their grids and arrays."""

from __future__ import annotations

from typing import NamedTuple

from warp import _native
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
# Numbers that files have for types of values, by name.
NUMBERS = _native.voxel_types
NAMES = {number: name for name, number in NUMBERS.items()}
INDEX, ON_INDEX = NUMBERS["Index"], NUMBERS["OnIndex"]


class GridInfo(NamedTuple):
    """The header of a grid.

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


def info_of(info) -> GridInfo:
    """The contents of a native `GridInfo`."""
    return GridInfo(
        info.name,
        info.size,
        info.index,
        info.count,
        info.type_name,
        dtypes.vec3f(*info.shift),
        dtypes.mat33f(*info.matrix),
    )
