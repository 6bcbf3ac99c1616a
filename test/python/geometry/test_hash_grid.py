"""Neighbours by hash grids, against all pairs in double precision."""

import numpy as np
import pytest

import warp as wp

RANDOM = np.random.default_rng(3)


@wp.kernel
def count_near(grid: wp.uint64, x: wp.array(dtype=wp.vec3), r: float, out: wp.array(dtype=int)):
    i = wp.tid()
    n = int(0)
    for j in wp.hash_grid_query(grid, x[i], r):
        if wp.length(x[j] - x[i]) <= r:
            n += 1
    out[i] = n


@wp.kernel
def count_near_while(
    grid: wp.uint64, x: wp.array(dtype=wp.vec3), r: float, out: wp.array(dtype=int)
):
    tid = wp.tid()
    i = wp.hash_grid_point_id(grid, tid)
    query = wp.hash_grid_query(grid, x[i], r)
    index = int(0)
    n = int(0)
    while wp.hash_grid_query_next(query, index):
        d = x[index] - x[i]
        if wp.dot(d, d) <= r * r:
            n += 1
    out[i] = n


@wp.kernel
def visit(grid: wp.uint64, p: wp.vec3, r: float, seen: wp.array(dtype=int)):
    for j in wp.hash_grid_query(grid, p, r):
        seen[j] += 1


@wp.kernel
def visit_double(grid: wp.uint64, p: wp.vec3d, r: wp.float64, seen: wp.array(dtype=int)):
    for j in wp.hash_grid_query(grid, p, r):
        seen[j] += 1


def built(points, radius, cells=(16, 8, 4), dtype=wp.float32):
    element = {wp.float16: wp.vec3h, wp.float32: wp.vec3, wp.float64: wp.vec3d}[dtype]
    x = wp.array(points, dtype=element, device="cpu")
    grid = wp.HashGrid(*cells, device="cpu", dtype=dtype)
    grid.build(x, radius)
    return grid, x


@pytest.mark.parametrize("kernel", [count_near, count_near_while])
@pytest.mark.parametrize("offset", [0.0, -7.3, 1000.0])
def test_finds_all_pairs(kernel, offset):
    points = (RANDOM.random((700, 3)) * 3 + offset).astype(np.float32)
    grid, x = built(points, 0.3)
    out = wp.zeros(len(points), dtype=int, device="cpu")
    wp.launch(kernel, dim=len(points), inputs=[grid.id, x, 0.3, out], device="cpu")
    distances = np.linalg.norm(points[:, None].astype(float) - points[None], axis=2)
    # Pairs at the radius to within a rounding may count or not.
    sure, maybe = (distances < 0.3 - 1e-4).sum(1), (distances < 0.3 + 1e-4).sum(1)
    assert (out.numpy() >= sure).all() and (out.numpy() <= maybe).all()
    assert sure.sum() > 2 * len(points)


@pytest.mark.parametrize("radius", [0.01, 0.5, 3.0, 1e6])
def test_each_point_comes_once_whatever_the_radius(radius):
    points = (RANDOM.random((500, 3)) * 4 - 2).astype(np.float32)
    grid, _ = built(points, 0.25)
    seen = wp.zeros(500, dtype=int, device="cpu")
    wp.launch(visit, dim=1, inputs=[grid.id, wp.vec3(0.1, 0.2, 0.3), radius, seen], device="cpu")
    near = np.abs(points - [0.1, 0.2, 0.3]).max(1) <= radius
    assert seen.numpy().max() <= 1
    assert (seen.numpy()[near] == 1).all()
    if radius > 2:
        assert seen.numpy().sum() == 500


def test_points_of_64_bits():
    points = RANDOM.random((300, 3)) * 1e-3 + 1e6
    grid, _ = built(points, 1e-4, dtype=wp.float64)
    seen = wp.zeros(300, dtype=int, device="cpu")
    center = points.mean(0)
    inputs = [grid.id, wp.vec3d(*center), wp.float64(2e-4), seen]
    wp.launch(visit_double, dim=1, inputs=inputs, device="cpu")
    near = np.linalg.norm(points - center, axis=1) < 2e-4
    assert near.any() and (seen.numpy()[near] == 1).all()


