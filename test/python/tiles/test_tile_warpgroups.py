"""Products of halves by warpgroups, of steps that are loaded together, against NumPy."""

import numpy as np
import pytest

import warp as wp
from tile_products import check, product

HALVES = [wp.float16, wp.bfloat16]


TILES = [
    ((128, 128, 32), 256),
    ((128, 256, 64), 256),
    ((256, 128, 16), 256),
    ((128, 128, 64), 128),
    ((64, 128, 128), 128),
    ((64, 64, 16), 128),
    ((64, 64, 32), 256),
    ((64, 32, 64), 128),
    ((128, 64, 32), 256),
    ((128, 64, 32), 128),
    ((128, 128, 48), 256),
]


@pytest.mark.parametrize("tile, threads", TILES)
@pytest.mark.parametrize("dtype", HALVES)
def test_tiles(dtype, tile, threads, device):
    kernel = product(dtype, *tile, first=0.5)
    shape = (2 * tile[0], 2 * tile[1], 5 * tile[2])
    check(kernel, dtype, tile, shape, threads, device, first=0.5)


@pytest.mark.parametrize("turned", [(False, False), (True, False), (False, True), (True, True)])
@pytest.mark.parametrize("dtype", HALVES)
@pytest.mark.parametrize("tile", [(128, 128, 32), (64, 64, 32)])
def test_transposed_factors(tile, dtype, turned, device):
    kernel = product(dtype, *tile, *turned)
    check(kernel, dtype, tile, (256, 384, 224), 256, device, turned)
    check(kernel, dtype, tile, (192, 200, 72), 256, device, turned)


@pytest.mark.parametrize("shape", [(61, 64, 32), (128, 131, 48), (200, 136, 104), (1, 1, 1)])
def test_edges(shape, device):
    tile = (128, 128, 32)
    kernel = product(wp.float16, *tile)
    check(kernel, wp.float16, tile, shape, 256, device)
    check(kernel, wp.float16, tile, shape, 256, device, start=1)


@pytest.mark.parametrize("steps", [0, 1, 2, 3, 6])
def test_loops_end_before_their_arrays(steps, device):
    """Elements behind the last step of a loop are not added, though loads take several steps."""
    tile = (64, 64, 16)
    kernel = product(wp.float16, *tile, first=2.0)
    check(kernel, wp.float16, tile, (128, 128, 160), 128, device, first=2.0, steps=steps)


