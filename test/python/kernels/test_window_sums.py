"""Adjoints of windows: lanes add to elements that overlap from one update to the next."""

import numpy as np
import pytest

import warp as wp

COUNTS = (1, 15, 16, 17, 40, 200)


def window_kernel(dtype, offsets, lanes, period):
    """A kernel whose adjoint adds to elements at these offsets, modulo the number of elements."""
    offsets = wp.constant(wp.types.vector(len(offsets), wp.int32)(*offsets))
    length = len(offsets)
    period = wp.constant(period)

    @wp.kernel(module="unique", module_options={"cpu_lanes": lanes})
    def window(x: wp.array(dtype=dtype), c: wp.array(dtype=dtype), y: wp.array(dtype=dtype)):
        i = wp.tid()
        a = c[i]
        for j in range(length):
            a = a + a * x[(i + offsets[j]) % period] * dtype(0.25)
        y[i] = a

    return window


def gradients(x, c, seed, offsets, period):
    """Gradients of x and c, in float64."""
    places = (np.arange(len(c))[:, None] + np.array(offsets)) % period
    factors = 1.0 + 0.25 * x[places]
    whole = factors.prod(axis=1)
    grad = np.zeros(len(x))
    for j in range(len(offsets)):
        others = np.delete(factors, j, axis=1).prod(axis=1)
        np.add.at(grad, places[:, j], seed * c * others * 0.25)
    return grad, seed * whole


@pytest.mark.parametrize("lanes", [1, 8, 16])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize(
    "offsets",
    [(0, 1, 2), (4, 2, 0, 1), (0, 1, 1, 3), tuple(range(12)), tuple(range(31, -1, -1)), (0, 7, 14)],
)
def test_overlapping_updates(offsets, dtype, lanes):
    """Shifts in any order, some of them twice, some left out, and at the border."""
    rng = np.random.default_rng(3)
    for count in COUNTS:
        period = count + 3
        kernel = window_kernel(dtype, offsets, lanes, period)
        x, c, seed, before = (rng.normal(size=n) for n in (period, count, count, period))
        given = [wp.array(one, dtype=dtype, device="cpu", requires_grad=True) for one in (x, c)]
        y = wp.zeros(count, dtype=dtype, device="cpu", requires_grad=True)
        y.grad.assign(seed)
        given[0].grad.assign(before)
        wp.launch(
            kernel,
            count,
            [*given, y],
            adj_inputs=[one.grad for one in given] + [y.grad],
            adjoint=True,
            device="cpu",
        )
        wanted = gradients(x, c, seed, offsets, period)
        tolerance = 2e-5 if dtype is wp.float32 else 1e-13
        np.testing.assert_allclose(
            given[0].grad.numpy() - before, wanted[0], rtol=0, atol=tolerance * 8
        )
        np.testing.assert_allclose(given[1].grad.numpy(), wanted[1], rtol=tolerance, atol=tolerance)


@wp.kernel(module="unique", module_options={"cpu_lanes": 16})
def counts(first: wp.array(dtype=int), y: wp.array(dtype=int)):
    i = wp.tid()
    n = y.shape[0]
    j = first[i]
    wp.atomic_add(y, (i + j) % n, 1)
    wp.atomic_add(y, (i + j + 1) % n, 10)
    wp.atomic_add(y, (i + j + 2) % n, 100)
    wp.atomic_add(y, (i + j + 3) % n, 1000)


@pytest.mark.parametrize("ragged", [False, True])
@pytest.mark.parametrize("count", COUNTS)
def test_integers(count, ragged):
    """Places from memory that follow each other, or do not, and wrap around anywhere."""
    rng = np.random.default_rng(1)
    for shift in (0, 5, count - 1):
        first = rng.integers(0, count, count) if ragged else np.full(count, shift)
        y = wp.zeros(count, dtype=int, device="cpu")
        wp.launch(counts, count, [wp.array(first, dtype=int, device="cpu"), y], device="cpu")
        wanted = np.zeros(count, dtype=int)
        for k in range(4):
            np.add.at(wanted, (np.arange(count) + first + k) % count, 10**k)
        np.testing.assert_array_equal(y.numpy(), wanted)
