"""Closest points among thin triangles: each kind of query finds the face that float64 finds."""

import numpy as np
import pytest

import warp as wp
from spheres import sphere


def strip(width, rows=4, size=1.0, center=(0.0, 0.0, 0.0)):
    """Needles side by side in a plane: rows of `width`, of length 1."""
    y = np.arange(rows + 1) * width
    points = np.concatenate([np.stack([x + 0 * y, y, 0 * y], 1) for x in (0.0, 1.0)])
    n = rows + 1
    corners = [f for i in range(rows) for f in ((i, n + i, n + i + 1), (i, n + i + 1, i + 1))]
    return (points * size + center).astype(np.float32), np.array(corners)


def caps(height, rows=4):
    """Triangles with an angle of almost 180 degrees, stacked; no symmetry of axes is left."""
    rng = np.random.default_rng(2)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    low = np.arange(rows)[:, None] * height
    a = np.concatenate([0 * low, low, 0 * low], 1)
    b = a + [1.0, 0.0, 0.0]
    c = a + np.stack([rng.uniform(0.2, 0.8, rows), np.full(rows, height), 0 * low[:, 0]], 1)
    points = np.stack([a, b, c], 1).reshape(-1, 3) @ turn.T
    return points.astype(np.float32), np.arange(3 * rows).reshape(-1, 3)


def distances(p, points, faces):
    """Distances to all faces in float64, by the regions of a triangle."""
    p = p.astype(np.float64)[:, None]
    a, b, c = (points.astype(np.float64)[faces[:, i]][None] for i in range(3))

    def to_segment(s, e):
        d = e - s
        length2 = (d * d).sum(-1)
        t = ((p - s) * d).sum(-1) / np.where(length2 > 0, length2, 1.0)
        return np.linalg.norm(s + np.clip(t, 0, 1)[..., None] * d - p, axis=-1)

    best = np.minimum(np.minimum(to_segment(a, b), to_segment(b, c)), to_segment(c, a))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=-1)
    inside = area > 0
    for s, e in ((a, b), (b, c), (c, a)):
        inside = inside & ((np.cross(e - s, p - s) * normal).sum(-1) >= 0)
    off = np.abs(((p - a) * normal).sum(-1)) / np.where(area > 0, area, 1.0)
    return np.where(inside, np.minimum(best, off), best)


@wp.kernel
def ask(
    mesh: wp.uint64,
    p: wp.array(dtype=wp.vec3),
    kind: int,
    reach: float,
    at: wp.array(dtype=wp.vec3),
    face: wp.array(dtype=int),
):
    i = wp.tid()
    q = wp.mesh_query_point_no_sign(mesh, p[i], reach)
    if kind == 1:
        q = wp.mesh_query_point(mesh, p[i], reach)
    elif kind == 2:
        q = wp.mesh_query_point_sign_normal(mesh, p[i], reach)
    elif kind == 3:
        q = wp.mesh_query_point_sign_winding_number(mesh, p[i], reach)
    elif kind == 4:
        q = wp.mesh_query_point_sign_parity(mesh, p[i], reach)
    face[i] = q.face
    at[i] = wp.mesh_eval_position(mesh, q.face, q.u, q.v)


@wp.kernel
def touch(mesh: wp.uint64, p: wp.array(dtype=wp.vec3), reach: float, n: wp.array(dtype=int)):
    i = wp.tid()
    for _face in wp.mesh_query_sphere(mesh, p[i], reach):
        n[i] += 1


def made(points, faces, device):
    corners = wp.array(faces.ravel(), dtype=int, device=device)
    return wp.Mesh(wp.array(points, dtype=wp.vec3, device=device), corners)


def answers(mesh, p, kind=0, reach=1e6):
    device = mesh.device
    at = wp.zeros(len(p), dtype=wp.vec3, device=device)
    face = wp.zeros(len(p), dtype=int, device=device)
    where = wp.array(p, dtype=wp.vec3, device=device)
    wp.launch(ask, len(p), inputs=[mesh.id, where, kind, reach, at, face], device=device)
    return at.numpy().astype(np.float64), face.numpy()


