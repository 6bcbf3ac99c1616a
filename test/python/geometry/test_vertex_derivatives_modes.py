"""Rays by the vertices of a mesh, forward mode, and gradients that come and go."""

import numpy as np
import pytest

import warp as wp
from mesh_derivatives import away, closest, differences, hit, meet, mesh_of, reverse, run, shell

RANDOM = np.random.default_rng(13)


@pytest.fixture(scope="module")
def scene():
    points, faces = shell()
    return points, faces, RANDOM.standard_normal(points.shape).astype(np.float32)


def test_rays_follow_vertices(scene):
    points, faces, velocities = scene
    mesh = mesh_of(points, faces, velocities)
    start = (3 * RANDOM.standard_normal((80, 3))).astype(np.float32)
    aim = (-start + 0.3 * RANDOM.standard_normal((80, 3))).astype(np.float32)
    weights = RANDOM.standard_normal((80, 6)).astype(np.float32)
    launch = run(meet, mesh, [start, aim], 6)
    out = launch().numpy()
    corners = points[faces].astype(float)
    met = np.array(
        [
            np.argmin([np.abs(hit(s, d, *abc) - row).max() for abc in corners])
            for s, d, row in zip(start.astype(float), aim.astype(float), out, strict=True)
        ]
    )
    # Rays that hit head on; others amplify rounding.
    normal = out[:, 3:] * aim / np.linalg.norm(aim, axis=1, keepdims=True)
    weights[np.abs(normal.sum(1)) < 0.3] = 0
    assert (weights[:, 0] != 0).sum() > 40
    reverse(launch, weights)

    def value(i, *abc):
        return hit(start[i].astype(float), aim[i].astype(float), *abc)

    expected = differences(value, points, faces, met, weights)
    scale = np.abs(expected).max()
    assert np.abs(mesh.points.grad.numpy() - expected).max() < 2e-4 * scale


@pytest.mark.parametrize("kernel, columns", [(closest, 8), (meet, 6), (away, 1)])
def test_forward_mode_is_the_transpose(scene, kernel, columns):
    points, faces, velocities = scene
    mesh = mesh_of(points, faces, velocities)
    start = (2 * RANDOM.standard_normal((60, 3))).astype(np.float32)
    inputs = [start, -start] if kernel is meet else [start]
    launch = run(kernel, mesh, inputs, columns)
    weights = RANDOM.standard_normal((60, columns)).astype(np.float32)
    reverse(launch, weights)
    along = RANDOM.standard_normal((3, *points.shape)).astype(np.float32)
    tangents = wp.autograd.jvp(
        launch, [mesh.points], [wp.array(along, dtype=wp.vec3, device="cpu")]
    ).numpy()
    one = wp.autograd.jvp(
        launch, [mesh.points], [wp.array(along[1], dtype=wp.vec3, device="cpu")]
    ).numpy()
    for k in range(3):
        left = (tangents[k].astype(float) * weights).sum()
        right = (along[k].astype(float) * mesh.points.grad.numpy()).sum()
        assert abs(left - right) < 1e-4 * np.abs(tangents[k] * weights).sum()
    assert np.allclose(one, tangents[1], rtol=1e-5, atol=1e-5)
    # The gradients are where they were.
    before = mesh.points.grad.numpy().copy()
    reverse(launch, weights)
    assert np.allclose(mesh.points.grad.numpy(), 2 * before, rtol=1e-4, atol=1e-4)


def test_gradients_that_come_and_go(scene):
    points, faces, velocities = scene
    mesh = mesh_of(points, faces, velocities)
    mesh.points.requires_grad = False
    launch = run(away, mesh, [points[:5] * 3], 1)
    reverse(launch, np.ones((5, 1)))
    mesh.points.requires_grad = True
    reverse(launch, np.ones((5, 1)))
    # Away from corners that are met the distance falls at speed 1.
    assert np.isclose(np.abs(mesh.points.grad.numpy()).max(), 1, atol=0.5)
    mesh.points.grad.zero_()
    kept = mesh.points.grad
    mesh.points = wp.array(points, dtype=wp.vec3, device="cpu", requires_grad=True)
    reverse(launch, np.ones((5, 1)))
    assert mesh.points.grad.numpy().any() and not kept.numpy().any()


def test_second_derivatives_by_vertices_are_an_error(scene):
    points, faces, velocities = scene
    mesh = mesh_of(points, faces, velocities)
    launch = run(away, mesh, [points[:1] * 3], 1)
    along = wp.array(points, dtype=wp.vec3, device="cpu")
    with pytest.raises(RuntimeError, match="second derivatives by arrays"):
        wp.autograd.hvp(lambda _: launch().flatten(), [mesh.points], [along])
