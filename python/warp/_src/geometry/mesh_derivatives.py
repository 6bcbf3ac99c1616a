"""Derivatives of closest points and of rays: of what a search found, without a search.

The face stays what it is; weights and the parameter of a ray follow query point and direction as
long as they name the same feature. A weight of exactly 0 says that the closest point is on an edge,
two that it is a corner. Ties, silhouettes and the medial axis have the derivative of the face that
was found. A moved corner counts as the point of the face that it moves, and as the edges that turn.
"""

from warp._src.derivatives.functions import custom_vjp
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.dtypes import vec2f, vec3f
from warp._src.types.scalars import float32, int32


def _constant(x: float32):
    """The same number without a derivative, which passes through bits."""
    return wp.cast(wp.cast(x, int32), float32)


def _weights(a: vec3f, b: vec3f, c: vec3f, point: vec3f, u: float, v: float):
    return wp.vec2(u, v)


def _along(first: vec3f, second: vec3f, point: vec3f, t: float, g: float):
    """Cotangents of both ends and of the query point, by the parameter of a point on an edge."""
    edge = second - first
    scaled = g / wp.dot(edge, edge)
    off = (point - first - edge * t) * scaled
    adjoint = edge * scaled
    return adjoint * (t - 1.0) - off, off - adjoint * t, adjoint


def _weights_pullback(a: vec3f, b: vec3f, c: vec3f, point: vec3f, u: float, v: float, g: vec2f):
    w = 1.0 - u - v
    adjoint = wp.vec3()
    of_a = wp.vec3()
    of_b = wp.vec3()
    of_c = wp.vec3()
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
            along_e = (ff * g[0] - ef * g[1]) / det
            along_f = (ee * g[1] - ef * g[0]) / det
            off = point - a * u - b * v - c * w
            adjoint = e * along_e + f * along_f
            of_a = off * along_e - adjoint * u
            of_b = off * along_f - adjoint * v
            of_c = -off * (along_e + along_f) - adjoint * w
    elif u == 0.0 and v != 0.0 and w > 1.0e-7:
        of_c, of_b, adjoint = along(c, b, point, v, g[1])
    elif v == 0.0 and u != 0.0 and w > 1.0e-7:
        of_c, of_a, adjoint = along(c, a, point, u, g[0])
    elif u != 0.0 and v != 0.0:
        of_b, of_a, adjoint = along(b, a, point, u, g[0] - g[1])
    return of_a, of_b, of_c, adjoint, 0.0, 0.0


def _meeting(a: vec3f, b: vec3f, c: vec3f, start: vec3f, dir: vec3f, u: float, v: float, t: float):
    return wp.vec3(u, v, t)


def _meeting_pullback(
    a: vec3f, b: vec3f, c: vec3f, start: vec3f, dir: vec3f, u: float, v: float, t: float, g: vec3f
):
    n = wp.cross(b - a, c - a)
    slope = wp.dot(n, dir)
    area2 = wp.dot(n, n)
    adjoint = wp.vec3()
    if slope != 0.0 and area2 > 0.0:
        # The point moves in the plane, by do + t dd + d dt.
        within = (wp.cross(n, c - b) * g[0] + wp.cross(n, a - c) * g[1]) / area2
        adjoint = within - n * ((g[2] + wp.dot(within, dir)) / slope)
    w = 1.0 - u - v
    return adjoint * -u, adjoint * -v, adjoint * -w, adjoint, adjoint * t, 0.0, 0.0, 0.0


constant = Function(_constant, "constant")
along = Function(_along, "along")
weights = custom_vjp(Function(_weights, "weights"), Function(_weights_pullback, "weights_pullback"))
meeting = custom_vjp(Function(_meeting, "meeting"), Function(_meeting_pullback, "meeting_pullback"))
