"""Sums of tiles of short vectors: lanes exchange components, as they do numbers."""

import numpy as np
import pytest

import warp as wp


@wp.func
def both(x: float, y: float):
    return wp.vec2(x * x, x * y)


def summed(n, kind=None):
    """A kernel that adds up a tile of floats, or one of vectors of that type."""

    def numbers(x: wp.array2d[float], y: wp.array2d[float], out: wp.array[float]):
        i = wp.tid()
        a, b = wp.tile_load(x[i], shape=n), wp.tile_load(y[i], shape=n)
        out[i] = wp.tile_reduce(wp.add, wp.tile_map(wp.mul, a, b))[0]

    def pairs(x: wp.array2d[float], y: wp.array2d[float], out: wp.array[wp.vec2]):
        i = wp.tid()
        a, b = wp.tile_load(x[i], shape=n), wp.tile_load(y[i], shape=n)
        out[i] = wp.tile_reduce(wp.add, wp.tile_map(both, a, b))[0]

    body = numbers if kind is None else pairs
    return wp.kernel(module="unique", enable_backward=False)(body)


def code_of(body, threads):
    kernel = wp.kernel(body.func, module="unique", module_options={"block_dim": threads})
    return kernel.ir("ptx", arch=90, rank=2)


@pytest.mark.parametrize("threads", [32, 64, 256])
def test_a_component_takes_one_barrier(threads):
    numbers, pairs = (code_of(summed(48, kind), threads) for kind in (None, wp.vec2))
    # Five exchanges for each number that is added.
    assert pairs.count("shfl") == numbers.count("shfl") + 5
    assert pairs.count("bar.sync") <= numbers.count("bar.sync") + (threads > 32)
    if threads == 32:
        assert "bar.sync" not in pairs


@pytest.mark.parametrize("threads", [32, 64, 256])
@pytest.mark.parametrize("n", [27, 48, 700])
def test_sums_of_pairs(device, n, threads):
    rng = np.random.default_rng(n)
    x, y = (rng.standard_normal((3, n)).astype(np.float32) for _ in range(2))
    arrays = [wp.array(one, dtype=float, device=device) for one in (x, y)]
    out = wp.zeros(3, dtype=wp.vec2, device=device)
    wp.launch_tiled(
        summed(n, wp.vec2), dim=3, inputs=arrays, outputs=[out], block_dim=threads, device=device
    )
    a, b = x.astype(np.float64), y.astype(np.float64)
    wanted = np.stack([(a * a).sum(axis=1), (a * b).sum(axis=1)], axis=1)
    np.testing.assert_allclose(out.numpy(), wanted, rtol=1e-5, atol=1e-5 * n)
