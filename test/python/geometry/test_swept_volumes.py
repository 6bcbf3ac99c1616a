"""Volumes swept by moving meshes, against distances that are known."""

import numpy as np
import pytest
import test_marching_cubes
from test_marching_cubes import is_closed, volume_of

import warp as wp
from warp.geometry import (
    IsoSurfaceMarchingCubes,
    SweptVolumeSignMode,
    swept_volume_bounds,
    swept_volume_field,
    swept_volume_mesh,
)


def ball_mesh(device, radius=0.5, n=25, **options):
    field = test_marching_cubes.ball(n, radius, device)
    points, indices = IsoSurfaceMarchingCubes.extract(
        field, 0.0, lower=wp.vec3(-1.0), upper=wp.vec3(1.0)
    )
    return wp.Mesh(points, indices, **options)


def poses_along(axis, count, length):
    poses = np.zeros((1, count, 7), dtype=np.float32)
    poses[0, :, axis] = np.linspace(0, length, count)
    poses[0, :, 6] = 1
    return poses


def segment_distance(places, axis, length, radius):
    along = np.clip(places[..., axis], 0, length)
    away = places.copy()
    away[..., axis] -= along
    return np.linalg.norm(away, axis=-1) - radius


@pytest.mark.parametrize("mode", ["NORMAL", "WINDING_NUMBER", "PARITY"])
def test_ball_along_an_axis_covers_a_capsule(device, mode):
    mesh = ball_mesh(device, support_winding_number=True)
    field, lower, upper = swept_volume_field(
        [mesh], poses_along(1, 33, 1.5), 0.11, sign_mode=SweptVolumeSignMode[mode]
    )
    values = field.numpy()
    axes = [np.linspace(a, b, n) for a, b, n in zip(lower, upper, values.shape, strict=True)]
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    exact = segment_distance(places, 1, 1.5, 0.5)
    # The ball is of triangles (2e-3), and between poses a little is missing.
    assert np.abs(values - exact)[exact > 0].max() < 6e-3
    assert ((values < 0) == (exact < 0))[np.abs(exact) > 6e-3].all()


def test_surface_is_closed_and_encloses_the_capsule(device):
    mesh = ball_mesh(device, n=49, support_winding_number=True)
    points, indices = swept_volume_mesh([mesh], poses_along(0, 65, 1.0), 0.03)
    faces = indices.numpy().reshape(-1, 3)
    assert is_closed(faces)
    exact = 4 / 3 * np.pi * 0.5**3 + np.pi * 0.5**2 * 1.0
    assert abs(volume_of(points.numpy(), faces) / exact - 1) < 1e-2
    assert np.abs(segment_distance(points.numpy(), 0, 1.0, 0.5)).max() < 1e-2


def test_bounds_of_turned_meshes(device):
    corners = np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0], [0, 0, 0.5]], dtype=np.float32)
    faces = np.array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3])
    mesh = wp.Mesh(
        wp.array(corners, dtype=wp.vec3, device=device), wp.array(faces, dtype=int, device=device)
    )
    half = np.sqrt(0.5)
    # As it is, and a quarter turn about z.
    low, high = swept_volume_bounds(
        [mesh], [[[0, 0, 0, 0, 0, 0, 1], [0, 0, 3, 0, 0, half, half]]], padding=0.25
    )
    assert np.allclose(low, [-1.25, -0.25, -0.25], atol=1e-6)
    assert np.allclose(high, [2.25, 2.25, 3.75], atol=1e-6)


def test_bad_input_is_refused(device):
    mesh, poses = ball_mesh(device, n=9), poses_along(0, 3, 1.0)
    with pytest.raises(ValueError, match=r"meshes\[0\] was made without `support_winding_number"):
        swept_volume_field([mesh], poses, 0.2)
    with pytest.raises(ValueError, match="at least one mesh"):
        swept_volume_bounds([], poses)
    with pytest.raises(ValueError, match="a row of 'transforms' for each of 2 meshes, but got 1"):
        swept_volume_bounds([mesh, mesh], poses)
    with pytest.raises(ValueError, match="at least one pose"):
        swept_volume_bounds([mesh], poses[:, :0])
    with pytest.raises(ValueError, match=r"shape \(meshes, poses, 7\)"):
        swept_volume_bounds([mesh], poses[..., :6])
    for wrong in (dict(), dict(voxel_size=0.1, resolution=(9, 9, 9))):
        with pytest.raises(ValueError, match="either 'voxel_size' or 'resolution'"):
            swept_volume_field([mesh], poses, **wrong)
    with pytest.raises(ValueError, match="voxel_size > 0"):
        swept_volume_field([mesh], poses, -0.1)
    with pytest.raises(ValueError, match="threshold > 0"):
        swept_volume_mesh([mesh], poses, 0.1, sign_mode=SweptVolumeSignMode.NO_SIGN)
