"""Hierarchy queries of kernels: the primitives that touch a box, a ball or a ray, one by one.

A query is a shape and a cursor (lib/DeviceLib/geometry/Overlap.h); the device library advances it.
"""

# The caller reads the value that is assigned to a reference.

import typing

from warp._src.device_table import WORDS
from warp._src.geometry.handles import BVH, MESH, publish, words
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types import dtypes
from warp._src.types.annotations import ref
from warp._src.types.dtypes import vec3f
from warp._src.types.scalars import float32, int32, uint64
from warp._src.types.structs import struct

_BOX, _BALL, _RAY, _CAPSULE, _TRIANGLE_BALL = 0, 1, 2, 3, 4
_INFINITY = float("inf")
# Words of the slot: the address of nodes, and their number in the upper half.
_NODES, _COUNTS = WORDS["Mesh"]["nodes"], WORDS["Mesh"]["tree_counts"]


@struct
class Cursor:
    """A place in a hierarchy."""

    node: int32
    level: int32
    block: int32
    left: int32
    low: uint64
    high: uint64


@struct
class BvhQuery:
    """The boxes of a `Bvh` that touch a shape."""

    id: uint64
    shape: int32
    first: vec3f
    second: vec3f
    radius: float32
    cursor: Cursor

    if typing.TYPE_CHECKING:  # Kernels iterate over it.

        def __iter__(self) -> typing.Iterator[int]: ...


@struct
class MeshQuery:
    """The faces of a `Mesh` that touch a shape."""

    id: uint64
    shape: int32
    first: vec3f
    second: vec3f
    radius: float32
    cursor: Cursor

    if typing.TYPE_CHECKING:  # Kernels iterate over it.

        def __iter__(self) -> typing.Iterator[int]: ...


def _check_root(id: uint64, root: int):
    """Reports in debug mode that a query cannot begin there; else it finds nothing."""
    mesh = words(id, MESH)
    last = wp.where(mesh[_NODES] != uint64(0), mesh[_COUNTS], words(id, BVH)[_COUNTS])
    count = wp.max(int(last >> uint64(32)), 1)
    assert root >= -1 and root < count, "`root` is no node of the hierarchy, nor -1 for all of it"


def _start(id: uint64, root: int):
    check_root(id, root)
    return Cursor(root, -1, 0, 0, uint64(0), uint64(0))


def bvh_query_aabb(id: uint64, low: vec3f, high: vec3f, root: int = -1):
    """The boxes of a Bvh that overlap a box, borders included."""
    return BvhQuery(id, _BOX, low, high, 0.0, start(id, root))


def bvh_query_sphere(id: uint64, center: vec3f, radius: float, root: int = -1):
    """The boxes of a Bvh that overlap a ball, borders included."""
    return BvhQuery(id, _BALL, center, wp.vec3f(radius, 0.0, 0.0), 0.0, start(id, root))


def bvh_query_ray(id: uint64, start: vec3f, dir: vec3f, root: int = -1):
    """The boxes of a Bvh that a ray meets, in no order."""
    return BvhQuery(id, _RAY, start, dir, 0.0, begin(id, root))


def bvh_query_capsule(id: uint64, start: vec3f, dir: vec3f, radius: float, root: int = -1):
    """The boxes of a Bvh that, grown by a radius, a ray meets, in no order.

    None is missed whose box is within `radius` of the segment up to `max_dist` of
    `bvh_query_next`, its ends included; near corners there may be more.
    """
    return BvhQuery(id, _CAPSULE, start, dir, radius, begin(id, root))


def mesh_query_aabb(id: uint64, low: vec3f, high: vec3f):
    """The faces of a mesh whose bounds overlap a box, borders included."""
    return MeshQuery(id, _BOX, low, high, 0.0, start(id, -1))


def mesh_query_sphere(id: uint64, center: vec3f, radius: float):
    """The faces of a mesh within a distance of a point."""
    reach = wp.vec3f(radius, 0.0, 0.0)
    return MeshQuery(id, _TRIANGLE_BALL, center, reach, 0.0, start(id, -1))


def _step(id: uint64, shape: int, a: vec3f, b: vec3f, r: float, limit: float, at: Cursor):
    index, node, level, block, left, low, high = wp._library_call(
        "warp_overlap_next", id, shape, a, b, r, limit,
        at.node, at.level, at.block, at.left, at.low, at.high,
    )  # fmt: skip
    return index, Cursor(node, level, block, left, low, high)


def bvh_query_next(query: ref[BvhQuery], index: ref[int32], max_dist: float = _INFINITY) -> bool:
    """The next box of a query in `index`; False when there is none.

    max_dist: a ray's end, in units of its direction.
    """
    found, at = step(
        query.id, query.shape, query.first, query.second, query.radius, max_dist, query.cursor
    )
    query.cursor = at
    index = wp.where(found >= 0, found, index)
    return found >= 0


def mesh_query_next(query: ref[MeshQuery], index: ref[int32]) -> bool:
    """The next face of a query in `index`; False when there is none."""
    found, at = step(
        query.id, query.shape, query.first, query.second, query.radius, 0.0, query.cursor
    )
    query.cursor = at
    index = wp.where(found >= 0, found, index)
    return found >= 0


def _advance_bvh(query: BvhQuery):
    found, at = step(
        query.id, query.shape, query.first, query.second, query.radius, _INFINITY, query.cursor
    )
    query.cursor = at
    return found >= 0, found, query


def _advance_mesh(query: MeshQuery):
    found, at = step(
        query.id, query.shape, query.first, query.second, query.radius, 0.0, query.cursor
    )
    query.cursor = at
    return found >= 0, found, query


check_root = Function(_check_root, "check_root")
start = begin = Function(_start, "start")
step = Function(_step, "step")
ADVANCE_BVH = Function(_advance_bvh, "bvh_query_next")
ADVANCE_MESH = Function(_advance_mesh, "mesh_query_next")
FUNCTIONS = {
    function.__name__: Function(function)
    for function in (
        *(bvh_query_aabb, bvh_query_sphere, bvh_query_ray, bvh_query_capsule, bvh_query_next),
        *(mesh_query_aabb, mesh_query_sphere, mesh_query_next),
    )
}
FUNCTIONS["mesh_query_aabb_next"] = FUNCTIONS["mesh_query_next"]
publish(FUNCTIONS)
MeshQueryAABB = MeshQuery
NEXT = (
    (dtypes.native_type(BvhQuery), ADVANCE_BVH),
    (dtypes.native_type(MeshQuery), ADVANCE_MESH),
)
