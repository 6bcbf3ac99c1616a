"""Decompositions of rotations and matrices, as formulas on mpmath's numbers."""

import mpmath as mp

from warp.report.search._numbers import dot, norm, rotation, scaled, times, transposed

ROTATIONS = {}


def reference(function):
    ROTATIONS[function.__name__.removeprefix("_")] = function
    return function


@reference
def _quat_twist(axis, q):
    if abs(mp.log10(norm(axis))) > 3:
        raise ValueError("an axis is of unit length, more or less")
    twist = [*scaled(axis, dot(axis, q[:3])), q[3]]
    return scaled(twist, 1 / norm(twist))


@reference
def _quat_twist_angle_signed(axis, q):
    return 2 * mp.atan2(dot(axis, q[:3]), q[3])


@reference
def _quat_to_axis_angle(q):
    size = norm(q[:3])
    return scaled(q[:3], (-1 if q[3] < 0 else 1) / size), 2 * mp.atan2(size, abs(q[3]))


@reference
def _quat_to_rpy(q):
    m = rotation(scaled(q, 1 / norm(q)))
    flat = mp.hypot(m[0][0], m[1][0])
    if flat < 1e-6:
        raise ValueError("roll and yaw turn about the same axis")
    return [mp.atan2(m[2][1], m[2][2]), mp.atan2(-m[2][0], flat), mp.atan2(m[1][0], m[0][0])]


def _chosen(q):
    """The one of q and -q that matrices give; where that is nearly a tie, there is no reference."""
    q = scaled(q, 1 / norm(q))
    small, large = sorted(q, key=abs)[-2:]
    if abs(abs(q[3]) - 0.5) < 1e-3 or (abs(large) - abs(small) < 1e-3 and small * large < 0):
        raise ValueError("a tie")
    leading = q[3] if abs(q[3]) > 0.5 else large
    return scaled(q, -1) if leading < 0 else q


@reference
def _quat_from_matrix(q):
    return _chosen(q)


@reference
def _transform_from_matrix(p, q):
    return [*p, *_chosen(q)]


@reference
def _transform_decompose(p, q, s):
    if min(s) <= 0 or max(abs(mp.log10(x)) for x in s) > 2:
        raise ValueError("the matrix that is taken apart would have lost the rotation's digits")
    return p, _chosen(q), s


@reference
def _polar(a):
    """The rotation and the symmetric factor, where the determinant is positive."""
    if mp.det(mp.matrix(a)) <= 0:
        raise ValueError("no rotation")
    values, vectors = mp.eigsy(mp.matrix(times(transposed(a), a)))
    root = vectors * mp.diag([mp.sqrt(x) for x in values]) * vectors.T
    return (mp.matrix(a) * mp.inverse(root)).tolist(), root.tolist()
