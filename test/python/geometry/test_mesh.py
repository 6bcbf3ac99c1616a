"""Closest points, rays and overlaps of meshes in kernels, against formulas in double precision."""

import numpy as np
import pytest

import warp as wp

RANDOM = np.random.default_rng(7)


def sphere(around=24, high=12):
    """Vertices and faces of a unit sphere, seen counter-clockwise from outside."""
    theta = np.pi * np.arange(1, high) / high
    phi = 2 * np.pi * np.arange(around) / around
    ring = np.stack(
        [
            np.outer(np.sin(theta), np.cos(phi)),
            np.outer(np.sin(theta), np.sin(phi)),
            np.outer(np.cos(theta), np.ones(around)),
        ],
        -1,
    ).reshape(-1, 3)
    points = np.concatenate([[[0, 0, 1]], ring, [[0, 0, -1]]]).astype(np.float32)

    def at(i, j):
        return 0 if i == 0 else len(points) - 1 if i == high else 1 + (i - 1) * around + j % around

    faces = []
    for i in range(high):
        for j in range(around):
            if i > 0:
                faces.append((at(i, j), at(i + 1, j), at(i, j + 1)))
            if i < high - 1:
                faces.append((at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)))
    return points, np.array(faces, np.int32)


def make(points, faces, **options):
    return wp.Mesh(
        wp.array(points, dtype=wp.vec3, device="cpu"),
        wp.array(faces.ravel(), dtype=int, device="cpu"),
        **options,
    )


@wp.kernel
def closest(
    mesh: wp.uint64,
    x: wp.array(dtype=wp.vec3),
    max_dist: float,
    at: wp.array(dtype=wp.vec3),
    sign: wp.array(dtype=float),
):
    i = wp.tid()
    found = wp.mesh_query_point(mesh, x[i], max_dist)
    if found.result:
        at[i] = wp.mesh_eval_position(mesh, found.face, found.u, found.v)
        sign[i] = found.sign


@wp.kernel
def closest_by_normal(
    mesh: wp.uint64, x: wp.array(dtype=wp.vec3), max_dist: float, sign: wp.array(dtype=float)
):
    i = wp.tid()
    found = wp.mesh_query_point_sign_normal(mesh, x[i], max_dist)
    if found.result:
        sign[i] = found.sign


@wp.kernel
def project(
    positions: wp.array(dtype=wp.vec3),
    mesh: wp.uint64,
    output_pos: wp.array(dtype=wp.vec3),
    output_face: wp.array(dtype=int),
):
    tid = wp.tid()
    x = wp.load(positions, tid)
    face_index = int(0)
    face_u = float(0.0)
    face_v = float(0.0)
    sign = float(0.0)
    max_dist = 2.0
    if wp.mesh_query_point(mesh, x, max_dist, sign, face_index, face_u, face_v):
        p = wp.mesh_eval_position(mesh, face_index, face_u, face_v)
        output_pos[tid] = p
        output_face[tid] = face_index


@wp.kernel
def cast(
    mesh: wp.uint64,
    start: wp.array(dtype=wp.vec3),
    dir: wp.array(dtype=wp.vec3),
    hit: wp.array(dtype=wp.vec4),
    normal: wp.array(dtype=wp.vec3),
    any: wp.array(dtype=bool),
):
    i = wp.tid()
    ray = wp.mesh_query_ray(mesh, start[i], dir[i], 1.0e6)
    hit[i] = wp.vec4(float(ray.face), ray.t, ray.sign, 0.0)
    normal[i] = ray.normal
    any[i] = wp.mesh_query_ray_anyhit(mesh, start[i], dir[i], 1.0e6)


@wp.kernel
def overlaps(
    mesh: wp.uint64, low: wp.array(dtype=wp.vec3), size: float, counts: wp.array2d(dtype=int)
):
    i = wp.tid()
    n = int(0)
    for _ in wp.mesh_query_aabb(mesh, low[i], low[i] + wp.vec3(size)):
        n += 1
    counts[i, 0] = n
    query = wp.mesh_query_aabb(mesh, low[i], low[i] + wp.vec3(size))
    face = int(0)
    m = int(0)
    while wp.mesh_query_aabb_next(query, face):
        m += face + 1
    counts[i, 1] = m


def array(values, dtype=wp.vec3):
    return wp.array(values, dtype=dtype, device="cpu")


def zeros(n, dtype=float):
    return wp.zeros(n, dtype=dtype, device="cpu")


