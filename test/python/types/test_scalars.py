"""Scalar types at Python scope."""

import copy
import math
import pickle

import numpy as np
import pytest

import warp as wp

INTS = [wp.int8, wp.uint8, wp.int16, wp.uint16, wp.int32, wp.uint32, wp.int64, wp.uint64]
FLOATS = [wp.float16, wp.bfloat16, wp.float32, wp.float64]


@pytest.mark.parametrize("dtype", [wp.bool, *INTS, *FLOATS])
def test_default_is_zero(dtype):
    assert dtype().value == 0
    assert not dtype()


@pytest.mark.parametrize("dtype", INTS)
def test_ints_wrap_like_numpy(dtype):
    numpy_type = np.dtype(dtype).type
    for value in (-1, 0, 1, 127, 128, 255, 2**31, 2**63 - 1):
        expected = int(np.array(value, np.int64).astype(numpy_type))
        assert dtype(value).value == expected


@pytest.mark.parametrize("dtype", INTS)
def test_ints_reject_floats(dtype):
    with pytest.raises(TypeError):
        dtype(1.5)


def test_arithmetic_gives_python_numbers():
    assert wp.int32(7) / wp.int32(2) == 3
    assert wp.int32(-7) / wp.int32(2) == -3
    assert wp.int32(-7) // wp.int32(2) == -4
    assert wp.int32(-7) % wp.int32(2) == -1
    assert wp.uint8(200) + wp.uint8(100) == 44
    assert wp.int32(5) & wp.int32(4) == 4
    assert wp.int32(1) << wp.int32(40) == 0
    assert 2 + wp.int32(7) == 9
    assert type(wp.float32(1.0) + 2.5) is float
    assert abs(wp.int32(-2)) == 2


def test_float_results_are_rounded():
    assert wp.float32(0.1) + wp.float32(0.2) == float(np.float32(0.1 + 0.2))
    assert wp.float16(1.0) + wp.float16(0.0001) == 1.0


def test_division_by_zero_is_defined():
    assert wp.int32(5) / wp.int32(0) == 0
    assert wp.int32(5) % wp.int32(0) == 0
    assert wp.float32(1.0) / wp.float32(0.0) == math.inf
    assert math.isnan(wp.float32(0.0) / wp.float32(0.0))


@pytest.mark.parametrize(
    "operation",
    [
        lambda: wp.float32(1.0) + wp.int32(1),
        lambda: wp.int32(1) + 2.5,
        lambda: wp.float32(1.0) * wp.float64(1.0),
        lambda: wp.int32(1) + "a",
    ],
)
def test_types_do_not_mix(operation):
    with pytest.raises(TypeError):
        operation()


def test_comparison_and_hash():
    assert wp.float32(1.0) == wp.float64(1.0) == 1
    assert wp.int32(5) < wp.int32(6) < 7
    assert hash(wp.int32(5)) == hash(5)
    assert {wp.int32(5): "five"}[wp.int32(5)] == "five"


def test_text_and_copies():
    assert repr(wp.float32(0.5)) == "float32(0.5)"
    assert str(wp.int32(3)) == "3"
    assert copy.deepcopy(wp.uint8(3)).value == 3
    assert pickle.loads(pickle.dumps(wp.float16(0.5))).value == 0.5


@pytest.mark.parametrize("value", [0.0, 1.0, -2.5, 65504.0, 6e-8, math.inf, 1e9, 0.1])
def test_half_precision_matches_numpy(value):
    from warp._src.types.arithmetic import half_from_bits, half_to_bits

    with np.errstate(over="ignore"):
        expected = np.float16(value)
    assert half_to_bits(value) == int(expected.view(np.uint16))
    assert half_from_bits(half_to_bits(value)) == float(expected)


@pytest.mark.parametrize("value", [0.0, 1.0, -2.5, 3.14159, 1e38, math.inf, 1.00390625])
def test_bfloat16_rounds_to_even(value):
    from warp._src.types.arithmetic import bfloat16_from_bits, bfloat16_to_bits
    from warp._src.types.numpy_types import bfloat16_bits

    bits = bfloat16_to_bits(value)
    assert bits == int(bfloat16_bits(np.array([value]))[0])
    around = [bfloat16_from_bits(b) for b in (bits - 1, bits, bits + 1) if 0 <= b < 2**16]
    if math.isfinite(value):
        errors = [abs(x - value) for x in around if math.isfinite(x)]
        assert abs(bfloat16_from_bits(bits) - value) == min(errors)


@pytest.mark.parametrize("dtype", [wp.bool, *INTS, wp.float16, wp.float32, wp.float64])
def test_numpy_dtypes_round_trip(dtype):
    assert wp.dtype_from_numpy(wp.dtype_to_numpy(dtype)) is dtype
    assert wp.dtype_from_numpy(np.dtype(dtype)) is dtype


def test_numpy_dtypes_without_counterpart():
    with pytest.raises(TypeError, match="complex64"):
        wp.dtype_from_numpy(np.complex64)
    with pytest.raises(TypeError):
        wp.dtype_to_numpy(wp.vec3)


def test_constants():
    assert wp.constant(4) == 4
    assert wp.constant(wp.vec3(1.0)) == (1, 1, 1)
    assert wp.PI == wp.pi == math.pi
    assert wp.INF == math.inf and math.isnan(wp.NAN)
    with pytest.raises(TypeError, match="list"):
        wp.constant([1])


@wp.kernel
def narrow(x: wp.array(dtype=float), y: wp.array(dtype=wp.bfloat16)):
    i = wp.tid()
    y[i] = wp.bfloat16(x[i])


def test_bfloat16_is_the_nearest_of_any_number(device):
    """Subnormal numbers, ties, infinities and NaN among them."""
    ml_dtypes = pytest.importorskip("ml_dtypes")
    low = np.array([0, 1, 0x7FFF, 0x8000, 0x8001, 0xFFFF], dtype=np.uint32)
    bits = (np.arange(1 << 16, dtype=np.uint32)[:, None] << np.uint32(16)) | low
    x = bits.reshape(-1).view(np.float32)
    with np.errstate(invalid="ignore"):
        expected = x.astype(ml_dtypes.bfloat16)
    for part in (slice(None), slice(390_000, 390_007)):
        y = wp.zeros(len(x[part]), dtype=wp.bfloat16, device=device)
        wp.launch(narrow, y.shape, [wp.array(x[part], device=device), y], device=device)
        found, wanted = y.numpy(), expected[part]
        nan = np.isnan(wanted.astype(np.float32))
        assert np.array_equal(np.isnan(found.astype(np.float32)), nan)
        assert np.array_equal(found.view(np.uint16)[~nan], wanted.view(np.uint16)[~nan])
