"""Blocks of one thread: on a GPU loops, where a CPU calls functions for whole tiles."""

import re

import numpy as np

import warp as wp

N, LENGTHS = 5, (8, 37)


@wp.kernel(module="unique", module_options={"block_dim": 1})
def algebra(
    x: wp.array2d(dtype=wp.float64), c: wp.array2d(dtype=wp.vec2d), y: wp.array2d(dtype=wp.float64),
    places: wp.array(dtype=int),
):  # fmt: skip
    g = wp.tile_load(x, shape=(N, N))
    f = wp.tile_cholesky(wp.tile_matmul(g, wp.tile_transpose(g)))
    v = wp.tile_cholesky_solve(f, wp.tile_sum(g, axis=0))
    wp.tile_store(y[0], v)
    order = wp.tile_arange(N, dtype=int)
    wp.tile_sort(v, order)
    wp.tile_store(places, order)
    wp.tile_store(y[1], wp.tile_scan_inclusive(v))
    whole = wp.tile_load(c, shape=(2, LENGTHS[0]))
    wp.tile_fft(whole)
    wp.tile_store(c, whole)
    prime = wp.tile_load(c, shape=(1, LENGTHS[1]), offset=(2, 0))
    wp.tile_ifft(prime)
    wp.tile_store(c, prime, offset=(2, 0))


@wp.kernel(module="unique", module_options={"block_dim": 1})
def factor(x: wp.array2d(dtype=wp.float64), y: wp.array2d(dtype=wp.float64)):
    wp.tile_store(y, wp.tile_cholesky(wp.tile_load(x, shape=(N, N))))


def test_code_for_a_gpu_calls_nothing_of_a_cpu():
    ptx = algebra.ir("ptx", arch=90)
    assert not re.search(r"\.extern \.func", ptx)
    assert "warp_tile" not in ptx
    ptx = factor.ir("ptx", arch=90, derivative="adjoint")
    assert not re.search(r"\.extern \.func", ptx)


def test_against_numpy(device):
    rng = np.random.default_rng(4)
    g = rng.normal(size=(N, N))
    given = rng.normal(size=(3, LENGTHS[1], 2))
    x = wp.array(g, dtype=wp.float64, device=device)
    c = wp.array(given, dtype=wp.vec2d, device=device)
    y = wp.zeros((2, N), dtype=wp.float64, device=device)
    places = wp.zeros(N, dtype=int, device=device)
    wp.launch_tiled(algebra, dim=1, inputs=[x, c, y, places], block_dim=1, device=device)
    v = np.linalg.solve(g @ g.T, g.sum(axis=0))
    np.testing.assert_allclose(y.numpy()[0], v, rtol=1e-9)
    np.testing.assert_array_equal(places.numpy(), np.argsort(v, kind="stable"))
    np.testing.assert_allclose(y.numpy()[1], np.cumsum(np.sort(v)), rtol=1e-9, atol=1e-9)
    z = given[..., 0] + 1j * given[..., 1]
    found = c.numpy()[..., 0] + 1j * c.numpy()[..., 1]
    expected = np.fft.fft(z[:2, : LENGTHS[0]])
    np.testing.assert_allclose(found[:2, : LENGTHS[0]], expected, rtol=1e-12, atol=1e-12)
    expected = np.fft.ifft(z[2]) * LENGTHS[1]
    np.testing.assert_allclose(found[2], expected, rtol=1e-12, atol=1e-12)
