"""Functions of scalars against mpmath, on their domain and on extremes, for every float type."""

import math

import numpy as np
import pytest
from warp._src.builtin_table import DOMAINS

import warp as wp
from builtin_values import FLOATS, MAX_FINITE, apply, assert_ulps, rounded

mp = pytest.importorskip("mpmath")

INF, NAN = math.inf, math.nan


def toward_zero(x):
    return mp.sign(x) * mp.floor(abs(x))


REFERENCES = {
    "sin": mp.sin,
    "cos": mp.cos,
    "tan": mp.tan,
    "asin": mp.asin,
    "acos": mp.acos,
    "atan": mp.atan,
    "atan2": mp.atan2,
    "sinh": mp.sinh,
    "cosh": mp.cosh,
    "tanh": mp.tanh,
    "degrees": mp.degrees,
    "radians": mp.radians,
    "exp": mp.exp,
    "log": mp.log,
    "log2": lambda x: mp.log(x, 2),
    "log10": mp.log10,
    "sqrt": mp.sqrt,
    "pow": mp.power,
    "cbrt": lambda x: mp.sign(x) * mp.cbrt(abs(x)),
    "erf": mp.erf,
    "erfc": mp.erfc,
    "erfinv": mp.erfinv,
    "erfcinv": lambda y: mp.erfinv(1 - y),
    "trunc": toward_zero,
    "floor": mp.floor,
    "ceil": mp.ceil,
    "rint": mp.nint,
    "round": lambda x: mp.sign(x) * mp.floor(abs(x) + 0.5),
    "frac": lambda x: x - toward_zero(x),
    "copysign": lambda x, y: abs(x) if y >= 0 else -abs(x),
    "expm1": mp.expm1,
    "log1p": mp.log1p,
    "hypot": mp.hypot,
    "sinc": mp.sinc,
    "softplus": lambda x: mp.log1p(mp.exp(x)),
}
# Units in the last place. The libraries state 1 to 2 in f32; 16-bit types round an f32 result.
LIMITS = {wp.float16: 0.51, wp.bfloat16: 0.51, wp.float32: 4, wp.float64: 4}


def test_every_domain_has_a_reference():
    assert set(DOMAINS) == set(REFERENCES)


def interval(bounds):
    low, high = bounds.strip("[]").split(",") if isinstance(bounds, str) else bounds
    return float(low), float(high)


@pytest.mark.parametrize("dtype", FLOATS)
@pytest.mark.parametrize("name", DOMAINS)
def test_domain(device, name, dtype):
    mp.mp.dps = 40
    random = np.random.default_rng(7)
    operands = []
    for low, high in map(interval, DOMAINS[name]):
        inside = low + (high - low) * random.uniform(0.004, 0.996, 400)
        operands.append(rounded(inside, dtype))
    result = apply(getattr(wp, name), operands, [dtype] * len(operands), dtype, device)
    reference = [float(REFERENCES[name](*map(mp.mpf, row))) for row in zip(*operands)]
    assert_ulps(result, reference, dtype, LIMITS[dtype])


