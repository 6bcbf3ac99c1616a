"""Hash grids that kernels build, against those of the runtime; groups of points."""

import numpy as np
import pytest

import warp as wp
from warp._src.geometry.device.grid import DeviceGrid

TYPES = {2: (np.float16, wp.vec3h), 4: (np.float32, wp.vec3f), 8: (np.float64, wp.vec3d)}
SCALARS = {2: wp.float16, 4: wp.float32, 8: wp.float64}


def cloud(n, kind):
    p = np.random.default_rng(0).uniform(-30, 30, (n, 3)).astype(kind)
    if n > 20:
        p[3], p[5, 1], p[7, 0], p[9] = np.nan, np.nan, np.inf, 1e4
        p[11] = p[12] = p[13] = 0.0
    return p


@wp.kernel
def order_of(grid: wp.uint64, out: wp.array(dtype=int)):
    i = wp.tid()
    out[i] = wp.hash_grid_point_id(grid, i)


@pytest.mark.parametrize("size", [2, 4, 8])
@pytest.mark.parametrize("n, cells", [(5000, (16, 7, 5)), (3000, (128, 64, 32)), (0, (4, 4, 4))])
def test_kernels_sort_as_the_runtime_does(device, size, n, cells):
    kind, vector = TYPES[size]
    given = cloud(n, kind)
    on_host = wp.HashGrid(*cells, device="cpu", dtype=SCALARS[size])
    on_host.build(wp.array(given, dtype=vector, device="cpu"), radius=1.3)
    wanted = wp.zeros(n, dtype=int, device="cpu")
    wp.launch(order_of, dim=n, inputs=[on_host.id, wanted], device="cpu")
    grid = DeviceGrid(list(cells), wp.get_device(device))
    for _ in range(2):
        grid.build(wp.array(given, dtype=vector, device=device), size, 1.3)
    assert (grid.order.numpy() == wanted.numpy()).all()
    assert grid.skipped == on_host.skipped == (2 if n else 0)
    found = wp.zeros(n, dtype=int, device=device)
    wp.launch(order_of, dim=n, inputs=[grid.id, found], device=device)
    assert (found.numpy() == wanted.numpy()).all()
    starts = grid.starts.numpy()
    assert starts[0] == 0 and (np.diff(starts) >= 0).all() and starts[-1] == n - grid.skipped


@wp.kernel
def count_both(
    grid: wp.uint64,
    x: wp.array(dtype=wp.vec3),
    group: wp.array(dtype=int),
    r: float,
    looped: wp.array(dtype=int),
    stepped: wp.array(dtype=int),
):
    i = wp.tid()
    for j in wp.hash_grid_query(grid, x[i], r, group[i]):
        if wp.length(x[j] - x[i]) < r:
            looped[i] += 1
    query = wp.hash_grid_query(grid, x[i], r, group[i])
    j = int(-1)
    while wp.hash_grid_query_next(query, j):
        if wp.length(x[j] - x[i]) < r:
            stepped[i] += 1


def test_a_query_of_a_group_finds_its_points_alone(device):
    rng = np.random.default_rng(1)
    p = rng.uniform(0, 10, (600, 3)).astype(np.float32)
    groups = rng.integers(-2, 3, 600).astype(np.int32)
    x = wp.array(p, dtype=wp.vec3, device=device)
    g = wp.array(groups, dtype=int, device=device)
    grid = wp.HashGrid(8, 8, 8, device=device)
    looped, stepped = (wp.zeros(600, dtype=int, device=device) for _ in range(2))
    inputs = [grid.id, x, g, 1.5, looped, stepped]
    grid.build(x, 1.5)
    wp.launch(count_both, dim=600, inputs=inputs, device=device)
    assert (looped.numpy() == 0).all() and (stepped.numpy() == 0).all()
    grid.build(x, 1.5, groups=g)
    wp.launch(count_both, dim=600, inputs=inputs, device=device)
    apart = np.linalg.norm(p[:, None].astype(np.float64) - p[None], axis=2)
    wanted = ((apart < 1.5) & (groups[:, None] == groups[None])).sum(axis=1)
    assert (looped.numpy() == wanted).all() and (stepped.numpy() == wanted).all()


def test_groups_of_another_number_are_refused():
    x = wp.zeros(4, dtype=wp.vec3, device="cpu")
    with pytest.raises(RuntimeError, match="4 points, but 3 groups"):
        wp.HashGrid(2, 2, 2, device="cpu").build(x, 1.0, wp.zeros(3, dtype=int, device="cpu"))


@pytest.mark.cuda
def test_a_graph_builds_a_grid_again():
    p = np.random.default_rng(2).uniform(0, 10, (1000, 3)).astype(np.float32)
    x = wp.array(p, dtype=wp.vec3, device="cuda:0")
    grid = wp.HashGrid(8, 8, 8, device="cuda:0")
    grid.build(x, 1.0)
    with wp.ScopedCapture(device="cuda:0") as capture:
        grid.build(x, 1.0)
    x.assign(p[::-1].copy())
    wp.capture_launch(capture.graph)
    order = wp.zeros(1000, dtype=int, device="cuda:0")
    wp.launch(order_of, dim=1000, inputs=[grid.id, order], device="cuda:0")
    again = wp.HashGrid(8, 8, 8, device="cpu")
    again.build(wp.array(p[::-1].copy(), dtype=wp.vec3, device="cpu"), 1.0)
    wanted = wp.zeros(1000, dtype=int, device="cpu")
    wp.launch(order_of, dim=1000, inputs=[again.id, wanted], device="cpu")
    assert (order.numpy() == wanted.numpy()).all()
