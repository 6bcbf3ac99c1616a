"""Joint queries of a block of threads.

The threads divide the tree among themselves where a query starts (lib/DeviceLib/geometry/Shares.h);
then each has an iterator of its own, and one that is at its end gives -1 until all are.
"""

# The caller reads the value that is assigned to a reference.

from warp._src.geometry.handles import publish
from warp._src.geometry.tree_queries import Cursor, step
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.annotations import ref
from warp._src.types.dtypes import vec3f
from warp._src.types.scalars import bool as bool_
from warp._src.types.scalars import int32, uint64
from warp._src.types.structs import struct

_BOX, _RAY = 0, 2
_INFINITY = float("inf")


@struct
class BvhQueryTiled:
    """The boxes of a `Bvh` that touch a shape, which the threads of a block find together."""

    id: uint64
    shape: int32
    first: vec3f
    second: vec3f
    cursor: Cursor
    last: int32


@struct
class MeshQueryAABBTiled:
    """The faces of a `Mesh` whose bounds touch a box, which a block's threads find together."""

    id: uint64
    shape: int32
    first: vec3f
    second: vec3f
    cursor: Cursor
    last: int32


def _share(id: uint64, shape: int, a: vec3f, b: vec3f):
    thread = wp.untile(wp.tile_arange(wp.block_dim(), dtype=int32))
    node, level, block, left, low, high = wp._library_call(
        "warp_overlap_share", id, shape, a, b, 0.0, thread, wp.block_dim()
    )
    return Cursor(node, level, block, left, low, high)


def tile_bvh_query_aabb(id: uint64, low: vec3f, high: vec3f):
    """The boxes of a Bvh that overlap a box, borders included, found by a block together.

    All threads of the block give the same arguments.
    """
    return BvhQueryTiled(id, _BOX, low, high, share(id, _BOX, low, high), 0)


def tile_bvh_query_ray(id: uint64, start: vec3f, dir: vec3f):
    """The boxes of a Bvh that a ray meets, in no order, found by a block together.

    All threads of the block give the same arguments.
    """
    return BvhQueryTiled(id, _RAY, start, dir, share(id, _RAY, start, dir), 0)


def tile_mesh_query_aabb(id: uint64, low: vec3f, high: vec3f):
    """The faces of a mesh whose bounds overlap a box, borders included, found by a block together.

    All threads of the block give the same arguments.
    """
    return MeshQueryAABBTiled(id, _BOX, low, high, share(id, _BOX, low, high), 0)


def tile_bvh_query_next(query: ref[BvhQueryTiled]):
    """The next boxes, a tile with one for each thread of the block; -1 where it has none left."""
    found, at = step(query.id, query.shape, query.first, query.second, 0.0, _INFINITY, query.cursor)
    query.cursor = at
    query.last = found
    return wp.tile(found)


def tile_mesh_query_aabb_next(query: ref[MeshQueryAABBTiled]):
    """The next faces, a tile with one for each thread of the block; -1 where it has none left."""
    found, at = step(query.id, query.shape, query.first, query.second, 0.0, _INFINITY, query.cursor)
    query.cursor = at
    query.last = found
    return wp.tile(found)


def tile_query_valid(query: BvhQueryTiled) -> bool_:
    """True if a block is to ask on: at first, and after a tile in which a thread had a result."""
    return wp.tile_max(wp.tile(query.last))[0] >= 0


def _mesh_query_valid(query: MeshQueryAABBTiled) -> bool_:
    return wp.tile_max(wp.tile(query.last))[0] >= 0


share = Function(_share, "share")
FUNCTIONS = {
    function.__name__: Function(function)
    for function in (
        *(tile_bvh_query_aabb, tile_bvh_query_ray, tile_bvh_query_next),
        *(tile_mesh_query_aabb, tile_mesh_query_aabb_next, tile_query_valid),
    )
}
FUNCTIONS["tile_query_valid"].add_overload(_mesh_query_valid)
# Names of before 1.18.
FORMER = {
    "bvh_query_aabb_tiled": "tile_bvh_query_aabb",
    "bvh_query_next_tiled": "tile_bvh_query_next",
    "bvh_query_ray_tiled": "tile_bvh_query_ray",
    "mesh_query_aabb_next_tiled": "tile_mesh_query_aabb_next",
    "mesh_query_aabb_tiled": "tile_mesh_query_aabb",
}
FUNCTIONS.update({former: FUNCTIONS[name] for former, name in FORMER.items()})
publish(FUNCTIONS)
