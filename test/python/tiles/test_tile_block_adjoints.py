"""Adjoints of products of tiles are right for blocks of several CPU threads, too."""

import numpy as np
import pytest

import warp as wp

M, N, K = 16, 16, 8


def make_product(real):
    @wp.kernel(module="unique")
    def product(a: wp.array2d(dtype=real), b: wp.array2d(dtype=real), c: wp.array2d(dtype=real)):
        i, j = wp.tid()
        total = wp.tile_zeros(shape=(M, N), dtype=real)
        for k in range(0, int(a.shape[1] / K)):
            left = wp.tile_load(a, shape=(M, K), offset=(i * M, k * K))
            right = wp.tile_load(b, shape=(K, N), offset=(k * K, j * N))
            wp.tile_matmul(left, right, total)
        wp.tile_store(c, total, offset=(i * M, j * N))

    return product


@pytest.mark.parametrize("blocks", [False, True])
@pytest.mark.parametrize("real", [wp.float32, wp.float64])
def test_product(real, blocks, monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", blocks)
    rng = np.random.default_rng(0)
    x, y, seed = (rng.normal(size=shape) for shape in ((32, 24), (24, 48), (32, 48)))
    a, b = (wp.array(one, dtype=real, requires_grad=True, device="cpu") for one in (x, y))
    c = wp.zeros((32, 48), dtype=real, requires_grad=True, device="cpu")
    kernel = make_product(real)
    with wp.Tape() as tape:
        wp.launch_tiled(kernel, (2, 3), [a, b], [c], block_dim=8, device="cpu")
    tape.backward(grads={c: wp.array(seed, dtype=real, device="cpu")})
    limit = 1e-4 if real is wp.float32 else 1e-12
    np.testing.assert_allclose(c.numpy(), x @ y, atol=limit)
    np.testing.assert_allclose(a.grad.numpy(), seed @ y.T, atol=limit)
    np.testing.assert_allclose(b.grad.numpy(), x.T @ seed, atol=limit)
