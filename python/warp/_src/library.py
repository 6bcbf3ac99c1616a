"""Builtins that are written in the kernel language itself.

The front end calls them under their public names; in Python they run as they are.
"""

import typing

import warp as wp
from warp._src.annotations import ArrayType
from warp._src.function import Function
from warp._src.types import Float, Scalar, vec3f, vector

_Spatial = vector(6, Float)


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


def quat_from_euler(e: vec3f, i: int, j: int, k: int):
    """The rotation by e[i] about axis i, then by e[j] about axis j, then by e[k] about axis k."""
    return about_axis(e, k) * about_axis(e, j) * about_axis(e, i)


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


def _public(function) -> Function:
    made = Function(function)
    made.__module__ = "warp"
    return made


LOWER_BOUND = Function(_lower_bound, "lower_bound")
about_axis = Function(_about_axis, "about_axis")
top, bottom = _public(spatial_top), _public(spatial_bottom)
LIBRARY: dict[str, typing.Any] = {
    "quat_from_euler": _public(quat_from_euler),
    "spatial_top": top,
    "spatial_bottom": bottom,
    "spatial_dot": _public(spatial_dot),
    "spatial_cross": _public(spatial_cross),
    "spatial_cross_dual": _public(spatial_cross_dual),
}
