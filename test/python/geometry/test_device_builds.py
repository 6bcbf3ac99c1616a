"""Hierarchies that kernels build: found is what the runtime's hierarchies find, bit for bit."""

import numpy as np
import pytest

import warp as wp
from solid_angles import exact_winding
from warp._src.geometry.device.refit import Refit, slot_of

GPU = "cuda:0"


@wp.kernel
def ask(
    mesh: wp.uint64,
    p: wp.array(dtype=wp.vec3),
    faces: wp.array2d(dtype=int),
    numbers: wp.array2d(dtype=float),
):
    i = wp.tid()
    near = wp.mesh_query_point(mesh, p[i], 100.0)
    ray = wp.mesh_query_ray(mesh, p[i], -p[i] + wp.vec3(0.01, 0.02, 0.03), 100.0)
    faces[i, 0], faces[i, 1], faces[i, 2] = near.face, ray.face, 0
    numbers[i, 0], numbers[i, 1], numbers[i, 2] = near.u, near.v, near.sign
    numbers[i, 3], numbers[i, 4], numbers[i, 5] = ray.u, ray.v, ray.t
    for _ in wp.mesh_query_sphere(mesh, p[i], 0.3):
        faces[i, 2] += 1


def answers(of, p):
    device = of.device
    faces = wp.full((len(p), 3), -7, dtype=int, device=device)
    numbers = wp.zeros((len(p), 6), dtype=float, device=device)
    x = wp.array(p, dtype=wp.vec3, device=device)
    wp.launch(ask, len(p), inputs=[of.id, x, faces, numbers], device=device)
    return np.concatenate([faces.numpy().view(np.float32), numbers.numpy()], 1).view(np.int32)