def around(points, faces, count=1500, offset=0.0):
    """Points on the faces, and at a distance from them."""
    rng = np.random.default_rng(0)
    weights = rng.dirichlet([1, 1, 1], count)
    corners = points.astype(np.float64)[faces[rng.integers(len(faces), size=count)]]
    p = (weights[..., None] * corners).sum(1)
    return (p + offset * rng.normal(size=p.shape)).astype(np.float32)


SCENES = [(strip, w) for w in (0.2, 0.03, 0.004, 1e-4, 1e-6)] + [
    (caps, h) for h in (0.1, 0.004, 1e-5)
]


@pytest.mark.parametrize("scene, thickness", SCENES)
@pytest.mark.parametrize("offset", [0.0, 1e-3, 0.5])
def test_no_other_face_is_closer(device, scene, thickness, offset):
    """The face and the point of it are as near as any, whichever query asks."""
    points, faces = scene(thickness)
    p = around(points, faces, offset=offset)
    wanted = distances(p, points, faces)
    mesh = made(points, faces, device)
    for kind in range(5):
        at, face = answers(mesh, p, kind)
        best = wanted.min(1)
        assert np.abs(np.linalg.norm(at - p, axis=1) - best).max() < 3e-6
        assert (wanted[np.arange(len(p)), face] - best).max() < 3e-6


@pytest.mark.parametrize("size, center", [(1e-3, (1.0, -1.0, 1.0)), (1e12, (0, 0, 0)), (64, 1000)])
def test_at_any_size_and_place(device, size, center):
    points, faces = strip(0.004, size=size, center=center)
    p = around(points, faces)
    best = distances(p, points, faces).min(1)
    at, _ = answers(made(points, faces, device), p)
    resolved = np.spacing(np.float32(np.abs(points).max()))
    assert np.abs(np.linalg.norm(at - p, axis=1) - best).max() < 3e-6 * size + 2 * resolved


def test_a_bound_below_the_old_error_finds_what_is_there(device):
    """Points on the strip are nearer than any bound, and balls around them touch it."""
    points, faces = strip(0.004)
    p = around(points, faces)
    mesh = made(points, faces, device)
    _, face = answers(mesh, p, reach=1e-5)
    assert (face >= 0).all()
    n = wp.zeros(len(p), dtype=int, device=device)
    where = wp.array(p, dtype=wp.vec3, device=device)
    wp.launch(touch, len(p), inputs=[mesh.id, where, 1e-5, n], device=device)
    assert (n.numpy() >= 1).all()


def test_near_duplicates_of_faces(device):
    """The nearer one of two faces that almost coincide is as near as float32 can tell."""
    points, faces = strip(0.004)
    lifted = points + np.float32([0, 0, 1e-5])
    both = np.concatenate([points, lifted]), np.concatenate([faces, faces + len(points)])
    p = around(points, faces, offset=1e-4)
    wanted = distances(p, *both)
    _, face = answers(made(*both, device), p)
    assert (wanted[np.arange(len(p)), face] - wanted.min(1)).max() < 1e-6


def test_signs_of_a_body_of_needles(device):
    """A ball squeezed to a needle: inside and outside by all ways to tell."""
    points, faces = sphere()
    points = (points * [1.0, 0.004, 0.004]).astype(np.float32)
    mesh = made(points, faces, device)
    inner = (0.6 * points).astype(np.float32)
    outer = (1.5 * points).astype(np.float32)

    @wp.kernel
    def sides(mesh: wp.uint64, p: wp.array(dtype=wp.vec3), out: wp.array2d(dtype=float)):
        i = wp.tid()
        out[i, 0] = wp.mesh_query_point(mesh, p[i], 10.0).sign
        out[i, 1] = wp.mesh_query_point_sign_normal(mesh, p[i], 10.0).sign
        out[i, 2] = wp.mesh_query_point_sign_winding_number(mesh, p[i], 10.0).sign
        out[i, 3] = wp.mesh_query_point_sign_parity(mesh, p[i], 10.0).sign

    for p, wanted in ((inner, -1.0), (outer, 1.0)):
        out = wp.zeros((len(p), 4), dtype=float, device=device)
        where = wp.array(p, dtype=wp.vec3, device=device)
        wp.launch(sides, len(p), inputs=[mesh.id, where, out], device=device)
        assert (out.numpy() == wanted).all()
