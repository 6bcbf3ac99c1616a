"""Surfaces of volumes: closed, the same as on a dense grid, with derivatives by voxels."""

import numpy as np
import pytest

import warp as wp

extract = wp.geometry.volume_marching_cubes


def is_closed(faces):
    """Each edge is there once in each direction."""
    there = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    unique = np.unique(there, axis=0)
    return len(unique) == len(there) and np.array_equal(unique, np.unique(there[:, ::-1], axis=0))


def corners_of(vertices, indices):
    """Triangles by their corners, in an order of their own."""
    corners = np.round(vertices.numpy()[indices.numpy().reshape(-1, 3)].astype(float), 4)
    start = np.lexsort(corners.transpose(2, 0, 1).reshape(3, -1)).argsort().reshape(-1, 3).argmin(1)
    turned = corners[np.arange(len(corners))[:, None], (start[:, None] + np.arange(3)) % 3]
    return turned[np.lexsort(turned.reshape(-1, 9).T)]


def test_same_triangles_as_on_a_dense_grid(device):
    values = np.random.default_rng(0).standard_normal((13, 17, 10)).astype(np.float32)
    for axis in range(3):
        for side in (0, -1):
            np.moveaxis(values, axis, 0)[side] = 1.0
    volume = wp.Volume.load_from_numpy(values, bg_value=1.0, device=device)
    vertices, indices = extract(volume, 0.25)
    field = wp.array(values, dtype=float, device=device)
    dense = wp.geometry.IsoSurfaceMarchingCubes.extract(field, 0.25)
    assert is_closed(indices.numpy().reshape(-1, 3))
    assert len(vertices) == len(dense[0])
    assert np.array_equal(corners_of(vertices, indices), corners_of(*dense))


def test_values_at_the_sides_of_leaves_are_closed_by_the_background(device):
    """Nothing is outside of the leaves, so all cells there have corners in the background."""
    values = -np.ones((8, 16, 8))
    volume = wp.Volume.load_from_numpy(
        values, min_world=(1.0, 2.0, 3.0), voxel_size=0.5, bg_value=1.0, device=device
    )
    vertices, indices = extract(volume)
    faces = indices.numpy().reshape(-1, 3)
    assert is_closed(faces) and len(vertices) - len(faces) // 2 == 2
    points = vertices.numpy()
    # Half a voxel around the outermost ones.
    assert np.allclose(points.min(0), [0.75, 1.75, 2.75])
    assert np.allclose(points.max(0), [4.75, 9.75, 6.75])


def test_positions_follow_voxels(device):
    x = np.stack(np.meshgrid(*[np.linspace(-1, 1, 12)] * 3, indexing="ij"), axis=-1)
    values = (np.linalg.norm(x, axis=-1) - 0.6).astype(np.float32)
    volume = wp.Volume.load_from_numpy(values, bg_value=1.0, device=device)
    volume.leaf_values.requires_grad = True
    field = wp.array(values, dtype=float, device=device, requires_grad=True)
    found = []
    for make in (lambda: extract(volume), lambda: wp.MarchingCubes.extract(field)):
        with wp.Tape() as tape:
            vertices, _ = make()
        # Weights that depend on places alone, as vertices come in another order.
        places = vertices.numpy()
        weights = np.sin(3 * places + np.roll(places, 1, axis=1)).astype(np.float32)
        tape.backward(grads={vertices: wp.array(weights, dtype=wp.vec3, device=device)})
    for corner, row in zip(
        volume.get_tiles().numpy(), volume.leaf_values.grad.numpy(), strict=True
    ):
        part = field.grad.numpy()[tuple(slice(c, c + 8) for c in corner)]
        a, b, c = part.shape
        block = row.reshape(8, 8, 8)
        found.append(np.abs(block[:a, :b, :c] - part).max())
        assert np.count_nonzero(block) == np.count_nonzero(part)
    assert max(found) < 1e-4 * np.abs(field.grad.numpy()).max()


def test_what_is_refused(device):
    volume = wp.Volume.load_from_numpy(np.ones((8, 8, 8)), bg_value=1, device=device)
    with pytest.raises(TypeError, match="float32, but got one of int32"):
        extract(volume)
    empty = wp.Volume.load_from_numpy(np.ones((8, 8, 8)), bg_value=1.0, device=device)
    vertices, indices = extract(empty)
    assert len(vertices) == 0 and len(indices) == 0