def soup(n, seed=0):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (n, 1, 3)) + rng.uniform(-0.2, 0.2, (n, 3, 3))
    # Coincident and flat ones.
    points[n // 2 : n // 2 + n // 8] = points[:1]
    points[: n // 8, 2] = points[: n // 8, 1]
    return points.reshape(-1, 3).astype(np.float32)


@pytest.mark.cuda
@pytest.mark.parametrize("constructor", [None, "lbvh", "median"])
@pytest.mark.parametrize("n", [0, 1, 8, 9, 65, 700, 4200, 70000])
def test_kernels_build_what_finds_the_same(constructor, n):
    points = soup(n)
    if n > 100:
        points[31], points[50, 1] = np.nan, np.inf
    x = wp.array(points, dtype=wp.vec3, device=GPU)
    indices = wp.array(np.arange(3 * n), dtype=int, device=GPU)
    made = wp.Mesh(x, indices, bvh_constructor=constructor)
    wanted = wp.Mesh(x, indices, bvh_constructor="sah")
    p = np.random.default_rng(1).uniform(-1.5, 1.5, (500, 3)).astype(np.float32)
    assert made._built and not wanted._built
    assert made.report.skipped == wanted.report.skipped == (2 if n > 100 else 0)
    assert (answers(made, p) == answers(wanted, p)).all()
    x.assign(np.roll(points, 3, 0) * np.float32(40))
    for change in ("rebuild", "refit"):
        getattr(made, change)()
        getattr(wanted, change)()
        assert (answers(made, 40 * p) == answers(wanted, 40 * p)).all()
    made.rebuild("sah")
    assert not made._built and (answers(made, 40 * p) == answers(wanted, 40 * p)).all()
    made.rebuild("lbvh")
    made.points = wp.clone(x)
    assert made._built and (answers(made, 40 * p) == answers(wanted, 40 * p)).all()


@wp.kernel
def overlapping(of: wp.uint64, p: wp.array(dtype=wp.vec3), found: wp.array2d(dtype=int)):
    i = wp.tid()
    for box in wp.bvh_query_aabb(of, p[i], p[i] + wp.vec3(0.2)):
        found[i, box] += 1


@pytest.mark.cuda
@pytest.mark.parametrize("constructor", [None, "lbvh"])
@pytest.mark.parametrize("n", [0, 1, 70, 1500])
def test_boxes_are_found_once_each(constructor, n):
    rng = np.random.default_rng(4)
    low = rng.uniform(-1, 1, (n, 3)).astype(np.float32)
    high = low + rng.uniform(0, 0.2, (n, 3)).astype(np.float32)
    if n > 10:
        low[3], high[4, 1] = np.nan, -9
    corners = [wp.array(one, dtype=wp.vec3, device=GPU) for one in (low, high)]
    made = wp.Bvh(*corners, constructor=constructor)
    p = rng.uniform(-1, 1, (40, 3)).astype(np.float32)
    x = wp.array(p, dtype=wp.vec3, device=GPU)
    found = wp.zeros((40, max(n, 1)), dtype=int, device=GPU)
    wp.launch(overlapping, 40, inputs=[made.id, x, found], device=GPU)
    far = p[:, None] + np.float32(0.2)
    wanted = ((low <= far) & (high >= p[:, None]) & (low <= high)).all(2)
    assert (found.numpy()[:, :n] == wanted).all()
    assert made.report.skipped == (2 if n > 10 else 0)


@pytest.mark.cuda
def test_an_index_out_of_range_names_the_face():
    x = wp.zeros(3, dtype=wp.vec3, device=GPU)
    indices = wp.array([0, 1, 2, 0, 7, -1], dtype=int, device=GPU)
    with pytest.raises(RuntimeError, match="face 1 has the index 7, but there are 3 points"):
        wp.Mesh(x, indices)


@pytest.mark.cuda
def test_tiny_and_huge_meshes_are_searched():
    for scale in (1e-20, 1e18):
        points = wp.array(soup(300) * np.float32(scale), dtype=wp.vec3, device=GPU)
        indices = wp.array(np.arange(900), dtype=int, device=GPU)
        p = np.random.default_rng(2).uniform(-1, 1, (100, 3)).astype(np.float32) * np.float32(scale)
        one, other = (wp.Mesh(points, indices, bvh_constructor=c) for c in (None, "sah"))
        assert (answers(one, p) == answers(other, p)).all()


def test_kernels_refit_what_the_host_built(device):
    points = soup(700)
    x = wp.array(points, dtype=wp.vec3, device=device)
    faces = wp.array(np.arange(2100), dtype=int, device=device)
    made, wanted = (wp.Mesh(x, faces, bvh_constructor="sah") for _ in range(2))
    x.assign(np.roll(points, 3, 0) * np.float32(0.9))
    wanted.rebuild()
    Refit(made._native.view, wp.get_device(device), True, slot_of(made.id, device)).refit(x, faces)
    p = np.random.default_rng(1).uniform(-1.5, 1.5, (500, 3)).astype(np.float32)
    assert (answers(made, p) == answers(wanted, p)).all()


@pytest.mark.cuda
@pytest.mark.parametrize("constructor", [None, "lbvh"])
def test_a_graph_builds(constructor):
    x = wp.array(soup(3000), dtype=wp.vec3, device=GPU)
    indices = wp.array(np.arange(9000), dtype=int, device=GPU)
    made = wp.Mesh(x, indices, bvh_constructor=constructor)
    made.rebuild()
    with wp.ScopedCapture(device=GPU) as capture:
        made.rebuild()
    x.assign(soup(3000, seed=5) * np.float32(3))
    wp.capture_launch(capture.graph)
    p = np.random.default_rng(1).uniform(-4, 4, (500, 3)).astype(np.float32)
    wanted = wp.Mesh(x, indices, bvh_constructor="sah")
    assert (answers(made, p) == answers(wanted, p)).all()


@wp.kernel
def find_sides(
    mesh: wp.uint64,
    p: wp.array(dtype=wp.vec3),
    limits: wp.array(dtype=float),
    out: wp.array(dtype=float),
):
    i = wp.tid()
    out[i] = wp.mesh_query_point_sign_winding_number(mesh, p[i], 100.0, 2.0, limits[i]).sign


def sides(mesh, p, limits):
    device = mesh.device
    out = wp.zeros(len(p), dtype=float, device=device)
    given = [
        wp.array(one, dtype=kind, device=device) for one, kind in ((p, wp.vec3), (limits, float))
    ]
    wp.launch(find_sides, len(p), inputs=[mesh.id, *given, out], device=device)
    return out.numpy()


def check_winding(mesh, points, p):
    winding = exact_winding(points.reshape(-1, 3, 3), p)
    assert (sides(mesh, p, winding - 1e-3) == -1).all()
    assert (sides(mesh, p, winding + 1e-3) == 1).all()


@pytest.mark.cuda
@pytest.mark.parametrize("constructor", [None, "lbvh"])
@pytest.mark.parametrize("n", [1, 70, 900])
def test_winding_numbers_of_what_kernels_build_and_refit(constructor, n):
    points = soup(n)
    x = wp.array(points, dtype=wp.vec3, device=GPU)
    faces = wp.array(np.arange(3 * n), dtype=int, device=GPU)
    mesh = wp.Mesh(x, faces, support_winding_number=True, bvh_constructor=constructor)
    p = np.random.default_rng(3).uniform(-3, 3, (300, 3)).astype(np.float32)
    assert mesh._moments is not None
    check_winding(mesh, points, p)
    for moved in (points * np.float32(0.75), points[::-1].copy()):
        x.assign(moved)
        mesh.refit()
        check_winding(mesh, moved, p)
    mesh.rebuild()
    check_winding(mesh, moved, p)


@pytest.mark.parametrize("n", [1, 70, 900])
def test_winding_numbers_of_what_the_host_built(device, n):
    points = soup(n)
    x = wp.array(points, dtype=wp.vec3, device=device)
    faces = wp.array(np.arange(3 * n), dtype=int, device=device)
    mesh = wp.Mesh(x, faces, support_winding_number=True, bvh_constructor="sah")
    moved = points[::-1].copy()
    x.assign(moved)
    mesh.refit()
    if mesh._moments is None:
        # On a CPU the host has refitted it; its sums are made again.
        mesh._show_moments()
        mesh._sum_moments()
    p = np.random.default_rng(3).uniform(-3, 3, (300, 3)).astype(np.float32)
    check_winding(mesh, moved, p)


@pytest.mark.cuda
@pytest.mark.parametrize("constructor", [None, "sah"])
def test_a_graph_refits_winding_numbers(constructor):
    points, n = soup(900), 900
    x = wp.array(points, dtype=wp.vec3, device=GPU)
    faces = wp.array(np.arange(3 * n), dtype=int, device=GPU)
    groups = None if constructor is None else wp.zeros(n, dtype=int, device=GPU)
    mesh = wp.Mesh(x, faces, support_winding_number=True, groups=groups)
    mesh.refit()
    with wp.ScopedCapture(device=GPU) as capture:
        mesh.refit()
    p = np.random.default_rng(3).uniform(-3, 3, (300, 3)).astype(np.float32)
    moved = points[::-1].copy()
    x.assign(moved)
    wp.capture_launch(capture.graph)
    check_winding(mesh, moved, p)
