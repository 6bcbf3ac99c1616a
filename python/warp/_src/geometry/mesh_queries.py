"""Mesh queries of kernels: closest points, rays, and its arrays.

Searches are calls of the device library; what surrounds them is in the kernel language, so what a
kernel does not read of a result costs nothing. Functions with parameters by reference are the first
forms of these queries: they leave variables as they are if nothing is found.
"""

# The caller reads the value that is assigned to a reference.
# ruff: noqa: F841

from warp._src.geometry.handles import publish
from warp._src.geometry.mesh_arrays import corners, indices, points, velocities
from warp._src.geometry.mesh_derivatives import constant, meeting, weights
from warp._src.geometry.tree_queries import check_root
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.annotations import ref
from warp._src.types.dtypes import vec3f
from warp._src.types.scalars import bool as bool_
from warp._src.types.scalars import float32, int32, uint64
from warp._src.types.structs import struct


@struct
class MeshQueryPoint:
    """A point of a mesh: u and v are the weights of the first two corners of `face`.

    `sign` is -1 inside and 1 outside, 0 where it was not asked for. Without `result` there is no
    such point, and `face` is -1.
    """

    result: bool_
    sign: float32
    face: int32
    u: float32
    v: float32


@struct
class MeshQueryRay:
    """Meeting of a ray and a mesh: `t` in units of its direction, u and v as in MeshQueryPoint.

    `sign` is positive if the front of the face is met, and `normal` has length 1.
    """

    result: bool_
    sign: float32
    face: int32
    t: float32
    u: float32
    v: float32
    normal: vec3f


def mesh_get_point(id: uint64, index: int) -> vec3f:
    """The position of the corner at a place of the mesh's indices."""
    return points(id)[indices(id)[index]]


def mesh_get_velocity(id: uint64, index: int) -> vec3f:
    """The velocity of the corner at a place of the mesh's indices; zero if it has none."""
    values = velocities(id)
    if len(values) == 0:
        return wp.vec3f()
    return values[indices(id)[index]]


def mesh_get_index(id: uint64, index: int) -> int:
    """An element of the mesh's indices."""
    return indices(id)[index]


def mesh_eval_position(id: uint64, face: int, u: float, v: float) -> vec3f:
    """The position of a point of a face; zero if there is no such face."""
    a, b, c = corners(points(id), indices(id), face)
    return a * u + b * v + c * (1.0 - u - v)


def mesh_eval_velocity(id: uint64, face: int, u: float, v: float) -> vec3f:
    """The velocity of a point of a face; zero if there is no such face, or no velocities."""
    values = velocities(id)
    a, b, c = corners(values, indices(id), wp.where(len(values) > 0, face, -1))
    return a * u + b * v + c * (1.0 - u - v)


def mesh_eval_face_normal(id: uint64, face: int) -> vec3f:
    """The unit normal of a face, on the side from which its corners go counter-clockwise."""
    a, b, c = corners(points(id), indices(id), face)
    return wp.normalize(wp.cross(b - a, c - a))


def mesh_get_bvh(id: uint64) -> uint64:
    """The hierarchy over the faces of a mesh, for `bvh_query_*`."""
    return id


def mesh_query_point_no_sign(id: uint64, point: vec3f, max_dist: float):
    """The closest point of a mesh that is nearer than `max_dist`."""
    face, u, v = wp._library_call("warp_mesh_closest", id, point, max_dist)
    a, b, c = corners(points(id), indices(id), face)
    at = weights(a, b, c, point, constant(u), constant(v))
    return MeshQueryPoint(face >= 0, 0.0, face, at[0], at[1])


def mesh_query_furthest_point_no_sign(id: uint64, point: vec3f, min_dist: float):
    """The corner of a mesh that is furthest, if it is further than `min_dist`."""
    face, u, v = wp._library_call("warp_mesh_furthest", id, point, min_dist)
    return MeshQueryPoint(face >= 0, 0.0, face, constant(u), constant(v))


def mesh_query_point(id: uint64, point: vec3f, max_dist: float):
    """The closest point of a mesh that is nearer than `max_dist`, and the side.

    Rays along the three axes say what is inside; two of them decide.
    """
    found = no_sign(id, point, max_dist)
    if found.result:
        side = wp._library_call("warp_mesh_side", id, point)
        found.sign = constant(side)
    return found


def mesh_query_point_sign_normal(id: uint64, point: vec3f, max_dist: float, epsilon: float = 1e-3):
    """The closest point of a mesh that is nearer than `max_dist`, and the side by normals.

    epsilon: corners of faces are one if they are this close, in parts of the longest edge there.
    """
    face, u, v, sign = wp._library_call("warp_mesh_closest_signed", id, point, max_dist, epsilon)
    a, b, c = corners(points(id), indices(id), face)
    at = weights(a, b, c, point, constant(u), constant(v))
    return MeshQueryPoint(face >= 0, constant(sign), face, at[0], at[1])


