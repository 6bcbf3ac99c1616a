"""Loops along rows of threads, which GPUs stage through shared memory, against NumPy."""

import numpy as np
import pytest

import warp as wp

rng = np.random.default_rng(11)
# Warps with a lane missing, less than a tile, tiles and a rest.
SIZES = [(1, 1), (31, 70), (64, 16), (300, 3), (70, 133)]


@wp.kernel
def norms(x: wp.array2d(dtype=wp.float64), n: int, y: wp.array(dtype=wp.float64)):
    i = wp.tid()
    s = wp.float64(0.0)
    for k in range(n):
        s += x[i, k] * x[i, k]
    y[i] = wp.sqrt(s)


@pytest.mark.parametrize(("rows", "n"), SIZES)
def test_norms_of_rows(rows, n, device):
    start, weight = rng.normal(size=(rows, n)), rng.normal(size=rows)
    before = rng.normal(size=(rows, n))
    x = wp.array(start, dtype=wp.float64, device=device, requires_grad=True)
    y = wp.zeros(rows, dtype=wp.float64, device=device, requires_grad=True)
    wp.launch(norms, rows, [x, n, y], device=device)
    expected = np.linalg.norm(start, axis=1)
    np.testing.assert_allclose(y.numpy(), expected, rtol=1e-13)
    x.grad.assign(before)
    y.grad.assign(weight)
    wp.launch(
        norms, rows, [x, n, y], adj_inputs=[x.grad, None, y.grad], adjoint=True, device=device
    )
    slopes = before + (weight / expected)[:, None] * start
    np.testing.assert_allclose(x.grad.numpy(), slopes, rtol=1e-12, atol=1e-14)


@wp.kernel
def rollout(u: wp.array2d(dtype=float), n: int, q: wp.array2d(dtype=float)):
    w = wp.tid()
    for t in range(n):
        q[w, t + 1] = q[w, t] + 0.05 * (u[w, t] - wp.sin(q[w, t]))


@pytest.mark.parametrize(("rows", "n"), SIZES)
def test_recurrences_along_rows(rows, n, device):
    u, seed = rng.normal(size=(rows, n)), rng.normal(size=(rows, n + 1))
    moved = np.zeros((rows, n + 1))
    moved[:, 0] = rng.normal(size=rows)
    inputs = wp.array(u, dtype=float, device=device, requires_grad=True)
    q = wp.array(moved, dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(rollout, rows, [inputs, n, q], device=device)
    for t in range(n):
        moved[:, t + 1] = moved[:, t] + 0.05 * (u[:, t] - np.sin(moved[:, t]))
    np.testing.assert_allclose(q.numpy(), moved, rtol=2e-5, atol=2e-5)
    tape.backward(grads={q: wp.array(seed, dtype=float, device=device)})
    slopes, left = np.zeros((rows, n)), seed.copy()
    for t in range(n - 1, -1, -1):
        slopes[:, t] = 0.05 * left[:, t + 1]
        left[:, t] += left[:, t + 1] * (1.0 - 0.05 * np.cos(moved[:, t]))
    np.testing.assert_allclose(inputs.grad.numpy(), slopes, rtol=2e-4, atol=2e-5)


@wp.kernel
def backwards(x: wp.array(dtype=wp.int64), n: int, total: wp.array(dtype=wp.int64)):
    """Suffix sums in place, of rows behind each other; the first one's sum goes elsewhere."""
    i = wp.tid()
    for k in range(1, n):
        at = i * n + n - 1 - k
        x[at] = x[at] + x[at + 1]
    wp.atomic_add(total, 0, x[i * n])


@pytest.mark.parametrize(("rows", "n"), SIZES)
def test_suffix_sums_in_place(rows, n, device):
    start = rng.integers(-1000, 1000, (rows, n))
    x = wp.array(start.ravel(), dtype=wp.int64, device=device)
    total = wp.zeros(1, dtype=wp.int64, device=device)
    wp.launch(backwards, rows, [x, n, total], device=device)
    expected = start[:, ::-1].cumsum(axis=1)[:, ::-1]
    np.testing.assert_array_equal(x.numpy(), expected.ravel())
    assert total.numpy()[0] == start.sum()


@wp.kernel
def by_planes(x: wp.array3d(dtype=float), n: int, y: wp.array2d(dtype=float)):
    i, j = wp.tid()
    for k in range(n):
        y[i, j] += x[i, j, k] * float(k + 1)


@pytest.mark.parametrize("inner", [5, 32, 70])
def test_warps_over_several_rows_of_a_launch(inner, device):
    start = rng.integers(-9, 9, (7, inner, 45)).astype(np.float32)
    y = wp.zeros((7, inner), dtype=float, device=device)
    x = wp.array(start, dtype=float, device=device)
    wp.launch(by_planes, (7, inner), [x, 45, y], device=device)
    np.testing.assert_array_equal(y.numpy(), start @ np.arange(1, 46, dtype=np.float32))


@wp.kernel
def each_other(x: wp.array2d(dtype=float), n: int, z: wp.array2d(dtype=float)):
    i = wp.tid()
    for k in range(n):
        z[i, k] = 2.0 * x[i, k]


def test_arrays_that_overlap(device):
    """A thread reads from the third column on what it has written to it before."""
    memory = wp.array(np.ones((40, 80)), dtype=float, device=device)
    wp.launch(each_other, 40, [memory[:, :70], 70, memory[:, 2:72]], device=device)
    expected = np.ones((40, 80))
    for k in range(70):
        expected[:, k + 2] = 2.0 * expected[:, k]
    np.testing.assert_allclose(memory.numpy(), expected.astype(np.float32), rtol=0)
