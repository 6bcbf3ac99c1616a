"""Conversions between all scalar types: saturating, and total."""

import math

import numpy as np
import pytest

import warp as wp
from builtin_values import FLOATS, INTS, MAX_FINITE, apply, rounded


def convert(source, target, values, device):
    @wp.kernel
    def cast_each(x: wp.array(dtype=source), y: wp.array(dtype=target)):
        i = wp.tid()
        y[i] = target(x[i])

    x = wp.array(values, dtype=source, device=device)
    y = wp.zeros(len(values), dtype=target, device=device)
    wp.launch(cast_each, dim=len(values), inputs=[x], outputs=[y], device=device)
    return y


def bounds(dtype):
    info = np.iinfo(np.dtype(dtype))
    return int(info.min), int(info.max)


@pytest.mark.parametrize("target", INTS)
@pytest.mark.parametrize("source", FLOATS)
def test_float_to_integer_saturates(device, source, target):
    low, high = bounds(target)
    special = [math.nan, math.inf, -math.inf, 0.0, -0.0, 1.9, -1.9, 1e10, -1e10]
    near = [float(v) for edge in (low, high) for v in (edge - 1, edge, edge + 1, edge / 2)]
    values = [v for v in special + near if not math.isfinite(v) or abs(v) <= MAX_FINITE[source]]
    stored = rounded(values, source)
    result = convert(source, target, stored, device).numpy()
    for v, got in zip(stored, result.tolist()):
        expected = 0 if math.isnan(v) else max(low, min(high, v))
        assert got == int(expected), (v, got)


@pytest.mark.parametrize("target", INTS)
@pytest.mark.parametrize("source", INTS)
def test_integer_to_integer_wraps(device, source, target):
    low, high = bounds(source)
    values = [low, low + 1, low // 2, 0, 1, 5, high // 2, high - 1, high]
    values = np.array(values, np.dtype(source))
    result = convert(source, target, values, device).numpy()
    np.testing.assert_array_equal(result, values.astype(np.dtype(target)))


@pytest.mark.parametrize("target", [wp.float32, wp.float64])
@pytest.mark.parametrize("source", INTS)
def test_integer_to_float_rounds_to_nearest(device, source, target):
    low, high = bounds(source)
    values = [
        v
        for v in (low, low + 1, -3, 0, 7, 2**24 + 1, 2**53 + 1, high - 1, high)
        if low <= v <= high
    ]
    values = np.array(values, np.dtype(source))
    result = convert(source, target, values, device).numpy()
    np.testing.assert_array_equal(result, values.astype(np.dtype(target)))


@pytest.mark.parametrize("target", FLOATS)
@pytest.mark.parametrize("source", FLOATS)
def test_float_to_float(device, source, target):
    values = rounded([0.0, -0.0, 1.0, -2.5, 1 / 3, 1000.0, 6e4, 1e-5, math.inf, -math.inf], source)
    result = convert(source, target, values, device)
    single = values.astype(np.float32) if target is not wp.float64 else values
    expected = wp.array(single, dtype=target, device="cpu")
    np.testing.assert_array_equal(result.numpy(), expected.numpy())


@pytest.mark.parametrize("source", [*INTS, *FLOATS])
def test_to_boolean(device, source):
    values = [0, 1, 5] if source in INTS else [0.0, -0.0, 0.25, math.nan, -math.inf]
    result = convert(source, wp.bool, values, device).numpy()
    assert result.tolist() == [bool(v) for v in values]


@pytest.mark.parametrize("target", [*INTS, *FLOATS])
def test_from_boolean(device, target):
    result = convert(wp.bool, target, [True, False], device)
    expected = wp.array([1.0, 0.0], dtype=target, device="cpu")
    np.testing.assert_array_equal(result.numpy(), expected.numpy())


def test_where_takes_booleans_and_integers(device):
    a, b = [1.0, 2.0, 3.0], [-1.0, -2.0, -3.0]
    for condition, dtype in (([True, False, True], wp.bool), ([7, 0, -1], wp.int32)):
        types = [dtype, wp.float32, wp.float32]
        result = apply(wp.where, [condition, a, b], types, wp.float32, device)
        np.testing.assert_array_equal(result, [1.0, -2.0, 3.0])
