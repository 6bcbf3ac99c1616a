"""Derivatives of closest points and of rays: of what a search found, without a search.

The face stays what it is; weights and the parameter of a ray follow query point and direction as
long as they name the same feature. A weight of exactly 0 says that the closest point is on an edge,
two that it is a corner. Ties, silhouettes and the medial axis have the derivative of the face that
was found. Vertices are constant.
"""

from warp._src.derivatives.functions import custom_vjp
from warp._src.geometry.mesh_arrays import corners, indices, points
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.dtypes import vec2f, vec3f
from warp._src.types.scalars import float32, int32, uint64


def _constant(x: float32):
    """The same number without a derivative, which passes through bits."""
    return wp.cast(wp.cast(x, int32), float32)


def _weights(id: uint64, face: int, point: vec3f, u: float, v: float):
    return wp.vec2(u, v)


def _along(first: vec3f, second: vec3f, g: float):
    """Of a point on an edge that moves by its parameter: the cotangent of the query point."""
    edge = second - first
    return edge * (g / wp.dot(edge, edge))


def _weights_pullback(id: uint64, face: int, point: vec3f, u: float, v: float, g: vec2f):
    a, b, c = corners(points(id), indices(id), face)
    w = 1.0 - u - v
    adjoint = wp.vec3()
    if u != 0.0 and v != 0.0 and w > 1.0e-7:
        # (E'E)^-1 E' dp with the edges E = [a - c, b - c].
        e = a - c
        f = b - c
        ee = wp.dot(e, e)
        ef = wp.dot(e, f)
        ff = wp.dot(f, f)
        n = wp.cross(e, f)
        det = wp.dot(n, n)
        if det > 0.0:
            adjoint = (e * (ff * g[0] - ef * g[1]) + f * (ee * g[1] - ef * g[0])) / det
    elif u == 0.0 and v != 0.0 and w > 1.0e-7:
        adjoint = along(c, b, g[1])
    elif v == 0.0 and u != 0.0 and w > 1.0e-7:
        adjoint = along(c, a, g[0])
    elif u != 0.0 and v != 0.0:
        adjoint = along(b, a, g[0] - g[1])
    return adjoint, 0.0, 0.0


def _meeting(id: uint64, face: int, start: vec3f, dir: vec3f, u: float, v: float, t: float):
    return wp.vec3(u, v, t)


def _meeting_pullback(
    id: uint64, face: int, start: vec3f, dir: vec3f, u: float, v: float, t: float, g: vec3f
):
    a, b, c = corners(points(id), indices(id), face)
    n = wp.cross(b - a, c - a)
    slope = wp.dot(n, dir)
    area2 = wp.dot(n, n)
    adjoint = wp.vec3()
    if slope != 0.0 and area2 > 0.0:
        # The point moves in the plane, by do + t dd + d dt.
        within = (wp.cross(n, c - b) * g[0] + wp.cross(n, a - c) * g[1]) / area2
        adjoint = within - n * ((g[2] + wp.dot(within, dir)) / slope)
    return adjoint, adjoint * t, 0.0, 0.0, 0.0


constant = Function(_constant, "constant")
along = Function(_along, "along")
weights = custom_vjp(Function(_weights, "weights"), Function(_weights_pullback, "weights_pullback"))
meeting = custom_vjp(Function(_meeting, "meeting"), Function(_meeting_pullback, "meeting_pullback"))
