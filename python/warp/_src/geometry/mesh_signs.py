"""More ways to tell the sides of a mesh, distances with a sign, and the arrays of a mesh."""

from warp._src.derivatives.functions import custom_vjp
from warp._src.geometry.handles import publish
from warp._src.geometry.mesh_arrays import indices, points, velocities
from warp._src.geometry.mesh_derivatives import constant
from warp._src.geometry.mesh_queries import (
    assign_side,
    face_normal,
    mesh_eval_position,
    no_sign,
    point_and_side,
)
from warp._src.geometry.tree_queries import check_root
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.annotations import ref
from warp._src.types.dtypes import vec3f
from warp._src.types.native import ArrayType
from warp._src.types.scalars import float32, int32, uint64
from warp._src.types.structs import struct

_HALF, _ACCURACY, _RAYS, _SPREAD = 0.5, 2.0, 1, 0.1
_INFINITY = float("inf")


@struct
class MeshArrays:
    """The arrays of a mesh, as `mesh_get` gives them."""

    points: ArrayType(vec3f, 1)
    velocities: ArrayType(vec3f, 1)
    indices: ArrayType(int32, 1)


def mesh_get(id: uint64):
    """The arrays of a mesh: `points`, `velocities` and `indices`."""
    return MeshArrays(points(id), velocities(id), indices(id))


def mesh_query_point_sign_winding_number(
    id: uint64, point: vec3f, max_dist: float, accuracy: float = _ACCURACY, threshold: float = _HALF
):
    """The closest point of a mesh that is nearer than `max_dist`, and the side.

    Inside is where the mesh goes around the point more than `threshold` times.

    accuracy: parts of the mesh count as one if they are this many times their radius away. Near
    the threshold the number is asked for more accurately until it is decided.
    """
    found = no_sign(id, point, max_dist)
    if found.result:
        side = wp._library_call("warp_mesh_side_winding", id, point, accuracy, threshold)
        found.sign = constant(side)
    return found


def mesh_query_point_sign_parity(
    id: uint64,
    point: vec3f,
    max_dist: float,
    n_sample: int = _RAYS,
    perturbation_scale: float = _SPREAD,
):
    """The closest point of a mesh that is nearer than `max_dist`, and the side.

    Inside is where half of `n_sample` rays around (1, 1, 1), or more, cross the mesh an odd number
    of times. A ray through an edge or a corner counts as one next to it.
    """
    found = no_sign(id, point, max_dist)
    if found.result:
        side = wp._library_call("warp_mesh_side_parity", id, point, n_sample, perturbation_scale)
        found.sign = constant(side)
    return found


def _winding_into(
    id: uint64,
    point: vec3f,
    max_dist: float,
    inside: ref[float32],
    face: ref[int32],
    bary_u: ref[float32],
    bary_v: ref[float32],
    accuracy: float = _ACCURACY,
    threshold: float = _HALF,
) -> bool:
    found = by_winding(id, point, max_dist, accuracy, threshold)
    return assign_side(found, inside, face, bary_u, bary_v)


def _parity_into(
    id: uint64,
    point: vec3f,
    max_dist: float,
    inside: ref[float32],
    face: ref[int32],
    bary_u: ref[float32],
    bary_v: ref[float32],
    n_sample: int = _RAYS,
    perturbation_scale: float = _SPREAD,
) -> bool:
    found = by_parity(id, point, max_dist, n_sample, perturbation_scale)
    return assign_side(found, inside, face, bary_u, bary_v)


def mesh_query_ray_count_intersections(id: uint64, start: vec3f, dir: vec3f, root: int = -1) -> int:
    """How often a ray crosses a mesh at t >= 0.

    A ray through an edge or a corner crosses once where the surface goes on behind it.
    """
    check_root(id, root)
    return wp._library_call("warp_mesh_ray_count", id, start, dir, root)


def mesh_get_group_root(id: uint64, group: int) -> int:
    """The node that holds the faces of a group, for queries with a `root`; -1 if there is none."""
    return wp._library_call("warp_group_root", id, group)


def bvh_get_group_root(id: uint64, group: int) -> int:
    """The node that holds the boxes of a group, for queries with a `root`; -1 if there is none."""
    return wp._library_call("warp_group_root", id, group)


def _distance(point: vec3f, foot: vec3f, sign: float, normal: vec3f, inner: int):
    return sign * wp.length(point - foot)


def _distance_pullback(point: vec3f, foot: vec3f, sign: float, normal: vec3f, inner: int, g: float):
    """Along the shortest way to the surface, whose direction is that of a face if it ends in one.

    The way turns when a corner moves, but its length does not change by that.

    Close to the surface the way itself is mostly rounding.
    """
    offset = point - foot
    along = normal
    if inner == 0:
        size = wp.length(offset)
        if size > 0.0:
            along = offset * (sign / size)
    elif wp.dot(offset, normal) * sign < 0.0:
        along = -normal
    return along * g, along * -g, 0.0, wp.vec3()


def mesh_sdf(id: uint64, point: vec3f, max_dist: float = _INFINITY) -> float:
    """The distance of a point to a mesh, negative inside; `max_dist` if it is no nearer.

    The side is that of `mesh_query_point`. The derivative by the point is the direction away from
    the surface, on it the normal of the face.
    """
    result = max_dist
    found = point_and_side(id, point, max_dist)
    if found.result:
        at = position(id, found.face, constant(found.u), constant(found.v))
        normal = face_normal(id, found.face)
        inner = int(found.u > 0.0 and found.v > 0.0 and 1.0 - found.u - found.v > 1.0e-7)
        result = distance(point, at, found.sign, normal, inner)
    return result


by_winding = Function(mesh_query_point_sign_winding_number)
by_parity = Function(mesh_query_point_sign_parity)
position = Function(mesh_eval_position)
distance = custom_vjp(
    Function(_distance, "distance"), Function(_distance_pullback, "distance_pullback")
)
FUNCTIONS = {
    function.__name__: Function(function)
    for function in (
        *(mesh_get, mesh_get_group_root, bvh_get_group_root, mesh_query_ray_count_intersections),
        *(mesh_query_point_sign_winding_number, mesh_query_point_sign_parity, mesh_sdf),
    )
}
FUNCTIONS["mesh_query_point_sign_winding_number"].add_overload(_winding_into)
FUNCTIONS["mesh_query_point_sign_parity"].add_overload(_parity_into)
publish(FUNCTIONS)
