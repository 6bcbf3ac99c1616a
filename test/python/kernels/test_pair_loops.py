"""Loops in which every thread adds to element j in iteration j, against NumPy in float64.

A GPU sums up over the lanes of full warps and tiles of 32 iterations, so the sizes here leave
warps and tiles ragged in every way.
"""

import numpy as np
import pytest

import warp as wp

REALS = {np.float32: 2e-5, np.float64: 1e-12}
# Threads, iterations and threads of a block.
SIZES = [
    (1, 1, 256),
    (31, 33, 256),
    (32, 32, 256),
    (33, 31, 64),
    (64, 1000, 32),
    (1000, 64, 96),
    (1000, 1000, 256),
    (257, 95, 128),
]


def attraction(real):
    vec3 = wp.types.vector(3, real)

    @wp.kernel(module="unique")
    def pull(x: wp.array(dtype=vec3), y: wp.array(dtype=vec3), n: int, out: wp.array(dtype=vec3)):
        i = wp.tid()
        xi = x[i]
        sum = vec3()
        for j in range(n):
            r = y[j] - xi
            near = real(1.0) / wp.sqrt(wp.dot(r, r) + real(0.25))
            sum += r * (near * near * near)
        out[i] = sum

    return pull


def pull_gradients(x, y, seeds):
    """Gradients of the attraction, written out."""
    r = y[None] - x[:, None]
    near = 1.0 / np.sqrt((r * r).sum(2) + 0.25)
    along = (r * seeds[:, None]).sum(2)
    pair = seeds[:, None] * near[..., None] ** 3 - 3.0 * (along * near**5)[..., None] * r
    return -pair.sum(1), pair.sum(0)


def launch(kernel, dim, arguments, device, block):
    wp.launch(kernel, dim, arguments, device=device, block_dim=block)


def check_close(got, wanted, tolerance):
    """Agreement within a share of the largest element."""
    np.testing.assert_allclose(got, wanted, rtol=0, atol=tolerance * np.abs(wanted).max())


@pytest.mark.parametrize("real", REALS)
@pytest.mark.parametrize("threads, trips, block", SIZES)
def test_adjoint_of_all_pairs(device, real, threads, trips, block):
    rng = np.random.default_rng(threads + trips)
    values = [rng.normal(size=(n, 3)).astype(real) for n in (threads, trips, threads)]
    scalar = wp.float32 if real is np.float32 else wp.float64
    vec3 = wp.types.vector(3, scalar)
    x, y, out = (wp.array(v, dtype=vec3, device=device, requires_grad=True) for v in values)
    with wp.Tape() as tape:
        launch(attraction(scalar), threads, [x, y, trips, out], device, block)
    tape.backward(grads={out: wp.array(values[2], dtype=vec3, device=device)})
    wanted = pull_gradients(*(v.astype(np.float64) for v in values))
    check_close(x.grad.numpy(), wanted[0], REALS[real])
    check_close(y.grad.numpy(), wanted[1], REALS[real])


@pytest.mark.parametrize("real", REALS)
@pytest.mark.parametrize("threads, trips, block", SIZES)
def test_sums_over_threads(device, real, threads, trips, block):
    scalar = wp.float32 if real is np.float32 else wp.float64

    @wp.kernel(module="unique")
    def spread(
        x: wp.array(dtype=scalar),
        first: int,
        last: int,
        total: wp.array(dtype=scalar),
        most: wp.array(dtype=scalar),
        count: wp.array(dtype=wp.int64),
    ):
        i = wp.tid()
        for j in range(first, last):
            v = x[i] * scalar(j + 1)
            wp.atomic_add(total, last - 1 - j, v)
            wp.atomic_max(most, j, v)
            if v > scalar(0.0):
                wp.atomic_add(count, 2 * j, wp.int64(1) << wp.int64(33))

    rng = np.random.default_rng(threads * trips)
    x = rng.normal(size=threads).astype(real)
    first, last = 7, 7 + trips
    arrays = [
        wp.array(x, dtype=scalar, device=device),
        wp.zeros(trips, dtype=scalar, device=device),
        wp.full(last, -1e30, dtype=scalar, device=device),
        wp.zeros(2 * last, dtype=wp.int64, device=device),
    ]
    launch(spread, threads, [arrays[0], first, last, *arrays[1:]], device, block)
    values = x.astype(np.float64)[:, None] * np.arange(first + 1, last + 1)
    check_close(arrays[1].numpy(), values.sum(0)[::-1], 10 * REALS[real])
    rounded = x[:, None] * np.arange(first + 1, last + 1).astype(real)
    np.testing.assert_array_equal(arrays[2].numpy()[first:], rounded.max(0))
    assert (arrays[2].numpy()[:first] == real(-1e30)).all()
    counts = np.zeros(2 * last, dtype=np.int64)
    counts[2 * first :: 2] = (values > 0).sum(0) << 33
    np.testing.assert_array_equal(arrays[3].numpy(), counts)


def test_updates_behind_the_end_of_an_array(device):
    """An element that no thread updates is not touched: here it is gigabytes away."""

    @wp.kernel(module="unique")
    def inside(n: int, limit: int, count: wp.array(dtype=int), odd: wp.array(dtype=int)):
        for j in range(n):
            if j < limit:
                wp.atomic_add(count, 60000000 * j, 1)
            elif wp.tid() % 2 == 1:
                wp.atomic_add(odd, j - limit, 1)

    count = wp.zeros(1, dtype=int, device=device)
    odd = wp.zeros(34, dtype=int, device=device)
    launch(inside, 64, [35, 1, count, odd], device, 256)
    assert count.numpy() == 64
    assert (odd.numpy() == 32).all()


@pytest.mark.parametrize("threads", [32, 100])
def test_lanes_apart(device, threads):
    """Warps whose lanes come to the loop apart, or not at all, or in an outer loop."""

    @wp.kernel(module="unique")
    def scattered(n: int, rows: int, once: wp.array(dtype=int), table: wp.array2d(dtype=int)):
        i = wp.tid()
        if i % 3 == 0:
            for j in range(n):
                wp.atomic_add(once, j, i)
        for k in range(rows):
            for j in range(n):
                wp.atomic_add(table, k, j, i * k + j)

    n, rows = 100, 5
    once = wp.zeros(n, dtype=int, device=device)
    table = wp.zeros((rows, n), dtype=int, device=device)
    launch(scattered, threads, [n, rows, once, table], device, 64)
    i = np.arange(threads)
    np.testing.assert_array_equal(once.numpy(), i[::3].sum())
    k, j = np.arange(rows)[:, None], np.arange(n)
    np.testing.assert_array_equal(table.numpy(), i.sum() * k + threads * j)


def test_order_of_a_primal_sum(device):
    """A sum of floats in a kernel keeps its order, whatever else the loop updates."""

    @wp.kernel(module="unique")
    def running(x: wp.array(dtype=float), out: wp.array(dtype=float), hits: wp.array(dtype=int)):
        total = float(0.0)
        for j in range(x.shape[0]):
            total += x[j]
            wp.atomic_add(hits, j, 1)
        out[wp.tid()] = total

    x = np.random.default_rng(4).normal(size=500).astype(np.float32)
    out = wp.zeros(96, dtype=float, device=device)
    hits = wp.zeros(500, dtype=int, device=device)
    launch(running, 96, [wp.array(x, device=device), out, hits], device, 256)
    wanted = np.add.accumulate(x, dtype=np.float32)[-1]
    assert (out.numpy() == wanted).all()
    assert (hits.numpy() == 96).all()
