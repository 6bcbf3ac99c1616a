"""The same bits in every run: of all that tiles compute, and of sums of blocks if asked for."""

import math

import numpy as np
import pytest

import warp as wp

BLOCKS, N = 96, 24


@wp.kernel
def mixture(x: wp.array3d(dtype=float), y: wp.array2d(dtype=float), s: wp.array2d(dtype=float)):
    i = wp.tid()
    g = wp.tile_load(x[i], shape=(N, N))
    a = wp.tile_matmul(g, wp.tile_transpose(g))
    a = wp.tile_diag_add(a, wp.tile_ones(N, dtype=float))
    f = wp.tile_cholesky(a)
    v = wp.tile_cholesky_solve(f, wp.tile_sum(g, axis=0))
    e = wp.tile_map(wp.exp, v - wp.tile_broadcast(wp.tile_max(v), shape=(N,)))
    v = wp.tile_map(wp.div, e, wp.tile_broadcast(wp.tile_sum(e), shape=(N,)))
    places = wp.tile_arange(N, dtype=int)
    wp.tile_sort(v, places)
    wp.tile_store(y[i], wp.tile_scan_inclusive(v))
    wp.tile_atomic_add(s, wp.tile_matmul(f, g))


def sums_of(option):
    @wp.kernel(module="unique", module_options={"deterministic": option})
    def sums(x: wp.array2d(dtype=float), each: wp.array2d(dtype=float), s: wp.array(dtype=float)):
        i = wp.tid()
        t = wp.tile_load(x[i], shape=100)
        total = wp.tile_sum(t)
        wp.tile_atomic_add(each, wp.tile_reshape(total, shape=(1, 1)), offset=(i, 0))
        wp.tile_atomic_add(s, total)

    return sums


# Sums in the array have the order in which blocks come; everything else has one of its own.
@pytest.mark.parametrize("threads", [1, 32, 100])
def test_bits_of_many_runs(device, threads, monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    rng = np.random.default_rng(0)
    x = wp.array(rng.normal(size=(BLOCKS, N, N)), dtype=float, device=device)
    found = set()
    for _run in range(30):
        y = wp.zeros((BLOCKS, N), dtype=float, device=device)
        s = wp.zeros((N, N), dtype=float, device=device)
        wp.launch_tiled(mixture, dim=BLOCKS, inputs=[x, y, s], block_dim=threads, device=device)
        found.add(y.numpy().tobytes())
    assert len(found) == 1
    np.testing.assert_allclose(y.numpy()[:, -1], 1.0, rtol=1e-5)
    g = x.numpy().astype(float)
    factors = np.linalg.cholesky(g @ g.transpose(0, 2, 1) + np.eye(N))
    np.testing.assert_allclose(s.numpy(), (factors @ g).sum(axis=0), rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("option", ["run_to_run", "gpu_to_gpu"])
@pytest.mark.parametrize("threads", [1, 64])
def test_sums_of_blocks(device, option, threads, monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    rng = np.random.default_rng(1)
    given = rng.normal(size=(2000, 100)) * 10.0 ** rng.integers(-6, 7, (2000, 1))
    x = wp.array(given, dtype=float, device=device)
    kernel, found = sums_of(option), set()
    for _run in range(10):
        each = wp.zeros((2000, 1), dtype=float, device=device)
        s = wp.zeros(1, dtype=float, device=device)
        wp.launch_tiled(kernel, dim=2000, inputs=[x, each, s], block_dim=threads, device=device)
        found.add(s.numpy().tobytes() + each.numpy().tobytes())
    assert len(found) == 1
    exact = math.fsum(each.numpy()[:, 0].astype(float))
    if option == "gpu_to_gpu" or device != "cpu":
        assert s.numpy()[0] == np.float32(exact)
    bound = 2000 * np.finfo(np.float32).eps * np.abs(each.numpy().astype(float)).sum()
    assert abs(s.numpy()[0] - exact) < bound
