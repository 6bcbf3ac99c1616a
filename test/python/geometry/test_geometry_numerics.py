"""Geometry where digits are few: winding numbers of broken shells, needles, the middle of gaps."""

import numpy as np
import pytest

import warp as wp
from solid_angles import exact_winding
from spheres import sphere

RANDOM = np.random.default_rng(21)


def joined(*meshes):
    """Several meshes as one."""
    sizes = np.cumsum([0] + [len(points) for points, _ in meshes])
    faces = [faces + start for (_, faces), start in zip(meshes, sizes, strict=False)]
    return np.concatenate([points for points, _ in meshes]), np.concatenate(faces)


def shells():
    points, faces = sphere()
    turned = faces.copy()
    turned[::2] = turned[::2, ::-1]
    hole = points[faces].mean(axis=1)[:, 2] < 0.6
    return {
        "closed": (points, faces),
        "open": (points, faces[hole]),
        "through itself": joined((points, faces), sphere(9, (0.7, 0.1, -0.2))),
        "twice": joined((points, faces), (points, faces)),
        "inside out": (points, faces[:, ::-1]),
        "turned here and there": (points, turned),
        "in another, inside out": joined((points, faces), sphere(8, (0, 0.1, 0), -0.5)),
    }


SHELLS = shells()


@wp.kernel
def is_inside(
    mesh: wp.uint64,
    p: wp.array(dtype=wp.vec3),
    accuracy: float,
    thresholds: wp.array(dtype=float),
    out: wp.array(dtype=float),
):
    i = wp.tid()
    query = wp.mesh_query_point_sign_winding_number(mesh, p[i], 100.0, accuracy, thresholds[i])
    out[i] = query.sign


def sides(mesh, p, thresholds, accuracy=2.0):
    device = mesh.device
    out = wp.zeros(len(p), dtype=float, device=device)
    given = [wp.array(p, dtype=wp.vec3, device=device), accuracy]
    limits = wp.array(np.broadcast_to(thresholds, len(p)), dtype=float, device=device)
    wp.launch(is_inside, len(p), inputs=[mesh.id, *given, limits, out], device=device)
    return out.numpy()


def mesh_of(points, faces, device, **options):
    corners = wp.array(faces.ravel(), dtype=int, device=device)
    return wp.Mesh(wp.array(points, dtype=wp.vec3, device=device), corners, **options)


@pytest.mark.parametrize("has_moments", [True, False])
@pytest.mark.parametrize("shell", SHELLS)
def test_winding_numbers_are_exact_to_a_thousandth(device, shell, has_moments):
    """The number is between thresholds on which side it is found."""
    points, faces = SHELLS[shell]
    p = RANDOM.uniform(-1.7, 1.7, (300, 3)).astype(np.float32)
    winding = exact_winding(points[faces], p)
    mesh = mesh_of(points, faces, device, support_winding_number=has_moments)
    assert (sides(mesh, p, winding - 1e-3) == -1).all()
    assert (sides(mesh, p, winding + 1e-3) == 1).all()
    is_clear = np.abs(winding - 0.5) > 1e-5
    found = sides(mesh, p, 0.5)
    assert (found == np.where(winding > 0.5, -1, 1))[is_clear].all()
    for accuracy in (1.0, 4.0, 100.0):
        assert (sides(mesh, p, 0.5, accuracy) == found)[is_clear].all()


@pytest.mark.parametrize("shell", SHELLS)
def test_points_on_a_surface_have_a_side(device, shell):
    points, faces = SHELLS[shell]
    middles = points[faces].mean(axis=1, dtype=np.float32)
    p = np.concatenate([points, middles, (points[faces[:, 0]] + points[faces[:, 1]]) / 2])
    first, second = (
        sides(mesh_of(points, faces, device, support_winding_number=True), p, 0.5) for _ in range(2)
    )
    assert (np.abs(first) == 1).all() and (first == second).all()


