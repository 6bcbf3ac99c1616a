"""Volumes made of points, index grids, rebuilding, and what is refused."""

import numpy as np
import pytest

import warp as wp


def voxels(n=300, seed=0):
    rng = np.random.default_rng(seed)
    near, far = rng.integers(-30, 30, (n, 3)), rng.integers(-9000, 9000, (20, 3))
    return np.concatenate([near, far, near[:5]]).astype(np.int32)


@wp.kernel
def numbers(id: wp.uint64, voxel: wp.array(dtype=wp.vec3i), out: wp.array(dtype=int)):
    i = wp.tid()
    v = voxel[i]
    out[i] = wp.volume_lookup_index(id, v[0], v[1], v[2])


def numbers_of(volume, at):
    device = volume.device
    out = wp.zeros(len(at), dtype=int, device=device)
    given = wp.array(at.astype(np.int32), dtype=wp.vec3i, device=device)
    wp.launch(numbers, dim=len(at), inputs=[volume.id, given, out], device=device)
    return out.numpy()


def test_each_voxel_has_one_number(device):
    given = voxels()
    unique = np.unique(given, axis=0)
    points = wp.array(given, dtype=wp.vec3i, device=device)
    volume = wp.Volume.allocate_by_voxels(points, voxel_size=0.5, device=device)
    assert volume.get_voxel_count() == len(unique)
    assert sorted(numbers_of(volume, unique)) == list(range(len(unique)))
    beside = unique + [0, 0, 1]
    taken = {tuple(v) for v in unique}
    found = numbers_of(volume, beside) >= 0
    assert found.tolist() == [tuple(v) in taken for v in beside]
    listed = volume.get_voxels().numpy()
    assert (numbers_of(volume, listed) == np.arange(len(unique))).all()


def test_tiles_around_points_of_the_world(device):
    p = np.random.default_rng(1).uniform(-20, 20, (100, 3)).astype(np.float32)
    p[3] = np.nan
    volume = wp.Volume.allocate_by_tiles(
        wp.array(p, dtype=wp.vec3, device=device), 0.5, None, (1.0, 0.0, 0.0), device
    )
    good = np.delete(p, 3, axis=0).astype(np.float64)
    wanted = np.floor((good - [1, 0, 0]) / 0.5 + 0.5).astype(int) >> 3
    tiles = volume.get_tiles().numpy()
    assert np.array_equal(np.unique(tiles >> 3, axis=0), np.unique(wanted, axis=0))
    assert volume.get_voxel_count() == 512 * volume.get_tile_count()


@wp.kernel
def sample_index(
    id: wp.uint64,
    p: wp.array(dtype=wp.vec3),
    data: wp.array(dtype=float),
    background: wp.array(dtype=float),
    out: wp.array(dtype=float),
):
    i = wp.tid()
    out[i] = wp.volume_sample_index(id, p[i], wp.Volume.LINEAR, data, background[0])


