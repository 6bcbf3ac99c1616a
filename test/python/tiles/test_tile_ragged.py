"""Launches that do not fill their blocks, and whose blocks are not rows: threads in their order."""

import numpy as np
import pytest
from support.block_program import run_launch

import warp as wp


@pytest.fixture(autouse=True)
def cpu_blocks(monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)


def blocks_of(values, threads):
    """Values of threads in the order of the launch, a row per block; zero for those missing."""
    flat = values.ravel()
    return np.pad(flat, (0, -len(flat) % threads)).reshape(-1, threads)


@wp.kernel
def of_one(x: wp.array(dtype=float), out: wp.array(dtype=float), sums: wp.array(dtype=float),
           lows: wp.array(dtype=float)):  # fmt: skip
    i = wp.tid()
    v = x[i]
    block = i // wp.block_dim()
    t = wp.tile(v)
    s = wp.tile_sum(t)
    out[i] = 2.0 * v + s[0]
    wp.tile_store(sums, s, offset=block)
    wp.tile_store(lows, wp.tile_min(t), offset=block)
    wp.atomic_add(sums, sums.shape[0] - 1, v)


@pytest.mark.parametrize("count", [1, 31, 33, 75, 96, 1000])
def test_one_dimension(device, count):
    given = np.random.default_rng(count).uniform(0.5, 1.0, count).astype(np.float32)
    rows = blocks_of(given.astype(float), 32)
    out, sums, lows = (
        wp.zeros(n, dtype=float, device=device) for n in (count, len(rows) + 1, len(rows))
    )
    inputs = [wp.array(given, device=device), out, sums, lows]
    wp.launch(of_one, dim=count, inputs=inputs, block_dim=32, device=device)
    np.testing.assert_allclose(sums.numpy()[:-1], rows.sum(1), rtol=1e-6)
    np.testing.assert_allclose(sums.numpy()[-1], given.astype(float).sum(), rtol=1e-5)
    np.testing.assert_array_equal(lows.numpy(), rows.min(1).astype(np.float32))
    expected = 2 * given + np.repeat(rows.sum(1), 32)[:count]
    np.testing.assert_allclose(out.numpy(), expected, rtol=1e-6)


def kernel_of(rank):
    if rank == 2:

        @wp.kernel(module="unique")
        def numbers(
            x: wp.array2d(dtype=int), seen: wp.array2d(dtype=int), sums: wp.array(dtype=int)
        ):
            i, j = wp.tid()
            block = (i * x.shape[1] + j) // wp.block_dim()
            t = wp.tile(x[i, j])
            seen[i, j] = wp.tile_extract(wp.tile_scan_inclusive(t), wp.block_dim() - 1) + block
            wp.atomic_add(sums, block, x[i, j])

        return numbers

    @wp.kernel(module="unique")
    def numbers(x: wp.array3d(dtype=int), seen: wp.array3d(dtype=int), sums: wp.array(dtype=int)):
        i, j, k = wp.tid()
        block = ((i * x.shape[1] + j) * x.shape[2] + k) // wp.block_dim()
        t = wp.tile(x[i, j, k])
        seen[i, j, k] = wp.tile_extract(wp.tile_scan_inclusive(t), wp.block_dim() - 1) + block
        wp.atomic_add(sums, block, x[i, j, k])

    return numbers


@pytest.mark.parametrize("shape", [(2, 6), (7, 5), (3, 64), (1, 1), (5, 3, 4), (2, 2, 33)])
@pytest.mark.parametrize("threads", [1, 4, 32])
def test_several_dimensions(device, shape, threads):
    given = np.random.default_rng(2).integers(0, 100, shape).astype(np.int32)
    rows = blocks_of(given, threads)
    seen, sums = (wp.zeros(extents, dtype=int, device=device) for extents in (shape, len(rows)))
    inputs = [wp.array(given, device=device), seen, sums]
    wp.launch(kernel_of(len(shape)), dim=shape, inputs=inputs, block_dim=threads, device=device)
    np.testing.assert_array_equal(sums.numpy(), rows.sum(1))
    expected = np.repeat(rows.sum(1) + np.arange(len(rows)), threads)[: given.size]
    np.testing.assert_array_equal(seen.numpy().ravel(), expected)


@pytest.mark.parametrize("shape", [(7, 5), (1, 1), (2, 2, 9)])
@pytest.mark.parametrize("threads", [4, 6])
def test_code_for_a_gpu(shape, threads):
    """By threads in any order, with those that the last block lacks."""
    given = np.random.default_rng(2).integers(0, 100, shape).astype(np.int32)
    rows = blocks_of(given, threads)
    seen, sums = (np.zeros(extents, dtype=np.int32) for extents in (shape, len(rows)))
    run_launch(kernel_of(len(shape)), [given, seen, sums], shape, threads, seed=threads)
    np.testing.assert_array_equal(sums, rows.sum(1))
    expected = np.repeat(rows.sum(1) + np.arange(len(rows)), threads)[: given.size]
    np.testing.assert_array_equal(seen.ravel(), expected)


@wp.kernel
def weighted(x: wp.array2d(dtype=float), y: wp.array(dtype=float)):
    i, j = wp.tid()
    t = wp.tile(x[i, j] * x[i, j])
    s = wp.tile_sum(t)
    wp.atomic_add(y, i, s[0] * x[i, j])


def test_gradients(device):
    shape, threads = (5, 7), 8
    given = np.random.default_rng(8).normal(size=shape).astype(np.float32)
    x = wp.array(given, requires_grad=True, device=device)
    y = wp.zeros(shape[0], dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch(weighted, dim=shape, inputs=[x, y], block_dim=threads, device=device)
    v = given.astype(float)
    sums = np.repeat((blocks_of(v, threads) ** 2).sum(1), threads)[: v.size].reshape(shape)
    np.testing.assert_allclose(y.numpy(), (sums * v).sum(1), rtol=1e-5, atol=1e-5)
    weights = np.arange(1.0, 6.0)
    tape.backward(grads={y: wp.array(weights, dtype=float, device=device)})
    each = weights[:, None] * np.ones(shape)
    of_sums = np.repeat(blocks_of(each * v, threads).sum(1), threads)[: v.size].reshape(shape)
    np.testing.assert_allclose(x.grad.numpy(), each * sums + of_sums * 2 * v, rtol=1e-4, atol=1e-4)
