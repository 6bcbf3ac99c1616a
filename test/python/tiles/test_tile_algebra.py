"""Factors, triangular solves and Fourier transforms of tiles, against NumPy in float64."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def factor(a: wp.array2d(dtype=wp.float64), out: wp.array2d(dtype=wp.float64)):
    wp.tile_store(out, wp.tile_cholesky(wp.tile_load(a, shape=(9, 9))))


@wp.kernel
def factor_upper(a: wp.array2d(dtype=wp.float64), out: wp.array2d(dtype=wp.float64)):
    wp.tile_store(out, wp.tile_cholesky(wp.tile_load(a, shape=(9, 9)), fill_mode="upper"))


@wp.kernel
def solve(
    a: wp.array2d(dtype=wp.float64),
    b: wp.array2d(dtype=wp.float64),
    out: wp.array2d(dtype=wp.float64),
):
    m = wp.tile_load(a, shape=(9, 9))
    l = wp.tile_cholesky(m)
    wp.tile_store(out, wp.tile_cholesky_solve(l, wp.tile_load(b, shape=(9, 4))))


@wp.kernel
def solve_triangles(
    a: wp.array2d(dtype=wp.float64),
    b: wp.array2d(dtype=wp.float64),
    out: wp.array2d(dtype=wp.float64),
):
    m = wp.tile_load(a, shape=(9, 9))
    y = wp.tile_lower_solve(m, wp.tile_load(b, shape=(9, 4)))
    wp.tile_store(out, wp.tile_upper_solve(m, y))


@wp.kernel
def raise_diagonal(
    a: wp.array2d(dtype=wp.float64),
    b: wp.array(dtype=wp.float64),
    out: wp.array2d(dtype=wp.float64),
):
    m = wp.tile_diag_add(wp.tile_load(a, shape=(9, 9)), wp.tile_load(b, shape=9))
    wp.tile_store(out, wp.tile_matmul(m, m))


@wp.kernel
def multiply_onto(
    a: wp.array2d(dtype=wp.float64), out: wp.array2d(dtype=wp.float64), beta: wp.float64
):
    m = wp.tile_load(a, shape=(9, 9))
    sums = wp.tile_load(out, shape=(9, 9))
    wp.tile_matmul(m, m, sums, beta=beta)
    wp.tile_store(out, sums)


# Zero leaves nothing of a tile that has infinities and NaN.
@pytest.mark.parametrize("beta", [0.0, -0.0, -1.5])
def test_factors_of_what_products_are_added_to(device, beta):
    a, before = matrix(), matrix() + 1.0
    if beta == 0.0:
        before[::2], before[1::2] = np.nan, np.inf
    out = wp.array(before, dtype=wp.float64, device=device)
    given = wp.array(a, dtype=wp.float64, device=device)
    wp.launch_tiled(multiply_onto, 1, [given, out, beta], block_dim=64, device=device)
    expected = a @ a if beta == 0.0 else a @ a + beta * before
    np.testing.assert_allclose(out.numpy(), expected, rtol=1e-13)


def matrix():
    rng = np.random.default_rng(3)
    half = rng.uniform(-1.0, 1.0, (9, 9))
    return half @ half.T + 9.0 * np.eye(9)


def triangles(a, b):
    return np.linalg.solve(np.triu(a), np.linalg.solve(np.tril(a), b))


def symmetric(a):
    """The matrix that a factorisation that reads the lower triangle takes."""
    return np.tril(a) + np.tril(a, -1).T


CASES = {
    "factor": (factor, None, lambda a: np.linalg.cholesky(symmetric(a))),
    "factor_upper": (factor_upper, None, lambda a: np.linalg.cholesky(symmetric(a.T)).T),
    "solve": (solve, (9, 4), lambda a, b: np.linalg.solve(symmetric(a), b)),
    "solve_triangles": (solve_triangles, (9, 4), triangles),
    "raise_diagonal": (
        raise_diagonal,
        (9,),
        lambda a, b: (a + np.diag(b)) @ (a + np.diag(b)),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_values_and_gradients(name, device):
    kernel, shape, reference = CASES[name]
    rng = np.random.default_rng(5)
    values = [matrix()] + ([rng.uniform(-1.0, 1.0, shape)] if shape else [])
    expected = reference(*values)
    arrays = [wp.array(v, dtype=wp.float64, device=device, requires_grad=True) for v in values]
    out = wp.zeros(expected.shape, dtype=wp.float64, device=device, requires_grad=True)
    tape = wp.Tape()
    with tape:
        wp.launch_tiled(kernel, dim=1, inputs=[*arrays, out], block_dim=32, device=device)
    np.testing.assert_allclose(out.numpy(), expected, rtol=1e-12, atol=1e-12)
    weights = rng.uniform(-1.0, 1.0, expected.shape)
    tape.backward(grads={out: wp.array(weights, dtype=wp.float64, device=device)})
    directions = [rng.uniform(-1.0, 1.0, v.shape) for v in values]
    step = 1e-6
    ahead = reference(*[x + step * u for x, u in zip(values, directions, strict=True)])
    behind = reference(*[x - step * u for x, u in zip(values, directions, strict=True)])
    slope = (weights * (ahead - behind)).sum() / (2 * step)
    found = sum((a.grad.numpy() * u).sum() for a, u in zip(arrays, directions, strict=True))
    np.testing.assert_allclose(found, slope, rtol=1e-7, atol=1e-7)


def test_not_positive_definite_is_nan(device):
    a = wp.array(-np.eye(9), dtype=wp.float64, device=device)
    out = wp.zeros((9, 9), dtype=wp.float64, device=device)
    wp.launch_tiled(factor, dim=1, inputs=[a, out], block_dim=32, device=device)
    assert np.isnan(out.numpy()[0, 0])


def transform_of(length, inverse):
    @wp.kernel
    def transform(a: wp.array2d(dtype=wp.vec2d), out: wp.array2d(dtype=wp.vec2d)):
        t = wp.tile_load(a, shape=(3, length))
        if wp.static(inverse):
            wp.tile_ifft(t)
        else:
            wp.tile_fft(t)
        wp.tile_store(out, t)

    return transform


@pytest.mark.parametrize("inverse", [False, True])
@pytest.mark.parametrize("length", [1, 2, 8, 12, 64, 97, 100, 128, 256, 512, 1024])
def test_transforms(length, inverse, device):
    rng = np.random.default_rng(length)
    x = rng.uniform(-1.0, 1.0, (3, length, 2))
    a = wp.array(x, dtype=wp.vec2d, device=device, requires_grad=True)
    out = wp.zeros((3, length), dtype=wp.vec2d, device=device, requires_grad=True)
    tape = wp.Tape()
    with tape:
        kernel = transform_of(length, inverse)
        wp.launch_tiled(kernel, dim=1, inputs=[a, out], block_dim=32, device=device)
    z = x[..., 0] + 1j * x[..., 1]
    expected = np.fft.ifft(z) * length if inverse else np.fft.fft(z)
    found = out.numpy()
    np.testing.assert_allclose(found[..., 0] + 1j * found[..., 1], expected, atol=1e-12 * length)
    g = rng.uniform(-1.0, 1.0, x.shape)
    tape.backward(grads={out: wp.array(g, dtype=wp.vec2d, device=device)})
    w = g[..., 0] + 1j * g[..., 1]
    back = np.fft.fft(w) if inverse else np.fft.ifft(w) * length
    found = a.grad.numpy()
    np.testing.assert_allclose(found[..., 0] + 1j * found[..., 1], back, atol=1e-12 * length)


@pytest.mark.parametrize("length", [256, 1024, 2048, 4096, 8192])
def test_long_transforms_of_floats_on_cpus(length):
    @wp.kernel(module="unique")
    def transform(a: wp.array(dtype=wp.vec2), out: wp.array(dtype=wp.vec2)):
        t = wp.tile_load(a, shape=length)
        wp.tile_fft(t)
        wp.tile_store(out, t)

    x = np.random.default_rng(length).normal(size=(length, 2)).astype(np.float32)
    out = wp.zeros(length, dtype=wp.vec2, device="cpu")
    a = wp.array(x, dtype=wp.vec2, device="cpu")
    wp.launch_tiled(transform, dim=1, inputs=[a, out], block_dim=32, device="cpu")
    expected = np.fft.fft(x[:, 0].astype(float) + 1j * x[:, 1])
    found = out.numpy().astype(float)
    error = np.abs(found[:, 0] + 1j * found[:, 1] - expected).max()
    assert error < 4 * np.finfo(np.float32).eps * np.abs(expected).max()
