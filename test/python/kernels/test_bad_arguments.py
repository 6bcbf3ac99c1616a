"""Launches and arrays with impossible arguments: a clear error, nothing lost, no crash."""

import numpy as np
import pytest

import warp as wp
from warp.extend import errors


@wp.kernel
def saxpy(a: float, x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = a * x[i] + y[i]


@wp.kernel
def shift(x: wp.array(dtype=wp.vec3), by: wp.vec3, n: int):
    i = wp.tid()
    if i < n:
        x[i] = x[i] + by


@wp.struct
class Pair:
    a: float
    b: wp.array(dtype=float)


@wp.kernel
def use_pair(p: Pair, out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = p.a * p.b[i]


def floats(device, *shape):
    return wp.ones(shape, dtype=float, device=device)


def check_failure(words, kernel, dim, inputs, device, kind=errors.WarpError):
    """The launch raises `kind`, its message names the kernel and holds all `words`."""
    with pytest.raises(kind) as caught:
        wp.launch(kernel, dim, inputs, device=device)
    message = str(caught.value)
    for word in (kernel.key, *words):
        assert word in message, f"'{word}' is not in: {message}"


def test_wrong_dtype(device):
    x, y = floats(device, 4), floats(device, 4)
    for other in (wp.int32, wp.float64, wp.vec3, wp.float16, wp.uint32):
        bad = wp.zeros(4, dtype=other, device=device)
        check_failure(["'x'"], saxpy, 4, [2.0, bad, y], device)
    check_failure(["'y'"], saxpy, 4, [2.0, x, wp.zeros(4, dtype=wp.vec2, device=device)], device)
    check_failure(["'x'"], shift, 4, [x, wp.vec3(), 1], device)


def test_wrong_rank(device):
    y = floats(device, 4)
    for bad in (floats(device, 4, 4), floats(device, 2, 2, 2), floats(device, 1, 1, 1, 4)):
        check_failure(["'x'", "1"], saxpy, 4, [2.0, bad, y], device)


def test_wrong_kind_of_value(device):
    x = floats(device, 4)
    for bad in (1.0, "text", object(), [1.0, "two"], {}, wp.vec3(), saxpy):
        check_failure(["'x'"], saxpy, 4, [2.0, bad, x], device)
    for bad in ("text", x, object(), wp.vec3(), None, [1.0]):
        check_failure(["'a'"], saxpy, 4, [bad, x, x], device)
    v = wp.zeros(4, dtype=wp.vec3, device=device)
    for bad in ("abc", (1.0, 2.0), (1.0, 2.0, 3.0, 4.0), (1.0, 2.0, "x"), None, 3.0, wp.vec2()):
        check_failure(["'by'"], shift, 4, [v, bad, 1], device)


def test_number_that_does_not_fit_its_parameter(device):
    v = wp.zeros(4, dtype=wp.vec3, device=device)
    for bad in (2**31, -(2**31) - 1, 2**70):
        check_failure(["'n'"], shift, 4, [v, wp.vec3(), bad], device)


def test_none_is_an_empty_array_and_an_error_for_a_struct(device):
    @wp.kernel
    def optional(x: wp.array(dtype=float), out: wp.array(dtype=float)):
        i = wp.tid()
        if x:
            out[i] = x[i]
        else:
            out[i] = -1.0

    out = floats(device, 3)
    wp.launch(optional, 3, [None, out], device=device)
    assert out.numpy().tolist() == [-1.0] * 3
    check_failure(["'p'"], use_pair, 3, [None, out], device)


def test_missing_and_extra_arguments(device):
    x = floats(device, 4)
    check_failure(["3", "2"], saxpy, 4, [2.0, x], device)
    check_failure(["3", "0"], saxpy, 4, [], device)
    check_failure(["3", "4"], saxpy, 4, [2.0, x, x, x], device)
    with pytest.raises(errors.WarpError):
        wp.launch(saxpy, 4, [2.0, x], [x, x], device=device)


@pytest.mark.parametrize(
    "dim", [-1, (-1,), (4, -2), (2, 2, 2, -9), 2**63, 2**31, (2**31, 2), 2**100]
)
def test_negative_and_huge_dimensions(device, dim):
    x = floats(device, 4)
    with pytest.raises((errors.WarpError, ValueError, OverflowError)):
        wp.launch(saxpy, dim, [2.0, x, x], device=device)
    assert (x.numpy() == 1.0).all()


@pytest.mark.parametrize("dim", [None, "4", 1.5, (1, 2, 3, 4, 5), [2, "x"], (), object()])
def test_dimensions_of_a_wrong_kind(device, dim):
    x = floats(device, 4)
    with pytest.raises((errors.WarpError, TypeError, ValueError)):
        wp.launch(saxpy, dim, [2.0, x, x], device=device)


@pytest.mark.parametrize("dim", [0, (0,), (0, 5), (5, 0), (3, 0, 2), (0, 0, 0, 0)])
def test_dimension_zero_does_nothing(device, dim):
    x = floats(device, 4)
    wp.launch(saxpy, dim, [2.0, x, x], device=device)
    assert (x.numpy() == 1.0).all()


def test_empty_arrays(device):
    x = wp.zeros(0, dtype=float, device=device)
    wp.launch(saxpy, 0, [2.0, x, x], device=device)
    assert x.numpy().shape == (0,)
    assert wp.clone(x).shape == (0,)
    assert wp.array([], dtype=float, device=device).shape == (0,)
    assert wp.zeros((3, 0), dtype=wp.vec3, device=device).numpy().shape == (3, 0, 3)


def test_unknown_device():
    x = floats("cpu", 4)
    for name in ("gpu", "cuda:99", "cpu:7", "", "cuda:-1", "cuda:x"):
        with pytest.raises((errors.WarpError, ValueError)):
            wp.launch(saxpy, 4, [2.0, x, x], device=name)
        with pytest.raises((errors.WarpError, ValueError)):
            wp.zeros(4, dtype=float, device=name)


@pytest.mark.cuda
def test_array_of_another_device():
    host, card = floats("cpu", 4), floats("cuda:0", 4)
    check_failure(["'x'", "cpu", "cuda:0"], saxpy, 4, [2.0, host, card], "cuda:0")
    check_failure(["'y'", "cpu", "cuda:0"], saxpy, 4, [2.0, host, card], "cpu")
    pair = Pair()
    pair.b = host
    check_failure(["'p'"], use_pair, 4, [pair, card], "cuda:0")


def test_wrong_struct(device):
    @wp.struct
    class Other:
        a: float
        b: wp.array(dtype=float)

    check_failure(["'p'", "Pair"], use_pair, 3, [Other(), floats(device, 3)], device)
    pair = Pair()
    with pytest.raises((errors.WarpError, TypeError, RuntimeError)):
        pair.b = wp.zeros(3, dtype=int, device=device)
    with pytest.raises((errors.WarpError, TypeError, RuntimeError)):
        pair.b = floats(device, 2, 2)
    with pytest.raises((errors.WarpError, AttributeError)):
        pair.unknown = 1.0
    with pytest.raises((errors.WarpError, TypeError, ValueError, RuntimeError)):
        pair.a = "text"


def test_not_a_kernel(device):
    for bad in (None, "saxpy", len, 3, wp.sin):
        with pytest.raises((errors.WarpError, TypeError, AttributeError)):
            wp.launch(bad, 4, [], device=device)


def test_a_failed_launch_leaves_the_kernel_usable(device):
    x, y = floats(device, 4), floats(device, 4)
    for _ in range(3):
        check_failure(["'x'"], saxpy, 4, [2.0, None if False else "x", y], device)
        wp.launch(saxpy, 4, [1.0, x, y], device=device)
    assert (y.numpy() == 4.0).all()


@pytest.mark.parametrize("shape", [-1, (-1, 3), (2, 2, 2, 2, 2), (2**31,), "x", 2.5])
def test_arrays_of_impossible_shape(device, shape):
    with pytest.raises((errors.WarpError, TypeError, ValueError, OverflowError)):
        wp.zeros(shape, dtype=float, device=device)


def test_more_memory_than_there_is(device):
    with pytest.raises((errors.WarpError, MemoryError)) as caught:
        wp.empty((2**31 - 1, 2**20), dtype=wp.vec4, device=device)
    assert "memory" in str(caught.value)


def test_data_that_is_no_array(device):
    for bad in ([[1.0, 2.0], [3.0]], ["a", "b"], object(), [None]):
        with pytest.raises((errors.WarpError, TypeError, ValueError)):
            wp.array(bad, dtype=float, device=device)
    with pytest.raises((errors.WarpError, TypeError, ValueError)):
        wp.array(np.zeros((4, 2)), dtype=wp.vec3, device=device)


def test_copies_of_different_size(device):
    with pytest.raises((errors.WarpError, ValueError)):
        wp.copy(floats(device, 3), floats(device, 4))
    with pytest.raises((errors.WarpError, ValueError, IndexError)):
        wp.copy(floats(device, 4), floats(device, 4), dest_offset=3, count=2)
    with pytest.raises((errors.WarpError, ValueError, TypeError)):
        floats(device, 2).assign([1.0, 2.0, 3.0])
    short = floats(device, 4)
    short.fill_(7.0)
    short.assign([1.0, 2.0])
    assert short.numpy().tolist() == [1.0, 2.0, 7.0, 7.0]


def test_nan_and_infinity_pass_as_ieee_says(device):
    @wp.kernel
    def kernel(a: wp.array(dtype=float), b: wp.array(dtype=float), out: wp.array2d(dtype=float)):
        i = wp.tid()
        x = a[i]
        y = b[i]
        out[i, 0] = x + y
        out[i, 1] = x - y
        out[i, 2] = x * y
        out[i, 3] = x / y
        out[i, 4] = wp.sqrt(x)

    special = np.array([0.0, -0.0, 1.0, -1.0, np.inf, -np.inf, np.nan, 3e38, 1e-45], np.float32)
    x, y = (grid.ravel() for grid in np.meshgrid(special, special))
    out = wp.zeros((len(x), 5), dtype=float, device=device)
    inputs = [wp.array(z, dtype=float, device=device) for z in (x, y)]
    wp.launch(kernel, len(x), inputs, [out], device=device)
    with np.errstate(all="ignore"):
        expected = np.stack([x + y, x - y, x * y, x / y, np.sqrt(x)], 1)
    result = out.numpy()
    np.testing.assert_array_equal(result, expected)
    ordered = ~np.isnan(expected)
    np.testing.assert_array_equal(np.signbit(result[ordered]), np.signbit(expected[ordered]))
