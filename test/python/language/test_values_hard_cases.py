"""Operands at which elementary functions lose digits, and what vectors of threads leave over."""

import math

import numpy as np
import pytest

import warp as wp
from builtin_values import apply, assert_ulps, rounded

mp = pytest.importorskip("mpmath")

FLOATS = (wp.float32, wp.float64)


def around(x, dtype, count=8):
    """Neighbours of a number on both sides."""
    real = np.float32 if dtype is wp.float32 else np.float64
    above, below = [real(x)], [real(x)]
    for _ in range(count):
        above.append(np.nextafter(above[-1], real(np.inf)))
        below.append(np.nextafter(below[-1], real(-np.inf)))
    return above + below


def check(name, reference, *operands, dtype):
    operands = [rounded(x, dtype) for x in operands]
    result = apply(getattr(wp, name), operands, [dtype] * len(operands), dtype, "cpu")
    exact = [float(reference(*map(mp.mpf, row))) for row in zip(*operands)]
    assert_ulps(result, exact, dtype, 1)


@pytest.mark.parametrize("dtype", FLOATS)
@pytest.mark.parametrize("name", ["sin", "cos", "tan"])
def test_angles_next_to_zeros_and_very_large_ones(name, dtype):
    mp.mp.prec = 1400
    turns = [1, 2, 3, 11, 355 / math.pi, 1e4, 33333, 2**18 + 1]
    x = [y for n in turns for y in around(round(n) * math.pi / 2, dtype)]
    top = 127 if dtype is wp.float32 else 1023
    x += [1.9 * 2.0**k for k in range(16, top + 1, 3)] + [-(1.1 * 2.0**k) for k in range(20, 30)]
    # The doubles and floats that lie closest to a multiple of pi/2.
    x += [16367173 * 2.0**72] if dtype is wp.float32 else [6381956970095103 * 2.0**797]
    check(name, getattr(mp, name), x, dtype=dtype)


@pytest.mark.parametrize("dtype", FLOATS)
def test_logarithms_next_to_one(dtype):
    mp.mp.prec = 300
    x = around(1.0, dtype, 20) + [1 + s * 2.0**-k for k in range(1, 20) for s in (-1, 1)]
    for name, reference in (("log", mp.log), ("log2", lambda v: mp.log(v, 2)), ("log10", mp.log10)):
        check(name, reference, x, dtype=dtype)


@pytest.mark.parametrize("dtype", FLOATS)
def test_results_near_the_ends_of_the_range(dtype):
    mp.mp.prec = 300
    top, bottom = (128, -149) if dtype is wp.float32 else (1024, -1074)
    low, high = bottom * math.log(2), top * math.log(2) * 0.9999
    x = np.concatenate([np.linspace(low, low * 0.9, 60), np.linspace(high * 0.99, high, 60)])
    check("exp", mp.exp, x, dtype=dtype)
    check("sinh", mp.sinh, x[60:], dtype=dtype)
    base = np.linspace(1.001, 9, 200)
    exponent = np.linspace(bottom, top * 0.999, 200) / np.log2(base)
    check("pow", mp.power, base, exponent, dtype=dtype)


@pytest.mark.parametrize("dtype", FLOATS)
def test_small_operands_of_differences(dtype):
    mp.mp.prec = 500
    x = [s * 1.7 * 2.0**-k for k in range(0, 100, 3) for s in (-0.5, 0.5)]
    for name in ("expm1", "log1p", "sinh", "tanh", "asin", "atan"):
        check(name, getattr(mp, name), x, dtype=dtype)


@pytest.mark.parametrize("dtype", FLOATS)
@pytest.mark.parametrize("name", ["sin", "exp", "log", "tanh", "cbrt"])
def test_bits_do_not_depend_on_the_number_of_threads(name, dtype):
    x = np.random.default_rng(4).uniform(0.01, 30, 67)
    x[5], x[40] = 1e30, np.nan
    together = apply(getattr(wp, name), [rounded(x, dtype)], [dtype], dtype, "cpu")
    alone = [apply(getattr(wp, name), [rounded([v], dtype)], [dtype], dtype, "cpu")[0] for v in x]
    np.testing.assert_array_equal(together, np.array(alone, together.dtype))
