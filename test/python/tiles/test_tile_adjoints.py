"""Gradients of factors and products of tiles, of shapes that have functions of their own and of
others, against NumPy in float64."""

import numpy as np
import pytest

import warp as wp


def run_backward(kernel, grid, inputs, out, gradient, threads, device):
    """The gradients of inputs, float64 arrays, for that of an output."""
    tape = wp.Tape()
    with tape:
        launch = {"inputs": inputs, "outputs": [out], "block_dim": threads, "device": device}
        wp.launch_tiled(kernel, dim=grid, **launch)
    tape.backward(grads={out: wp.array(gradient, dtype=out.dtype, device=device)})
    return [one.grad.numpy().astype(float) for one in inputs]


def factor_gradient(a, g):
    """The gradient by the lower triangle of a matrix whose factor has the cotangent g."""
    lower = np.linalg.cholesky(a)
    halved = np.tril(lower.T @ np.tril(g))
    halved[np.diag_indices_from(a)] *= 0.5
    inverse = np.linalg.inv(lower)
    both = inverse.T @ halved @ inverse
    gradient = np.tril(both + both.T)
    gradient[np.diag_indices_from(a)] *= 0.5
    return gradient


@pytest.mark.parametrize("threads", [32, 128])
@pytest.mark.parametrize("fill", ["lower", "upper"])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("n", [1, 5, 8, 16, 23, 32, 33, 65, 100])
def test_factors(n, dtype, fill, threads, device):
    @wp.kernel(module="unique")
    def work(a: wp.array3d(dtype=dtype), factor: wp.array3d(dtype=dtype)):
        i = wp.tid()
        f = wp.tile_cholesky(wp.tile_load(a[i], shape=(n, n)), fill_mode=fill)
        wp.tile_store(factor[i], f)

    real = wp.dtype_to_numpy(dtype)
    rng = np.random.default_rng(n)
    half = rng.normal(size=(3, n, n))
    a = (half @ half.transpose(0, 2, 1) / n + np.eye(n)).astype(real)
    # The cotangent of the factor's other triangle has no effect.
    g = rng.normal(size=a.shape).astype(real)
    given = wp.array(a, dtype=dtype, device=device, requires_grad=True)
    out = wp.zeros_like(given, requires_grad=True)
    (found,) = run_backward(work, 3, [given], out, g, threads, device)
    for one, cotangent, gradient in zip(a.astype(float), g.astype(float), found, strict=True):
        if fill == "upper":
            cotangent, gradient = cotangent.T, gradient.T
        expected = factor_gradient(one, cotangent)
        error = np.abs(gradient - expected).max()
        assert error < 50 * np.finfo(real).eps * np.abs(expected).max()


def product(dtype, m, n, k, turned):
    """A block per tile of the result, which goes through the depth."""

    @wp.kernel(module="unique")
    def work(
        a: wp.array2d(dtype=dtype),
        b: wp.array2d(dtype=dtype),
        steps: int,
        c: wp.array2d(dtype=float),
    ):
        i, j = wp.tid()
        sums = wp.tile_zeros(shape=(m, n), dtype=float)
        for s in range(steps):
            x = wp.tile_load(a, shape=(m, k), offset=(i * m, s * k))
            if wp.static(turned):
                y = wp.tile_transpose(wp.tile_load(b, shape=(n, k), offset=(j * n, s * k)))
            else:
                y = wp.tile_load(b, shape=(k, n), offset=(s * k, j * n))
            wp.tile_matmul(x, y, sums)
        wp.tile_store(c, sums, offset=(i * m, j * n))

    return work


