"""Factors and solves of matrices that are reshaped rows of memory."""

import re

import numpy as np
import pytest

import warp as wp


def factor(n, upper):
    area, mode = n * n, "upper" if upper else "lower"

    @wp.kernel(module="unique", enable_backward=False, module_options={"block_dim": 32})
    def kernel(
        picks: wp.array(dtype=int),
        given: wp.array2d(dtype=float),
        y: wp.array2d(dtype=float),
        factors: wp.array2d(dtype=float),
        x: wp.array2d(dtype=float),
    ):
        w = wp.tid()
        at = wp.tile_load(picks, shape=(area,), storage="shared")
        row = wp.tile_load_indexed(given[w], at, shape=(area,), storage="shared")
        matrix = wp.tile_reshape(row, (n, n))
        wp.tile_cholesky_inplace(matrix, fill_mode=mode)
        wp.tile_store(factors[w], wp.tile_reshape(matrix, (area,)))
        side = wp.tile_load(y[w], shape=(n,))
        wp.tile_store(x[w], wp.tile_cholesky_solve(matrix, side, fill_mode=mode))

    return kernel


@pytest.mark.parametrize("upper", [True, False])
@pytest.mark.parametrize("n", [3, 16, 27, 40])
def test_values_are_those_of_numpy(device, n, upper):
    rng = np.random.default_rng(n)
    root = rng.normal(size=(5, n, n))
    matrices = root @ root.transpose(0, 2, 1) + n * np.eye(n)
    y = rng.normal(size=(5, n))
    # Elements in random places of a longer row.
    picks = rng.permutation(2 * n * n)[: n * n].astype(np.int32)
    rows = np.zeros((5, 2 * n * n), np.float32)
    rows[:, picks] = matrices.reshape(5, -1)
    factors, x = wp.zeros((5, n * n), device=device), wp.zeros((5, n), device=device)
    inputs = [
        wp.array(picks, dtype=int, device=device),
        wp.array(rows, dtype=float, device=device),
        wp.array(y, dtype=float, device=device),
    ]
    wp.launch_tiled(
        factor(n, upper), 5, [*inputs], outputs=[factors, x], block_dim=32, device=device
    )
    right = np.linalg.cholesky(matrices)
    right = right.transpose(0, 2, 1) if upper else right
    np.testing.assert_allclose(factors.numpy().reshape(5, n, n), right, rtol=2e-5, atol=2e-5)
    np.testing.assert_allclose(
        x.numpy(), np.linalg.solve(matrices, y[..., None])[..., 0], atol=1e-5
    )


def test_warps_factor_them_in_registers():
    shown = factor(27, True).ir("launch", arch=90)
    called = re.findall(r'library_call "(\w+)"', shown)
    assert called == ["warp_tile_factor_f32_16", *["warp_tile_substitute_f32_1"] * 2]
