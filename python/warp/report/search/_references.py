"""Builtins as formulas on mpmath's numbers.

A formula gets operands as `Type.pack` makes them, and returns a value or a tuple of values. It is
given for the whole domain of the builtin; where it raises or gives a complex number, there is no
reference.
"""

import mpmath as mp

from warp.report.search._numbers import (
    conjugate,
    cross,
    dot,
    flatten,
    minus,
    norm,
    plus,
    quat_times,
    rotated,
    rotation,
    scaled,
    times,
    transposed,
)

REFERENCES = {}

#: The loss by decision, by builtin and part.
KNOWN = {
    ("pow", "gradient"): "x^(y - 1) overflows where x and y are both subnormal",
    ("mod", "value"): "the remainder of a division by zero is not a number",
    ("angle_between", "gradient"): "its direction loses as many digits as the angle is small",
    ("quat_twist", "gradient"): "terms along an axis that is not of unit length cancel",
    ("quat_slerp", "gradient"): "that by b is lost beside that by a where t is below rounding",
}


def reference(*names):
    def decorate(function):
        REFERENCES.update(dict.fromkeys(names, function))
        return function

    return decorate


def _each(function):
    """By component, with numbers beside composites."""

    def apply(*values):
        if not any(isinstance(value, list) for value in values):
            return function(*values)
        length = max(len(value) for value in values if isinstance(value, list))
        parts = [value if isinstance(value, list) else [value] * length for value in values]
        return [apply(*part) for part in zip(*parts, strict=True)]

    return apply


def _stairs(function):
    """Steps of differences are integers where all floats are, too."""

    def apply(x):
        if abs(x) > 2**50:
            raise ValueError("an integer")
        return function(x)

    return apply


def _remainder(a, b):
    if abs(a / b) > 2**50:
        raise ValueError("no digit of the quotient is after the point")
    return a - b * _trunc(a / b)


def _trunc(x):
    return mp.floor(x) if x > 0 else mp.ceil(x)


ELEMENTARY = (
    "acos asin atan atan2 cbrt cos cosh erf erfc erfinv exp expm1 hypot log log10 log1p sin sinc "
    "sinh sqrt tan tanh degrees radians"
)
for _name in ELEMENTARY.split():
    REFERENCES[_name] = getattr(mp, _name)

REFERENCES.update(
    {
        "abs": _each(abs),
        "pos": _each(lambda a: a),
        "ceil": _stairs(mp.ceil),
        "floor": _stairs(mp.floor),
        "trunc": _stairs(_trunc),
        "frac": lambda x: x - _stairs(_trunc)(x),
        "rint": _stairs(mp.nint),
        "round": _stairs(lambda x: _trunc(x + (0.5 if x > 0 else -0.5))),
        "mod": _each(_remainder),
        "floordiv": lambda a, b: _stairs(mp.floor)(a / b),
        "sign": _each(lambda x: mp.mpf(-1 if x < 0 else 1)),
        "step": lambda x: mp.mpf(x < 0),
        "nonzero": lambda x: mp.mpf(x != 0),
        "copysign": lambda x, y: -abs(x) if y < 0 else abs(x),
        "div_approx": _each(lambda x, y: x / y),
        "add": _each(lambda a, b: a + b),
        "sub": _each(lambda a, b: a - b),
        "neg": _each(lambda a: -a),
        "cw_mul": _each(lambda a, b: a * b),
        "cw_div": _each(lambda a, b: a / b),
        "lerp": _each(lambda a, b, t: a * (1 - t) + b * t),
        "log2": lambda x: mp.log(x, 2),
        "softplus": lambda x: mp.log(1 + mp.exp(x)) if x < 1000 else x + mp.exp(-x),
        "erfcinv": lambda x: mp.erfinv(1 - x),
        "clamp": lambda x, low, high: min(max(x, low), high),
        "cross": cross,
        "ddot": lambda a, b: dot(flatten(a), flatten(b)),
        "dot": dot,
        "length": norm,
        "norm_l2": norm,
        "length_sq": lambda a: dot(a, a),
        "norm_l1": lambda a: mp.fsum(map(abs, a)),
        "outer": lambda a, b: [scaled(b, x) for x in a],
        "transpose": transposed,
        "trace": lambda a: mp.fsum(a[i][i] for i in range(len(a))),
        "get_diag": lambda a: [a[i][i] for i in range(len(a))],
        "diag": lambda v: [[x * (i == j) for j in range(len(v))] for i, x in enumerate(v)],
        "skew": lambda v: [[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]],
        "determinant": lambda a: mp.det(mp.matrix(a)),
        "quat_inverse": conjugate,
        "quat_rotate": rotated,
        "quat_rotate_inv": lambda q, v: rotated(conjugate(q), v),
        "quat_to_matrix": rotation,
        "spatial_dot": dot,
        "transform_get_translation": lambda t: t[:3],
        "transform_get_rotation": lambda t: t[3:],
    }
)


@reference("min")
def _min(*values):
    return min(values[0]) if len(values) == 1 else _each(min)(*values)


