"""Launches over more memory than a GPU's cache alternate their order: each index runs once."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def add_one(x: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = x[i] + 1.0


@wp.kernel
def add_plane(x: wp.array2d(dtype=float)):
    i, j = wp.tid()
    x[i, j] = x[i, j] + float(j % 7)


@wp.kernel
def add_solid(x: wp.array3d(dtype=float)):
    i, j, k = wp.tid()
    x[i, j, k] = x[i, j, k] + float(i % 5)


@wp.kernel
def turn(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
    i, j = wp.tid()
    y[j, i] = y[j, i] + x[i, j]


@wp.kernel
def total(x: wp.array(dtype=float), out: wp.array(dtype=float)):
    wp.atomic_add(out, 0, x[wp.tid()])


@wp.kernel
def tiles(x: wp.array(dtype=float)):
    i = wp.tid()
    t = wp.tile_load(x, shape=1000, offset=i * 1000)
    wp.tile_store(x, t + wp.tile_ones(shape=1000, dtype=float), offset=i * 1000)


@pytest.fixture
def rows(device):
    """Arrays of 4 KB: more than any cache has, and few for a CPU."""
    return 64 if device == "cpu" else 40_000


def test_one_dimension(rows, device):
    x = wp.zeros(rows * 1000 + 3, dtype=float, device=device)
    for _ in range(4):
        wp.launch(add_one, x.shape, [x], device=device)
    assert np.all(x.numpy() == 4)


def test_planes_and_solids(rows, device):
    x = wp.zeros((rows + 1, 1001), dtype=float, device=device)
    for _ in range(3):
        wp.launch(add_plane, x.shape, [x], device=device)
    assert np.all(x.numpy() == 3 * (np.arange(1001) % 7))
    y = wp.zeros((rows // 8 + 1, 10, 801), dtype=float, device=device)
    for _ in range(3):
        wp.launch(add_solid, y.shape, [y], device=device)
    assert np.all(y.numpy() == 3 * (np.arange(rows // 8 + 1) % 5)[:, None, None])


def test_exchanged_indices(rows, device):
    source = np.arange((rows + 1) * 1001, dtype=np.float32).reshape(rows + 1, 1001) % 1000
    x = wp.array(source, dtype=float, device=device)
    y = wp.zeros((1001, rows + 1), dtype=float, device=device)
    for _ in range(3):
        wp.launch(turn, x.shape, [x, y], device=device)
    assert np.all(y.numpy() == 3 * source.T)


def test_sums(rows, device):
    x = wp.ones(rows * 400, dtype=float, device=device)
    out = wp.zeros(1, dtype=float, device=device)
    for _ in range(3):
        out.zero_()
        wp.launch(total, x.shape, [x, out], device=device)
        assert out.numpy()[0] == rows * 400


def test_tiles_and_graphs(rows, device):
    x = wp.zeros(rows * 1000, dtype=float, device=device)
    for _ in range(3):
        wp.launch_tiled(tiles, [rows], [x], block_dim=128, device=device)
    assert np.all(x.numpy() == 3)
    with wp.ScopedCapture(device) as capture:
        for _ in range(3):
            wp.launch_tiled(tiles, [rows], [x], block_dim=128, device=device)
    wp.capture_launch(capture.graph)
    wp.capture_launch(capture.graph)
    assert np.all(x.numpy() == 9)


def test_recorded_launches(rows, device):
    x = wp.zeros(rows * 1000, dtype=float, device=device)
    launch = wp.launch(add_one, x.shape, [x], device=device, record_cmd=True)
    for _ in range(4):
        launch.launch()
    assert np.all(x.numpy() == 4)
