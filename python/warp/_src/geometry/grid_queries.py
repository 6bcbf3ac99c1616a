"""Hash grid queries of kernels: `hash_grid_query`, `hash_grid_query_next`, `hash_grid_point_id`.

Points are sorted by the number of their cell, x fastest, so the cells that a query overlaps along x
are one run of points, or two where the grid wraps. A query is the runs still to come and the place
in the current one. It yields all points of the overlapped cells, each once; distances are the
caller's to check.
"""

# The caller reads the value that is assigned to a reference.
# ruff: noqa: F841

import typing

from warp._src.device_table import WORDS
from warp._src.geometry.handles import EXTENT, GRID, integers, publish, words
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types import dtypes
from warp._src.types.annotations import ref
from warp._src.types.dtypes import Float, vec3d, vec3f, vec3h, vector
from warp._src.types.native import ArrayType
from warp._src.types.scalars import float16, float32, float64, int32, uint64
from warp._src.types.structs import struct


@struct
class HashGridQuery:
    """The points of the cells around a point, as `hash_grid_query` gives them.

    `HashGridQuery[wp.float64]` is the same: it knows cells, whatever the points consist of.
    """

    starts: ArrayType(int32, 1)
    order: ArrayType(int32, 1)
    # First cell, number of cells, cells of the grid.
    x: int32
    x_count: int32
    x_cells: int32
    y: int32
    y_count: int32
    y_cells: int32
    z: int32
    z_count: int32
    z_cells: int32
    # The run: row, layer, and 1 behind the seam of x.
    row: int32
    layer: int32
    part: int32
    place: int32
    end: int32

    if typing.TYPE_CHECKING:  # Kernels iterate over it.

        def __iter__(self) -> typing.Iterator[int]: ...


HashGridQuery.__class_getitem__ = classmethod(lambda cls, dtype: cls)


@struct
class HashGridGroupQuery:
    """The points of one group among those of a query."""

    query: HashGridQuery
    groups: ArrayType(int32, 1)
    group: int32


_SLOT = WORDS["HashGrid"]
_CELLS_XY, _CELLS_Z, _INVERSE = _SLOT["cells_xy"], _SLOT["cells_z"], _SLOT["inverse"]
_STARTS, _ORDER, _GROUPS = _SLOT["starts"], _SLOT["order"], _SLOT["groups"]
_GROUP_COUNT = _GROUPS + EXTENT


def _number_of_points(slot: ArrayType(uint64, 1)):
    return int(slot[_CELLS_Z] >> uint64(32))


def _query(slot: ArrayType(uint64, 1), point: vector(3, Float), max_dist: Float):
    nx = int(slot[_CELLS_XY] & uint64(0xFFFFFFFF))
    ny = int(slot[_CELLS_XY] >> uint64(32))
    nz = int(slot[_CELLS_Z] & uint64(0xFFFFFFFF))
    inverse = type(max_dist)(wp.cast(slot[_INVERSE], float64))
    x, x_count, y, y_count, z, z_count = cells(point, max_dist, inverse, nx, ny, nz)
    starts = integers(slot[_STARTS], nx * ny * nz + 1)
    order = integers(slot[_ORDER], number_of_points(slot))
    return HashGridQuery(
        starts, order, x, x_count, nx, y, y_count, ny, z, z_count, nz, 0, 0, 0, 0, 0
    )


def _cells_single(
    point: vec3f, max_dist: float32, inverse: float32, nx: int32, ny: int32, nz: int32
):
    """The first cell and how many along each axis; as the build has it where they wrap."""
    return wp._library_call("warp_grid_cells_f32", inverse, nx, ny, nz, point, max_dist)


def _cells_double(
    point: vec3d, max_dist: float64, inverse: float64, nx: int32, ny: int32, nz: int32
):
    return wp._library_call("warp_grid_cells_f64", inverse, nx, ny, nz, point, max_dist)


def _query_single(id: uint64, point: vec3f, max_dist: float32):
    return query(words(id, GRID), point, max_dist)


def _query_half(id: uint64, point: vec3h, max_dist: float16):
    wide = wp.vec3f(float(point[0]), float(point[1]), float(point[2]))
    return query_single(id, wide, float(max_dist))


