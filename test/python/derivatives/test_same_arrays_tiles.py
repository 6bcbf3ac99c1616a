"""Kernels with tiles that read and write one array, by one name or two, have its exact gradient."""

import numpy as np
import pytest

import warp as wp
from warp.extend import errors

R = wp.float64
Matrix = wp.array2d(dtype=R)


@wp.kernel
def two_names(x: Matrix, y: Matrix, z: wp.array(dtype=R)):
    i = wp.tid()
    t = wp.tile_load(x[i], shape=4)
    wp.tile_store(z, wp.tile_sum(wp.tile_map(wp.sin, t)), offset=i)
    wp.tile_store(y[i], wp.tile_map(wp.cos, t))


@wp.kernel
def one_name(x: Matrix, z: wp.array(dtype=R)):
    i = wp.tid()
    t = wp.tile_load(x[i], shape=4)
    wp.tile_store(z, wp.tile_sum(wp.tile_map(wp.sin, t)), offset=i)
    wp.tile_store(x[i], wp.tile_map(wp.cos, t))


@wp.func
def squared(a: R):
    return a * a


@wp.kernel
def next_row(x: Matrix, y: Matrix, a: int, b: int):
    i = wp.tid()
    t = wp.tile_load(x, shape=(1, 4), offset=(a, 4 * i))
    wp.tile_store(y, wp.tile_map(squared, t), offset=(b, 4 * i))


def real(values, device):
    return wp.array(values, dtype=R, requires_grad=True, device=device)


@pytest.mark.parametrize("kernel", [one_name, two_names])
def test_in_place(kernel, device):
    values, seed = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 3, 4))
    x, z = real(values, device), real(np.zeros(3), device)
    arrays = [x, z] if kernel is one_name else [x, x, z]
    with wp.Tape() as tape:
        wp.launch_tiled(kernel, [3], arrays, block_dim=32, device=device)
    tape.backward(grads={z: real(np.ones(3), device), x: real(seed, device)})
    np.testing.assert_allclose(x.numpy(), np.cos(values), rtol=1e-14)
    expected = np.cos(values) - seed * np.sin(values)
    np.testing.assert_allclose(x.grad.numpy(), expected, rtol=1e-13, atol=1e-14)


def test_rows_of_one_array(device):
    values = np.random.default_rng(1).uniform(0.5, 1.0, (4, 8))
    x, seed = real(values, device), np.zeros((4, 8))
    seed[3] = 1.0
    with wp.Tape() as tape:
        for k in range(3):
            wp.launch_tiled(next_row, [2], [x, x, k, k + 1], block_dim=32, device=device)
    tape.backward(grads={x: real(seed, device)})
    np.testing.assert_allclose(x.grad.numpy()[0], 8.0 * values[0] ** 7, rtol=1e-13)


def test_views_that_overlap_are_refused(device):
    x, z = real(np.ones((4, 4)), device), real(np.zeros(3), device)
    with wp.Tape() as tape:
        wp.launch_tiled(two_names, [3], [x[1:], x[:-1], z], block_dim=32, device=device)
    with pytest.raises(errors.WarpGradientError, match="'y', which is written, and 'x' overlap"):
        tape.backward(grads={z: real(np.ones(3), device)})


def test_views_side_by_side(device):
    """Columns that interleave in memory do not meet."""
    values = np.random.default_rng(2).uniform(-1.0, 1.0, (3, 8))
    x, z = real(values, device), real(np.zeros(3), device)
    seed = np.random.default_rng(3).uniform(-1.0, 1.0, (3, 8))
    with wp.Tape() as tape:
        wp.launch_tiled(two_names, [3], [x[:, :4], x[:, 4:], z], block_dim=32, device=device)
    tape.backward(grads={z: real(np.ones(3), device), x: real(seed, device)})
    left = np.cos(values[:, :4]) + seed[:, :4] - seed[:, 4:] * np.sin(values[:, :4])
    np.testing.assert_allclose(x.grad.numpy(), np.hstack([left, np.zeros((3, 4))]), atol=1e-14)
