"""Gradients of sums over the neighbours that a hash grid finds, against all pairs in float64."""

import numpy as np
import pytest

import warp as wp

H = 0.2


def _kernel(loop, lanes, mode):
    options = {"cpu_lanes": lanes, "mode": mode}

    @wp.kernel(module_options=options, module="unique")
    def by_for(
        grid: wp.uint64,
        x: wp.array(dtype=wp.vec3),
        m: wp.array(dtype=float),
        y: wp.array(dtype=float),
    ):
        i = wp.hash_grid_point_id(grid, wp.tid())
        s = float(0.0)
        for j in wp.hash_grid_query(grid, x[i], H):
            d = wp.length_sq(x[i] - x[j])
            if d < H * H:
                w = H * H - d
                s += m[j] * w * w
        y[i] = s

    @wp.kernel(module_options=options, module="unique")
    def by_while(
        grid: wp.uint64,
        x: wp.array(dtype=wp.vec3),
        m: wp.array(dtype=float),
        y: wp.array(dtype=float),
    ):
        i = wp.hash_grid_point_id(grid, wp.tid())
        p = x[i]
        s = float(0.0)
        query = wp.hash_grid_query(grid, p, H)
        j = int(0)
        while wp.hash_grid_query_next(query, j):
            d = wp.length_sq(p - x[j])
            if d < H * H:
                w = H * H - d
                s += m[j] * w * w
        y[i] = s

    return by_for if loop == "for" else by_while


@pytest.mark.parametrize(
    "lanes,mode", [(0, "release"), (1, "release"), (16, "release"), (1, "debug")]
)
@pytest.mark.parametrize("loop", ["for", "while"])
def test_gradients(loop, lanes, mode):
    random = np.random.default_rng(3)
    x, m, seed = random.random((400, 3)), random.random(400), random.random(400)
    given = wp.array(x.astype(np.float32), dtype=wp.vec3, device="cpu", requires_grad=True)
    mass = wp.array(m.astype(np.float32), dtype=float, device="cpu", requires_grad=True)
    y = wp.zeros(400, dtype=float, device="cpu", requires_grad=True)
    grid = wp.HashGrid(8, 8, 8, device="cpu")
    grid.build(given, H)
    with wp.Tape() as tape:
        wp.launch(_kernel(loop, lanes, mode), 400, [grid.id, given, mass], [y], device="cpu")
    tape.backward(grads={y: wp.array(seed.astype(np.float32), dtype=float, device="cpu")})
    d = x[:, None] - x[None]
    w = np.maximum(H * H - (d * d).sum(-1), 0.0)
    assert np.allclose(y.numpy(), (w * w) @ m, rtol=1e-4, atol=1e-9)
    assert np.allclose(mass.grad.numpy(), (w * w).T @ seed, rtol=1e-4, atol=1e-9)
    pull = -4.0 * w * (seed[:, None] * m[None] + seed[None] * m[:, None])
    expected = (pull[..., None] * d).sum(1)
    assert np.abs(given.grad.numpy() - expected).max() < 1e-5 * np.abs(expected).max()
