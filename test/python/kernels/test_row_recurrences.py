"""Loops along rows that carry values through an array, with rows that share sets of the cache."""

import numpy as np
import pytest

import warp as wp

rng = np.random.default_rng(11)


@wp.kernel
def pendulum(
    q: wp.array2d(dtype=float), v: wp.array2d(dtype=float), u: wp.array2d(dtype=float), n: int
):
    e = wp.tid()
    for t in range(n):
        a = u[e, t] - wp.sin(q[e, t]) - 0.1 * v[e, t]
        v[e, t + 1] = v[e, t] + 0.01 * a
        q[e, t + 1] = q[e, t] + 0.01 * v[e, t + 1]


@wp.kernel
def backwards(y: wp.array2d(dtype=float), n: int):
    e = wp.tid()
    for t in range(n - 1, 0, -1):
        y[e, t - 1] = y[e, t - 1] + 0.5 * wp.exp(-y[e, t])


@wp.kernel
def two_apart(y: wp.array2d(dtype=float), n: int):
    e = wp.tid()
    for t in range(2, n):
        y[e, t] = y[e, t] - 0.25 * wp.sin(y[e, t - 2])


@wp.kernel
def from_behind(y: wp.array2d(dtype=float), n: int):
    e = wp.tid()
    for t in range(n - 1):
        y[e, t] = 0.5 * y[e, t + 1] + wp.cos(y[e, t])


def rollout(q, v, u):
    for t in range(u.shape[1]):
        a = u[:, t] - np.sin(q[:, t]) - 0.1 * v[:, t]
        v[:, t + 1] = v[:, t] + 0.01 * a
        q[:, t + 1] = q[:, t] + 0.01 * v[:, t + 1]
    return q, v


def filtered(kind, y):
    n = y.shape[1]
    if kind is backwards:
        for t in range(n - 1, 0, -1):
            y[:, t - 1] += 0.5 * np.exp(-y[:, t])
    elif kind is two_apart:
        for t in range(2, n):
            y[:, t] -= 0.25 * np.sin(y[:, t - 2])
    else:
        for t in range(n - 1):
            y[:, t] = 0.5 * y[:, t + 1] + np.cos(y[:, t])
    return y


# Rows of 2, 4 and 8 KiB, one element more or less, and short ones; worlds that fill no vector.
SHAPES = [(37, 512), (64, 1024), (33, 2048), (40, 511), (17, 1025), (5, 1024), (100, 9)]


@pytest.mark.parametrize("worlds, length", SHAPES)
def test_rollouts(worlds, length, device):
    start = [rng.normal(size=(worlds, n)) for n in (length, length, length - 1)]
    q, v, u = (wp.array(one, dtype=float, device=device) for one in start)
    wp.launch(pendulum, worlds, [q, v, u, length - 1], device=device)
    for found, right in zip((q, v), rollout(*(one.astype(np.float64) for one in start))):
        np.testing.assert_allclose(found.numpy(), right, rtol=2e-4, atol=2e-4)


@pytest.mark.parametrize("worlds, length", SHAPES)
@pytest.mark.parametrize("kind", [backwards, two_apart, from_behind], ids=lambda k: k.key)
def test_filters(kind, worlds, length, device):
    start = rng.normal(size=(worlds, length))
    y = wp.array(start, dtype=float, device=device)
    wp.launch(kind, worlds, [y, length], device=device)
    np.testing.assert_allclose(y.numpy(), filtered(kind, start), rtol=1e-4, atol=1e-4)


def test_far_rows_have_fewer_lanes():
    def lanes_of(length):
        kernel = wp.Kernel(pendulum.func, key="pendulum_of_rows")
        arrays = [wp.zeros((64, length), dtype=float, device="cpu") for _ in range(3)]
        wp.launch(kernel, 64, [*arrays, length - 1], device="cpu")
        (made,) = kernel.schedule("cpu")
        return int(made["lanes"]), str(made)

    near, text = lanes_of(1010)
    far, other = lanes_of(1024)
    assert far <= 8 < near and "rows 2 KiB apart" in other and "2 KiB" not in text


def test_variants_of_near_and_far_rows_agree():
    kernel = wp.Kernel(pendulum.func, key="pendulum_of_both")
    for length in (1010, 1024, 1010, 1024, 513):
        start = [rng.normal(size=(20, n)) for n in (length, length, length - 1)]
        q, v, u = (wp.array(one, dtype=float, device="cpu") for one in start)
        wp.launch(kernel, 20, [q, v, u, length - 1], device="cpu")
        right, _ = rollout(*(one.astype(np.float64) for one in start))
        np.testing.assert_allclose(q.numpy(), right, rtol=2e-4, atol=2e-4)
