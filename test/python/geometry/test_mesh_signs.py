"""Sides of meshes by winding numbers, parity and crossings, and signed distances."""

import numpy as np
import pytest

import warp as wp
from solid_angles import exact_winding


def cylinder(n=40, caps=True):
    """A closed cylinder of radius 1 and |z| < 1, or its open wall."""
    angle = 2 * np.pi * np.arange(n) / n
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    low = np.column_stack([ring, np.full(n, -1.0)])
    points = np.concatenate([low, low + [0, 0, 2], [[0, 0, -1], [0, 0, 1]]])
    i = np.arange(n)
    j = (i + 1) % n
    faces = [np.stack([i, j, j + n], 1), np.stack([i, j + n, i + n], 1)]
    if caps:
        bottom, top = np.full(n, 2 * n), np.full(n, 2 * n + 1)
        faces += [np.stack([bottom, j, i], 1), np.stack([top, i + n, j + n], 1)]
    return points.astype(np.float32), np.concatenate(faces).astype(np.int32)


def mesh_of(points, faces, device, **options):
    return wp.Mesh(
        wp.array(points, dtype=wp.vec3, device=device),
        wp.array(faces.ravel(), dtype=int, device=device),
        **options,
    )


@wp.kernel
def sides(mesh: wp.uint64, p: wp.array(dtype=wp.vec3), out: wp.array2d(dtype=float)):
    i = wp.tid()
    out[i, 0] = wp.mesh_query_point_sign_winding_number(mesh, p[i], 100.0).sign
    out[i, 1] = wp.mesh_query_point_sign_parity(mesh, p[i], 100.0).sign
    out[i, 2] = wp.mesh_query_point_sign_parity(mesh, p[i], 100.0, 5, 0.4).sign
    out[i, 3] = wp.mesh_query_point(mesh, p[i], 100.0).sign
    inside = float(0.0)
    face = int(0)
    u = float(0.0)
    v = float(0.0)
    if wp.mesh_query_point_sign_winding_number(mesh, p[i], 100.0, inside, face, u, v):
        out[i, 4] = inside


def sides_of(mesh, p):
    out = wp.zeros((len(p), 5), dtype=float, device=mesh.device)
    x = wp.array(p, dtype=wp.vec3, device=mesh.device)
    wp.launch(sides, dim=len(p), inputs=[mesh.id, x, out], device=mesh.device)
    return out.numpy()


def samples(n=400):
    return np.random.default_rng(0).uniform(-1.6, 1.6, (n, 3)).astype(np.float32)


@pytest.mark.parametrize("moments", [True, False])
def test_all_ways_agree_on_a_closed_mesh(device, moments):
    points, faces = cylinder()
    p = samples()
    winding = exact_winding(points[faces], p)
    assert np.abs(winding - np.round(winding)).max() < 1e-6
    wanted = np.where(winding > 0.5, -1.0, 1.0)
    found = sides_of(mesh_of(points, faces, device, support_winding_number=moments), p)
    assert (found == wanted[:, None]).all()


def test_winding_numbers_close_an_open_wall(device):
    points, faces = cylinder(caps=False)
    p = samples()
    wanted = np.where(exact_winding(points[faces], p) > 0.5, -1.0, 1.0)
    mesh = mesh_of(points, faces, device, support_winding_number=True)
    assert (sides_of(mesh, p)[:, 0] == wanted).all()
    mesh.points = wp.array(2 * points, dtype=wp.vec3, device=device)
    assert (sides_of(mesh, 2 * p)[:, 0] == wanted).all()


@wp.kernel
def crossings(
    mesh: wp.uint64,
    start: wp.array(dtype=wp.vec3),
    dir: wp.array(dtype=wp.vec3),
    out: wp.array(dtype=int),
):
    i = wp.tid()
    out[i] = wp.mesh_query_ray_count_intersections(mesh, start[i], dir[i])


def test_rays_through_edges_and_corners_cross_once(device):
    points, faces = cylinder(8)
    mesh = mesh_of(points, faces, device)
    # To the corners, the middles of edges, along the axis through two fans.
    targets = np.concatenate([points, (points[:8] + points[8:16]) / 2, points[16:]])
    count = len(targets)
    start = wp.zeros(count, dtype=wp.vec3, device=device)
    out = wp.zeros(count, dtype=int, device=device)
    dirs = wp.array(targets, dtype=wp.vec3, device=device)
    wp.launch(crossings, dim=count, inputs=[mesh.id, start, dirs, out], device=device)
    assert (out.numpy() == 1).all()
    outside = wp.array(-4.0 * targets, dtype=wp.vec3, device=device)
    wp.launch(crossings, dim=count, inputs=[mesh.id, outside, dirs, out], device=device)
    assert (out.numpy() == 2).all()


@wp.kernel
def signed(mesh: wp.uint64, p: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = wp.mesh_sdf(mesh, p[i], 10.0)


def test_signed_distance_of_a_box_and_its_derivative(device):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * 2.0 - 1.0
    faces = np.array(
        [
            *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
            *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
        ]
    )
    mesh = mesh_of(corners, faces, device)
    p = samples(200)
    q = np.abs(p.astype(np.float64)) - 1.0
    wanted = np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)
    x = wp.array(p, dtype=wp.vec3, device=device, requires_grad=True)
    out = wp.zeros(200, dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(signed, dim=200, inputs=[mesh.id, x, out], device=device)
    assert np.abs(out.numpy() - wanted).max() < 1e-6
    tape.backward(grads={out: wp.ones_like(out)})
    outer = np.maximum(q, 0) * np.sign(p)
    inner = (q == q.max(axis=1)[:, None]) * np.sign(p)
    away = np.where((q > 0).any(axis=1)[:, None], outer, inner)
    away /= np.linalg.norm(away, axis=1)[:, None]
    assert np.abs(x.grad.numpy() - away).max() < 1e-4


def test_arrays_of_a_mesh(device):
    @wp.kernel
    def read(mesh: wp.uint64, out: wp.array(dtype=wp.vec3)):
        arrays = wp.mesh_get(mesh)
        out[0] = arrays.points[arrays.indices[4]]
        out[1] = arrays.velocities[0]
        out[2] = wp.vec3(float(len(arrays.indices)), 0.0, 0.0)

    points, faces = cylinder(8)
    moving = wp.array(points + 1, dtype=wp.vec3, device=device)
    mesh = mesh_of(points, faces, device, velocities=moving)
    out = wp.zeros(3, dtype=wp.vec3, device=device)
    wp.launch(read, dim=1, inputs=[mesh.id, out], device=device)
    wanted = [points[faces.ravel()[4]], points[0] + 1, [faces.size, 0, 0]]
    assert np.allclose(out.numpy(), wanted)