def test_samples_of_an_array_and_their_derivatives(device):
    corners = np.stack(np.meshgrid(*[np.arange(6)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    given = wp.array(corners, dtype=wp.vec3i, device=device)
    volume = wp.Volume.allocate_by_voxels(given, voxel_size=1.0, device=device)
    place = volume.get_voxels().numpy()
    weights = np.array([1.0, -2.0, 0.5])
    data = wp.array(place @ weights + 3.0, dtype=float, device=device, requires_grad=True)
    background = wp.array([9.0], dtype=float, device=device, requires_grad=True)
    p = np.random.default_rng(2).uniform(0.1, 4.9, (64, 3)).astype(np.float32)
    p[0] = [-0.25, 2.0, 2.0]
    x = wp.array(p, dtype=wp.vec3, device=device, requires_grad=True)
    out = wp.zeros(64, dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(sample_index, 64, inputs=[volume.id, x, data, background, out], device=device)
    exact = p.astype(np.float64) @ weights + 3.0
    assert np.abs(out.numpy()[1:] - exact[1:]).max() < 1e-5
    tape.backward(grads={out: wp.ones_like(out)})
    assert np.abs(x.grad.numpy()[1:] - weights).max() < 1e-5
    # A sample is an average: its weights add up to 1, those of the first to 3/4 within.
    assert abs(data.grad.numpy().sum() - 63.75) < 1e-4
    assert abs(background.grad.numpy()[0] - 0.25) < 1e-6


def test_rebuilding_keeps_the_id(device):
    points = wp.array(voxels(), dtype=wp.vec3i, device=device)
    status = wp.zeros(1, dtype=wp.uint32, device=device)
    volume = wp.Volume.allocate_by_voxels(
        points, voxel_size=1.0, device=device, max_active_voxels=400, status=status
    )
    assert status.numpy()[0] == wp.Volume.REBUILD_SUCCESS and volume.is_rebuildable
    id, other = volume.id, np.unique(voxels(seed=5), axis=0)
    mask = wp.array(np.arange(len(other)) % 2, dtype=int, device=device)
    volume.rebuild(wp.array(other, dtype=wp.vec3i, device=device), status, mask)
    assert volume.id == id and volume.get_active_stats().voxel_count == len(other) // 2
    assert ((numbers_of(volume, other) >= 0) == (np.arange(len(other)) % 2 == 1)).all()
    many = wp.array(voxels(2000), dtype=wp.vec3i, device=device)
    volume.rebuild(many, status)
    assert status.numpy()[0] & wp.Volume.REBUILD_VOXEL_CAPACITY_EXCEEDED
    assert volume.get_active_stats().voxel_count == len(other) // 2


def test_an_empty_volume_is_its_background(device):
    none = wp.zeros(0, dtype=wp.vec3i, device=device)
    volume = wp.Volume.allocate_by_voxels(none, voxel_size=1.0, device=device)
    assert volume.get_voxel_count() == 0
    assert (numbers_of(volume, voxels()) == -1).all()


def test_what_is_refused():
    points = wp.zeros(3, dtype=wp.vec3i, device="cpu")
    for error, arguments in (
        (ValueError, {}),
        (ValueError, {"voxel_size": -1.0}),
        (ValueError, {"voxel_size": (1.0, 2.0)}),
        (TypeError, {"voxel_size": "large"}),
        (ValueError, {"voxel_size": 1.0, "transform": np.eye(3)}),
        (ValueError, {"transform": np.zeros((3, 3))}),
        (ValueError, {"voxel_size": 1.0, "max_tiles": 0}),
        (TypeError, {"voxel_size": 1.0, "bg_value": "zero"}),
        (TypeError, {"voxel_size": 1.0, "bg_value": wp.float16(1.0)}),
    ):
        with pytest.raises(error):
            wp.Volume.allocate_by_tiles(points, device="cpu", **arguments)
    with pytest.raises(RuntimeError, match="packed array"):
        wp.Volume.allocate_by_tiles(wp.zeros(3, dtype=wp.vec2i, device="cpu"), 1.0, device="cpu")


def test_a_freed_volume_is_an_error():
    volume = wp.Volume.allocate([0, 0, 0], [1, 1, 1], 1.0, device="cpu")
    id = volume.id
    del volume
    out, p = wp.zeros(1, dtype=int, device="cpu"), wp.zeros(1, dtype=wp.vec3i, device="cpu")
    with pytest.raises((RuntimeError, ValueError), match="freed"):
        wp.launch(numbers, dim=1, inputs=[id, p, out], device="cpu")


def test_a_turned_grid_and_its_voxel_size(device):
    """As NanoVDB writes it: where a step of one voxel along all axes leads."""
    turned = [[0, -1, 0], [1, 0, 0], [0, 0, 2]]
    points = wp.array([[-1, 1, 4]], dtype=wp.vec3, device=device)
    volume = wp.Volume.allocate_by_voxels(points, transform=turned, device=device)
    assert volume.get_voxels().numpy().tolist() == [[1, 1, 2]]
    assert volume.get_voxel_size() == (-1.0, 1.0, 2.0)


def test_rows_beyond_the_tiles_stay_as_they_are(device):
    points = wp.array([[0, 0, 0], [8, 0, 0]], dtype=wp.vec3i, device=device)
    volume = wp.Volume.allocate_by_tiles(points, 1.0, device=device, max_tiles=4)
    out = wp.full((4, 3), -999, dtype=int, device=device)
    assert volume.get_tiles(out=out) is out
    assert sorted(out.numpy().tolist()) == [[-999] * 3] * 2 + [[0, 0, 0], [8, 0, 0]]
    assert volume.get_tiles().numpy()[2:].tolist() == [[0, 0, 0]] * 2
