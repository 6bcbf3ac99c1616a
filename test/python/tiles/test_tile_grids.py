"""Launches of many blocks, along one to three extents of the grid, against NumPy."""

import numpy as np
import pytest

import warp as wp

TILE = 64


def scaled():
    @wp.kernel
    def work(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        t = wp.tile_load(x, shape=TILE, offset=i * TILE)
        wp.tile_store(y, t * 2.0 + t, offset=i * TILE)

    return work


def row_sums(rank):
    @wp.kernel
    def flat(x: wp.array2d(dtype=float), out: wp.array(dtype=float), b: int, c: int):
        i = wp.tid()
        wp.tile_store(out, wp.tile_sum(wp.tile_load(x[i], shape=TILE)), offset=i)

    @wp.kernel
    def square(x: wp.array2d(dtype=float), out: wp.array(dtype=float), b: int, c: int):
        i, j = wp.tid()
        row = i * b + j
        wp.tile_store(out, wp.tile_sum(wp.tile_load(x[row], shape=TILE)), offset=row)

    @wp.kernel
    def cube(x: wp.array2d(dtype=float), out: wp.array(dtype=float), b: int, c: int):
        i, j, k = wp.tid()
        row = (i * b + j) * c + k
        wp.tile_store(out, wp.tile_sum(wp.tile_load(x[row], shape=TILE)), offset=row)

    return (flat, square, cube)[rank - 1]


@pytest.mark.parametrize("threads", [32, 48, 128, 256])
@pytest.mark.parametrize("count", [1, 2, 37, 70000])
def test_rows_of_blocks(count, threads, device):
    values = np.random.default_rng(count).random(count * TILE, dtype=np.float32)
    x = wp.array(values, dtype=float, device=device)
    y = wp.zeros_like(x)
    wp.launch_tiled(
        scaled(), dim=[count], inputs=[x], outputs=[y], block_dim=threads, device=device
    )
    assert np.array_equal(y.numpy(), values * np.float32(2.0) + values)


@pytest.mark.parametrize("threads", [32, 128])
@pytest.mark.parametrize("grid", [(11,), (5, 7), (3, 5, 7)])
def test_grids_of_blocks(grid, threads, device):
    rows = int(np.prod(grid))
    values = np.random.default_rng(rows).random((rows, TILE), dtype=np.float32)
    x = wp.array(values, dtype=float, device=device)
    out = wp.zeros(rows, dtype=float, device=device)
    b, c = (*grid[1:], 1, 1)[:2]
    wp.launch_tiled(
        row_sums(len(grid)), dim=grid, inputs=[x, out, b, c], block_dim=threads, device=device
    )
    assert np.allclose(out.numpy(), values.astype(np.float64).sum(1), rtol=1e-6)
