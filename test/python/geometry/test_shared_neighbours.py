"""Loops over neighbours, in which the lanes of a CPU come to a point together.

Every thread does what it would do alone, in its order: sums have the bits of threads that are not
lanes (debug mode), whether lanes have the same neighbours or none in common.
"""

import numpy as np
import pytest

import warp as wp

RANDOM = np.random.default_rng(5)


def _kernels(mode):
    """A sum in the order of a `for`, of a `while`, with loops and stores within; a break."""
    options = {"mode": mode}

    @wp.kernel(module_options=options, module="unique")
    def by_for(
        grid: wp.uint64,
        x: wp.array(dtype=wp.vec3),
        order: wp.array(dtype=int),
        h: float,
        out: wp.array(dtype=float),
        last: wp.array(dtype=int),
    ):
        tid = wp.tid()
        i = order[wp.hash_grid_point_id(grid, tid)]
        s = float(0.0)
        for j in wp.hash_grid_query(grid, x[i], h):
            d = x[i] - x[j]
            r2 = wp.dot(d, d)
            if r2 < h * h:
                s += wp.exp(-r2) * (h * h - r2)
                last[i] = j
        out[i] = s

    @wp.kernel(module_options=options, module="unique")
    def by_while(
        grid: wp.uint64,
        x: wp.array(dtype=wp.vec3),
        order: wp.array(dtype=int),
        h: float,
        out: wp.array(dtype=float),
        last: wp.array(dtype=int),
    ):
        tid = wp.tid()
        i = order[wp.hash_grid_point_id(grid, tid)]
        s = float(1.0)
        index = int(-1)
        query = wp.hash_grid_query(grid, x[i], h)
        while wp.hash_grid_query_next(query, index):
            d = wp.length(x[i] - x[index])
            for _k in range(index % 3):
                s = s * 0.75 + d
        out[i] = s
        last[i] = index

    @wp.kernel(module_options=options, module="unique")
    def by_some(
        grid: wp.uint64,
        x: wp.array(dtype=wp.vec3),
        order: wp.array(dtype=int),
        h: float,
        out: wp.array(dtype=float),
        last: wp.array(dtype=int),
    ):
        tid = wp.tid()
        i = order[wp.hash_grid_point_id(grid, tid)]
        s = float(0.5)
        if i % 3 != 0:
            for j in wp.hash_grid_query(grid, x[i], h * float(1 + i % 2)):
                if j == i:
                    continue
                s = s * 0.5 + x[j][0]
                if s > 2.5:
                    break
                last[i] += 1
        out[i] = s

    return {"for": by_for, "while": by_while, "some": by_some}


@pytest.fixture(scope="module")
def kernels():
    return {mode: _kernels(mode) for mode in ("release", "debug")}


def _run(kernel, points, order, radius, cells):
    x = wp.array(points, dtype=wp.vec3, device="cpu")
    grid = wp.HashGrid(*cells, device="cpu")
    grid.build(x, radius)
    out = wp.zeros(len(points), dtype=float, device="cpu")
    last = wp.zeros(len(points), dtype=int, device="cpu")
    places = wp.array(order.astype(np.int32), dtype=int, device="cpu")
    count = int(np.isfinite(points).all(axis=1).sum())
    wp.launch(kernel, count, [grid.id, x, places, radius, out, last], device="cpu")
    return out.numpy(), last.numpy()


@pytest.mark.parametrize("name", ["for", "while", "some"])
@pytest.mark.parametrize("sorted_threads", [True, False])
@pytest.mark.parametrize("cells", [(8, 8, 8), (3, 2, 2), (64, 1, 1)])
def test_sums_are_those_of_each_thread_alone(kernels, name, sorted_threads, cells):
    points = (RANDOM.random((501, 3)) * [4, 2, 1] - 1).astype(np.float32)
    points[7] = np.nan
    order = np.arange(501) if sorted_threads else RANDOM.permutation(501)
    runs = [_run(kernels[mode][name], points, order, 0.25, cells) for mode in ("release", "debug")]
    for lanes, alone in zip(*runs, strict=True):
        np.testing.assert_array_equal(lanes, alone)
    assert len(np.unique(runs[0][0])) > 10


def test_sums_are_right(kernels):
    points = RANDOM.random((700, 3)).astype(np.float32)
    found, _ = _run(kernels["release"]["for"], points, np.arange(700), 0.2, (16, 16, 16))
    p = points.astype(float)
    squared = ((p[:, None] - p[None]) ** 2).sum(2)
    h = float(np.float32(0.2))
    expected = np.where(squared < h * h, np.exp(-squared) * (h * h - squared), 0).sum(1)
    np.testing.assert_allclose(found, expected, rtol=1e-4)


@wp.kernel
def density(
    grid: wp.uint64,
    x: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    h: float,
    out: wp.array(dtype=float),
):
    i = wp.hash_grid_point_id(grid, wp.tid())
    s = float(0.0)
    for j in wp.hash_grid_query(grid, x[i], h):
        d = x[i] - x[j]
        room = h * h - wp.dot(d, d)
        if room > 0.0:
            s += mass[j] * room * room
    out[i] = s


def test_lanes_agree_on_the_next_point():
    # By the least of their places in the list.
    assert "warp.combine_lanes" in density.ir("launch", device="cpu")


@pytest.mark.parametrize("cells", [(16, 16, 16), (2, 2, 2)])
def test_gradients_of_neighbours_are_analytic(device, cells):
    """The gradient of sum_ij w_i m_j (h^2 - |x_i - x_j|^2)_+^2, added to shared neighbours."""
    points = (RANDOM.random((701, 3)) * 1.5).astype(np.float32)
    masses = RANDOM.uniform(0.5, 2, 701).astype(np.float32)
    weights = RANDOM.normal(size=701).astype(np.float32)
    h = 0.3
    x = wp.array(points, dtype=wp.vec3, device=device, requires_grad=True)
    mass = wp.array(masses, dtype=float, device=device, requires_grad=True)
    out = wp.zeros(701, dtype=float, device=device, requires_grad=True)
    grid = wp.HashGrid(*cells, device=device)
    grid.build(x, h)
    with wp.Tape() as tape:
        wp.launch(density, 701, [grid.id, x, mass, h, out], device=device)
    tape.backward(grads={out: wp.array(weights, dtype=float, device=device)})

    p, m, w = (one.astype(np.float64) for one in (points, masses, weights))
    offset = p[:, None] - p
    room = np.maximum(np.float64(np.float32(h)) ** 2 - (offset**2).sum(2), 0)
    assert np.allclose(out.numpy(), (m * room**2).sum(1), rtol=1e-5)
    assert np.allclose(mass.grad.numpy(), w @ room**2, rtol=1e-4, atol=1e-6)
    both = np.outer(w, m) + np.outer(m, w)
    wanted = (both * -4 * room)[..., None] * offset
    assert np.allclose(x.grad.numpy(), wanted.sum(1), rtol=1e-4, atol=1e-5)
