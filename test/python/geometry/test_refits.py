"""Hierarchies that kernels refit, word by word against those that the runtime refits."""

import numpy as np
import pytest

import warp as wp
from warp._src.geometry.device.refit import BOXES, NODE, TRIANGLES, Refit, slot_of


def faces_of(n):
    rng = np.random.default_rng(0)
    at = rng.uniform(-1, 1, (n, 1, 3))
    points = (at + rng.uniform(-0.05, 0.05, (n, 3, 3))).reshape(-1, 3)
    # The corners that hold the extent stay.
    return np.concatenate([points, [[-2, -2, -2], [2, 2, 2], [2, -2, 2]]]).astype(np.float32)


def words_of(address, count):
    """Numbers in memory; NaN is NaN, and a zero has no sign."""
    words = wp.array(ptr=address, dtype=float, shape=count, device="cpu").numpy().copy()
    return np.nan_to_num(words, nan=7e7, posinf=8e8, neginf=-8e8) + 0.0


def check_same(one, other, block):
    assert len(one.order) == len(other.order) and one.scale == other.scale
    a, b = (words_of(v.nodes, NODE * len(v.order)).reshape(-1, NODE) for v in (one, other))
    assert (a[:, :48] == b[:, :48]).all()
    count = block * one.block_count
    assert (words_of(one.blocks, count) == words_of(other.blocks, count)).all()
    return a


@pytest.mark.parametrize("n", [0, 1, 7, 900, 5000])
def test_triangles_are_refitted_as_by_the_runtime(n):
    points = faces_of(n)
    indices = wp.array(np.arange(3 * n + 3), dtype=int, device="cpu")
    moving = wp.array(points, dtype=wp.vec3, device="cpu")
    by_kernels = wp.Mesh(moving, indices)
    by_runtime = wp.Mesh(wp.clone(moving), indices)
    before = check_same(by_kernels._native.view, by_runtime._native.view, TRIANGLES).copy()
    moved = points.copy()
    moved[: 3 * n] = np.random.default_rng(1).permutation(points[: 3 * n] * 0.9)
    if n > 100:
        moved[30], moved[40, 1] = np.nan, np.inf
    moving.assign(moved)
    slot = slot_of(by_kernels.id, "cpu")
    Refit(by_kernels._native.view, wp.get_device("cpu"), True, slot).refit(moving, indices)
    by_runtime.points = wp.clone(moving)
    after = check_same(by_kernels._native.view, by_runtime._native.view, TRIANGLES)
    assert n < 100 or (before[:, :48] != after[:, :48]).any()


@pytest.mark.parametrize("n", [1, 40, 4000])
def test_boxes_are_refitted_as_by_the_runtime(n):
    rng = np.random.default_rng(2)
    low = rng.uniform(-1, 1, (n, 3)).astype(np.float32)
    low[0] = -4
    high = low + rng.uniform(0, 0.1, (n, 3)).astype(np.float32)
    corners = [wp.array(x, dtype=wp.vec3, device="cpu") for x in (low, high)]
    by_kernels, by_runtime = wp.Bvh(*corners), wp.Bvh(*map(wp.clone, corners))
    shift = rng.uniform(-0.5, 0.5, (n, 3)).astype(np.float32)
    shift[0] = 0
    low, high = low + shift, high + shift
    if n > 10:
        high[3] = low[3] - 1
        low[5, 2] = np.nan
    for mine, theirs, x in zip(
        corners, (by_runtime.lowers, by_runtime.uppers), (low, high), strict=True
    ):
        mine.assign(x)
        theirs.assign(x)
    slot = slot_of(by_kernels.id, "cpu")
    Refit(by_kernels._native.view, wp.get_device("cpu"), False, slot).refit(*corners)
    by_runtime.refit()
    check_same(by_kernels._native.view, by_runtime._native.view, BOXES)


