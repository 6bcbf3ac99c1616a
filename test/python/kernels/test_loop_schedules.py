"""Loops that a GPU runs in tiles or several iterations at a time, and its square roots."""

import numpy as np
import pytest

import warp as wp

INT_MAX = 2**31 - 1


@wp.kernel
def escape(start: wp.array(dtype=int), bound: int, limit: int, out: wp.array2d(dtype=int)):
    i = wp.tid()
    v = start[i]
    k = int(limit) - 10
    if limit < 0:
        k = limit
    while k < limit and v < bound:
        v = v * 3 + 1
        k = k + 1
    out[i, 0] = v
    out[i, 1] = k


@pytest.mark.parametrize("limit", [10, 0, 7, INT_MAX, -INT_MAX - 1, -INT_MAX])
def test_exits_of_a_conditional_loop(limit, device):
    """Values at the exit, for every number of iterations and limits at the end of the range."""
    count, bound = 1000, 5000
    start = np.random.default_rng(1).integers(0, 6000, count).astype(np.int32)
    out = wp.zeros((count, 2), dtype=int, device=device)
    inputs = [wp.array(start, dtype=int, device=device), bound, limit, out]
    wp.launch(escape, count, inputs, device=device)
    v = start.astype(np.int64)
    k = np.full(count, limit if limit < 0 else limit - 10, np.int64)
    while True:
        live = (k < limit) & (v < bound)
        if not live.any():
            break
        v[live] = 3 * v[live] + 1
        k[live] += 1
    np.testing.assert_array_equal(out.numpy(), np.stack([v, k], 1))


@wp.kernel
def pairs(
    x: wp.array(dtype=wp.vec3i),
    y: wp.array2d(dtype=wp.int64),
    begin: int,
    end: int,
    out: wp.array(dtype=wp.int64),
):
    i = wp.tid()
    total = wp.int64(0)
    for j in range(begin, end):
        d = x[j]
        if j != i and (i + j) % 3 != 0:
            total = total * wp.int64(3) + wp.int64(d[0] - 2 * d[1] + d[2] * j)
        total = total + y[1, j - begin]
    out[i] = total


@pytest.mark.parametrize("threads", [1, 31, 32, 33, 300])
@pytest.mark.parametrize("begin, end", [(0, 0), (0, 1), (0, 63), (5, 69), (3, 100), (0, 1000)])
def test_loops_over_what_all_threads_load(threads, begin, end, device):
    """Sums that depend on the order, of wrapped integers: exact for any tile that is right."""
    rng = np.random.default_rng(2)
    x = rng.integers(-1000, 1000, (1000, 3)).astype(np.int32)
    y = rng.integers(-1000, 1000, (2, 1000)).astype(np.int64)
    out = wp.zeros(threads, dtype=wp.int64, device=device)
    arrays = [
        wp.array(x, dtype=wp.vec3i, device=device),
        wp.array(y, dtype=wp.int64, device=device),
    ]
    wp.launch(pairs, threads, [*arrays, begin, end, out], device=device)
    i = np.arange(threads)
    total = np.zeros(threads, np.int64)
    with np.errstate(over="ignore"):
        for j in range(begin, end):
            term = np.int64(int(x[j, 0]) - 2 * int(x[j, 1]) + int(x[j, 2]) * j)
            total = np.where((i != j) & ((i + j) % 3 != 0), total * np.int64(3) + term, total)
            total = total + y[1, j - begin]
    np.testing.assert_array_equal(out.numpy(), total)


@wp.kernel
def roots(x: wp.array(dtype=float), root: wp.array(dtype=float), inverse: wp.array(dtype=float)):
    i = wp.tid()
    root[i] = wp.sqrt(x[i])
    inverse[i] = 1.0 / wp.sqrt(x[i])


def test_square_roots(device):
    """Roots are rounded correctly, reciprocals within 1.5 ulp, of floats of every exponent."""
    rng = np.random.default_rng(3)
    bits = rng.integers(0, 2**32, 2_000_000, dtype=np.uint32)
    edges = np.array([0.0, -0.0, np.inf, -np.inf, np.nan, 1e-45, 1.1754944e-38, 3.4028235e38])
    # Around 1e-30, below which roots on a GPU are computed in another way.
    near = np.arange(0x0DA24200, 0x0DA24300, dtype=np.uint32)
    x = np.concatenate([bits.view(np.float32), edges.astype(np.float32), near.view(np.float32)])
    root, inverse = (wp.zeros(len(x), dtype=float, device=device) for _ in range(2))
    wp.launch(
        roots, len(x), [wp.array(x, dtype=float, device=device), root, inverse], device=device
    )
    with np.errstate(all="ignore"):
        exact = np.sqrt(x)
        reciprocal = 1.0 / np.sqrt(x.astype(float))
        ulp = np.spacing(np.abs(reciprocal).astype(np.float32)).astype(float)
    got = root.numpy()
    np.testing.assert_array_equal(got, exact)
    number = ~np.isnan(exact)
    np.testing.assert_array_equal(np.signbit(got)[number], np.signbit(exact)[number])
    finite = np.isfinite(reciprocal) & (reciprocal != 0)
    error = np.abs(inverse.numpy()[finite] - reciprocal[finite]) / ulp[finite]
    assert error.max() <= 1.5
    np.testing.assert_array_equal(inverse.numpy()[~finite], reciprocal[~finite])