def test_what_is_not_a_number_is_left_out_and_finds_nothing():
    points = RANDOM.random((100, 3)).astype(np.float32)
    points[::10, 1] = np.nan
    points[5] = np.inf
    grid, _ = built(points, 0.5)
    assert grid.skipped == 10
    seen = wp.zeros(100, dtype=int, device="cpu")
    wp.launch(visit, dim=1, inputs=[grid.id, wp.vec3(0.5, 0.5, 0.5), 1e9, seen], device="cpu")
    assert (seen.numpy() == ~np.isnan(points).any(1)).all()
    for p, r in ((wp.vec3(np.nan, 0.0, 0.0), 1.0), (wp.vec3(), -1.0), (wp.vec3(), np.nan)):
        seen.zero_()
        wp.launch(visit, dim=1, inputs=[grid.id, p, r, seen], device="cpu")
        assert seen.numpy().sum() == 0


def test_empty_and_not_built():
    grid = wp.HashGrid(4, 4, 4, device="cpu")
    seen = wp.zeros(1, dtype=int, device="cpu")
    wp.launch(visit, dim=1, inputs=[grid.id, wp.vec3(), 1.0, seen], device="cpu")
    grid.build(wp.zeros(0, dtype=wp.vec3, device="cpu"), 1.0)
    wp.launch(visit, dim=1, inputs=[grid.id, wp.vec3(), 1.0, seen], device="cpu")
    assert seen.numpy()[0] == 0


def test_bad_input():
    with pytest.raises(TypeError, match="integer"):
        wp.HashGrid(1.5, 2, 2, device="cpu")
    with pytest.raises(RuntimeError, match="at least one cell"):
        wp.HashGrid(4, 0, 4, device="cpu")
    with pytest.raises(RuntimeError, match="2\\^31"):
        wp.HashGrid(2048, 2048, 2048, device="cpu")
    with pytest.raises(TypeError, match="float16, float32 or float64"):
        wp.HashGrid(4, 4, 4, device="cpu", dtype=wp.int32)
    grid = wp.HashGrid(4, 4, 4, device="cpu")
    for radius in (0.0, -1.0, np.nan):
        with pytest.raises(ValueError, match="positive radius"):
            grid.build(wp.zeros(3, dtype=wp.vec3, device="cpu"), radius)
    with pytest.raises(TypeError, match="vec3"):
        grid.build(wp.zeros(3, dtype=wp.vec3d, device="cpu"), 1.0)


def test_handles_are_checked():
    seen = wp.zeros(1, dtype=int, device="cpu")
    grid = wp.HashGrid(4, 4, 4, device="cpu")
    freed = grid.id
    del grid
    for handle, got in ((freed, "freed HashGrid"), (0, "none"), (12345, "none")):
        with pytest.raises(wp.WarpLaunchError, match=f"argument 'grid'.*{got}"):
            wp.launch(visit, dim=1, inputs=[handle, wp.vec3(), 1.0, seen], device="cpu")


@wp.kernel
def visit_chosen(grids: wp.array(dtype=wp.uint64), out: wp.array(dtype=int)):
    i = wp.tid()
    for j in wp.hash_grid_query(grids[i], wp.vec3(0.0, 0.0, 0.0), 1.0):
        out[i] = out[i] + 1
        if j == 1:
            break


def test_handles_of_arrays_and_break():
    grid, _ = built(np.zeros((5, 3), np.float32), 1.0)
    gone, _ = built(np.zeros((5, 3), np.float32), 1.0)
    handles = wp.array([grid.id, gone.id, 0, 12345], dtype=wp.uint64, device="cpu")
    del gone
    out = wp.zeros(4, dtype=int, device="cpu")
    wp.launch(visit_chosen, dim=4, inputs=[handles, out], device="cpu")
    assert out.numpy().tolist() == [2, 0, 0, 0]


@wp.func
def count_of(query: wp.HashGridQuery[wp.float32]) -> int:
    found, index = int(0), int(0)
    while wp.hash_grid_query_next(query, index):
        found += 1
    return found


@wp.kernel
def count_around(grid: wp.uint64, out: wp.array(dtype=int)):
    out[0] = count_of(wp.hash_grid_query(grid, wp.vec3(0.0, 0.0, 0.0), 1.0))


def test_queries_have_a_type_of_numbers(device):
    points = wp.array([[0.1, 0.1, 0.1], [0.2, 0.0, 0.0], [3.5, 3.5, 3.5]], wp.vec3, device=device)
    grid = wp.HashGrid(8, 8, 8, device=device)
    grid.build(points, 1.0)
    out = wp.zeros(1, dtype=int, device=device)
    wp.launch(count_around, 1, [grid.id, out], device=device)
    assert out.numpy()[0] == 2