def check_product(tile, shape, threads, device, dtype=wp.float32, turned=False):
    m, n, k = shape
    rng = np.random.default_rng(sum(shape))
    kind = wp.dtype_to_numpy(dtype)
    a, b = rng.normal(size=(m, k)).astype(kind), rng.normal(size=(k, n)).astype(kind)
    g = rng.normal(size=(m, n)).astype(np.float32)
    given = [
        wp.array(one, dtype=dtype, device=device, requires_grad=True)
        for one in (a, b.T.copy() if turned else b)
    ]
    out = wp.zeros((m, n), dtype=float, device=device, requires_grad=True)
    grid = (-(-m // tile[0]), -(-n // tile[1]))
    steps = -(-k // tile[2])
    kernel = product(dtype, *tile, turned)
    tape = wp.Tape()
    with tape:
        wp.launch_tiled(
            kernel, dim=grid, inputs=[*given, steps], outputs=[out], block_dim=threads,
            device=device,
        )  # fmt: skip
    # Gradients are added to what is there.
    for one in given:
        one.grad.fill_(2.0)
    tape.backward(grads={out: wp.array(g, dtype=float, device=device)})
    a, b, g = (one.astype(float) for one in (a, b, g))
    found = [one.grad.numpy().astype(float) for one in given]
    expected = [g @ b.T, (a.T @ g).T if turned else a.T @ g]
    bounds = [np.abs(g) @ np.abs(b).T, np.abs(a).T @ np.abs(g)]
    if turned:
        bounds[1] = bounds[1].T
    for one, wanted, bound in zip(found, expected, bounds, strict=True):
        most = (max(shape) + 8) * 2.0**-24 * (bound + 2.0)
        if dtype is wp.float16:
            most += 2.0**-11 * (4 + grid[0] + grid[1]) * (bound + 2.0)
        assert np.all(np.abs(one - wanted - 2.0) <= most)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    "shape", [(192, 128, 96), (64, 512, 32), (512, 64, 48), (64, 64, 512), (128, 192, 16)]
)
def test_products(shape, turned, device):
    """More blocks than steps of the depth, and fewer."""
    check_product((64, 64, 16), shape, 128, device, turned=turned)


@pytest.mark.parametrize("shape", [(61, 64, 32), (70, 130, 20), (130, 70, 200), (1, 1, 1)])
def test_products_across_edges(shape, device):
    check_product((64, 64, 16), shape, 128, device)
    check_product((32, 32, 16), shape, 32, device)


@pytest.mark.parametrize("tile, threads", [((48, 40, 16), 96), ((16, 16, 16), 32), ((7, 5, 3), 64)])
def test_products_of_other_tiles(tile, threads, device):
    check_product(tile, (4 * tile[0], 3 * tile[1], 5 * tile[2]), threads, device)


def test_products_of_halves(device):
    check_product((64, 64, 16), (192, 128, 96), 128, device, dtype=wp.float16)


def test_batches_of_products(device):
    """Weights that all matrices of a batch have in common, in arrays of three dimensions."""

    @wp.kernel(module="unique")
    def work(a: wp.array3d(dtype=float), b: wp.array2d(dtype=float), c: wp.array3d(dtype=float)):
        q, i, j = wp.tid()
        sums = wp.tile_zeros(shape=(16, 16), dtype=float)
        for s in range(3):
            x = wp.tile_load(a[q], shape=(16, 16), offset=(i * 16, s * 16))
            y = wp.tile_load(b, shape=(16, 16), offset=(s * 16, j * 16))
            wp.tile_matmul(x, y, sums)
        wp.tile_store(c[q], sums, offset=(i * 16, j * 16))

    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(5, 32, 48)), rng.normal(size=(48, 64))
    g = rng.normal(size=(5, 32, 64)).astype(np.float32)
    arrays = [wp.array(v, dtype=float, device=device, requires_grad=True) for v in (a, b)]
    out = wp.zeros(g.shape, dtype=float, device=device, requires_grad=True)
    found = run_backward(work, (5, 2, 4), arrays, out, g, 32, device)
    assert np.allclose(found[0], g @ b.T, atol=1e-4)
    assert np.allclose(found[1], np.einsum("qik,qij->kj", a, g), atol=1e-4)


def test_repeated_backward_of_products(device):
    """Cotangents are taken once: a second pass adds nothing."""
    kernel = product(wp.float32, 32, 32, 16, False)
    rng = np.random.default_rng(2)
    a, b = (
        wp.array(rng.normal(size=(64, 64)), dtype=float, device=device, requires_grad=True)
        for _ in range(2)
    )
    out = wp.zeros((64, 64), dtype=float, device=device, requires_grad=True)
    launch = {"inputs": [a, b, 4], "outputs": [out], "block_dim": 64, "device": device}
    out.grad.fill_(1.0)
    for _ in range(2):
        wp.launch_tiled(
            kernel, dim=(2, 2), adj_inputs=[a.grad, b.grad, 0], adj_outputs=[out.grad],
            adjoint=True, **launch,
        )  # fmt: skip
    assert np.allclose(a.grad.numpy(), np.ones((64, 64)) @ b.numpy().T, atol=1e-4)
    assert not out.grad.numpy().any()


@pytest.mark.parametrize("columns", [96, 100, 1024])
def test_rows_that_blocks_own(columns, device):
    """Plain sums where each block has its own elements, also where a tile crosses the edge."""

    @wp.kernel(module="unique")
    def work(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
        i = wp.tid()
        t = wp.tile_load(x, shape=(2, columns), offset=(2 * i, 0))
        largest = wp.tile_broadcast(wp.tile_max(t), shape=(2, columns))
        wp.tile_store(y, t * t + largest, offset=(2 * i, 0))

    rng = np.random.default_rng(columns)
    values = rng.normal(size=(7, columns)).astype(np.float32)
    g = rng.normal(size=values.shape).astype(np.float32)
    x = wp.array(values, dtype=float, device=device, requires_grad=True)
    y = wp.zeros_like(x, requires_grad=True)
    (found,) = run_backward(work, 4, [x], y, g, 64, device)
    expected = 2.0 * values * g
    for first in range(0, 7, 2):
        pair, part = values[first : first + 2], g[first : first + 2]
        if len(pair) < 2:  # The rest of the tile is zero, and none is larger.
            assert pair.max() > 0
        place = np.unravel_index(pair.argmax(), pair.shape)
        expected[first + place[0], place[1]] += part.astype(float).sum()
    assert np.allclose(found, expected, atol=1e-4)
