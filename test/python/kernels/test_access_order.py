"""Invariants of vector code: order of accesses, wrapped indices."""

import numpy as np
import pytest

import warp as wp

COUNT = 100


@wp.kernel
def between_components(
    x: wp.array(dtype=wp.vec2), y: wp.array(dtype=wp.vec2), out: wp.array(dtype=float)
):
    i = wp.tid()
    a = x[i][0]
    y[i][1] = 7.0
    b = x[i][1]
    out[i] = a + b


@wp.kernel
def between_neighbours(
    x: wp.array(dtype=float), y: wp.array(dtype=float), out: wp.array(dtype=float)
):
    i = wp.tid()
    a = x[2 * i]
    y[2 * i + 1] = 7.0
    b = x[2 * i + 1]
    out[i] = a + b


@wp.kernel
def hashed(values: wp.array(dtype=int), out: wp.array(dtype=int)):
    i = wp.tid()
    out[i] = values[(i * 73856093) % values.shape[0]]


@wp.kernel
def flattened(values: wp.array(dtype=int), width: int, out: wp.array(dtype=int)):
    i, j = wp.tid()
    out[i * wp.abs(width) + j] = values[i * width + j]


@pytest.mark.parametrize(
    "kernel, dtype, length",
    [(between_components, wp.vec2, COUNT), (between_neighbours, float, 2 * COUNT)],
)
def test_same_array_twice(kernel, dtype, length, device):
    """A write through one argument is seen by a later read through the other."""
    x = wp.zeros(length, dtype=dtype, device=device)
    out = wp.zeros(COUNT, dtype=float, device=device)
    wp.launch(kernel, dim=COUNT, inputs=[x, x, out], device=device)
    np.testing.assert_array_equal(out.numpy(), np.full(COUNT, 7.0))


def test_negative_remainders(device):
    """A product that overflows leaves negative remainders, which count from the end."""
    count, size = 100_000, 1000
    values = wp.array(np.arange(size), dtype=int, device=device)
    out = wp.zeros(count, dtype=int, device=device)
    wp.launch(hashed, dim=count, inputs=[values, out], device=device)
    products = (np.arange(count, dtype=np.int64) * 73856093).astype(np.int32)
    np.testing.assert_array_equal(out.numpy(), np.fmod(products, size) % size)


@pytest.mark.parametrize("width", [40, -40])
def test_sign_of_an_index_argument(width, device):
    """The same kernel takes strides of either sign."""
    rows, columns = 30, 40
    values = wp.array(np.arange(rows * columns), dtype=int, device=device)
    out = wp.zeros(rows * columns, dtype=int, device=device)
    wp.launch(flattened, dim=(rows, columns), inputs=[values, width, out], device=device)
    i, j = np.indices((rows, columns))
    expected = (i * width + j) % (rows * columns)
    np.testing.assert_array_equal(out.numpy().reshape(rows, columns), expected)


def test_updates_of_neighbours_meet_in_one_vector(device):
    """x[i-1], x[i], x[i+1] from every thread, and the wrapped -1 of a launch beyond the array."""

    @wp.kernel(module="unique")
    def spread(x: wp.array(dtype=float)):
        i = wp.tid()
        if i > 0 and i < x.shape[0] - 1:
            wp.atomic_add(x, i - 1, 1.0)
            wp.atomic_add(x, i, 2.0)
            wp.atomic_add(x, i + 1, 3.0)

    @wp.kernel(module="unique")
    def wrapped(x: wp.array(dtype=float)):
        i = wp.tid()
        wp.atomic_add(x, i - 1, 1.0)

    for n in (3, 17, 1000):
        x = wp.zeros(n, dtype=float, device=device)
        wp.launch(spread, n, [x], device=device)
        expected = np.zeros(n)
        for part, value in ((slice(0, n - 2), 1), (slice(1, n - 1), 2), (slice(2, n), 3)):
            expected[part] += value
        np.testing.assert_array_equal(x.numpy(), expected)
    x = wp.zeros(9, dtype=float, device=device)
    wp.launch(wrapped, 10, [x], device=device)
    np.testing.assert_array_equal(x.numpy(), [1] * 8 + [2])


def test_a_gradient_that_is_cleared_between_loads(device):
    """Loads move over the store only where the arrays are different ones."""

    @wp.kernel(module="unique")
    def clear(x: wp.array(dtype=float), y: wp.array(dtype=float), out: wp.array(dtype=float)):
        i = wp.tid()
        a = y[i]
        y[i] = 0.0
        out[i] = wp.cos(a) + x[i]

    data = np.linspace(-3.0, 3.0, COUNT, dtype=np.float32)
    for shared in (False, True, False):
        y = wp.array(data, dtype=float, device=device)
        x = y if shared else wp.array(data, dtype=float, device=device)
        out = wp.zeros(COUNT, dtype=float, device=device)
        wp.launch(clear, dim=COUNT, inputs=[x, y, out], device=device)
        expected = np.cos(data.astype(float)) + (0.0 if shared else data)
        np.testing.assert_allclose(out.numpy(), expected, rtol=0, atol=1e-6)
        np.testing.assert_array_equal(y.numpy(), np.zeros(COUNT))
