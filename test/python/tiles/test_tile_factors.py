"""Cholesky factors and solves of sizes around those of vectors, against NumPy in float64."""

import numpy as np
import pytest

import warp as wp


def system_of(n, dtype, mode):
    @wp.kernel(module="unique")
    def system(
        a: wp.array2d(dtype=dtype),
        b: wp.array2d(dtype=dtype),
        factor: wp.array2d(dtype=dtype),
        x: wp.array2d(dtype=dtype),
        first: wp.array(dtype=dtype),
    ):
        m = wp.tile_load(a, shape=(n, n))
        v = wp.tile_load(b, shape=(n, 3))
        f = wp.tile_cholesky(m, fill_mode=mode)
        wp.tile_store(factor, f)
        wp.tile_store(x, wp.tile_cholesky_solve(f, v, fill_mode=mode))
        side = wp.tile_reshape(wp.tile_view(v, offset=(0, 0), shape=(n, 1)), shape=(n,))
        wp.tile_store(first, wp.tile_cholesky_solve(f, side, fill_mode=mode))

    return system


@pytest.mark.parametrize("mode", ["lower", "upper"])
@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("n", [1, 7, 8, 9, 16, 17, 33, 65])
def test_factors_and_solutions(n, dtype, mode):
    real = wp.dtype_to_numpy(dtype)
    rng = np.random.default_rng(n)
    g = rng.normal(size=(n, n))
    a = (g @ g.T / n + np.eye(n)).astype(real)
    b = rng.normal(size=(n, 3)).astype(real)
    # The other triangle is not read.
    given = a.copy()
    given[np.triu_indices(n, 1) if mode == "lower" else np.tril_indices(n, -1)] = np.nan
    factor, x = np.zeros((n, n), real), np.zeros((n, 3), real)
    outputs = [wp.array(one, dtype=dtype, device="cpu") for one in (factor, x, x[:, 0])]
    inputs = [wp.array(one, dtype=dtype, device="cpu") for one in (given, b)]
    wp.launch_tiled(system_of(n, dtype, mode), dim=1, inputs=inputs + outputs, device="cpu")
    lower = np.linalg.cholesky(a.astype(float))
    solved = np.linalg.solve(a.astype(float), b.astype(float))
    expected = [lower if mode == "lower" else lower.T, solved, solved[:, 0]]
    for found, wanted in zip(outputs, expected, strict=True):
        error = np.abs(found.numpy() - wanted).max()
        assert error < 20 * np.finfo(real).eps * np.abs(wanted).max()
