"""Builtins that are written in the kernel language itself.

The front end calls them under their public names; in Python they run as they are.
"""

import math

from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.dtypes import Float, Scalar, matrix, quaternion, transformation, vec3f, vector
from warp._src.types.native import ArrayType

_Vector, _Spatial, _Square = vector(3, Float), vector(6, Float), matrix((3, 3), Float)
_Quaternion, _Transform = quaternion(Float), transformation(Float)
# Products of constants would be computed in f32.
_HALF_TURN, _TURN, _RIGHT_ANGLE = math.pi, 2 * math.pi, math.pi / 2


def _lower_bound(arr: ArrayType(Scalar), begin: int, end: int, value: Scalar):
    low = int(begin)
    high = int(end - 1)
    while low < high:
        middle = low + (high - low) // 2
        if arr[middle] < value:
            low = middle + 1
        else:
            high = middle
    return low


def _about_axis(angles: vec3f, axis: int):
    half = angles[axis] * 0.5
    part = wp.vec3()
    part[axis] = wp.sin(half)
    return wp.quat(part, wp.cos(half))


def _wrapped(angle: Float):
    turn = type(angle)(_TURN)
    if angle > type(angle)(_HALF_TURN):
        return angle - turn
    if -angle > type(angle)(_HALF_TURN):
        return angle + turn
    return angle


def quat_from_euler(e: vec3f, i: int, j: int, k: int):
    """The rotation by e[i] about axis i, then by e[j] about axis j, then by e[k] about axis k."""
    return about_axis(e, k) * about_axis(e, j) * about_axis(e, i)


def quat_to_euler(q: _Quaternion, i: int, j: int, k: int):
    """The angles of which quat_from_euler gives the rotation, for three different axes.

    The angle about axis j is in [-pi/2, pi/2]. After Bernardes and Viollet, "Quaternion to Euler
    angles conversion", PLoS ONE 17(11), 2022; arc tangents keep the digits near a right angle.
    """
    even = type(q[3])((i - j) * (j - k) * (k - i) // 2)
    a = q[3] - q[j]
    b = q[i] + even * q[k]
    c = q[3] + q[j]
    d = even * q[k] - q[i]
    sum = wp.atan2(b, a)
    difference = wp.atan2(d, c)
    angles = wp.vector(q[0], q[1], q[2])
    angles[i] = wrapped(sum - difference)
    angles[j] = type(a)(2.0) * wp.atan2(wp.hypot(c, d), wp.hypot(a, b)) - type(a)(_RIGHT_ANGLE)
    angles[k] = even * wrapped(sum + difference)
    return angles


def spatial_top(a: _Spatial):
    """The angular part of a spatial vector."""
    return wp.vector(a[0], a[1], a[2])


def spatial_bottom(a: _Spatial):
    """The linear part of a spatial vector."""
    return wp.vector(a[3], a[4], a[5])


def spatial_dot(a: _Spatial, b: _Spatial):
    """The inner product of two spatial vectors."""
    return wp.dot(a, b)


def spatial_cross(a: _Spatial, b: _Spatial):
    """The cross product of two motions."""
    w = wp.cross(top(a), top(b))
    v = wp.cross(bottom(a), top(b)) + wp.cross(top(a), bottom(b))
    return wp.vector(w[0], w[1], w[2], v[0], v[1], v[2])


def spatial_cross_dual(a: _Spatial, b: _Spatial):
    """The cross product of a motion and a force."""
    w = wp.cross(top(a), top(b)) + wp.cross(bottom(a), bottom(b))
    v = wp.cross(top(a), bottom(b))
    return wp.vector(w[0], w[1], w[2], v[0], v[1], v[2])


def spatial_adjoint(r: _Square, s: _Square):
    """The matrix of blocks (r, 0) above (s, r), which carries motions to another frame."""
    z = r.dtype(0.0)
    # fmt: off
    return wp.matrix(
        r[0, 0], r[0, 1], r[0, 2], z, z, z,
        r[1, 0], r[1, 1], r[1, 2], z, z, z,
        r[2, 0], r[2, 1], r[2, 2], z, z, z,
        s[0, 0], s[0, 1], s[0, 2], r[0, 0], r[0, 1], r[0, 2],
        s[1, 0], s[1, 1], s[1, 2], r[1, 0], r[1, 1], r[1, 2],
        s[2, 0], s[2, 1], s[2, 2], r[2, 0], r[2, 1], r[2, 2],
        shape=(6, 6),
    )
    # fmt: on


def velocity_at_point(qd: _Spatial, r: _Vector):
    """The velocity of the point at `r` of a body that moves by `qd`."""
    return wp.cross(top(qd), r) + bottom(qd)


def transform_twist(t: _Transform, x: _Spatial):
    """A motion in the frame that the transform maps to."""
    q = wp.transform_get_rotation(t)
    w = wp.quat_rotate(q, top(x))
    v = wp.quat_rotate(q, bottom(x)) + wp.cross(wp.transform_get_translation(t), w)
    return wp.vector(w[0], w[1], w[2], v[0], v[1], v[2])


def transform_wrench(t: _Transform, x: _Spatial):
    """A force in the frame that the transform maps to."""
    q = wp.transform_get_rotation(t)
    v = wp.quat_rotate(q, bottom(x))
    w = wp.quat_rotate(q, top(x)) + wp.cross(wp.transform_get_translation(t), v)
    return wp.vector(w[0], w[1], w[2], v[0], v[1], v[2])


def _public(function) -> Function:
    made = Function(function)
    made.__module__ = "warp"
    return made


LOWER_BOUND = Function(_lower_bound, "lower_bound")
about_axis = Function(_about_axis, "about_axis")
wrapped = Function(_wrapped, "wrapped")
top, bottom = _public(spatial_top), _public(spatial_bottom)


def quat_between_vectors(a: vec3f, b: vec3f):
    """The shortest rotation that turns the direction of `a` into that of `b`.

    Half the angle comes from the sum of the two directions, which stays exact for small angles; of
    opposite directions any axis across them is taken.
    """
    a = wp.normalize(a)
    b = wp.normalize(b)
    cosine = wp.dot(a, b)
    if cosine < -0.999999:
        axis = wp.cross(a, wp.vec3(1.0, 0.0, 0.0))
        if wp.length_sq(axis) < 0.01:
            axis = wp.cross(a, wp.vec3(0.0, 1.0, 0.0))
        axis = wp.normalize(axis)
        return wp.quat(axis[0], axis[1], axis[2], 0.0)
    axis = wp.cross(a, b)
    return wp.normalize(wp.quat(axis[0], axis[1], axis[2], 1.0 + cosine))


FUNCTIONS = {
    function.__name__: function
    for function in (
        *(top, bottom),
        *map(
            _public,
            (
                *(quat_between_vectors, quat_from_euler, quat_to_euler),
                *(spatial_adjoint, spatial_dot, spatial_cross, spatial_cross_dual),
                *(transform_twist, transform_wrench, velocity_at_point),
            ),
        ),
    )
}
