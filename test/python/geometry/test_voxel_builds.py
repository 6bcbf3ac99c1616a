"""Grids of volumes that kernels build: the bytes are those of the host's builder."""

import numpy as np
import pytest

import warp as wp
from warp._src.geometry.device.refit import slot_of as device_slot
from warp._src.geometry.device.refit import words
from warp._src.geometry.volumes import allocation, points

TURN = np.array([[0.25, 0.5, 0.0], [-0.5, 0.25, 0.0], [0.0, 0.125, 2.0]])
BACKGROUNDS = {
    "numbers of voxels": None,
    "float32": 1.5,
    "nothing": 0.0,
    "int32": -7,
    "float64": wp.float64(2.5),
    "vec3f": (1.0, 2.0, 3.0),
    "vec3d": wp.vec3d(1.0, 2.0, 3.0),
    "vec4f": (1.0, 2.0, 3.0, 4.0),
}
ROOM = {"max_lower_nodes": 60, "max_upper_nodes": 40}


@pytest.fixture
def by_kernels(device, monkeypatch):
    """A device, where kernels build also if it is the CPU."""
    monkeypatch.setattr(allocation, "builds_there", lambda _, recipe: recipe.capacities is not None)
    return device


def voxels(n=300, seed=0):
    rng = np.random.default_rng(seed)
    near, far = rng.integers(-30, 30, (n, 3)), rng.integers(-9000, 9000, (20, 3))
    return np.concatenate([near, far, near[: n // 9]]).astype(np.int32)


def built_by_host(volume, given, mask=None):
    """The grid that the host's builder makes of the same points."""
    return wp.Volume._of_grids(volume._recipe.native.make(*points.given(given, mask)), given.device)


# Where a header has the box of the grid in the world.
WORLD_BOX = slice(560, 608)


def table_of(volume):
    """Extents and numbers of the table of leaves, as kernels find it."""
    found = device_slot(volume.id, volume.device).numpy()
    extent, at = found[31:34], found[26:28].view(np.uint64)[0]
    count = int(np.prod(extent))
    return extent, words(int(at), count, volume.device).numpy().reshape(extent) if count else None


def check(volume, given, mask=None):
    host = built_by_host(volume, given, mask)
    found, wanted = volume.array().numpy().copy(), host.array().numpy()
    assert found.size == wanted.size
    # Products of a turned transform may be rounded in another order.
    box, other = (grid[WORLD_BOX].view(np.float64) for grid in (found, wanted))
    np.testing.assert_allclose(box, other, rtol=1e-15, atol=1e-12)
    found[WORLD_BOX] = wanted[WORLD_BOX]
    assert (found == wanted).all()
    (_, numbers), (_, table) = table_of(volume), table_of(host)
    assert (numbers is None) == (table is None)
    if table is not None:
        assert (numbers == table).all()


@pytest.mark.parametrize("values", BACKGROUNDS)
@pytest.mark.parametrize("n", [0, 1, 300])
def test_tiles_are_those_of_the_host(by_kernels, n, values):
    given = wp.array(voxels(n)[: n and None], dtype=wp.vec3i, device=by_kernels)
    status = wp.full(1, 99, dtype=wp.uint32, device=by_kernels)
    volume = wp.Volume.allocate_by_tiles(
        *(given, 0.5, BACKGROUNDS[values], (1.0, -2.0, 0.0), by_kernels),
        **ROOM, max_tiles=400, status=status,
    )  # fmt: skip
    assert status.numpy()[0] == 0 and volume.is_rebuildable
    check(volume, given)
    other = wp.array(voxels(n // 2, seed=5), dtype=wp.vec3i, device=by_kernels)
    volume.rebuild(other)
    check(volume, other)


@pytest.mark.parametrize("n", [0, 1, 9, 300, 5000])
def test_voxels_are_those_of_the_host(by_kernels, n):
    given = wp.array(voxels(n)[: n and None], dtype=wp.vec3i, device=by_kernels)
    room = {"max_active_voxels": 6000, "max_leaf_nodes": 1000, **ROOM}
    volume = wp.Volume.allocate_by_voxels(given, 0.5, device=by_kernels, **room)
    check(volume, given)
    mask = (np.arange(len(given)) % 3 > 0).astype(np.int32)
    mask = wp.array(mask, dtype=int, device=by_kernels)
    volume.rebuild(given, point_mask=mask)
    check(volume, given, mask)
    listed, stats = volume.get_voxels().numpy(), volume.get_active_stats()
    wanted = np.unique(given.numpy()[mask.numpy() != 0].reshape(-1, 3), axis=0)
    assert stats.voxel_count == len(wanted)
    assert (np.unique(listed[: len(wanted)], axis=0) == wanted).all()


@pytest.mark.parametrize("shape", [wp.vec3, float])
def test_points_of_the_world_have_the_voxels_of_the_host(by_kernels, shape):
    p = np.random.default_rng(1).uniform(-60, 60, (400, 3)).astype(np.float32)
    p[3], p[4, 1], p[5, 2] = np.nan, np.inf, -np.inf
    given = wp.array(p, dtype=shape, device=by_kernels)
    kind = {"transform": wp.mat33(*TURN.ravel()), "translation": (1.0, -3.0, 0.5)}
    for make in (wp.Volume.allocate_by_tiles, wp.Volume.allocate_by_voxels):
        volume = make(given, device=by_kernels, **kind, **ROOM)
        check(volume, given)


@pytest.mark.parametrize("values", ["voxels", *BACKGROUNDS])
def test_grids_of_the_size_that_points_need(device, values, monkeypatch):
    there = {"counts": True}
    monkeypatch.setattr(allocation, "counts_there", lambda *_: there["counts"])
    for given in (wp.array(voxels(), dtype=wp.vec3i, device=device), None):
        given = wp.array(voxels() * 0.3, dtype=wp.vec3, device=device) if given is None else given
        some = wp.array(np.arange(len(given)) % 3 > 0, dtype=int, device=device)

        def make(by_kernels, given=given, some=some):
            there["counts"] = by_kernels
            if values == "voxels":
                return wp.Volume.allocate_by_voxels(given, 0.5, device=device, point_mask=some)
            kind = (0.5, BACKGROUNDS[values], (1.0, -2.0, 0.0), device)
            return wp.Volume.allocate_by_tiles(given, *kind, point_mask=some)

        made, wanted = make(True), make(False)
        assert made._built and not wanted._built and not made.is_rebuildable
        assert (made.array().numpy() == wanted.array().numpy()).all()
        assert made.get_tile_count() == wanted.get_tile_count()
        assert made.get_voxel_count() == wanted.get_voxel_count()
        assert (made.get_tiles().numpy() == wanted.get_tiles().numpy()).all()
        (extent, numbers), (other, expected) = table_of(made), table_of(wanted)
        assert (extent == other).all() and (numbers is None) == (expected is None)


def test_without_room_the_grid_stays(by_kernels):
    few = wp.array(voxels(4), dtype=wp.vec3i, device=by_kernels)
    many = wp.array(voxels(300), dtype=wp.vec3i, device=by_kernels)
    far = wp.array([[3e9, 0.0, 0.0]], dtype=wp.vec3, device=by_kernels)
    status = wp.zeros(1, dtype=wp.uint32, device=by_kernels)
    room = {"max_active_voxels": 30, "max_leaf_nodes": 30, **ROOM, "status": status}
    volume = wp.Volume.allocate_by_voxels(few, 0.5, device=by_kernels, **room)
    id, before = volume.id, volume.array().numpy()
    volume.rebuild(many, status)
    leaves = len(np.unique(many.numpy() >> 3, axis=0))
    assert leaves > 30 and status.numpy()[0] == (
        wp.Volume.REBUILD_LEAF_CAPACITY_EXCEEDED | wp.Volume.REBUILD_VOXEL_CAPACITY_EXCEEDED
    )
    volume.rebuild(far, status)
    assert status.numpy()[0] == wp.Volume.REBUILD_INVALID_INPUT
    assert (volume.array().numpy() == before).all() and volume.id == id
    volume.rebuild(wp.zeros(0, dtype=wp.vec3i, device=by_kernels), status)
    assert status.numpy()[0] == 0 and volume.get_active_stats().voxel_count == 0
    # At first it is empty.
    volume = wp.Volume.allocate_by_voxels(many, 0.5, device=by_kernels, **room)
    assert status.numpy()[0] != 0 and volume.get_active_stats() == (0, 0, 0, 0)


@wp.kernel
def sample(id: wp.uint64, p: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = wp.volume_sample_f(id, p[i], wp.Volume.LINEAR)


@wp.kernel
def store(id: wp.uint64, at: wp.array(dtype=wp.vec3i)):
    v = at[wp.tid()]
    wp.volume_store_f(id, v[0], v[1], v[2], float(v[0] + 2 * v[1] - v[2]))


def test_values_and_gradients_are_those_of_the_last_build(by_kernels, tmp_path):
    dense = np.stack(np.meshgrid(*[np.arange(16)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    device, rng = by_kernels, np.random.default_rng(2)
    first = wp.array(dense[::7] - 400, dtype=wp.vec3i, device=device)
    volume = wp.Volume.allocate_by_tiles(first, 1.0, 0.0, device=device, max_tiles=64, **ROOM)
    volume.leaf_values.requires_grad = True
    second = wp.array(dense, dtype=wp.vec3i, device=device)
    volume.rebuild(second)
    check(volume, second)
    assert table_of(volume)[1] is not None
    wp.launch(store, len(second), inputs=[volume.id, second], device=device)
    p = rng.uniform(0, 15, (200, 3)).astype(np.float32)
    given = wp.array(p, dtype=wp.vec3, device=device)
    out = wp.zeros(200, dtype=float, device=device, requires_grad=True)
    assert volume.leaf_values.shape == (8, 512)
    volume.leaf_values.requires_grad = True
    with wp.Tape() as tape:
        wp.launch(sample, 200, inputs=[volume.id, given, out], device=device)
    np.testing.assert_allclose(out.numpy(), p @ [1, 2, -1], atol=2e-5)
    out.grad.fill_(1.0)
    tape.backward()
    assert volume.leaf_values.grad.numpy().sum() == pytest.approx(200, rel=1e-5)
    again = wp.Volume.load_from_nvdb(volume.save_to_nvdb(tmp_path / "one.nvdb"), device="cpu")
    assert (again.leaf_values.numpy() == volume.leaf_values.numpy()).all()


@pytest.mark.cuda
@pytest.mark.parametrize("kind", ["tiles", "voxels"])
def test_a_graph_rebuilds(kind):
    given = wp.array(voxels(400), dtype=wp.vec3i, device="cuda:0")
    status = wp.zeros(1, dtype=wp.uint32, device="cuda:0")
    make = getattr(wp.Volume, f"allocate_by_{kind}")
    volume = make(given, 0.5, device="cuda:0", **ROOM, status=status)
    assert volume._built is not None
    mask = wp.full(len(given), 1, dtype=int, device="cuda:0")
    volume.rebuild(given, status, mask)
    with wp.ScopedCapture(device="cuda:0") as capture:
        volume.rebuild(given, status, mask)
    for seed in (3, 4):
        given.assign(voxels(400, seed))
        mask.assign(np.random.default_rng(seed).integers(0, 2, len(given)).astype(np.int32))
        wp.capture_launch(capture.graph)
        assert status.numpy()[0] == 0
        check(volume, given, mask)


@pytest.mark.cuda
def test_more_room_than_a_gigabyte_is_the_hosts(monkeypatch):
    given = wp.array(voxels(40), dtype=wp.vec3i, device="cuda:0")
    volume = wp.Volume.allocate_by_tiles(given, 0.5, device="cuda:0", max_tiles=5000)
    assert volume._built is None and volume.is_rebuildable
    volume.rebuild(wp.array(voxels(50, 2), dtype=wp.vec3i, device="cuda:0"))
    check(volume, wp.array(voxels(50, 2), dtype=wp.vec3i, device="cpu"))


@pytest.mark.cuda
@pytest.mark.parametrize("bg_value", [None, 2.0])
def test_a_graph_allocates_a_volume(bg_value):
    points = wp.array([[0, 0, 0], [8, 0, 0]], dtype=wp.vec3i, device="cuda:0")
    room = {"rebuildable": True, "max_tiles": 4, "max_lower_nodes": 4, "max_upper_nodes": 4}
    with wp.ScopedCapture(device="cuda:0") as capture:
        volume = wp.Volume.allocate_by_tiles(points, 1.0, bg_value, device="cuda:0", **room)
    for last in (8, 16):
        points.assign([[0, 0, 0], [last, 0, 0]])
        wp.capture_launch(capture.graph)
        assert volume.get_active_stats().leaf_node_count == 2
        out = wp.zeros((4, 3), dtype=int, device="cuda:0")
        found = volume.get_tiles(out=out).numpy()[:2].tolist()
        assert sorted(found) == [[0, 0, 0], [last, 0, 0]]