def test_adjoint(device):
    """Gradients of a product of halves that a loop adds up: g b^T and a^T g."""
    m, n, k, tile = 128, 256, 96, (128, 128, 32)

    @wp.kernel(module="unique")
    def work(
        a: wp.array2d(dtype=wp.float16), b: wp.array2d(dtype=wp.float16), c: wp.array2d(dtype=float)
    ):
        i, j = wp.tid()
        sums = wp.tile_zeros(shape=(128, 128), dtype=float)
        for s in range(3):
            x = wp.tile_load(a, shape=(128, 32), offset=(i * 128, s * 32))
            y = wp.tile_load(b, shape=(32, 128), offset=(s * 32, j * 128))
            wp.tile_matmul(x, y, sums)
        wp.tile_store(c, sums, offset=(i * 128, j * 128))

    rng = np.random.default_rng(3)
    values = [rng.normal(size=s).astype(np.float16) for s in ((m, k), (k, n))]
    g = rng.normal(size=(m, n)).astype(np.float16).astype(np.float32)
    a, b = (wp.array(v, dtype=wp.float16, device=device, requires_grad=True) for v in values)
    c = wp.zeros((m, n), dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        grid = (m // tile[0], n // tile[1])
        wp.launch_tiled(work, dim=grid, inputs=[a, b], outputs=[c], block_dim=256, device=device)
    tape.backward(grads={c: wp.array(g, dtype=float, device=device)})
    x, y = (v.astype(float) for v in values)
    for array, expected, bound in (
        (a, g @ y.T, np.abs(g) @ np.abs(y).T),
        (b, x.T @ g, np.abs(x).T @ np.abs(g)),
    ):
        # Cotangents and what blocks add are rounded to halves.
        assert np.all(np.abs(array.grad.numpy() - expected) <= 8 * 2.0**-11 * bound)


@pytest.mark.parametrize("padding", [8, 3])
def test_views_of_wider_arrays(padding, device):
    """Rows that are a multiple of 16 bytes apart, but not their own width, and others."""
    kernel = product(wp.float16, 64, 64, 64)
    rng = np.random.default_rng(padding)
    a, b = (rng.normal(size=(128, 128)).astype(np.float16) for _ in range(2))
    wide = [np.pad(v, ((0, 0), (0, padding)), constant_values=np.nan) for v in (a, b)]
    arrays = [wp.array(v, dtype=wp.float16, device=device)[:, :128] for v in wide]
    c = wp.zeros((128, 128), dtype=float, device=device)
    wp.launch_tiled(kernel, dim=(2, 2), inputs=[*arrays, c, 2], block_dim=128, device=device)
    bound = np.abs(a).astype(float) @ np.abs(b).astype(float)
    error = np.abs(c.numpy() - a.astype(float) @ b.astype(float))
    assert np.all(error <= (128 + 8) * 2.0**-24 * bound)


def test_windows_outside_at_both_ends(device):
    """Zero is read before the first element and behind the last one, along both axes."""

    @wp.kernel(module="unique")
    def work(
        a: wp.array2d(dtype=wp.float16), b: wp.array2d(dtype=wp.float16), c: wp.array2d(dtype=float)
    ):
        i, j = wp.tid()
        sums = wp.tile_zeros(shape=(64, 64), dtype=float)
        for s in range(4):
            x = wp.tile_load(a, shape=(64, 32), offset=(i * 64 - 16, s * 32 - 24))
            y = wp.tile_load(b, shape=(32, 64), offset=(s * 32 - 24, j * 64 - 8))
            wp.tile_matmul(x, y, sums)
        wp.tile_store(c, sums, offset=(i * 64, j * 64))

    rng = np.random.default_rng(5)
    a, b = (rng.normal(size=s).astype(np.float16) for s in ((80, 88), (88, 96)))
    arrays = [wp.array(v, dtype=wp.float16, device=device) for v in (a, b)]
    c = wp.zeros((128, 128), dtype=float, device=device)
    wp.launch_tiled(work, dim=(2, 2), inputs=arrays, outputs=[c], block_dim=128, device=device)
    x = np.pad(a.astype(float), ((16, 32), (24, 16)))
    y = np.pad(b.astype(float), ((24, 16), (8, 24)))
    bound = np.abs(x) @ np.abs(y)
    assert np.all(np.abs(c.numpy() - x @ y) <= (128 + 8) * 2.0**-24 * bound)


def test_kernels_that_write_to_a_factor(device):
    """Elements that a block has stored are there when it loads them as a factor."""

    @wp.kernel(module="unique")
    def work(
        a: wp.array2d(dtype=wp.float16), b: wp.array2d(dtype=wp.float16), c: wp.array2d(dtype=float)
    ):
        i = wp.tid()
        t = wp.tile_load(a, shape=(64, 64), offset=(i * 64, 0))
        wp.tile_store(a, t + t, offset=(i * 64, 0))
        sums = wp.tile_zeros(shape=(64, 64), dtype=float)
        for s in range(1):
            x = wp.tile_load(a, shape=(64, 64), offset=(i * 64, s * 64))
            y = wp.tile_load(b, shape=(64, 64), offset=(s * 64, 0))
            wp.tile_matmul(x, y, sums)
        wp.tile_store(c, sums, offset=(i * 64, 0))

    rng = np.random.default_rng(6)
    a, b = (rng.normal(size=s).astype(np.float16) for s in ((256, 64), (64, 64)))
    arrays = [wp.array(v, dtype=wp.float16, device=device) for v in (a, b)]
    c = wp.zeros((256, 64), dtype=float, device=device)
    wp.launch_tiled(work, dim=4, inputs=arrays, outputs=[c], block_dim=128, device=device)
    bound = 2 * np.abs(a).astype(float) @ np.abs(b).astype(float)
    error = np.abs(c.numpy() - 2 * a.astype(float) @ b.astype(float))
    assert np.all(error <= (64 + 8) * 2.0**-24 * bound)


def test_shown_code_is_that_of_launches():
    """Kernels shown for compute capability 9.0 have its instructions of warpgroups."""
    halves = product(wp.float16, 128, 128, 32)
    shown = halves.ir("ptx", arch=90)
    assert ".target sm_90a" in shown
    assert "wgmma.mma_async" in shown and "cp.async.bulk.tensor" in shown
    assert "wgmma" not in halves.ir("ptx", arch=80)
    assert "cp.async.bulk.tensor" in product(wp.float32, 128, 128, 32).ir("ptx", arch=90)
