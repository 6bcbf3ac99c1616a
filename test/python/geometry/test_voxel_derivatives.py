"""Derivatives of samples and lookups by the voxels of a volume, against their weights."""

import numpy as np
import pytest

import warp as wp
from warp._src.geometry.device.refit import slot_of

SHAPE = (11, 9, 10)
RANDOM = np.random.default_rng(3)


@wp.kernel
def sample(id: wp.uint64, p: wp.array(dtype=wp.vec3), out: wp.array2d(dtype=float)):
    i = wp.tid()
    out[i, 0] = wp.volume_sample_f(id, p[i], wp.Volume.LINEAR)
    out[i, 1] = wp.volume_sample(id, p[i], wp.Volume.CLOSEST, dtype=float)
    out[i, 2] = wp.volume_lookup_f(id, int(p[i][0]), int(p[i][1]), int(p[i][2]))
    slope = wp.vec3()
    value = wp.volume_sample_grad_f(id, p[i], wp.Volume.LINEAR, slope)
    for k in range(3):
        out[i, 3 + k] = slope[k]


@wp.kernel
def sample_vectors(id: wp.uint64, p: wp.array(dtype=wp.vec3), out: wp.array(dtype=wp.vec3d)):
    i = wp.tid()
    out[i] = wp.volume_sample(id, p[i], wp.Volume.LINEAR, dtype=wp.vec3d)


def dense(volume, rows):
    """Numbers of all voxels of leaves, in one array."""
    corners = volume.get_tiles().numpy()
    made = np.zeros((*(corners.max(0) + 8), *rows.shape[2:]))
    for (x, y, z), row in zip(corners, rows, strict=True):
        made[x : x + 8, y : y + 8, z : z + 8] = row.reshape(8, 8, 8, *rows.shape[2:])
    return made


def weights_of(p, shape):
    """Derivatives of each output by each voxel, of shape (6, points, *shape)."""
    found = np.zeros((6, len(p), *shape))
    for i, point in enumerate(p.astype(float)):
        cell = np.floor(point).astype(int)
        t = point - cell
        for d in np.ndindex(2, 2, 2):
            voxel = tuple(cell + d)
            if min(voxel) < 0 or (np.array(voxel) >= shape).any():
                continue
            parts = np.where(d, t, 1 - t)
            found[(0, i, *voxel)] = parts.prod()
            for k in range(3):
                found[(3 + k, i, *voxel)] = np.delete(parts, k).prod() * (1 if d[k] else -1)
        for row, voxel in ((1, np.floor(point + 0.5)), (2, np.trunc(point))):
            voxel = voxel.astype(int)
            if voxel.min() >= 0 and (voxel < shape).all():
                found[(row, i, *voxel)] = 1
    return found


@pytest.fixture
def scene(device):
    values = RANDOM.standard_normal(SHAPE).astype(np.float32)
    volume = wp.Volume.load_from_numpy(values, bg_value=0.5, device=device)
    p = np.concatenate([RANDOM.uniform(0.1, 15, (150, 3)), RANDOM.uniform(6, 9, (50, 3))])
    return volume, wp.array(p, dtype=wp.vec3, device=device), p.astype(np.float32)


def launched(volume, p):
    out = wp.zeros((len(p), 6), dtype=float, device=volume.device, requires_grad=True)
    wp.launch(sample, len(p), [volume.id, p, out], device=volume.device)
    return out


