"""Meshes that were not made for winding numbers: the first launch that asks prepares them."""

import numpy as np
import pytest

import warp as wp
from solid_angles import exact_winding
from warp._src.geometry import mesh as meshes


@wp.func
def side_of(mesh: wp.uint64, p: wp.vec3, limit: float):
    return wp.mesh_query_point_sign_winding_number(mesh, p, 100.0, 2.0, limit).sign


@wp.struct
class Scene:
    radius: float
    mesh: wp.uint64


@wp.kernel
def ask(
    mesh: wp.uint64,
    p: wp.array(dtype=wp.vec3),
    limits: wp.array(dtype=float),
    out: wp.array(dtype=float),
):
    i = wp.tid()
    out[i] = side_of(mesh, p[i], limits[i])


@wp.kernel
def ask_scene(
    scene: Scene,
    p: wp.array(dtype=wp.vec3),
    limits: wp.array(dtype=float),
    out: wp.array(dtype=float),
):
    i = wp.tid()
    out[i] = side_of(scene.mesh, p[i], limits[i])


@wp.kernel
def ask_first(
    ids: wp.array(dtype=wp.uint64),
    p: wp.array(dtype=wp.vec3),
    limits: wp.array(dtype=float),
    out: wp.array(dtype=float),
):
    i = wp.tid()
    out[i] = side_of(ids[0], p[i], limits[i])


@wp.kernel
def find_distance(mesh: wp.uint64, p: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
    i = wp.tid()
    q = wp.mesh_query_point_no_sign(mesh, p[i], 100.0)
    out[i] = wp.length(wp.mesh_eval_position(mesh, q.face, q.u, q.v) - p[i])


def soup(seed=3, n=500):
    """Triangles that are no surface: winding numbers are all but whole."""
    random = np.random.default_rng(seed)
    corners = random.uniform(-1, 1, (n, 1, 3)) + random.uniform(-0.3, 0.3, (n, 3, 3))
    return corners.astype(np.float32)


def mesh_of(corners, device, **options):
    points = wp.array(corners.reshape(-1, 3), dtype=wp.vec3, device=device)
    return wp.Mesh(
        points, wp.array(np.arange(3 * len(corners)), dtype=int, device=device), **options
    )


def check(kernel, given, corners, device):
    """Numbers a little below and above the exact one are told apart."""
    p = np.random.default_rng(1).uniform(-1.5, 1.5, (300, 3)).astype(np.float32)
    exact = exact_winding(corners, p)
    x = wp.array(p, dtype=wp.vec3, device=device)
    out = wp.zeros(len(p), dtype=float, device=device)
    for shift, wanted in ((-1e-3, -1), (1e-3, 1)):
        limits = wp.array((exact + shift).astype(np.float32), dtype=float, device=device)
        wp.launch(kernel, len(p), inputs=[given, x, limits, out], device=device)
        assert (out.numpy() == wanted).all()


@pytest.mark.parametrize("constructor", [None, "sah"])
def test_a_launch_prepares_the_mesh_it_gets(device, constructor):
    corners = soup()
    mesh, other = (mesh_of(corners, device, bvh_constructor=constructor) for _ in range(2))
    check(ask, mesh.id, corners, device)
    assert mesh.support_winding_number and not other.support_winding_number
    assert meshes._without_winding.get(mesh.id) is None
    assert meshes._without_winding.get(other.id) is other
    check(ask_scene, Scene(radius=1.0, mesh=other.id), corners, device)
    assert other.support_winding_number


@pytest.mark.parametrize("constructor", [None, "sah"])
def test_later_refits_and_builds_keep_it(device, constructor):
    mesh = mesh_of(soup(), device, bvh_constructor=constructor)
    mesh.refit()
    check(ask, mesh.id, soup(), device)
    moved = soup(seed=5)
    for change in (mesh.refit, mesh.rebuild):
        moved = moved[::-1].copy() * np.float32(1.5)
        mesh.points.assign(moved.reshape(-1, 3))
        change()
        check(ask, mesh.id, moved, device)


def test_positions_that_were_not_taken_over_are_not(device):
    corners = soup()
    mesh = mesh_of(corners, device)
    mesh.points.assign(-corners.reshape(-1, 3))
    check(ask, mesh.id, corners, device)


def test_ids_in_arrays_are_asked_face_by_face(device):
    corners = soup()
    mesh = mesh_of(corners, device)
    check(ask_first, wp.array([mesh.id], dtype=wp.uint64, device=device), corners, device)
    assert not mesh.support_winding_number


def test_other_queries_prepare_nothing(device):
    mesh = mesh_of(soup(), device)
    x = wp.zeros(4, dtype=wp.vec3, device=device)
    out = wp.zeros(4, dtype=float, device=device)
    wp.launch(find_distance, 4, inputs=[mesh.id, x, out], device=device)
    assert not mesh.support_winding_number
