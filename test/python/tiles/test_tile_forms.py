"""Products, factors and transforms of shapes that GPUs have functions for, against NumPy."""

import numpy as np
import pytest

import warp as wp
from tile_products import check, product, rounded


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


@pytest.mark.parametrize(
    "tile, threads",
    [((32, 32, 32), 256), ((32, 32, 16), 128), ((16, 16, 16), 64), ((16, 16, 32), 256),
     ((24, 24, 24), 64), ((48, 48, 16), 128), ((64, 32, 16), 1024), ((20, 28, 12), 96)],
)  # fmt: skip
@pytest.mark.parametrize("turned", [(False, False), (True, False), (False, True), (True, True)])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float16])
def test_products_of_fewer_threads_than_a_block_has(dtype, turned, tile, threads, device):
    shape = (3 * tile[0] - 1, 2 * tile[1] + 3, 5 * tile[2])
    check(product(dtype, *tile, *turned), dtype, tile, shape, threads, device, turned)
    kernel = product(dtype, *tile, *turned, halves=True)
    check(kernel, dtype, tile, shape, threads, device, turned, scale=0.5)


@pytest.mark.parametrize(
    "tile, threads",
    [((64, 64, 16), 128), ((128, 64, 32), 128), ((32, 32, 8), 64), ((32, 48, 12), 96),
     ((16, 16, 20), 128)],
)  # fmt: skip
@pytest.mark.parametrize("turned", [(False, False), (True, False), (False, True), (True, True)])
def test_products_of_doubles(turned, tile, threads, device):
    m, n, k = tile

    @wp.kernel(module="unique")
    def work(
        a: wp.array2d(dtype=wp.float64),
        b: wp.array2d(dtype=wp.float64),
        c: wp.array2d(dtype=wp.float64),
        total: wp.array2d(dtype=wp.float64),
        steps: int,
    ):
        i, j = wp.tid()
        sums = wp.tile_full(shape=(m, n), value=wp.float64(0.5), dtype=wp.float64)
        for s in range(steps):
            if wp.static(turned[0]):
                x = wp.tile_transpose(wp.tile_load(a, shape=(k, m), offset=(s * k, i * m)))
            else:
                x = wp.tile_load(a, shape=(m, k), offset=(i * m, s * k))
            if wp.static(turned[1]):
                y = wp.tile_transpose(wp.tile_load(b, shape=(n, k), offset=(j * n, s * k)))
            else:
                y = wp.tile_load(b, shape=(k, n), offset=(s * k, j * n))
            wp.tile_matmul(x, y, sums)
        wp.tile_store(c, sums, offset=(i * m, j * n))
        wp.tile_atomic_add(total, sums, offset=(i * m, j * n))
        wp.tile_atomic_add(total, wp.tile_matmul(x, y) * wp.float64(2.0), offset=(i * m, j * n))

    rows, columns, depth = 2 * m - 1, 2 * n + 3, 3 * k
    rng = np.random.default_rng(rows)
    a, b = rng.normal(size=(rows, depth)), rng.normal(size=(depth, columns))
    given = [v.T.copy() if t else v for v, t in zip((a, b), turned, strict=True)]
    arrays = [wp.array(v, dtype=wp.float64, device=device) for v in given]
    c, total = (wp.zeros((rows, columns), dtype=wp.float64, device=device) for _ in range(2))
    wp.launch_tiled(
        work, dim=(2, 3), inputs=[*arrays, c, total, 3], block_dim=threads, device=device
    )
    bound = (np.abs(a) @ np.abs(b) + 0.5) * (depth + 8) * 2.0**-53
    assert np.all(np.abs(c.numpy() - (a @ b + 0.5)) <= bound)
    last = a[:, 2 * k :] @ b[2 * k :]
    assert np.all(np.abs(total.numpy() - (a @ b + 0.5 + 2 * last)) <= 4 * bound)


@pytest.mark.parametrize("threads", [32, 128, 256])
@pytest.mark.parametrize("dtype", [wp.float16, wp.bfloat16])
def test_products_that_are_halves(dtype, threads, device):
    """Sums of floats that are rounded once, of which there are two here: added, a third one."""

    @wp.kernel(module="unique")
    def work(a: wp.array2d(dtype=dtype), b: wp.array2d(dtype=dtype), c: wp.array2d(dtype=dtype)):
        i = wp.tid()
        x = wp.tile_load(a, shape=(32, 64), offset=(i * 32, 0))
        y = wp.tile_load(b, shape=(64, 64))
        s = wp.tile_matmul(x, y)
        wp.tile_matmul(x, y, s)
        wp.tile_store(c, s + wp.tile_matmul(x, y), offset=(i * 32, 0))

    rng = np.random.default_rng(4)
    a, b = (rounded(rng.normal(size=(64, 64)), dtype).astype(float) for _ in range(2))
    arrays = [wp.array(v.astype(np.float32), dtype=dtype, device=device) for v in (a, b)]
    c = wp.zeros((64, 64), dtype=dtype, device=device)
    wp.launch_tiled(work, dim=2, inputs=[*arrays, c], block_dim=threads, device=device)
    unit = 2.0**-11 if dtype is wp.float16 else 2.0**-8
    bound = np.abs(a) @ np.abs(b)
    error = np.abs(c.numpy().astype(float) - 3 * (a @ b))
    assert np.all(error <= 7.1 * unit * np.abs(a @ b) + 3 * 70 * 2.0**-24 * bound)


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
def test_products_that_are_added(dtype, device):
    @wp.kernel(module="unique")
    def work(a: wp.array2d(dtype=dtype), b: wp.array2d(dtype=dtype), c: wp.array2d(dtype=dtype)):
        i, j = wp.tid()
        sums = wp.tile_full(shape=(32, 32), value=dtype(0.5), dtype=dtype)
        for s in range(4):
            x = wp.tile_load(a, shape=(32, 16), offset=(i * 32, s * 16))
            y = wp.tile_load(b, shape=(16, 32), offset=(s * 16, j * 32))
            sums += wp.tile_matmul(x, y)
        wp.tile_store(c, sums, offset=(i * 32, j * 32))

    rng = np.random.default_rng(2)
    a, b = (rng.normal(size=(64, 64)).astype(wp.dtype_to_numpy(dtype)) for _ in range(2))
    c = wp.zeros((64, 64), dtype=dtype, device=device)
    arrays = [wp.array(v, dtype=dtype, device=device) for v in (a, b)]
    wp.launch_tiled(work, dim=(2, 2), inputs=[*arrays, c], block_dim=64, device=device)
    expected = a.astype(float) @ b.astype(float) + 0.5
    bound = np.abs(a).astype(float) @ np.abs(b).astype(float) + 0.5
    assert np.all(np.abs(c.numpy() - expected) <= 72 * 2 * np.finfo(a.dtype).eps * bound)


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
