"""Two edges, two triangles: kernel functions that need no mesh.

Both are worked out in 64 bits. Triangles that touch meet: where rounding could decide about a sign,
it is found exactly (lib/DeviceLib/geometry/Predicates.h).
"""

from warp._src.geometry.handles import publish
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.dtypes import vec3d, vec3f
from warp._src.types.scalars import float32, float64, int32

# The error of a determinant of three differences, in parts of the sum of its products' sizes
# (Shewchuk, "Adaptive precision floating-point arithmetic", 1997: 7 units and a little).
_ROUNDING = 8.9e-16


def _wide(v: vec3f):
    return wp.vec3d(float64(v[0]), float64(v[1]), float64(v[2]))


def _ratio(x: float64, y: float64):
    """x / y within [0, 1]; 0 where y is 0."""
    result = float64(0.0)
    if y > float64(0.0):
        result = wp.clamp(x / y, float64(0.0), float64(1.0))
    return result


def closest_point_edge_edge(p1: vec3f, q1: vec3f, p2: vec3f, q2: vec3f, epsilon: float32) -> vec3f:
    """The closest points of two edges: (s, t, distance) of p1 + s (q1 - p1) and p2 + t (q2 - p2).

    An edge whose squared length is at most `epsilon` is its first point. For parallel edges one of
    the closest pairs is given (Ericson, "Real-Time Collision Detection", 2004, 5.1.9).
    """
    d1 = wide(q1) - wide(p1)
    d2 = wide(q2) - wide(p2)
    r = wide(p1) - wide(p2)
    a = wp.dot(d1, d1)
    e = wp.dot(d2, d2)
    c = wp.dot(d1, r)
    f = wp.dot(d2, r)
    s = float64(0.0)
    t = float64(0.0)
    if a <= float64(epsilon):
        if e > float64(epsilon):
            t = ratio(f, e)
    elif e <= float64(epsilon):
        s = ratio(-c, a)
    else:
        b = wp.dot(d1, d2)
        s = ratio(b * f - c * e, a * e - b * b)
        t = (b * s + f) / e
        if t < float64(0.0):
            t = float64(0.0)
            s = ratio(-c, a)
        elif t > float64(1.0):
            t = float64(1.0)
            s = ratio(b - c, a)
    distance = wp.length(r + d1 * s - d2 * t)
    return wp.vec3f(float32(s), float32(t), float32(distance))


def _side(a: vec3d, b: vec3d, c: vec3d, d: vec3d) -> int32:
    """On which side of a plane a point is: 1, -1, or 0 if it is in the plane."""
    u = a - d
    v = b - d
    w = c - d
    xy = u[0] * v[1]
    yx = u[1] * v[0]
    yz = u[1] * v[2]
    zy = u[2] * v[1]
    zx = u[2] * v[0]
    xz = u[0] * v[2]
    volume = w[0] * (yz - zy) + w[1] * (zx - xz) + w[2] * (xy - yx)
    size = (
        wp.abs(w[0]) * (wp.abs(yz) + wp.abs(zy))
        + wp.abs(w[1]) * (wp.abs(zx) + wp.abs(xz))
        + wp.abs(w[2]) * (wp.abs(xy) + wp.abs(yx))
    )
    result = int(0)
    if volume > float64(_ROUNDING) * size:
        result = 1
    elif volume < -float64(_ROUNDING) * size:
        result = -1
    else:
        result = wp._library_call("warp_orient3d", a, b, c, d)
    return result


def _pierces(p: vec3d, q: vec3d, a: vec3d, b: vec3d, c: vec3d) -> int32:
    """1 if an edge that is not in the triangle's plane meets the triangle."""
    first = side(a, b, c, p)
    second = side(a, b, c, q)
    result = int(0)
    if first * second <= 0 and (first != 0 or second != 0):
        u = side(p, q, a, b)
        v = side(p, q, b, c)
        w = side(p, q, c, a)
        if (u >= 0 and v >= 0 and w >= 0) or (u <= 0 and v <= 0 and w <= 0):
            result = 1
    return result


def _turn(px: float64, py: float64, qx: float64, qy: float64, rx: float64, ry: float64) -> int32:
    """True if three points of a plane go left (1), right (-1) or along a line."""
    a = (qx - px) * (ry - py)
    b = (qy - py) * (rx - px)
    limit = float64(_ROUNDING) * (wp.abs(a) + wp.abs(b))
    result = int(0)
    if a - b > limit:
        result = 1
    elif a - b < -limit:
        result = -1
    else:
        result = wp._library_call("warp_orient2d", px, py, qx, qy, rx, ry)
    return result


def _within(p: float64, q: float64, r: float64, s: float64) -> int32:
    """True if two closed intervals, of any order of their ends, share a number."""
    return int(wp.max(p, q) >= wp.min(r, s) and wp.max(r, s) >= wp.min(p, q))