@reference("max")
def _max(*values):
    return max(values[0]) if len(values) == 1 else _each(max)(*values)


@reference("mul")
def _mul(a, b):
    if isinstance(a, list) and isinstance(b, list):
        if isinstance(a[0], list):
            return times(a, b)
        if isinstance(b[0], list):
            return times(transposed(b), a)
        return quat_times(a, b) if len(a) == 4 else _transform_times(a, b)
    return _each(lambda x, y: x * y)(a, b)


@reference("div")
def _div(a, b):
    return _each(lambda x, y: x / y)(a, b)


@reference("pow")
def _pow(x, y):
    if x < 0:
        raise ValueError("no derivative by the exponent, which the builtin says")
    return mp.power(x, y)


@reference("smoothstep")
def _smoothstep(a, b, x):
    t = min(max((x - a) / (b - a), mp.mpf(0)), mp.mpf(1))
    return t * t * (3 - 2 * t)


@reference("angle_between")
def _angle_between(a, b):
    a, b = scaled(a, 1 / norm(a)), scaled(b, 1 / norm(b))
    return 2 * mp.atan2(norm(minus(a, b)), norm(plus(a, b)))


@reference("logsumexp")
def _logsumexp(a):
    top = max(a)
    return top + mp.log(mp.fsum(mp.exp(x - top) for x in a))


@reference("norm_huber")
def _norm_huber(v, delta):
    size = norm(v)
    return size * size / 2 if size <= delta else delta * (size - delta / 2)


@reference("norm_pseudo_huber")
def _pseudo_huber(v, delta):
    return delta * mp.sqrt(1 + dot(v, v) / (delta * delta))


@reference("smooth_normalize")
def _smooth_normalize(v, delta):
    return scaled(v, 1 / _pseudo_huber(v, delta))


@reference("normalize")
def _normalize(a):
    return scaled(a, 1 / norm(a))


@reference("quat_exp")
def _quat_exp(v):
    half = norm(v) / 2
    return [*scaled(v, mp.sinc(half) / 2), mp.cos(half)]


@reference("quat_log")
def _quat_log(q):
    if q[3] < 0:
        q = scaled(q, -1)
    size = norm(q[:3])
    return scaled(q[:3], 2 * mp.atan2(size, q[3]) / size)


@reference("quat_from_axis_angle")
def _axis_angle(axis, angle):
    return [*scaled(axis, mp.sin(angle / 2)), mp.cos(angle / 2)]


@reference("quat_rpy")
def _rpy(roll, pitch, yaw):
    ex, ey, ez = ([mp.mpf(i == j) for i in range(3)] for j in range(3))
    turned = quat_times(_axis_angle(ey, pitch), _axis_angle(ex, roll))
    return quat_times(_axis_angle(ez, yaw), turned)


@reference("quat_twist_angle")
def _twist_angle(axis, q):
    return 2 * mp.atan2(abs(dot(axis, q[:3])), q[3])


@reference("quat_slerp")
def _slerp(a, b, t):
    a, b = _normalize(a), _normalize(b)
    if dot(a, b) < 0:
        b = scaled(b, -1)
    angle = 2 * mp.atan2(norm(minus(a, b)), norm(plus(a, b)))
    if angle == 0:
        return a
    first = mp.sin((1 - t) * angle) / mp.sin(angle)
    return plus(scaled(a, first), scaled(b, mp.sin(t * angle) / mp.sin(angle)))


@reference("transform_multiply")
def _transform_times(a, b):
    return [*plus(rotated(a[3:], b[:3]), a[:3]), *quat_times(a[3:], b[3:])]


@reference("transform_inverse")
def _transform_inverse(t):
    inverse = conjugate(t[3:])
    return [*scaled(rotated(inverse, t[:3]), -1), *inverse]


@reference("transform_point")
def _transform_point(t, p):
    if isinstance(t[0], list):
        return [dot(row[:3], p) + row[3] for row in t[:3]]
    return plus(rotated(t[3:], p), t[:3])


@reference("transform_vector")
def _transform_vector(t, v):
    if isinstance(t[0], list):
        return [dot(row[:3], v) for row in t[:3]]
    return rotated(t[3:], v)


@reference("transform_to_matrix")
def _transform_to_matrix(t):
    rows = rotation(t[3:])
    return [*(row + [x] for row, x in zip(rows, t[:3], strict=True)), [0, 0, 0, 1]]


@reference("transform_compose")
def _compose(position, q, scale):
    rows = [[x * s for x, s in zip(row, scale, strict=True)] for row in rotation(q)]
    return [*(row + [x] for row, x in zip(rows, position, strict=True)), [0, 0, 0, 1]]


@reference("spatial_cross")
def _spatial_cross(a, b):
    return [*cross(a[:3], b[:3]), *plus(cross(a[3:], b[:3]), cross(a[:3], b[3:]))]


@reference("spatial_cross_dual")
def _spatial_cross_dual(a, b):
    return [*plus(cross(a[:3], b[:3]), cross(a[3:], b[3:])), *cross(a[:3], b[3:])]
