"""Scattered sums that much is computed for: stretches of threads, ranks, types, order."""

import numpy as np
import pytest

import warp as wp

LENGTHS = [1, 2, 255, 256, 257, 511, 512, 513, 1025, 5000]


@wp.kernel
def pull(x: wp.array(dtype=wp.vec3), pairs: wp.array2d(dtype=int), f: wp.array(dtype=wp.vec3)):
    t = wp.tid()
    i = pairs[t, 0]
    j = pairs[t, 1]
    d = x[i] - x[j]
    length = wp.length(d)
    s = d / length * (length - 1.0) * wp.exp(-length)
    wp.atomic_sub(f, i, s)
    wp.atomic_add(f, j, s)


def pull_in_float64(x, pairs):
    d = x[pairs[:, 0]] - x[pairs[:, 1]]
    length = np.linalg.norm(d, axis=1, keepdims=True)
    s = d / length * (length - 1.0) * np.exp(-length)
    f = np.zeros_like(x)
    np.add.at(f, pairs[:, 0], -s)
    np.add.at(f, pairs[:, 1], s)
    return f


@pytest.mark.parametrize("count", LENGTHS)
def test_stretches(device, count):
    rng = np.random.default_rng(count)
    points = 7
    x = rng.standard_normal((points, 3)).astype(np.float32)
    first = rng.integers(0, points, count)
    pairs = np.stack([first, (first + rng.integers(1, points, count)) % points], 1)
    f = wp.zeros(points, dtype=wp.vec3, device=device)
    arrays = [
        wp.array(x, dtype=wp.vec3, device=device),
        wp.array(pairs, dtype=int, device=device),
        f,
    ]
    wp.launch(pull, count, arrays, device=device)
    expected = pull_in_float64(x.astype(float), pairs)
    np.testing.assert_allclose(f.numpy(), expected, rtol=2e-5, atol=2e-6 * count)


@wp.kernel
def spread(
    at: wp.array2d(dtype=wp.int64),
    x: wp.array2d(dtype=wp.float64),
    low: wp.array(dtype=wp.float64),
    high: wp.array(dtype=wp.float64),
    count: wp.array(dtype=int),
):
    i, j = wp.tid()
    a = x[i, j]
    b = a * a * a - wp.float64(0.5) * a * a + wp.float64(2.0) * a + wp.sin(a) * wp.cos(a)
    c = b * b + a * b + wp.sqrt(b * b + wp.float64(1.0)) * a - b / (wp.float64(1.0) + a * a)
    d = c * b - a * c + wp.float64(3.0) * c * c - a
    k = at[i, j]
    wp.atomic_min(low, k, d)
    wp.atomic_max(high, k, d)
    wp.atomic_add(count, k, int(wp.floor(wp.abs(d))) % 5)


@pytest.mark.parametrize("shape", [(1, 700), (3, 5), (40, 513), (700, 1)])
def test_rows(device, shape):
    rng = np.random.default_rng(shape[0])
    x = rng.uniform(-1.0, 1.0, shape)
    at = rng.integers(-4, 4, shape)
    b = x**3 - 0.5 * x * x + 2.0 * x + np.sin(x) * np.cos(x)
    c = b * b + x * b + np.sqrt(b * b + 1.0) * x - b / (1.0 + x * x)
    d = c * b - x * c + 3.0 * c * c - x
    # Counts do not depend on the last digits.
    x[np.abs(np.abs(d) - np.round(np.abs(d))) < 1e-6] = 0.0
    d[x == 0.0] = 0.0
    low, high, count = np.full(4, np.inf), np.full(4, -np.inf), np.zeros(4, int)
    np.minimum.at(low, at, d)
    np.maximum.at(high, at, d)
    np.add.at(count, at, np.floor(np.abs(d)).astype(int) % 5)
    results = [
        wp.array(np.full(4, np.inf), dtype=wp.float64, device=device),
        wp.array(np.full(4, -np.inf), dtype=wp.float64, device=device),
        wp.zeros(4, dtype=int, device=device),
    ]
    inputs = [
        wp.array(at, dtype=wp.int64, device=device),
        wp.array(x, dtype=wp.float64, device=device),
    ]
    wp.launch(spread, shape, inputs + results, device=device)
    np.testing.assert_allclose(results[0].numpy(), low, rtol=1e-12)
    np.testing.assert_allclose(results[1].numpy(), high, rtol=1e-12)
    np.testing.assert_array_equal(results[2].numpy(), count)


@wp.kernel
def replace(at: wp.array(dtype=int), x: wp.array(dtype=float), last: wp.array(dtype=float)):
    i = wp.tid()
    a = x[i]
    b = a * a + 3.0 * a - a * a * a
    c = b * b - a * b + 2.0 * b
    d = c * b - a * c + b * b * a - 4.0 * c
    wp.atomic_add(last, at[i], d - d + 1.0)
    wp.atomic_add(last, at[i], d * 0.0)


def test_two_updates_of_one_element(device):
    at = np.repeat(np.arange(9), 200).astype(np.int32)
    last = wp.zeros(9, dtype=float, device=device)
    x = wp.array(np.linspace(0.0, 1.0, at.size), dtype=float, device=device)
    wp.launch(replace, at.size, [wp.array(at, device=device), x, last], device=device)
    np.testing.assert_array_equal(last.numpy(), 200.0)


def test_gradients(device):
    rng = np.random.default_rng(3)
    points, count = 50, 1300
    x = rng.standard_normal((points, 3))
    first = rng.integers(0, points, count)
    pairs = np.stack([first, (first + rng.integers(1, points, count)) % points], 1)
    weights = rng.standard_normal((points, 3))
    positions = wp.array(x, dtype=wp.vec3, device=device, requires_grad=True)
    f = wp.zeros_like(positions)
    with wp.Tape() as tape:
        inputs = [positions, wp.array(pairs, dtype=int, device=device), f]
        wp.launch(pull, count, inputs, device=device)
    tape.backward(grads={f: wp.array(weights, dtype=wp.vec3, device=device)})
    direction = rng.standard_normal(x.shape)
    step = 1e-5
    ahead, behind = (pull_in_float64(x + s * direction, pairs) for s in (step, -step))
    expected = np.sum(weights * (ahead - behind)) / (2.0 * step)
    found = np.sum(direction * positions.grad.numpy().astype(float))
    assert abs(found - expected) < 2e-4 * np.linalg.norm(weights) * np.linalg.norm(direction)