def _query_double(id: uint64, point: vec3d, max_dist: float64):
    return query(words(id, GRID), point, max_dist)


def _of_group(id: uint64, query: HashGridQuery, group: int):
    """A grid that was built without groups has no point of any."""
    slot = words(id, GRID)
    count = int(slot[_GROUP_COUNT] & uint64(0xFFFFFFFF))
    if count == 0:
        query.z_count = 0
    return HashGridGroupQuery(query, integers(slot[_GROUPS], count), group)


def _group_single(id: uint64, point: vec3f, max_dist: float32, group: int):
    return of_group(id, query_single(id, point, max_dist), group)


def _group_half(id: uint64, point: vec3h, max_dist: float16, group: int):
    return of_group(id, query_single(id, point, max_dist), group)


def _group_double(id: uint64, point: vec3d, max_dist: float64, group: int):
    return of_group(id, query_single(id, point, max_dist), group)


def hash_grid_query_next(query: ref[HashGridQuery], index: ref[int32]) -> bool:
    """The next point of a query in `index`; False when there is none."""
    while query.place >= query.end and query.layer < query.z_count:
        z = query.z + query.layer
        if z >= query.z_cells:
            z -= query.z_cells
        y = query.y + query.row
        if y >= query.y_cells:
            y -= query.y_cells
        line = (z * query.y_cells + y) * query.x_cells
        # Cells before the seam, and behind it.
        ahead = wp.min(query.x_cells - query.x, query.x_count)
        if query.part == 0:
            line += query.x
        count = wp.where(query.part == 0, ahead, query.x_count - ahead)
        query.place = query.starts[line]
        query.end = query.starts[line + count]
        if query.part == 0 and ahead < query.x_count:
            query.part = 1
        else:
            query.part = 0
            query.row += 1
            if query.row == query.y_count:
                query.row = 0
                query.layer += 1
    found = query.place < query.end
    if found:
        index = query.order[query.place]
        query.place += 1
    return found


def _next_of_group(query: ref[HashGridGroupQuery], index: ref[int32]) -> bool:
    rest = query.query
    found = bool(True)
    searching = bool(True)
    while searching:
        candidate = int(0)
        found = next_point(rest, candidate)
        searching = found
        if found:
            searching = query.groups[candidate] != query.group
            index = wp.where(searching, index, candidate)
    query.query = rest
    return found


def _advance_group(query: HashGridGroupQuery):
    index = int(0)
    found = next_of_group(query, index)
    return found, index, query


def _advance(query: HashGridQuery):
    index = int(0)
    found = next_point(query, index)
    return found, index, query


def hash_grid_point_id(id: uint64, index: int) -> int:
    """The point at a place of the grid's order, in which neighbours are close; -1 beyond it."""
    slot = words(id, GRID)
    count = number_of_points(slot)
    found = int(-1)
    if index >= 0 and index < count:
        order = integers(slot[_ORDER], count)
        found = order[index]
    return found


number_of_points = Function(_number_of_points, "number_of_points")
cells = Function(_cells_single, "cells")
cells.add_overload(_cells_double)
query = Function(_query, "query")
query_single = Function(_query_single, "hash_grid_query")
query_single.add_overload(_query_half)
query_single.add_overload(_query_double)
next_point = Function(hash_grid_query_next)
of_group = Function(_of_group, "of_group")
next_of_group = Function(_next_of_group, "hash_grid_query_next")
ADVANCE = Function(_advance, "hash_grid_query_next")
ADVANCE_GROUP = Function(_advance_group, "hash_grid_query_next")
FUNCTIONS = {
    "hash_grid_query": Function(_query_single, "hash_grid_query"),
    "hash_grid_query_next": Function(hash_grid_query_next),
    "hash_grid_point_id": Function(hash_grid_point_id),
}
for _form in (_query_half, _query_double, _group_single, _group_half, _group_double):
    FUNCTIONS["hash_grid_query"].add_overload(_form)
FUNCTIONS["hash_grid_query_next"].add_overload(_next_of_group)
publish(FUNCTIONS)
NEXT = (
    (dtypes.native_type(HashGridQuery), ADVANCE),
    (dtypes.native_type(HashGridGroupQuery), ADVANCE_GROUP),
)
