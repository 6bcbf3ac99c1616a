"""Integer operators: every pair of 8-bit numbers, and the edges of the wider types.

The reference is Python's own integers, reduced to the type's width.
"""

import operator

import numpy as np
import pytest

import warp as wp
from builtin_values import INTS, apply


def limits(dtype):
    info = np.iinfo(np.dtype(dtype))
    return int(info.min), int(info.max)


def wrap(value, dtype):
    low, high = limits(dtype)
    return (value - low) % (high - low + 1) + low


def pairs(dtype):
    low, high = limits(dtype)
    if high - low == 255:
        values = list(range(low, high + 1))
    else:
        near = [-9, -8, -7, -3, -2, -1, 0, 1, 2, 3, 7, 8, 9, 15, 16, 31, 32, 33, 63, 64, 65]
        edges = [low, low + 1, low + 7, low // 2, high // 2, high - 7, high - 1, high]
        values = sorted({v for v in near + edges if low <= v <= high})
    return [(a, b) for a in values for b in values]


def divide(a, b):
    return 0 if b == 0 else abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)


def width(dtype):
    return np.dtype(dtype).itemsize * 8


REFERENCES = {
    "add": lambda a, b, t: a + b,
    "sub": lambda a, b, t: a - b,
    "mul": lambda a, b, t: a * b,
    "div": lambda a, b, t: divide(a, b),
    "floordiv": lambda a, b, t: 0 if b == 0 else a // b,
    "mod": lambda a, b, t: 0 if b == 0 else a - divide(a, b) * b,
    "min": lambda a, b, t: min(a, b),
    "max": lambda a, b, t: max(a, b),
    "bit_and": lambda a, b, t: a & b,
    "bit_or": lambda a, b, t: a | b,
    "bit_xor": lambda a, b, t: a ^ b,
    "lshift": lambda a, b, t: a << b if 0 <= b < width(t) else 0,
    "rshift": lambda a, b, t: a >> (b if 0 <= b < width(t) else width(t) - 1 + (a >= 0)),
}


def expected(name, operands, dtype):
    reference = REFERENCES[name]
    return [wrap(reference(a, b, dtype), dtype) for a, b in operands]


@pytest.mark.parametrize("dtype", INTS)
@pytest.mark.parametrize("name", REFERENCES)
def test_binary(device, name, dtype):
    operands = pairs(dtype)
    a, b = (np.array(side, np.dtype(dtype)) for side in zip(*operands))
    result = apply(getattr(wp, name), [a, b], [dtype, dtype], dtype, device)
    np.testing.assert_array_equal(result, np.array(expected(name, operands, dtype), a.dtype))


COMPARISONS = {
    "eq": operator.eq,
    "ne": operator.ne,
    "lt": operator.lt,
    "le": operator.le,
    "gt": operator.gt,
    "ge": operator.ge,
}


@pytest.mark.parametrize("dtype", INTS)
@pytest.mark.parametrize("name", COMPARISONS)
def test_comparison(device, name, dtype):
    operands = pairs(dtype)
    a, b = (np.array(side, np.dtype(dtype)) for side in zip(*operands))
    result = apply(getattr(wp, name), [a, b], [dtype, dtype], wp.bool, device)
    np.testing.assert_array_equal(result, COMPARISONS[name](a, b))


UNARY = {
    "neg": lambda x: -x,
    "pos": lambda x: x,
    "invert": lambda x: ~x,
    "abs": abs,
    "sign": lambda x: -1 if x < 0 else 1,
    "step": lambda x: int(x < 0),
    "nonzero": lambda x: int(x != 0),
}


@pytest.mark.parametrize("dtype", INTS)
@pytest.mark.parametrize("name", UNARY)
def test_unary(device, name, dtype):
    values = sorted({a for a, _ in pairs(dtype)})
    x = np.array(values, np.dtype(dtype))
    result = apply(getattr(wp, name), [x], [dtype], dtype, device)
    reference = [wrap(UNARY[name](v), dtype) for v in values]
    np.testing.assert_array_equal(result, np.array(reference, x.dtype))


@pytest.mark.parametrize("dtype", INTS)
def test_bit_count_of_twos_complement(device, dtype):
    values = sorted({a for a, _ in pairs(dtype)})
    x = np.array(values, np.dtype(dtype))
    result = apply(wp.bit_count, [x], [dtype], wp.int32, device)
    mask = 2 ** width(dtype) - 1
    np.testing.assert_array_equal(result, [bin(v & mask).count("1") for v in values])


@pytest.mark.parametrize("dtype", INTS)
def test_clamp(device, dtype):
    low, high = limits(dtype)
    x = np.array(sorted({a for a, _ in pairs(dtype)}), np.dtype(dtype))
    bounds = [np.full(len(x), v, x.dtype) for v in (low // 2, high // 2)]
    result = apply(wp.clamp, [x, *bounds], [dtype] * 3, dtype, device)
    np.testing.assert_array_equal(result, np.clip(x, low // 2, high // 2))


@pytest.mark.parametrize("divisor", [1, 2, 3, 8, -1, -3, -8, 0])
def test_constant_divisor(device, divisor):
    """Guards that constants make superfluous are left out; values stay."""

    @wp.kernel
    def divide_by_constant(x: wp.array(dtype=int), y: wp.array2d(dtype=int)):
        i = wp.tid()
        y[i, 0] = x[i] / divisor
        y[i, 1] = x[i] // divisor
        y[i, 2] = x[i] % divisor

    values = [-(2**31), -9, -8, -7, -1, 0, 1, 7, 8, 9, 2**31 - 1]
    x = wp.array(values, dtype=int, device=device)
    y = wp.zeros((len(values), 3), dtype=int, device=device)
    wp.launch(divide_by_constant, dim=len(values), inputs=[x], outputs=[y], device=device)
    operands = [(v, divisor) for v in values]
    reference = [expected(name, operands, wp.int32) for name in ("div", "floordiv", "mod")]
    np.testing.assert_array_equal(y.numpy().T, reference)


@pytest.mark.parametrize("amount", [0, 1, 31, 32, 40, -1])
def test_constant_shift(device, amount):
    @wp.kernel
    def shift_by_constant(x: wp.array(dtype=int), y: wp.array2d(dtype=int)):
        i = wp.tid()
        y[i, 0] = x[i] << amount
        y[i, 1] = x[i] >> amount

    values = [-(2**31), -9, -1, 0, 1, 9, 2**31 - 1]
    x = wp.array(values, dtype=int, device=device)
    y = wp.zeros((len(values), 2), dtype=int, device=device)
    wp.launch(shift_by_constant, dim=len(values), inputs=[x], outputs=[y], device=device)
    operands = [(v, amount) for v in values]
    reference = [expected(name, operands, wp.int32) for name in ("lshift", "rshift")]
    np.testing.assert_array_equal(y.numpy().T, reference)