# Operands and the result that IEEE 754-2019 section 9.2 or our documentation gives.
EXTREMES = {
    "sin": [(0.0, 0.0), (-0.0, -0.0), (INF, NAN), (NAN, NAN)],
    "cos": [(0.0, 1.0), (-INF, NAN), (NAN, NAN)],
    "tan": [(-0.0, -0.0), (INF, NAN), (NAN, NAN)],
    "asin": [(2.0, math.pi / 2), (-INF, -math.pi / 2), (-0.0, -0.0), (NAN, NAN)],
    "acos": [(2.0, 0.0), (-INF, math.pi), (1.0, 0.0), (NAN, NAN)],
    "atan": [(INF, math.pi / 2), (-INF, -math.pi / 2), (-0.0, -0.0), (NAN, NAN)],
    "sinh": [(INF, INF), (-INF, -INF), (-0.0, -0.0), (NAN, NAN)],
    "cosh": [(INF, INF), (-INF, INF), (0.0, 1.0), (NAN, NAN)],
    "tanh": [(INF, 1.0), (-INF, -1.0), (-0.0, -0.0), (NAN, NAN)],
    "exp": [(INF, INF), (-INF, 0.0), (0.0, 1.0), (NAN, NAN)],
    "log": [(INF, INF), (0.0, -INF), (-1.0, NAN), (1.0, 0.0), (NAN, NAN)],
    "log2": [(INF, INF), (-0.0, -INF), (-1.0, NAN), (8.0, 3.0), (NAN, NAN)],
    "log10": [(INF, INF), (0.0, -INF), (-1.0, NAN), (100.0, 2.0), (NAN, NAN)],
    "sqrt": [(INF, INF), (-0.0, -0.0), (-1.0, NAN), (4.0, 2.0), (NAN, NAN)],
    "cbrt": [(INF, INF), (-INF, -INF), (-0.0, -0.0), (-27.0, -3.0), (NAN, NAN)],
    "erf": [(INF, 1.0), (-INF, -1.0), (-0.0, -0.0), (NAN, NAN)],
    "erfc": [(INF, 0.0), (-INF, 2.0), (0.0, 1.0), (NAN, NAN)],
    "erfinv": [(1.0, INF), (-1.0, -INF), (0.0, 0.0), (1.5, NAN), (NAN, NAN)],
    "erfcinv": [(0.0, INF), (2.0, -INF), (1.0, 0.0), (-0.5, NAN), (NAN, NAN)],
    "round": [(0.5, 1.0), (-0.5, -1.0), (2.5, 3.0), (-0.0, -0.0), (INF, INF), (NAN, NAN)],
    "rint": [(0.5, 0.0), (1.5, 2.0), (-2.5, -2.0), (-0.0, -0.0), (INF, INF), (NAN, NAN)],
    "trunc": [(-1.75, -1.0), (-0.5, -0.0), (-INF, -INF), (NAN, NAN)],
    "floor": [(-0.5, -1.0), (0.5, 0.0), (INF, INF), (NAN, NAN)],
    "ceil": [(0.5, 1.0), (-0.5, -0.0), (-INF, -INF), (NAN, NAN)],
    "frac": [(-1.75, -0.75), (1.25, 0.25), (3.0, 0.0), (INF, NAN), (NAN, NAN)],
    "abs": [(-0.0, 0.0), (-INF, INF), (NAN, NAN)],
    "neg": [(0.0, -0.0), (-INF, INF), (NAN, NAN)],
    "sign": [(0.0, 1.0), (-0.0, 1.0), (-2.0, -1.0), (INF, 1.0)],
    "step": [(0.0, 0.0), (-2.0, 1.0), (2.0, 0.0), (NAN, 0.0)],
    "nonzero": [(0.0, 0.0), (-0.0, 0.0), (0.5, 1.0), (NAN, 1.0)],
    "atan2": [
        (0.0, 0.0, 0.0),
        (0.0, -0.0, math.pi),
        (-0.0, -1.0, -math.pi),
        (INF, INF, math.pi / 4),
        (1.0, -INF, math.pi),
        (NAN, 1.0, NAN),
    ],
    "pow": [
        (0.0, 0.0, 1.0),
        (NAN, 0.0, 1.0),
        (1.0, NAN, 1.0),
        (-2.0, 3.0, -8.0),
        (-2.0, 0.5, NAN),
        (0.0, -1.0, INF),
        (2.0, -INF, 0.0),
    ],
    "copysign": [(NAN, -1.0, NAN), (0.0, -2.0, -0.0), (3.0, -0.0, -3.0), (-INF, 1.0, INF)],
    "min": [(NAN, 1.0, 1.0), (1.0, NAN, 1.0), (NAN, NAN, NAN), (-INF, 3.0, -INF)],
    "max": [(NAN, 1.0, 1.0), (1.0, NAN, 1.0), (NAN, NAN, NAN), (INF, 3.0, INF)],
    "div": [(1.0, 0.0, INF), (-1.0, 0.0, -INF), (0.0, 0.0, NAN), (INF, INF, NAN)],
    "mod": [(-7.5, 2.0, -1.5), (7.5, -2.0, 1.5), (1.0, 0.0, NAN), (5.0, INF, 5.0)],
    "floordiv": [(-7.0, 2.0, -4.0), (7.0, 2.0, 3.0), (1.0, 0.0, INF)],
    "clamp": [(5.0, 0.0, 1.0, 1.0), (-5.0, 0.0, 1.0, 0.0), (NAN, 0.0, 1.0, 0.0)],
    "smoothstep": [(0.0, 2.0, -1.0, 0.0), (0.0, 2.0, 3.0, 1.0), (0.0, 2.0, 1.0, 0.5)],
    "lerp": [(1.0, 3.0, 0.25, 1.5), (1.0, 3.0, 1.0, 3.0), (1.0, 3.0, 0.0, 1.0)],
}