def distance_to_sphere(points, faces, x):
    """Distances of points to a dense sample of the faces, which is above the true one."""
    a, b, c = (points[faces[:, i]].astype(float) for i in range(3))
    w = [(i / 12, j / 12) for i in range(13) for j in range(13 - i)]
    sample = np.concatenate([u * a + v * b + (1 - u - v) * c for u, v in w])
    return np.array([np.linalg.norm(sample - p, axis=1).min() for p in x])


def test_closest_points_and_sides():
    points, faces = sphere()
    mesh = make(points, faces)
    x = (RANDOM.random((400, 3)) * 3 - 1.5).astype(np.float32)
    at, sign, by_normal = zeros(400, wp.vec3), zeros(400), zeros(400)
    wp.launch(closest, dim=400, inputs=[mesh.id, array(x), 1e6, at, sign], device="cpu")
    wp.launch(closest_by_normal, dim=400, inputs=[mesh.id, array(x), 1e6, by_normal], device="cpu")
    got, above = np.linalg.norm(at.numpy() - x, axis=1), distance_to_sphere(points, faces, x)
    assert (got <= above + 1e-6).all() and (got > above - 0.03).all()
    r = np.linalg.norm(x, axis=1)
    clear = np.abs(r - 0.98) > 0.05
    assert (sign.numpy()[clear] == np.where(r > 1, 1, -1)[clear]).all()
    assert (by_normal.numpy() == sign.numpy())[clear].all()


def test_first_form_of_the_query():
    points, faces = sphere()
    mesh = make(points, faces)
    x = np.array([[3.5, 0, 0], [0, 0, 2]], np.float32)
    at, face = zeros(2, wp.vec3), wp.full(2, -7, dtype=int, device="cpu")
    wp.launch(project, dim=2, inputs=[array(x), mesh.id, at, face], device="cpu")
    assert at.numpy()[0].tolist() == [0, 0, 0] and face.numpy()[0] == -7
    assert np.allclose(at.numpy()[1], [0, 0, 1]) and face.numpy()[1] >= 0


def test_rays():
    points, faces = sphere()
    mesh = make(points, faces)
    start = (RANDOM.random((500, 3)) * 3 - 1.5).astype(np.float32)
    direction = RANDOM.normal(size=(500, 3)).astype(np.float32)
    hit, normal, any_hit = zeros(500, wp.vec4), zeros(500, wp.vec3), zeros(500, bool)
    inputs = [mesh.id, array(start), array(direction), hit, normal, any_hit]
    wp.launch(cast, dim=500, inputs=inputs, device="cpu")
    face, t, sign = hit.numpy()[:, 0].astype(int), hit.numpy()[:, 1], hit.numpy()[:, 2]
    met = face >= 0
    assert (any_hit.numpy() == met).all() and 100 < met.sum() < 500
    assert met[np.linalg.norm(start, axis=1) < 0.95].all()
    where = start[met] + t[met, None] * direction[met]
    corners = points[faces[face[met]]].astype(float)
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    assert np.allclose(((where - corners[:, 0]) * n).sum(1), 0, atol=1e-5)
    assert np.allclose(normal.numpy()[met], n, atol=1e-4)
    assert (sign[met] == np.where((n * direction[met]).sum(1) < 0, 1, -1)).all()


def test_overlaps_both_ways():
    points, faces = sphere()
    mesh = make(points, faces)
    low = (RANDOM.random((100, 3)) * 2 - 1.2).astype(np.float32)
    counts = wp.zeros((100, 2), dtype=int, device="cpu")
    wp.launch(overlaps, dim=100, inputs=[mesh.id, array(low), 0.4, counts], device="cpu")
    corners = points[faces]
    high = low + np.float32(0.4)
    touch = (corners.min(1)[None] <= high[:, None]) & (corners.max(1)[None] >= low[:, None])
    touch = touch.all(2)
    assert (counts.numpy()[:, 0] == touch.sum(1)).all() and touch.sum() > 100
    assert (counts.numpy()[:, 1] == (touch * (np.arange(len(faces)) + 1)).sum(1)).all()


def test_refit_and_new_points():
    points, faces = sphere()
    mesh = make(points, faces)
    mesh.points = array(points * 2)
    at, sign = zeros(1, wp.vec3), zeros(1)
    wp.launch(closest, dim=1, inputs=[mesh.id, array([[0, 0, 3]]), 9.0, at, sign], device="cpu")
    assert np.allclose(at.numpy(), [[0, 0, 2]])