def _assign_place(
    found: MeshQueryPoint, face: ref[int32], bary_u: ref[float32], bary_v: ref[float32]
) -> bool:
    if found.result:
        face = found.face
        bary_u = found.u
        bary_v = found.v
    return found.result


def _assign_side(
    found: MeshQueryPoint,
    inside: ref[float32],
    face: ref[int32],
    bary_u: ref[float32],
    bary_v: ref[float32],
) -> bool:
    if found.result:
        inside = found.sign
    return assign_place(found, face, bary_u, bary_v)


def _point_into(
    id: uint64,
    point: vec3f,
    max_dist: float,
    inside: ref[float32],
    face: ref[int32],
    bary_u: ref[float32],
    bary_v: ref[float32],
) -> bool:
    return assign_side(point_and_side(id, point, max_dist), inside, face, bary_u, bary_v)


def _no_sign_into(
    id: uint64,
    point: vec3f,
    max_dist: float,
    face: ref[int32],
    bary_u: ref[float32],
    bary_v: ref[float32],
) -> bool:
    return assign_place(no_sign(id, point, max_dist), face, bary_u, bary_v)


def _normal_into(
    id: uint64,
    point: vec3f,
    max_dist: float,
    inside: ref[float32],
    face: ref[int32],
    bary_u: ref[float32],
    bary_v: ref[float32],
    epsilon: float = 1e-3,
) -> bool:
    found = by_normal(id, point, max_dist, epsilon)
    return assign_side(found, inside, face, bary_u, bary_v)


def _furthest_into(
    id: uint64,
    point: vec3f,
    min_dist: float,
    face: ref[int32],
    bary_u: ref[float32],
    bary_v: ref[float32],
) -> bool:
    return assign_place(furthest(id, point, min_dist), face, bary_u, bary_v)


def mesh_query_ray(id: uint64, start: vec3f, dir: vec3f, max_t: float, root: int = -1):
    """The first meeting of a ray and a mesh, at 0 <= t < max_t; back faces count."""
    check_root(id, root)
    face, u, v, t = wp._library_call(
        "warp_mesh_ray", id, start, dir, max_t, root
    )  # fmt: skip
    normal = face_normal(id, face)
    sign = wp.where(wp.dot(normal, dir) < 0.0, 1.0, -1.0)
    a, b, c = corners(points(id), indices(id), face)
    at = meeting(a, b, c, start, dir, constant(u), constant(v), constant(t))
    return MeshQueryRay(face >= 0, sign, face, at[2], at[0], at[1], normal)


def _ray_into(
    id: uint64,
    start: vec3f,
    dir: vec3f,
    max_t: float,
    t: ref[float32],
    bary_u: ref[float32],
    bary_v: ref[float32],
    sign: ref[float32],
    normal: ref[vec3f],
    face: ref[int32],
    root: int = -1,
) -> bool:
    found = ray(id, start, dir, max_t, root)
    if found.result:
        t = found.t
        bary_u = found.u
        bary_v = found.v
        sign = found.sign
        normal = found.normal
        face = found.face
    return found.result


def mesh_query_ray_anyhit(
    id: uint64, start: vec3f, dir: vec3f, max_t: float, root: int = -1
) -> bool:
    """True if a ray meets a mesh at 0 <= t < max_t."""
    check_root(id, root)
    met = wp._library_call(
        "warp_mesh_ray_any", id, start, dir, max_t, root
    )  # fmt: skip
    return met != 0


face_normal = Function(mesh_eval_face_normal)
no_sign = Function(mesh_query_point_no_sign)
point_and_side = Function(mesh_query_point)
furthest = Function(mesh_query_furthest_point_no_sign)
by_normal = Function(mesh_query_point_sign_normal)
ray = Function(mesh_query_ray)
assign_place = Function(_assign_place, "assign_place")
assign_side = Function(_assign_side, "assign_side")
FUNCTIONS = {
    function.__name__: Function(function)
    for function in (
        *(mesh_get_point, mesh_get_velocity, mesh_get_index, mesh_get_bvh),
        *(mesh_eval_position, mesh_eval_velocity, mesh_eval_face_normal),
        *(mesh_query_furthest_point_no_sign, mesh_query_ray_anyhit),
        *(mesh_query_point, mesh_query_point_no_sign, mesh_query_ray),
        mesh_query_point_sign_normal,
    )
}
FUNCTIONS["mesh_query_point"].add_overload(_point_into)
FUNCTIONS["mesh_query_point_no_sign"].add_overload(_no_sign_into)
FUNCTIONS["mesh_query_furthest_point_no_sign"].add_overload(_furthest_into)
FUNCTIONS["mesh_query_point_sign_normal"].add_overload(_normal_into)
FUNCTIONS["mesh_query_ray"].add_overload(_ray_into)
publish(FUNCTIONS)