@pytest.mark.parametrize("dtype", FLOATS)
@pytest.mark.parametrize("name", EXTREMES)
def test_extremes(device, name, dtype):
    *operands, reference = zip(*EXTREMES[name])
    result = apply(getattr(wp, name), operands, [dtype] * len(operands), dtype, device)
    reference = rounded(reference, dtype)
    assert_ulps(result, reference, dtype, 1)
    signed = reference == 0
    np.testing.assert_array_equal(np.signbit(result[signed]), np.signbit(reference[signed]))


@pytest.mark.parametrize("dtype", FLOATS)
def test_arithmetic_rounds_after_every_operation(device, dtype):
    random = np.random.default_rng(3)
    a, b = (rounded(random.uniform(-4, 4, 500), dtype) for _ in range(2))
    for name, exact in (("add", a + b), ("sub", a - b), ("mul", a * b), ("div", a / b)):
        result = apply(getattr(wp, name), [a, b], [dtype, dtype], dtype, device)
        assert_ulps(result, exact, dtype, 0 if dtype is wp.float64 else 0.5)


@pytest.mark.parametrize("dtype", FLOATS)
def test_classes(device, dtype):
    x = [0.0, -1.0, INF, -INF, NAN, MAX_FINITE[dtype]]
    for name, expected in (
        ("isnan", [0, 0, 0, 0, 1, 0]),
        ("isinf", [0, 0, 1, 1, 0, 0]),
        ("isfinite", [1, 1, 0, 0, 0, 1]),
    ):
        result = apply(getattr(wp, name), [x], [dtype], wp.bool, device)
        np.testing.assert_array_equal(result, np.array(expected, bool))


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
def test_inverse_error_function_over_its_whole_range(device, dtype):
    """Down to the smallest positive number, where 1 - y would be 1."""
    mp.mp.dps = 40
    tiny = 2.0 ** (-149 if dtype is wp.float32 else -1074)
    y = rounded(np.concatenate([np.geomspace(tiny, 1.0, 60), 2 - np.geomspace(1e-7, 1, 20)]), dtype)
    result = apply(wp.erfcinv, [y], [dtype], dtype, device)

    def inverse(v):
        start = mp.sqrt(-mp.log(v)) if v < 1e-3 else mp.erfinv(1 - v)
        return mp.findroot(lambda z: mp.log(mp.erfc(z) / v), start) if v < 1e-3 else start

    assert_ulps(result, [float(inverse(mp.mpf(v))) for v in y], dtype, 4)


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
def test_comparisons_with_nan(device, dtype):
    a, b = [1.0, NAN, NAN, 2.0, -0.0], [NAN, 1.0, NAN, 1.0, 0.0]
    for name, expected in (
        ("eq", [0, 0, 0, 0, 1]),
        ("ne", [1, 1, 1, 1, 0]),
        ("lt", [0, 0, 0, 0, 0]),
        ("le", [0, 0, 0, 0, 1]),
        ("gt", [0, 0, 0, 1, 0]),
        ("ge", [0, 0, 0, 1, 1]),
    ):
        result = apply(getattr(wp, name), [a, b], [dtype, dtype], wp.bool, device)
        np.testing.assert_array_equal(result, np.array(expected, bool))