@wp.kernel
def measure_area(sides: wp.array(dtype=wp.vec3d), out: wp.array(dtype=wp.float64)):
    """Kahan's formula, in which each pair of parentheses counts; sides in descending order."""
    i = wp.tid()
    a = sides[i][0]
    b = sides[i][1]
    c = sides[i][2]
    out[i] = wp.float64(0.25) * wp.sqrt(
        (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c))
    )


def test_area_of_a_needle_by_its_sides(device):
    import mpmath

    given = np.array([[100000.0, 99999.99979, 0.00029], [1e8, 1e8, 1e-8], [5.0, 4.0, 3.0]])
    out = wp.zeros(3, dtype=wp.float64, device=device)
    wp.launch(
        measure_area, 3, inputs=[wp.array(given, dtype=wp.vec3d, device=device), out], device=device
    )
    with mpmath.workdps(60):
        exact = []
        for sides in given:
            a, b, c = (mpmath.mpf(float(side)) for side in sides)
            s = (a + b + c) / 2
            exact.append(float(mpmath.sqrt(s * (s - a) * (s - b) * (s - c))))
    np.testing.assert_allclose(out.numpy(), exact, rtol=1e-14)
    assert out.numpy()[0] == pytest.approx(10.000000077, rel=1e-9)


@wp.kernel
def distance(mesh: wp.uint64, p: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = wp.mesh_sdf(mesh, p[i], 10.0)


def distance_and_gradient(mesh, p):
    device = mesh.device
    x = wp.array(p, dtype=wp.vec3, device=device, requires_grad=True)
    out = wp.zeros(len(p), dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(distance, len(p), inputs=[mesh.id, x, out], device=device)
    out.grad.fill_(1.0)
    tape.backward()
    return out.numpy(), x.grad.numpy()


def test_between_two_walls_the_gradient_leads_away_from_one_of_them(device):
    gap = 1e-3
    quad = np.array([[0, 1, 2], [0, 2, 3]])
    wall = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=np.float32)
    points, faces = joined((wall, quad), (wall + [0, 0, gap], quad[:, ::-1]))
    points = points.astype(np.float32)
    x = RANDOM.uniform(-0.5, 0.5, (200, 3))
    x[:, 2] = RANDOM.uniform(0, gap, 200)
    x[:50, 2] = np.float32(gap) / 2
    x = x.astype(np.float32)
    value, gradient = distance_and_gradient(mesh_of(points, faces, device), x)
    z, top = x[:, 2].astype(float), float(np.float32(gap))
    np.testing.assert_allclose(np.abs(value), np.minimum(z, top - z), rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(gradient, axis=1), 1.0, atol=1e-6)
    np.testing.assert_allclose(np.abs(gradient[:, 2]), 1.0, atol=1e-6)
    assert np.isfinite(gradient).all()


def test_gradients_at_needles_and_caps_are_finite_and_of_length_one(device):
    points = np.array(
        [[0, 0, 0], [1, 0, 0], [0.5, 1e-6, 0], [2, 0, 0], [3, 0, 0], [3.0, 1e-6, 0]], np.float32
    )
    mesh = mesh_of(points, np.array([[0, 1, 2], [3, 4, 5]]), device)
    p = RANDOM.uniform(-0.5, 3.5, (400, 3)).astype(np.float32)
    value, gradient = distance_and_gradient(mesh, p)
    # All of the surface is within 1e-6 of two segments.
    along = np.minimum(
        np.abs(p[:, 0] - np.clip(p[:, 0], 0, 1)), np.abs(p[:, 0] - np.clip(p[:, 0], 2, 3))
    )
    expected = np.linalg.norm(np.column_stack([along, p[:, 1:]]).astype(float), axis=1)
    np.testing.assert_allclose(np.abs(value), expected, atol=2e-6, rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(gradient, axis=1), 1.0, atol=1e-5)
