"""Products of single precision whose factors TMA loads, against NumPy."""

import numpy as np
import pytest

import warp as wp
from tile_products import check, product

TILES = [
    ((128, 128, 32), 256),
    ((128, 64, 64), 256),
    ((64, 64, 32), 128),
    ((64, 64, 32), 256),
    ((32, 64, 96), 64),
    ((32, 32, 32), 32),
]
ORDERS = [(False, False), (True, False), (False, True), (True, True)]


@pytest.mark.parametrize("turned", ORDERS)
@pytest.mark.parametrize("tile, threads", TILES)
def test_tiles(tile, threads, turned, device):
    kernel = product(wp.float32, *tile, *turned, first=0.5)
    shape = (2 * tile[0], 2 * tile[1], 5 * tile[2])
    check(kernel, wp.float32, tile, shape, threads, device, turned, first=0.5)


@pytest.mark.parametrize("turned", ORDERS)
@pytest.mark.parametrize("shape", [(200, 180, 72), (61, 64, 32), (128, 131, 48), (1, 1, 1)])
def test_edges(shape, turned, device):
    tile = (64, 64, 32)
    kernel = product(wp.float32, *tile, *turned)
    check(kernel, wp.float32, tile, shape, 128, device, turned)
    check(kernel, wp.float32, tile, shape, 128, device, turned, start=1)


@pytest.mark.parametrize("steps", [0, 1, 2, 3, 7])
def test_loops_end_before_their_arrays(steps, device):
    tile = (64, 64, 32)
    kernel = product(wp.float32, *tile, first=2.0)
    check(kernel, wp.float32, tile, (128, 128, 256), 128, device, first=2.0, steps=steps)


@pytest.mark.parametrize("depth, steps", [(16, 8), (8, 12), (16, 7), (4, 3)])
def test_steps_that_come_together(depth, steps, device):
    """Where a loop has a known number of steps, several make what is loaded at a time."""

    @wp.kernel(module="unique")
    def work(a: wp.array2d(dtype=float), b: wp.array2d(dtype=float), c: wp.array2d(dtype=float)):
        i, j = wp.tid()
        sums = wp.tile_zeros(shape=(64, 128), dtype=float)
        for s in range(steps):
            x = wp.tile_load(a, shape=(64, depth), offset=(i * 64, s * depth))
            y = wp.tile_load(b, shape=(depth, 128), offset=(s * depth, j * 128))
            wp.tile_matmul(x, y, sums)
        wp.tile_store(c, sums, offset=(i * 64, j * 128))

    rng = np.random.default_rng(depth)
    # More than the loop goes through.
    a, b = (rng.normal(size=s).astype(np.float32) for s in ((128, 160), (160, 256)))
    arrays = [wp.array(v, dtype=float, device=device) for v in (a, b)]
    c = wp.zeros((128, 256), dtype=float, device=device)
    wp.launch_tiled(work, dim=(2, 2), inputs=arrays, outputs=[c], block_dim=128, device=device)
    x, y = a[:, : steps * depth].astype(float), b[: steps * depth].astype(float)
    bound = (160 + 8) * 2.0**-24 * (np.abs(x) @ np.abs(y))
    assert np.all(np.abs(c.numpy() - x @ y) <= bound)


def test_windows_outside_at_both_ends(device):
    """Zero is read before the first element and behind the last one, along both axes."""

    @wp.kernel(module="unique")
    def work(a: wp.array2d(dtype=float), b: wp.array2d(dtype=float), c: wp.array2d(dtype=float)):
        i, j = wp.tid()
        sums = wp.tile_zeros(shape=(64, 64), dtype=float)
        for s in range(4):
            x = wp.tile_load(a, shape=(64, 32), offset=(i * 64 - 16, s * 32 - 24))
            y = wp.tile_load(b, shape=(32, 64), offset=(s * 32 - 24, j * 64 - 8))
            wp.tile_matmul(x, y, sums)
        wp.tile_store(c, sums, offset=(i * 64 - 16, j * 64 - 8))

    rng = np.random.default_rng(5)
    a, b = (rng.normal(size=s).astype(np.float32) for s in ((80, 88), (88, 96)))
    arrays = [wp.array(v, dtype=float, device=device) for v in (a, b)]
    c = wp.zeros((80, 96), dtype=float, device=device)
    wp.launch_tiled(work, dim=(2, 2), inputs=arrays, outputs=[c], block_dim=128, device=device)
    x, y = a.astype(float), b.astype(float)
    bound = np.abs(x) @ np.abs(y)
    assert np.all(np.abs(c.numpy() - x @ y) <= (128 + 8) * 2.0**-24 * bound)


@pytest.mark.parametrize("shape", [(192, 100), (70, 192), (61, 67)])
def test_sums_that_blocks_add(shape, device):
    """Blocks share the depth and add to one result, whole tiles and those at edges."""
    depth, parts = 256, 4

    @wp.kernel(module="unique")
    def work(a: wp.array2d(dtype=float), b: wp.array2d(dtype=float), c: wp.array2d(dtype=float)):
        i, j, part = wp.tid()
        sums = wp.tile_zeros(shape=(64, 64), dtype=float)
        for s in range(2):
            k = (part * 2 + s) * 32
            x = wp.tile_load(a, shape=(64, 32), offset=(i * 64, k))
            y = wp.tile_load(b, shape=(32, 64), offset=(k, j * 64))
            wp.tile_matmul(x, y, sums)
        wp.tile_atomic_add(c, sums, offset=(i * 64, j * 64))

    rng = np.random.default_rng(sum(shape))
    a, b = (rng.normal(size=s).astype(np.float32) for s in ((shape[0], depth), (depth, shape[1])))
    arrays = [wp.array(v, dtype=float, device=device) for v in (a, b)]
    c = wp.ones(shape, dtype=float, device=device)
    grid = (-(-shape[0] // 64), -(-shape[1] // 64), parts)
    wp.launch_tiled(work, dim=grid, inputs=arrays, outputs=[c], block_dim=128, device=device)
    x, y = a.astype(float), b.astype(float)
    bound = np.abs(x) @ np.abs(y) + 1
    assert np.all(np.abs(c.numpy() - x @ y - 1) <= (depth + 8) * 2.0**-24 * bound)