def test_gradients_are_the_weights_of_voxels(scene):
    volume, p, places = scene
    values = volume.leaf_values
    assert np.array_equal(
        dense(volume, values.numpy())[: SHAPE[0], : SHAPE[1], : SHAPE[2]].shape, SHAPE
    )
    values.requires_grad = True
    seeds = RANDOM.standard_normal((len(p), 6)).astype(np.float32)
    with wp.Tape() as tape:
        out = launched(volume, p)
    tape.backward(grads={out: wp.array(seeds, dtype=float, device=volume.device)})
    found = dense(volume, values.grad.numpy())
    weights = weights_of(places, found.shape)
    expected = np.einsum("ik,kixyz->xyz", seeds, weights)
    assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max() + 1e-5
    # The values themselves are linear in voxels, up to the background.
    inner = (places < np.array(found.shape) - 1).all(1)
    linear = np.einsum("kixyz,xyz->ik", weights, dense(volume, values.numpy()))
    assert np.abs(out.numpy()[inner] - linear[inner]).max() < 1e-5
    tape.zero()
    assert not values.grad.numpy().any()


def test_tangents_are_the_same_weights(scene):
    volume, p, places = scene
    along = RANDOM.standard_normal(volume.leaf_values.shape).astype(np.float32)
    tangents = wp.array(along, dtype=float, device=volume.device)
    found = wp.autograd.jvp(lambda _: launched(volume, p), [volume.leaf_values], [tangents])
    weights = weights_of(places, dense(volume, along).shape)
    expected = np.einsum("kixyz,xyz->ik", weights, dense(volume, along))
    assert np.abs(found.numpy() - expected).max() < 1e-5
    batch = wp.array(np.stack([along, along]), dtype=float, device=volume.device)
    with pytest.raises(RuntimeError, match="one direction at a time"):
        wp.autograd.jvp(lambda _: launched(volume, p), [volume.leaf_values], [batch])


def test_vectors_of_doubles(device):
    values = RANDOM.standard_normal((8, 8, 8, 3))
    volume = wp.Volume.load_from_numpy(values, bg_value=wp.vec3d(), device=device)
    volume.leaf_values.requires_grad = True
    p = RANDOM.uniform(0, 7, (60, 3)).astype(np.float32)
    seeds = RANDOM.standard_normal((60, 3))
    x = wp.array(p, dtype=wp.vec3, device=device)
    out = wp.zeros(60, dtype=wp.vec3d, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(sample_vectors, 60, [volume.id, x, out], device=device)
    tape.backward(grads={out: wp.array(seeds, dtype=wp.vec3d, device=device)})
    found = dense(volume, volume.leaf_values.grad.numpy())
    expected = np.einsum("ic,ixyz->xyzc", seeds, weights_of(p, (8, 8, 8))[0])
    assert np.abs(found - expected).max() < 1e-6


def test_what_has_no_gradients(device):
    volume = wp.Volume.load_from_numpy(np.ones((8, 8, 8)), bg_value=1, device=device)
    assert volume.leaf_values.dtype is wp.int32
    with pytest.raises(RuntimeError, match="have no values"):
        points = wp.array([[0, 0, 0]], dtype=wp.vec3i, device=device)
        wp.Volume.allocate_by_voxels(points, 1.0, device=device).leaf_values  # noqa: B018


def has_table(volume):
    """True if kernels find leaves by a table: word 13 of what the handle leads to."""
    return slot_of(volume.id, volume.device).numpy()[26:28].any()


def test_the_table_of_leaves_changes_nothing(scene):
    """A tile far away makes a table too large, so the same voxels are found from the root."""
    volume, p, _ = scene
    tiles = np.concatenate([volume.get_tiles().numpy(), [[1 << 20, 0, -(1 << 19)]]])
    given = wp.array(tiles, dtype=wp.vec3i, device=volume.device)
    other = wp.Volume.allocate_by_tiles(given, 1.0, bg_value=0.5, device=volume.device)
    rows = {tuple(tile): row for tile, row in zip(tiles, volume.leaf_values.numpy(), strict=False)}
    made = [rows.get(tuple(tile), np.zeros(512)) for tile in other.get_tiles().numpy()]
    other.leaf_values.assign(np.array(made, dtype=np.float32))
    assert has_table(volume) and not has_table(other)
    assert np.array_equal(launched(volume, p).numpy(), launched(other, p).numpy())