def _cross_in_plane(p: vec3d, q: vec3d, r: vec3d, s: vec3d, x: int32, y: int32) -> int32:
    """1 if two edges of a plane share a point; x and y are its axes."""
    a = turn(p[x], p[y], q[x], q[y], r[x], r[y])
    b = turn(p[x], p[y], q[x], q[y], s[x], s[y])
    c = turn(r[x], r[y], s[x], s[y], p[x], p[y])
    d = turn(r[x], r[y], s[x], s[y], q[x], q[y])
    result = int(0)
    if a * b <= 0 and c * d <= 0:
        result = within(p[x], q[x], r[x], s[x]) * within(p[y], q[y], r[y], s[y])
    return result


def _is_in(p: vec3d, a: vec3d, b: vec3d, c: vec3d, x: int32, y: int32) -> int32:
    u = turn(a[x], a[y], b[x], b[y], p[x], p[y])
    v = turn(b[x], b[y], c[x], c[y], p[x], p[y])
    w = turn(c[x], c[y], a[x], a[y], p[x], p[y])
    inside = (u > 0 and v > 0 and w > 0) or (u < 0 and v < 0 and w < 0)
    return int(inside)


def _edge_in_plane(p: vec3d, q: vec3d, a: vec3d, b: vec3d, c: vec3d, x: int32, y: int32) -> int32:
    return (
        cross_in_plane(p, q, a, b, x, y)
        | cross_in_plane(p, q, b, c, x, y)
        | cross_in_plane(p, q, c, a, x, y)
    )


def _overlap_in_plane(a: vec3d, b: vec3d, c: vec3d, d: vec3d, e: vec3d, f: vec3d) -> int32:
    """1 if two triangles of one plane share a point."""
    n = wp.cross(b - a, c - a)
    m = wp.cross(e - d, f - d)
    size = wp.vec3d(
        wp.abs(n[0]) + wp.abs(m[0]), wp.abs(n[1]) + wp.abs(m[1]), wp.abs(n[2]) + wp.abs(m[2])
    )
    # Seen along the axis that the plane's normal is closest to.
    x = int(0)
    y = int(1)
    if size[0] >= size[1] and size[0] >= size[2]:
        x = 1
        y = 2
    elif size[1] >= size[2]:
        x = 2
        y = 0
    met = edge_in_plane(a, b, d, e, f, x, y)
    met = met | edge_in_plane(b, c, d, e, f, x, y) | edge_in_plane(c, a, d, e, f, x, y)
    return met | is_in(a, d, e, f, x, y) | is_in(d, a, b, c, x, y)


def intersect_tri_tri(v0: vec3d, v1: vec3d, v2: vec3d, u0: vec3d, u1: vec3d, u2: vec3d) -> int32:
    """1 if two triangles share a point, else 0. Triangles in one plane may, too."""
    met = pierces(v0, v1, u0, u1, u2) | pierces(v1, v2, u0, u1, u2) | pierces(v2, v0, u0, u1, u2)
    met = met | pierces(u0, u1, v0, v1, v2)
    met = met | pierces(u1, u2, v0, v1, v2) | pierces(u2, u0, v0, v1, v2)
    if met == 0:
        # Only corners or edges in the other's plane are left, or all of both.
        of_v = side(u0, u1, u2, v0), side(u0, u1, u2, v1), side(u0, u1, u2, v2)
        if of_v[0] == 0 and of_v[1] == 0 and of_v[2] == 0:
            met = overlap_in_plane(v0, v1, v2, u0, u1, u2)
        else:
            of_u = side(v0, v1, v2, u0), side(v0, v1, v2, u1), side(v0, v1, v2, u2)
            if of_u[0] == 0 and of_u[1] == 0 and of_u[2] == 0:
                met = overlap_in_plane(v0, v1, v2, u0, u1, u2)
    return met


def _intersect_single(v0: vec3f, v1: vec3f, v2: vec3f, u0: vec3f, u1: vec3f, u2: vec3f) -> int32:
    return intersect(wide(v0), wide(v1), wide(v2), wide(u0), wide(u1), wide(u2))


wide, ratio, side = Function(_wide, "wide"), Function(_ratio, "ratio"), Function(_side, "side")
pierces, turn = Function(_pierces, "pierces"), Function(_turn, "turn")
within, is_in = Function(_within, "within"), Function(_is_in, "is_in")
cross_in_plane = Function(_cross_in_plane, "cross_in_plane")
edge_in_plane = Function(_edge_in_plane, "edge_in_plane")
overlap_in_plane = Function(_overlap_in_plane, "overlap_in_plane")
intersect = Function(intersect_tri_tri)
FUNCTIONS = {
    "closest_point_edge_edge": Function(closest_point_edge_edge),
    "intersect_tri_tri": Function(intersect_tri_tri),
}
FUNCTIONS["intersect_tri_tri"].add_overload(_intersect_single)
publish(FUNCTIONS)