def test_bad_input():
    points, faces = sphere()
    with pytest.raises(RuntimeError, match="face 2 has the index 9999"):
        make(points, np.array([[0, 1, 2], [1, 2, 3], [0, 9999, 1]], np.int32))
    with pytest.raises(RuntimeError, match="face 0 has the index -1"):
        make(points, np.array([[-1, 1, 2]], np.int32))
    with pytest.raises(RuntimeError, match="three indices"):
        make(points, np.array([0, 1], np.int32))
    with pytest.raises(RuntimeError, match="vec3"):
        wp.Mesh(zeros(3), wp.array([0, 1, 2], dtype=int, device="cpu"))
    with pytest.raises(ValueError, match="constructor"):
        make(points, faces, bvh_constructor="octree")
    make(points, faces, bvh_constructor="cubql")
    mesh = make(points, faces)
    grid = wp.HashGrid(2, 2, 2, device="cpu")
    freed = mesh.id
    del mesh
    for handle, got in ((freed, "freed Mesh"), (grid.id, "that of a HashGrid")):
        with pytest.raises(wp.WarpLaunchError, match=f"argument 'mesh'.*{got}"):
            wp.launch(closest_by_normal, dim=1, inputs=[handle, array(points), 1.0, zeros(1)])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_faces_that_are_not_finite_are_counted(bad):
    points, faces = sphere()
    points = points.copy()
    points[0] = bad
    mesh = make(points, faces)
    assert mesh.report.skipped == 24
    empty = make(points, np.zeros((0, 3), np.int32))
    at, sign = zeros(2, wp.vec3), zeros(2)
    x = array([[0, 0, -3], [bad, 0, 0]])
    wp.launch(closest, dim=2, inputs=[mesh.id, x, 9.0, at, sign], device="cpu")
    assert np.allclose(at.numpy(), [[0, 0, -1], [0, 0, 0]]) and sign.numpy()[1] == 0
    wp.launch(closest, dim=1, inputs=[empty.id, x, 9.0, at, sign], device="cpu")


def _record(out: wp.array2d(dtype=float), n: int, found: bool, side: float, place: wp.vec3):
    out[n, 0] = float(found)
    out[n, 1] = side
    for k in range(3):
        out[n, 2 + k] = place[k]


record = wp.func(_record)


@wp.kernel(enable_backward=False)
def into_variables(mesh: wp.uint64, at: wp.vec3, out: wp.array2d(dtype=float)):
    side = float(0.0)
    face = int(-1)
    u = float(0.0)
    v = float(0.0)
    r = wp.mesh_query_point(mesh, at, 9.0, side, face, u, v)
    record(out, 0, r, side, wp.mesh_eval_position(mesh, face, u, v))
    r = wp.mesh_query_point_no_sign(mesh, at, 9.0, face, u, v)
    record(out, 1, r, 0.0, wp.mesh_eval_position(mesh, face, u, v))
    r = wp.mesh_query_furthest_point_no_sign(mesh, at, 0.0, face, u, v)
    record(out, 2, r, 0.0, wp.mesh_eval_position(mesh, face, u, v))
    r = wp.mesh_query_point_sign_normal(mesh, at, 9.0, side, face, u, v)
    record(out, 3, r, side, wp.mesh_eval_position(mesh, face, u, v))
    r = wp.mesh_query_point_sign_normal(mesh, at, 9.0, side, face, u, v, epsilon=0.01)
    record(out, 4, r, side, wp.mesh_eval_position(mesh, face, u, v))
    r = wp.mesh_query_point_sign_winding_number(mesh, at, 9.0, side, face, u, v)
    record(out, 5, r, side, wp.mesh_eval_position(mesh, face, u, v))
    r = wp.mesh_query_point_sign_parity(mesh, at, 9.0, side, face, u, v)
    record(out, 6, r, side, wp.mesh_eval_position(mesh, face, u, v))


def test_queries_into_variables(device):
    """A cube of side 2 around the origin: closest points and the furthest corner are known."""
    corners = np.array(
        [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float32
    )
    faces = [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
    mesh = wp.Mesh(
        wp.array(corners, dtype=wp.vec3, device=device),
        wp.array(np.ravel(faces), dtype=int, device=device),
        support_winding_number=True,
    )
    for at, side, near in (
        ([1.5, 0.25, 0.5], 1, [1, 0.25, 0.5]),
        ([0.75, 0.25, 0.5], -1, [1, 0.25, 0.5]),
    ):
        out = wp.zeros((7, 5), dtype=float, device=device)
        wp.launch(into_variables, 1, [mesh.id, wp.vec3(at), out], device=device)
        expected = np.array([[1, side, *near]] * 7, dtype=float)
        expected[1:3, 1] = 0.0
        expected[2, 2:] = [-1, -1, -1]
        np.testing.assert_allclose(out.numpy(), expected, atol=1e-6)
