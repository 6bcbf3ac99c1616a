"""Kernels that a GPU runs in squares, patches, jammed loops and shared loops, beside NumPy."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def turn(a: wp.array2d(dtype=int), b: wp.array2d(dtype=int), k: int):
    i, j = wp.tid()
    b[j + k, i] = 3 * a[i, j] + i


@wp.kernel
def turn_back(
    a: wp.array2d(dtype=wp.vec3i), b: wp.array2d(dtype=wp.vec3i), c: wp.array2d(dtype=wp.int64)
):
    i, j = wp.tid()
    v = a[j, i]
    w = b[i, j]
    b[i, j] = v - w
    c[j, i] = wp.int64(v[0]) + c[j, i]


SHAPES = [(96, 96), (97, 130), (128, 32), (300, 101), (1, 500), (500, 1), (33, 31)]


@pytest.mark.parametrize("block", [0, 128, 64, 512])
@pytest.mark.parametrize("shape", SHAPES)
def test_exchanged_indices(shape, block, device):
    rng = np.random.default_rng(1)
    n, m = shape
    a = rng.integers(-1000, 1000, shape).astype(np.int32)
    b = wp.zeros((m + 2, n), dtype=int, device=device)
    inputs = [wp.array(a, dtype=int, device=device), b, 2]
    wp.launch(turn, shape, inputs, device=device, block_dim=block)
    expected = np.zeros((m + 2, n), np.int32)
    expected[2:] = (3 * a + np.arange(n)[:, None]).T
    np.testing.assert_array_equal(b.numpy(), expected)


@pytest.mark.parametrize("shape", SHAPES)
def test_exchanged_loads_and_stores(shape, device):
    rng = np.random.default_rng(2)
    n, m = shape
    a = rng.integers(-1000, 1000, (m, n, 3)).astype(np.int32)
    b = rng.integers(-1000, 1000, (n, m, 3)).astype(np.int32)
    c = rng.integers(-1000, 1000, (m, n))
    arrays = [
        wp.array(a, dtype=wp.vec3i, device=device),
        wp.array(b, dtype=wp.vec3i, device=device),
        wp.array(c, dtype=wp.int64, device=device),
    ]
    wp.launch(turn_back, shape, arrays, device=device)
    np.testing.assert_array_equal(arrays[1].numpy(), a.transpose(1, 0, 2) - b)
    np.testing.assert_array_equal(arrays[2].numpy(), c + a[:, :, 0])


@wp.kernel
def turn_planes(a: wp.array3d(dtype=wp.float64), b: wp.array3d(dtype=wp.float64)):
    p, i, j = wp.tid()
    b[p, j, i] = a[p, i, j] * wp.float64(2.0)


@pytest.mark.parametrize("shape", [(3, 96, 128), (2, 101, 97), (5, 40, 7)])
def test_exchanged_indices_of_planes_and_their_adjoint(shape, device):
    a = np.random.default_rng(3).standard_normal(shape)
    x = wp.array(a, dtype=wp.float64, device=device, requires_grad=True)
    y = wp.zeros((shape[0], shape[2], shape[1]), wp.float64, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(turn_planes, shape, [x, y], device=device)
    np.testing.assert_array_equal(y.numpy(), 2 * a.transpose(0, 2, 1))
    seed = np.random.default_rng(4).standard_normal(y.shape)
    tape.backward(grads={y: wp.array(seed, dtype=wp.float64, device=device)})
    np.testing.assert_array_equal(x.grad.numpy(), 2 * seed.transpose(0, 2, 1))


@wp.kernel
def fold_table(
    table: wp.array(dtype=int), x: wp.array(dtype=int), y: wp.array(dtype=wp.int64), n: int
):
    i = wp.tid()
    own = x[i]
    total = wp.int64(1)
    for j in range(n):
        d = table[j] - own
        if d % 3 != 0:
            total = total * wp.int64(3) + wp.int64(d)
    y[i] = total + wp.int64(own)
    x[i] = -1


@pytest.mark.parametrize("threads", [110_000, 110_001, 131_072])
def test_indices_that_share_a_loop(threads, device):
    """The order of operations shows in wrapped integers; the last thread has one index."""
    x = np.random.default_rng(5).integers(-9, 9, threads + 70).astype(np.int32)
    xs = wp.array(x, dtype=int, device=device)
    y = wp.zeros(threads + 1, dtype=wp.int64, device=device)
    table = wp.array(x, dtype=int, device=device)
    wp.launch(fold_table, threads, [table, xs, y, 67], device=device)
    total = np.ones(threads, np.int64)
    with np.errstate(over="ignore"):
        for j in range(67):
            d = (x[j] - x[:threads]).astype(np.int64)
            total = np.where(np.fmod(d, 3) != 0, total * 3 + d, total)
    np.testing.assert_array_equal(y.numpy(), np.append(total + x[:threads], 0))
    np.testing.assert_array_equal(xs.numpy()[:threads], -1)
    np.testing.assert_array_equal(xs.numpy()[threads:], x[threads:])


@wp.kernel
def add_up(
    x: wp.array(dtype=wp.vec2i),
    y: wp.array(dtype=wp.int64),
    lo: int,
    hi: int,
    z: wp.array(dtype=int),
):
    i = wp.tid()
    own = x[i]
    total = wp.int64(own[1])
    most = int(7)
    for j in range(lo, hi):
        d = x[j] - own
        if d[0] > 0:
            total = total + wp.int64(d[0]) * wp.int64(d[1])
        most = most + d[1]
    y[i] = total
    wp.atomic_add(z, most & 3, most)


@pytest.mark.parametrize("threads", [1, 31, 33, 255, 1000])
@pytest.mark.parametrize("bounds", [(0, 0), (5, 4), (0, 1), (3, 600), (0, 1000), (-3, 0)])
def test_threads_that_share_a_loop(threads, bounds, device):
    """Sums of integers have no order; indices below 0 count from the end."""
    x = np.random.default_rng(6).integers(-500, 500, (1000, 2)).astype(np.int32)
    y = wp.zeros(threads + 1, dtype=wp.int64, device=device)
    z = wp.zeros(4, dtype=int, device=device)
    inputs = [wp.array(x, dtype=wp.vec2i, device=device), y, *bounds, z]
    wp.launch(add_up, threads, inputs, device=device)
    wide = x.astype(np.int64)
    total, most = wide[:threads, 1].copy(), np.full(threads, 7, np.int64)
    for j in range(*bounds):
        d = wide[j] - wide[:threads]
        total += np.where(d[:, 0] > 0, d[:, 0] * d[:, 1], 0)
        most += d[:, 1]
    np.testing.assert_array_equal(y.numpy(), np.append(total, 0))
    expected = np.zeros(4, np.int64)
    np.add.at(expected, most & 3, most)
    np.testing.assert_array_equal(z.numpy(), expected.astype(np.int32))


@wp.kernel
def around(u: wp.array3d(dtype=int), out: wp.array3d(dtype=int)):
    i, j, k = wp.tid()
    inside = i > 0 and j > 0 and k > 0
    if inside and i < u.shape[0] - 1 and j < u.shape[1] - 1 and k < u.shape[2] - 1:
        s = u[i - 1, j, k] + 2 * u[i + 1, j, k] + 3 * u[i, j - 1, k] + 4 * u[i, j + 1, k]
        out[i, j, k] = s + 5 * u[i, j, k - 1] + 6 * u[i, j, k + 1]


@pytest.mark.parametrize("shape", [(130, 130, 130), (65, 181, 183), (64, 3, 11000)])
def test_patches_of_a_stencil(shape, device):
    u = np.random.default_rng(7).integers(-1000, 1000, shape).astype(np.int32)
    out = wp.zeros(shape, dtype=int, device=device)
    wp.launch(around, shape, [wp.array(u, dtype=int, device=device), out], device=device)
    expected = np.zeros(shape, np.int32)
    c = slice(1, -1)
    s = u[:-2, c, c] + 2 * u[2:, c, c] + 3 * u[c, :-2, c] + 4 * u[c, 2:, c]
    expected[c, c, c] = s + 5 * u[c, c, :-2] + 6 * u[c, c, 2:]
    np.testing.assert_array_equal(out.numpy(), expected)
