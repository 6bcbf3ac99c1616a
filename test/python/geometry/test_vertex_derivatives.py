"""Distances and closest points by the vertices of a mesh, against differences in float64."""

import numpy as np
import pytest

from mesh_derivatives import (
    arrays,
    away,
    closest,
    differences,
    faces_of,
    foot,
    mesh_of,
    reverse,
    shell,
)
from mesh_derivatives import run as launch_of

RANDOM = np.random.default_rng(12)


@pytest.fixture(scope="module")
def scene():
    points, faces = shell()
    return points, faces, RANDOM.standard_normal(points.shape).astype(np.float32)


def test_closest_points_follow_vertices_and_velocities(scene):
    points, faces, velocities = scene
    mesh = mesh_of(points, faces, velocities)
    x = (RANDOM.random((120, 3)) * 4 - 2).astype(np.float32)
    weights = RANDOM.standard_normal((120, 8)).astype(np.float32)
    tape, out = reverse(launch_of(closest, mesh, [x], 8), weights)
    found = faces_of(mesh, x)

    def value(i, *corners):
        at, w = foot(x[i].astype(float), *corners)
        w3 = np.array([*w, 1 - w.sum()])
        return np.concatenate([at, w, w3 @ velocities[faces[found[i]]].astype(float)])

    expected = differences(value, points, faces, found, weights)
    for i in range(120):
        assert np.allclose(out[i], value(i, *points[faces[found[i]]].astype(float)), atol=2e-5)
    scale = np.abs(expected).max()
    assert np.abs(mesh.points.grad.numpy() - expected).max() < 2e-4 * scale
    by_velocity = np.zeros(points.shape)
    for i, face in enumerate(found):
        u, v = out[i, 3:5]
        by_velocity[faces[face]] += np.outer([u, v, 1 - u - v], weights[i, 5:])
    assert np.allclose(mesh.velocities.grad.numpy(), by_velocity, atol=1e-5)
    # Inner points, edges and corners were met.
    zeros = (np.stack([out[:, 3], out[:, 4], 1 - out[:, 3] - out[:, 4]]) < 1e-6).sum(0)
    assert all((zeros == k).sum() > 5 for k in range(3))
    tape.zero()
    assert not mesh.points.grad.numpy().any()


def test_distances_and_arrays_follow_vertices(scene):
    points, faces, velocities = scene
    mesh = mesh_of(points, faces, velocities)
    x = (RANDOM.random((100, 3)) * 4 - 2).astype(np.float32)
    weights = RANDOM.standard_normal((100, 1)).astype(np.float32)
    _, out = reverse(launch_of(away, mesh, [x], 1), weights)
    found = faces_of(mesh, x)

    def value(i, *corners):
        at, _ = foot(x[i].astype(float), *corners)
        return np.sign(out[i]) * np.linalg.norm(at - x[i])

    expected = differences(value, points, faces, found, weights)
    assert np.abs(mesh.points.grad.numpy() - expected).max() < 2e-4
    mesh.points.grad.zero_()
    n = mesh.indices.size
    weights = RANDOM.standard_normal((n, 1)).astype(np.float32)
    reverse(launch_of(arrays, mesh, [], 1), weights)
    expected = np.zeros(points.shape)
    rows = velocities[faces.ravel()] + [3, 0, 0]
    np.add.at(expected, faces.ravel(), weights * rows)
    assert np.allclose(mesh.points.grad.numpy(), expected, atol=1e-5)
