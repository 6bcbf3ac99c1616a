"""Products, factors and transforms of shapes that GPUs have functions for, against NumPy."""

import numpy as np
import pytest

import warp as wp
from tile_products import check, product


@pytest.mark.parametrize("turned", [(False, False), (True, False), (False, True), (True, True)])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float16])
def test_products_of_loops(dtype, turned, device):
    kernel = product(dtype, 64, 64, 16, *turned)
    check(kernel, dtype, (64, 64, 16), (192, 128, 96), 128, device, turned)


@pytest.mark.parametrize("shape", [(61, 64, 32), (64, 67, 48), (70, 130, 20), (1, 1, 1)])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float16])
def test_products_across_edges(dtype, shape, device):
    check(product(dtype, 64, 64, 16), dtype, (64, 64, 16), shape, 128, device)
    check(product(dtype, 32, 32, 16), dtype, (32, 32, 16), shape, 32, device, start=1)


@pytest.mark.parametrize(
    "tile, threads",
    [((128, 128, 32), 256), ((128, 64, 16), 256), ((64, 64, 32), 256), ((32, 32, 16), 64),
     ((16, 16, 16), 32), ((48, 40, 16), 96), ((64, 128, 16), 64)],
)  # fmt: skip
@pytest.mark.parametrize("dtype", [wp.float32, wp.float16])
def test_tiles_of_products(dtype, tile, threads, device):
    kernel = product(dtype, *tile, halves=True)
    shape = (4 * tile[0], 3 * tile[1], 5 * tile[2])
    check(kernel, dtype, tile, shape, threads, device, scale=0.5)


@pytest.mark.parametrize("threads", [32, 64, 128])
@pytest.mark.parametrize("fill", ["lower", "upper"])
@pytest.mark.parametrize("n", [1, 5, 8, 16, 23, 32, 33, 48, 64, 100])
def test_factors_and_solutions(n, fill, threads, device):
    @wp.kernel(module="unique")
    def work(
        a: wp.array3d(dtype=float),
        b: wp.array3d(dtype=float),
        factor: wp.array3d(dtype=float),
        x: wp.array3d(dtype=float),
    ):
        i = wp.tid()
        f = wp.tile_cholesky(wp.tile_load(a[i], shape=(n, n)), fill_mode=fill)
        wp.tile_store(factor[i], f)
        y = wp.tile_load(b[i], shape=(n, 3))
        wp.tile_store(x[i], wp.tile_cholesky_solve(f, y, fill_mode=fill))

    rng = np.random.default_rng(n)
    g = rng.normal(size=(3, n, n))
    a = (g @ g.transpose(0, 2, 1) / n + np.eye(n)).astype(np.float32)
    b = rng.normal(size=(3, n, 3)).astype(np.float32)
    da, db = (wp.array(v, dtype=float, device=device) for v in (a, b))
    factor, x = wp.zeros_like(da), wp.zeros_like(db)
    inputs = [da, db, factor, x]
    wp.launch_tiled(work, dim=[3], inputs=inputs, block_dim=threads, device=device)
    lower = np.linalg.cholesky(a.astype(float))
    expected = lower if fill == "lower" else lower.transpose(0, 2, 1)
    assert np.allclose(factor.numpy(), expected, rtol=0, atol=4e-6)
    solution = np.linalg.solve(a.astype(float), b.astype(float))
    assert np.allclose(x.numpy(), solution, rtol=0, atol=1e-4)


def test_factor_of_what_is_not_positive(device):
    @wp.kernel(module="unique")
    def work(a: wp.array2d(dtype=float), factor: wp.array2d(dtype=float)):
        wp.tile_store(factor, wp.tile_cholesky(wp.tile_load(a, shape=(4, 4))))

    a = wp.array(np.diag([4.0, 1.0, -1.0, 1.0]), dtype=float, device=device)
    factor = wp.zeros_like(a)
    wp.launch_tiled(work, dim=[1], inputs=[a, factor], block_dim=32, device=device)
    assert np.isnan(factor.numpy()[2, 2]) and factor.numpy()[0, 0] == 2


@pytest.mark.parametrize("threads", [32, 64, 128])
@pytest.mark.parametrize(
    "rows, n", [(1, 4), (5, 8), (3, 16), (1, 64), (2, 128), (1, 256), (1, 1024)]
)
def test_transforms(rows, n, threads, device):
    @wp.kernel(module="unique")
    def work(
        x: wp.array2d(dtype=wp.vec2), y: wp.array2d(dtype=wp.vec2), z: wp.array2d(dtype=wp.vec2)
    ):
        t = wp.tile_load(x, shape=(rows, n))
        wp.tile_fft(t)
        wp.tile_store(y, t)
        wp.tile_ifft(t)
        wp.tile_store(z, t)

    values = np.random.default_rng(n).normal(size=(rows, n, 2)).astype(np.float32)
    x = wp.array(values, dtype=wp.vec2, device=device)
    y, z = wp.zeros_like(x), wp.zeros_like(x)
    wp.launch_tiled(work, dim=[1], inputs=[x, y, z], block_dim=threads, device=device)
    got = y.numpy()[..., 0] + 1j * y.numpy()[..., 1]
    expected = np.fft.fft(values[..., 0].astype(float) + 1j * values[..., 1])
    assert np.abs(got - expected).max() <= 1e-6 * np.abs(expected).max()
    assert np.abs(z.numpy() / n - values).max() <= 2e-6 * np.abs(values).max()
