"""Sums, minima and maxima of all threads of a launch, several of them at a time."""

import numpy as np
import pytest

import warp as wp


@pytest.mark.parametrize("block", [32, 96, 256, 1024])
@pytest.mark.parametrize("count", [1, 2, 3, 5, 15, 16])
def test_numbers_of_sums(device, count, block):
    """`3 * count` sums: from 3 to 48, so that they fill a warp's lanes, or less, or more."""
    vector = wp.types.vector(count, wp.float64)

    @wp.kernel(module="unique")
    def program(x: wp.array(dtype=vector), total: wp.array(dtype=vector)):
        v = x[wp.tid()]
        wp.atomic_add(total, 0, v)
        wp.atomic_sub(total, 1, v)
        wp.atomic_add(total, 2, wp.cw_mul(v, v))

    threads = 3 * block - 7
    x = np.random.default_rng(count).integers(-99, 100, (threads, count)).astype(np.float64)
    total = wp.zeros(3, dtype=vector, device=device)
    given = wp.array(x, dtype=vector, device=device)
    wp.launch(program, threads, [given, total], device=device, block_dim=block)
    # Whole numbers: no order of terms rounds.
    assert total.numpy().tolist() == [
        x.sum(0).tolist(),
        (-x).sum(0).tolist(),
        (x * x).sum(0).tolist(),
    ]


@pytest.mark.parametrize("dtype", [wp.int32, wp.uint32, wp.int64, wp.float32, wp.float64])
def test_kinds_side_by_side(device, dtype):
    """Updates combined in one way go together; the rest has ways of its own."""
    vector = wp.types.vector(3, dtype)

    @wp.kernel(module="unique")
    def program(
        x: wp.array(dtype=vector),
        low: wp.array(dtype=vector),
        high: wp.array(dtype=vector),
        total: wp.array(dtype=vector),
        even: wp.array(dtype=int),
    ):
        i = wp.tid()
        wp.atomic_min(low, 0, x[i])
        wp.atomic_max(high, 0, x[i])
        wp.atomic_add(total, 0, x[i])
        if i % 2 == 0:
            wp.atomic_add(even, 0, 1)

    signed = dtype not in (wp.uint32,)
    x = np.random.default_rng(5).integers(-1000 if signed else 0, 1000, (700, 3))
    given = wp.array(x, dtype=vector, device=device)
    low, high = (wp.full(1, value, dtype=vector, device=device) for value in (500, 400))
    total = wp.zeros(1, dtype=vector, device=device)
    even = wp.zeros(1, dtype=int, device=device)
    wp.launch(program, 700, [given, low, high, total, even], device=device)
    assert low.numpy()[0].tolist() == np.minimum(x.min(0), 500).tolist()
    assert high.numpy()[0].tolist() == np.maximum(x.max(0), 400).tolist()
    assert total.numpy()[0].tolist() == x.sum(0).tolist()
    assert even.numpy()[0] == 350


def test_gradient_of_a_matrix_that_all_threads_use(device):
    """64 sums of a block, made in float64."""
    matrix = wp.types.matrix((8, 8), float)
    vector = wp.types.vector(8, float)

    @wp.kernel(module="unique")
    def program(w: wp.array2d(dtype=float), x: wp.array(dtype=vector), y: wp.array(dtype=vector)):
        i = wp.tid()
        m = matrix()
        for a in range(8):
            for b in range(8):
                m[a, b] = w[a, b]
        y[i] = m * x[i]

    rng = np.random.default_rng(2)
    w, x, seed = rng.normal(size=(8, 8)), rng.normal(size=(1000, 8)), rng.normal(size=(1000, 8))
    weights = wp.array(w, dtype=float, device=device, requires_grad=True)
    given = wp.array(x, dtype=vector, device=device)
    y = wp.zeros(1000, dtype=vector, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(program, 1000, [weights, given, y], device=device)
    tape.backward(grads={y: wp.array(seed, dtype=vector, device=device)})
    wanted = seed.astype(np.float32).astype(np.float64).T @ x.astype(np.float32)
    np.testing.assert_allclose(weights.grad.numpy(), wanted, rtol=1e-5, atol=1e-4)


@wp.kernel
def count_in_loops(x: wp.array(dtype=wp.float64), n: int, c: wp.array(dtype=int)):
    a = x[wp.tid()]
    for k in range(n):
        if a > wp.float64(0.5):
            wp.atomic_add(c, 0, 1)
        if a < wp.float64(0.2):
            wp.atomic_add(c, 1, 1)
        if k % 2 == 0:
            wp.atomic_add(c, 2, 1)
        a = wp.sin(wp.float64(3.0) * a)


@pytest.mark.parametrize("threads", [1, 31, 32, 33, 40, 300])
def test_counts_of_warps_with_idle_threads(threads, device):
    """A sine of 64 bits has a rare path that calls a function, in a loop before the sum."""
    start = np.random.default_rng(threads).uniform(-1, 1, threads)
    x = wp.array(start, dtype=wp.float64, device=device)
    c = wp.zeros(3, dtype=int, device=device)
    wp.launch(count_in_loops, threads, [x, 5, c], device=device)
    wanted, a = np.zeros(3, dtype=int), start
    for k in range(5):
        wanted += [(a > 0.5).sum(), (a < 0.2).sum(), threads * (k % 2 == 0)]
        a = np.sin(3.0 * a)
    assert c.numpy().tolist() == wanted.tolist()