@wp.kernel
def closest(mesh: wp.uint64, p: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
    i = wp.tid()
    found = wp.mesh_query_point_no_sign(mesh, p[i], 100.0)
    out[i] = wp.length(p[i] - wp.mesh_eval_position(mesh, found.face, found.u, found.v))


def test_a_refitted_mesh_is_searched_where_it_is(device):
    points = faces_of(400)
    moving = wp.array(points, dtype=wp.vec3, device=device)
    indices = wp.array(np.arange(1203), dtype=int, device=device)
    mesh = wp.Mesh(moving, indices)
    p = np.random.default_rng(3).uniform(-2, 2, (300, 3)).astype(np.float32)
    x = wp.array(p, dtype=wp.vec3, device=device)
    out = wp.zeros(300, dtype=float, device=device)
    for turn in range(3):
        moving.assign(points * np.float32(1 - 0.2 * turn) + np.float32(0.1 * turn))
        mesh.refit()
        wp.launch(closest, dim=300, inputs=[mesh.id, x, out], device=device)
        again = wp.Mesh(wp.clone(moving), indices)
        wanted = wp.zeros(300, dtype=float, device=device)
        wp.launch(closest, dim=300, inputs=[again.id, x, wanted], device=device)
        assert np.abs(out.numpy() - wanted.numpy()).max() < 1e-6


@wp.kernel
def sides(mesh: wp.uint64, p: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
    i = wp.tid()
    found = wp.mesh_query_point_sign_winding_number(mesh, p[i], 100.0)
    out[i] = found.sign * wp.length(
        p[i] - wp.mesh_eval_position(mesh, found.face, found.u, found.v)
    )


@pytest.mark.cuda
@pytest.mark.parametrize("constructor", [None, "lbvh", "sah"])
def test_a_graph_refits(constructor):
    """The first refit is in the graph."""
    points = faces_of(400)
    moving = wp.array(points, dtype=wp.vec3, device="cuda:0")
    indices = wp.array(np.arange(1203), dtype=int, device="cuda:0")
    mesh = wp.Mesh(moving, indices, bvh_constructor=constructor, support_winding_number=True)
    x = wp.array(np.zeros((1, 3)), dtype=wp.vec3, device="cuda:0")
    out = wp.zeros(1, dtype=float, device="cuda:0")
    wp.launch(sides, dim=1, inputs=[mesh.id, x, out], device="cuda:0")
    with wp.ScopedCapture(device="cuda:0") as capture:
        mesh.refit()
        wp.launch(sides, dim=1, inputs=[mesh.id, x, out], device="cuda:0")
    moving.assign(points + np.float32(10.0))
    wp.capture_launch(capture.graph)
    again = wp.Mesh(wp.clone(moving), mesh.indices, support_winding_number=True)
    wanted = wp.zeros(1, dtype=float, device="cuda:0")
    wp.launch(sides, dim=1, inputs=[again.id, x, wanted], device="cuda:0")
    assert abs(out.numpy()[0] - wanted.numpy()[0]) < 1e-5


@pytest.mark.cuda
def test_a_graph_does_not_take_over_other_arrays_in_what_the_host_has_built():
    points = wp.array(faces_of(40), dtype=wp.vec3, device="cuda:0")
    indices = wp.array(np.arange(123), dtype=int, device="cuda:0")
    mesh = wp.Mesh(points, indices, bvh_constructor="sah")
    other = wp.clone(points)
    with wp.ScopedCapture(device="cuda:0"):
        with pytest.raises(RuntimeError, match="while a graph is being captured"):
            mesh.points = other


@wp.kernel
def overlaps(bvh: wp.uint64, low: wp.vec3, high: wp.vec3, out: wp.array(dtype=int)):
    for _ in wp.bvh_query_aabb(bvh, low, high):
        wp.atomic_add(out, 0, 1)


@pytest.mark.cuda
@pytest.mark.parametrize("constructor", [None, "sah"])
def test_a_graph_refits_boxes(constructor):
    low = np.random.default_rng(4).uniform(-1, 1, (300, 3)).astype(np.float32)
    lowers, uppers = (wp.array(x, dtype=wp.vec3, device="cuda:0") for x in (low, low + 0.01))
    bvh = wp.Bvh(lowers, uppers, constructor=constructor)
    out = wp.zeros(1, dtype=int, device="cuda:0")
    corners = [wp.vec3(1.5), wp.vec3(4.5)]
    with wp.ScopedCapture(device="cuda:0") as capture:
        bvh.refit()
        wp.launch(overlaps, dim=1, inputs=[bvh.id, *corners, out], device="cuda:0")
    lowers.assign(low + np.float32(3.0))
    uppers.assign(low + np.float32(3.01))
    wp.capture_launch(capture.graph)
    assert out.numpy()[0] == 300
