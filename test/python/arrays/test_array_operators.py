"""Operators of arrays, compared with NumPy."""

import operator

import numpy as np
import pytest

import warp as wp

FLOATS = [wp.float16, wp.float32, wp.float64]
INTEGERS = [wp.int8, wp.int32, wp.int64, wp.uint16]
SIGNS = {
    "+": (operator.add, operator.iadd),
    "-": (operator.sub, operator.isub),
    "*": (operator.mul, operator.imul),
    "/": (operator.truediv, operator.itruediv),
    "//": (operator.floordiv, operator.ifloordiv),
    "**": (operator.pow, operator.ipow),
}


def positive(shape, dtype):
    values = np.random.default_rng(3).integers(1, 10, shape)
    return values.astype(wp.dtype_to_numpy(dtype))


@pytest.mark.parametrize("dtype", FLOATS, ids=lambda t: t.__name__)
@pytest.mark.parametrize("sign", SIGNS)
def test_floats(device, sign, dtype):
    x, y = positive((2, 4, 5), dtype)
    if sign == "**":
        y[:] = 2
    a, b = wp.array(x, device=device), wp.array(y, device=device)
    compute, update = SIGNS[sign]
    tolerance = {wp.float16: 2e-3, wp.float32: 1e-6, wp.float64: 1e-14}[dtype]
    got = compute(a, b)
    assert got.dtype is dtype
    np.testing.assert_allclose(got.numpy(), compute(x, y), rtol=tolerance)
    for number in (2, 2.0):
        np.testing.assert_allclose(
            compute(a, number).numpy(), compute(x, x.dtype.type(2)), tolerance
        )
        np.testing.assert_allclose(
            compute(number, a).numpy(), compute(x.dtype.type(2), x), tolerance
        )
    before = a.ptr
    a = update(a, b)
    assert a.ptr == before
    np.testing.assert_allclose(a.numpy(), compute(x, y), rtol=tolerance)


# `/` truncates, `//` floors and `%` has the sign of the dividend, as in kernels.
@pytest.mark.parametrize("dtype", INTEGERS, ids=lambda t: t.__name__)
def test_integers(device, dtype):
    x, y = positive((2, 20), dtype)
    a, b = wp.array(x, device=device), wp.array(y, device=device)
    for got, expected in (
        (a + b, x + y),
        (a - b, x - y),
        (a * 3, x * 3),
        (a / b, x // y),
        (a // b, x // y),
        (a % b, x % y),
        (7 - a, 7 - x),
    ):
        assert got.dtype is dtype
        np.testing.assert_array_equal(got.numpy(), expected.astype(x.dtype))
    if dtype is not wp.uint16:
        c = wp.array(-x, device=device)
        np.testing.assert_array_equal((c / 4).numpy(), -(x // 4))
        np.testing.assert_array_equal((c // 4).numpy(), -x // 4)
        np.testing.assert_array_equal((c % 4).numpy(), np.fmod(-x, 4))
        np.testing.assert_array_equal((-a).numpy(), -x)


def test_composites(device):
    x = np.random.default_rng(5).normal(size=(6, 3)).astype(np.float32)
    v = wp.array(x, dtype=wp.vec3, device=device)
    s = wp.array(np.arange(6.0), dtype=float, device=device)
    for got, expected in (
        (v + v, x + x),
        (v * 2, x * 2),
        (2.0 * v, x * 2),
        (v / 2.0, x / 2),
        (v * s, x * np.arange(6, dtype=np.float32)[:, None]),
        (v - wp.vec3(1.0, 2.0, 3.0), x - np.float32([1, 2, 3])),
        (wp.vec3(1.0, 2.0, 3.0) - v, np.float32([1, 2, 3]) - x),
        (-v, -x),
    ):
        assert got.dtype is wp.vec3
        np.testing.assert_array_equal(got.numpy(), expected)


def test_operands_of_other_kinds(device):
    a = wp.ones(3, dtype=wp.float64, device=device)
    assert (a + wp.float64(0.5)).list() == [1.5] * 3
    assert (a + np.float64(0.5)).list() == [1.5] * 3
    assert (+a).list() == [1.0] * 3
    for other in ("x", None, [1.0, 2.0, 3.0], {}):
        with pytest.raises(TypeError):
            a + other


def test_broadcasting_and_in_place(device):
    x = np.arange(12.0, dtype=np.float32).reshape(3, 4)
    a = wp.array(x, device=device)
    a += a[0]
    a[:, 1:] *= 2.0
    expected = x + x[0]
    expected[:, 1:] *= 2
    np.testing.assert_array_equal(a.numpy(), expected)
    with pytest.raises(ValueError, match=r"output of shape \(3, 4\)"):
        row = a[0]
        row += a


class Tensor:
    """An array of another library, which would make sums its own."""

    def __array__(self, dtype=None, copy=None):
        return np.ones(3, dtype=np.float32)

    def __radd__(self, other):
        return self

    __rmul__ = __rtruediv__ = __rsub__ = __rpow__ = __radd__


@pytest.mark.parametrize("name", ["iadd", "isub", "imul", "itruediv", "ipow"])
@pytest.mark.parametrize("other", [np.ones(3, np.float32), Tensor(), [1.0], "x", None])
def test_in_place_means_this_array_or_an_error(name, other):
    """A result of another library never takes the name of an array that was to change."""
    a = wp.full(3, 2.0, dtype=float, device="cpu")
    some = wp.indexedarray(a, wp.array([0, 2], dtype=int, device="cpu"))
    for target in (a, some):
        with pytest.raises(TypeError):
            getattr(operator, name)(target, other)
    assert a.list() == [2.0, 2.0, 2.0]
    # Values are taken as they are, and so are parts of the array itself.
    alias = a
    a += np.float32(1.0)
    a[1:] *= a[:-1]
    assert alias is a and a.list() == [3.0, 9.0, 9.0]


def test_read_only():
    source = np.arange(3.0)
    source.flags.writeable = False
    a = wp.from_dlpack(source)
    assert (a + 1).list() == [1.0, 2.0, 3.0]
    with pytest.raises(ValueError, match="read-only"):
        a += 1


@pytest.mark.parametrize(
    "compute, message",
    [
        (lambda a, i: a + i, r"no overload of '\+'.*float32, int32"),
        (lambda a, i: i + 1.5, "one type, but got an array of 'int32' and 1.5"),
        (lambda a, i: i**2, "'pow'"),
        (lambda a, i: a @ a, "`@` is not defined"),
    ],
)
def test_types_do_not_mix(compute, message):
    a, i = wp.ones(3, device="cpu"), wp.ones(3, dtype=int, device="cpu")
    with pytest.raises(TypeError, match=message):
        compute(a, i)


def test_numbers_out_of_range():
    with pytest.raises((OverflowError, wp.WarpError)):
        wp.ones(3, dtype=wp.uint8, device="cpu") + 300
