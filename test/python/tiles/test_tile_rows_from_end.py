"""Rows of tiles at indices known at run time, which count from the end below zero as in NumPy."""

import numpy as np
import pytest

import warp as wp


@wp.kernel(module="unique")
def change(
    a: wp.array3d(dtype=float), y: wp.array3d(dtype=float), z: wp.array(dtype=float), i: int
):
    t = wp.tile_load(a, shape=(2, 3, 4))
    wp.tile_store(z, t[i, i])
    z[4] = t[i][i][i]
    z[5] = t[i, 0][i]
    wp.tile_store(z, t[:, 0, i], offset=6)
    t[i][0] = wp.tile_ones(4, dtype=float)
    t[0, i] += wp.tile_ones(4, dtype=float)
    t[i][1][i] = 50.0
    wp.tile_store(y, t)


@pytest.mark.parametrize("mode", ["release", "debug"])
@pytest.mark.parametrize("i", [-1, -2, 0, 1])
def test_rows_count_from_the_end(device, monkeypatch, mode, i):
    """Reads, stores and updates of rows agree with NumPy in both modes."""
    monkeypatch.setattr(wp.config, "mode", mode)
    t = np.arange(24.0, dtype=np.float32).reshape(2, 3, 4)
    y, z = wp.zeros((2, 3, 4), dtype=float, device=device), wp.zeros(8, dtype=float, device=device)
    a = wp.array(t, device=device)
    wp.launch_tiled(change, dim=[1], inputs=[a, y, z, i], block_dim=32, device=device)
    want = [*t[i, i], t[i][i][i], t[i, 0][i], *t[:, 0, i]]
    np.testing.assert_array_equal(z.numpy(), want)
    t[i][0] = 1
    t[0, i] += 1
    t[i][1][i] = 50
    np.testing.assert_array_equal(y.numpy(), t)


@wp.kernel(module="unique")
def scale(a: wp.array2d(dtype=float), y: wp.array(dtype=float), i: int):
    t = wp.tile_load(a, shape=(2, 3))
    wp.tile_store(y, t[i] * t[i])


def test_gradients_reach_rows_from_the_end(device):
    """The gradient of a row's squares is twice the row, at the row's place."""
    t = np.arange(1.0, 7.0, dtype=np.float32).reshape(2, 3)
    a = wp.array(t, requires_grad=True, device=device)
    y = wp.zeros(3, dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch_tiled(scale, dim=[1], inputs=[a, y, -1], block_dim=32, device=device)
    tape.backward(grads={y: wp.ones(3, dtype=float, device=device)})
    np.testing.assert_array_equal(y.numpy(), t[1] ** 2)
    np.testing.assert_array_equal(a.grad.numpy(), [[0, 0, 0], 2 * t[1]])


@pytest.mark.parametrize("i", [2, -3])
def test_rows_outside_are_told_in_debug_mode(device, monkeypatch, i):
    """The error names the index as the program gave it, and the extent."""
    monkeypatch.setattr(wp.config, "mode", "debug")
    a, y = wp.zeros((2, 3), dtype=float, device=device), wp.zeros(3, dtype=float, device=device)
    with pytest.raises(wp.WarpLaunchError, match=rf"index \({i},.*out of bounds"):
        wp.launch_tiled(scale, dim=[1], inputs=[a, y, i], block_dim=32, device=device)
        wp.synchronize_device(device)
