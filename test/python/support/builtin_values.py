"""Runs a builtin over arrays of operands, and says how far results are from a reference."""

import numpy as np

import warp as wp

FLOATS = [wp.float16, wp.bfloat16, wp.float32, wp.float64]
INTS = [wp.int8, wp.uint8, wp.int16, wp.uint16, wp.int32, wp.uint32, wp.int64, wp.uint64]
MANTISSA_BITS = {wp.float16: 10, wp.bfloat16: 7, wp.float32: 23, wp.float64: 52}
MIN_EXPONENT = {wp.float16: -14, wp.bfloat16: -126, wp.float32: -126, wp.float64: -1022}
MAX_FINITE = {
    wp.float16: 65504.0,
    wp.bfloat16: (2 - 2.0**-7) * 2.0**127,
    wp.float32: float(np.finfo(np.float32).max),
    wp.float64: float(np.finfo(np.float64).max),
}


def unary(function, source, target):
    @wp.kernel
    def apply_unary(x: wp.array(dtype=source), y: wp.array(dtype=target)):
        i = wp.tid()
        y[i] = function(x[i])

    return apply_unary


def binary(function, first, second, target):
    @wp.kernel
    def apply_binary(
        a: wp.array(dtype=first), b: wp.array(dtype=second), y: wp.array(dtype=target)
    ):
        i = wp.tid()
        y[i] = function(a[i], b[i])

    return apply_binary


def ternary(function, types, target):
    first, second, third = types

    @wp.kernel
    def apply_ternary(
        a: wp.array(dtype=first),
        b: wp.array(dtype=second),
        c: wp.array(dtype=third),
        y: wp.array(dtype=target),
    ):
        i = wp.tid()
        y[i] = function(a[i], b[i], c[i])

    return apply_ternary


def apply(function, operands, types, target, device):
    """Results of `function` over operands of the given types, as float64 for floats."""
    arrays = [
        wp.array(np.asarray(values), dtype=dtype, device=device)
        for values, dtype in zip(operands, types)
    ]
    count = arrays[0].shape[0]
    result = wp.zeros(count, dtype=target, device=device)
    if len(types) == 1:
        kernel = unary(function, types[0], target)
    elif len(types) == 2:
        kernel = binary(function, types[0], types[1], target)
    else:
        kernel = ternary(function, types, target)
    wp.launch(kernel, dim=count, inputs=arrays, outputs=[result], device=device)
    return to_numpy(result)


def to_numpy(array):
    """As NumPy has it; floats of any width as float64."""
    values = array.numpy()
    scalar = getattr(array.dtype, "_wp_scalar_type_", array.dtype)
    if scalar is wp.bfloat16:
        values = (values.view(np.uint16).astype(np.uint32) << 16).view(np.float32)
    return values.astype(np.float64) if scalar in FLOATS else values


def rounded(values, dtype):
    """The values as `dtype` stores them."""
    return to_numpy(wp.array(np.asarray(values, np.float64), dtype=dtype, device="cpu"))


def ulp(reference, dtype):
    """Distance of neighbouring numbers of `dtype` around each reference."""
    magnitude = np.abs(np.asarray(reference, np.float64))
    exponent = np.frexp(magnitude)[1] - 1
    exponent = np.where(magnitude > 0, exponent, MIN_EXPONENT[dtype])
    return np.ldexp(1.0, np.maximum(exponent, MIN_EXPONENT[dtype]) - MANTISSA_BITS[dtype])


def assert_ulps(actual, reference, dtype, limit):
    """At most `limit` units in the last place away; infinities and NaN in the same places."""
    reference = np.asarray(reference, np.float64)
    overflow = np.abs(reference) > MAX_FINITE[dtype]
    reference = np.where(overflow, np.copysign(np.inf, reference), reference)
    np.testing.assert_array_equal(np.isnan(actual), np.isnan(reference))
    finite = np.isfinite(reference)
    infinite = np.isinf(reference)
    np.testing.assert_array_equal(actual[infinite], reference[infinite])
    error = np.abs(actual[finite] - reference[finite]) / ulp(reference[finite], dtype)
    worst = int(np.argmax(error)) if error.size else 0
    assert error.size == 0 or error[worst] <= limit, (
        f"{error[worst]:.3g} ulp at #{worst}: got {actual[finite][worst]!r}, "
        f"expected {reference[finite][worst]!r}"
    )
