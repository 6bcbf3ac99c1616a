"""Products and factors of tiles of any shape, against NumPy in float64."""

import numpy as np
import pytest

import warp as wp


def product_of(rows, depth, columns, dtype, transposed):
    @wp.kernel
    def multiply(
        a: wp.array2d(dtype=dtype), b: wp.array2d(dtype=dtype), c: wp.array2d(dtype=dtype)
    ):
        x = wp.tile_load(a, shape=wp.static((depth, rows) if transposed else (rows, depth)))
        y = wp.tile_load(b, shape=wp.static((columns, depth) if transposed else (depth, columns)))
        if wp.static(transposed):
            wp.tile_store(c, wp.tile_matmul(wp.tile_transpose(x), wp.tile_transpose(y)))
        else:
            wp.tile_store(c, wp.tile_matmul(x, y))

    return multiply


PRODUCTS = [(np.float32, shape) for shape in ((1, 1, 1), (8, 5, 32), (13, 1, 16), (3, 64, 65))] + [
    (dtype, (9, 33, 47)) for dtype in (np.float16, np.float32, np.float64)
]


@pytest.mark.parametrize("transposed", [False, True])
@pytest.mark.parametrize(("dtype", "shape"), PRODUCTS)
def test_products_of_any_shape(shape, dtype, transposed, device):
    rows, depth, columns = shape
    rng = np.random.default_rng(rows)
    x, y = rng.normal(size=(rows, depth)), rng.normal(size=(depth, columns))
    x, y = x.astype(dtype), y.astype(dtype)
    given = [np.ascontiguousarray(one.T) if transposed else one for one in (x, y)]
    a, b = (wp.array(one, device=device) for one in given)
    c = wp.zeros((rows, columns), dtype=a.dtype, device=device)
    kernel = product_of(rows, depth, columns, a.dtype, transposed)
    wp.launch_tiled(kernel, dim=1, inputs=[a, b, c], block_dim=32, device=device)
    x, y = x.astype(np.float64), y.astype(np.float64)
    # A sum of products is wrong by its length times what each is, and rounded once.
    eps = np.finfo(dtype).eps
    sums = (depth + 2) * min(eps, np.finfo(np.float32).eps)
    bound = sums * (np.abs(x) @ np.abs(y)) + eps * np.abs(x @ y)
    assert (np.abs(c.numpy() - x @ y) <= bound).all()


def large(n, upper):
    @wp.kernel
    def work(
        a: wp.array2d(dtype=wp.float64),
        b: wp.array(dtype=wp.float64),
        f: wp.array2d(dtype=wp.float64),
        x: wp.array(dtype=wp.float64),
    ):
        l = wp.tile_cholesky(
            wp.tile_load(a, shape=(n, n)), fill_mode=wp.static("upper" if upper else "lower")
        )
        wp.tile_store(f, l)
        v = wp.tile_load(b, shape=n)
        mode = wp.static("upper" if upper else "lower")
        wp.tile_store(x, wp.tile_cholesky_solve(l, v, fill_mode=mode))

    return work


@pytest.mark.parametrize("upper", [False, True])
@pytest.mark.parametrize("n", [1, 19, 45])
def test_factors_of_any_size(n, upper, device):
    rng = np.random.default_rng(n)
    half = rng.normal(size=(n, n))
    m = half @ half.T + n * np.eye(n)
    b = rng.normal(size=n)
    # The values of the other triangle do not count.
    given = np.triu(m) if upper else np.tril(m)
    arrays = [wp.array(one, dtype=wp.float64, device=device) for one in (given, b)]
    f = wp.zeros((n, n), dtype=wp.float64, device=device)
    x = wp.zeros(n, dtype=wp.float64, device=device)
    wp.launch_tiled(large(n, upper), dim=1, inputs=[*arrays, f, x], block_dim=32, device=device)
    expected = np.linalg.cholesky(m)
    np.testing.assert_allclose(f.numpy(), expected.T if upper else expected, atol=1e-12 * n)
    np.testing.assert_allclose(x.numpy(), np.linalg.solve(m, b), rtol=1e-11, atol=1e-12)
