"""Grids of OpenVDB read here, and ours read by OpenVDB: values, active voxels, samples, places.

test/exchange/vdb-exchange.cpp makes grids with OpenVDB and asks them; NanoVDB's conversions of both
directions are between.
"""

import pathlib
import subprocess

import numpy as np
import pytest

import warp as wp

PROGRAM = pathlib.Path(wp.__file__).parents[2] / "bin" / "vdb-exchange"
pytestmark = pytest.mark.skipif(not PROGRAM.exists(), reason="OpenVDB's headers are not installed")
BACKGROUND, OF_TILES = -7.0, 2.5
OFFSET = np.array([0.25, 0.5, 0.75])
KINDS = ["float", "double", "int32", "Vec3f"]


@wp.kernel
def look(
    id: wp.uint64,
    kind: int,
    voxels: wp.array(dtype=wp.vec3i),
    values: wp.array(dtype=wp.float64),
    samples: wp.array(dtype=wp.float64),
    places: wp.array(dtype=wp.vec3),
):
    n = wp.tid()
    i, j, k = voxels[n][0], voxels[n][1], voxels[n][2]
    at = wp.vec3(float(i) + 0.25, float(j) + 0.5, float(k) + 0.75)
    places[n] = wp.volume_index_to_world(id, at)
    if kind == 0:
        values[n] = wp.float64(wp.volume_lookup_f(id, i, j, k))
        samples[n] = wp.float64(wp.volume_sample_f(id, at, wp.Volume.LINEAR))
    elif kind == 1:
        values[n] = wp.volume_lookup(id, i, j, k, wp.float64)
        samples[n] = wp.volume_sample(id, at, wp.Volume.LINEAR, wp.float64)
    elif kind == 2:
        values[n] = wp.float64(wp.volume_lookup_i(id, i, j, k))
    else:
        values[n] = wp.float64(wp.volume_lookup_v(id, i, j, k)[2])
        samples[n] = wp.float64(wp.volume_sample_v(id, at, wp.Volume.LINEAR)[2])


def found_here(volume, kind, voxels):
    """Values, samples and their places, as kernels find them."""
    device, n = volume.device, len(voxels)
    given = wp.array(voxels.astype(np.int32), dtype=wp.vec3i, device=device)
    values, samples = (wp.zeros(n, dtype=wp.float64, device=device) for _ in range(2))
    places = wp.zeros(n, dtype=wp.vec3, device=device)
    inputs = [volume.id, KINDS.index(kind), given, values, samples, places]
    wp.launch(look, dim=n, inputs=inputs, device=device)
    return values.numpy(), samples.numpy(), places.numpy()


def ask(lines, *arguments):
    text = "\n".join(" ".join(f"{number:.17g}" for number in line) for line in lines)
    done = subprocess.run([PROGRAM, *arguments], input=text, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def found_by_openvdb(path, voxels):
    """Values, which are active, samples and their places."""
    table = np.array(ask(voxels, "read", path).split(), dtype=float).reshape(-1, 6)
    return table[:, 0], table[:, 1].astype(bool), table[:, 2], table[:, 3:]


def scattered(kind):
    """Voxels that are set, in leaves around the origin and far from it, and their values."""
    rng = np.random.default_rng(3)
    near, far = rng.integers(-20, 20, (400, 3)), rng.integers(-5000, 5000, (60, 3))
    voxels = np.unique(np.concatenate([near, far]), axis=0)
    values = rng.normal(0, 100, len(voxels))
    return voxels, np.round(values) if kind == "int32" else values.astype(np.float32)


def asked(voxels):
    """These voxels, their neighbours, and some within tiles and at their borders."""
    rng = np.random.default_rng(4)
    tiles = rng.integers(-2, 18, (200, 3)) + [-64, 0, 8]
    return np.concatenate([voxels, voxels + [1, 0, 0], voxels - [0, 1, 1], tiles])


def is_in_tile(voxels):
    return ((voxels >= [-64, 0, 8]) & (voxels < [-48, 16, 24])).all(axis=1)


def values_at(voxels, given, values):
    """The value of a voxel, of a tile, or the background; and its active state."""
    table = dict(zip(map(tuple, given), values, strict=True))
    elsewhere = np.where(is_in_tile(voxels), OF_TILES, BACKGROUND)
    at = [table.get(tuple(one), other) for one, other in zip(voxels, elsewhere, strict=True)]
    active = [tuple(one) in table for one in voxels] | is_in_tile(voxels)
    return np.array(at), active


@pytest.mark.parametrize("kind", KINDS)
def test_what_openvdb_makes_is_read(tmp_path, device, kind):
    path = tmp_path / "one.nvdb"
    given, values = scattered(kind)
    written = ask(np.column_stack([given, values]), "write", kind, path)
    voxels = asked(given)
    volume = wp.Volume.load_from_nvdb(path, device=device)
    found, samples, places = found_here(volume, kind, voxels)
    expected, expected_active = values_at(voxels, given, values)
    if kind == "int32":
        expected = np.trunc(expected)
    assert (found == expected).all()

    reference, active, sampled, world = found_by_openvdb(path, voxels)
    assert (reference == expected).all() and (active == expected_active).all()
    np.testing.assert_allclose(places, world, rtol=0, atol=4e-7 * np.abs(world).max())
    before = np.array(written.split(), dtype=float).reshape(-1, 3)
    np.testing.assert_allclose(world[: len(given)], before, rtol=0, atol=1e-11)
    if kind != "int32":
        limit = 4 * 2.0 ** (-52 if kind == "double" else -23) * np.abs(expected).max()
        np.testing.assert_allclose(samples, sampled, rtol=0, atol=limit)


@pytest.mark.parametrize("codec", ["none", "zip"])
def test_what_is_loaded_and_saved_is_the_same_for_openvdb(tmp_path, codec):
    first, second = tmp_path / "first.nvdb", tmp_path / "second.nvdb"
    given, values = scattered("float")
    ask(np.column_stack([given, values]), "write", "float", first)
    volume = wp.Volume.load_from_nvdb(first, device="cpu")
    # NanoVDB's program reads uncompressed files here.
    volume.save_to_nvdb(tmp_path / "saved.nvdb", codec)
    wp.Volume.load_from_nvdb(tmp_path / "saved.nvdb", device="cpu").save_to_nvdb(second)
    voxels = asked(given)
    for former, latter in zip(
        found_by_openvdb(first, voxels), found_by_openvdb(second, voxels), strict=True
    ):
        assert (former == latter).all()


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_made_here_openvdb_reads(tmp_path, device, kind):
    rng = np.random.default_rng(6)
    tiles = rng.integers(-300, 300, (50, 3))
    background = {"double": wp.float64(-7), "int32": -7, "Vec3f": (-7.0, -7.0, -7.0)}
    matrix = wp.mat33(0.25, 0.5, 0.0, -0.5, 0.25, 0.0, 0.0, 0.125, 2.0)
    volume = wp.Volume.allocate_by_tiles(
        wp.array(tiles.astype(np.int32), dtype=wp.int32, device=device),
        bg_value=background.get(kind, -7.0),
        transform=matrix,
        translation=(3.0, -40.0, 0.125),
        device=device,
    )
    volume.leaf_values.assign(
        rng.normal(0, 100, volume.leaf_values.shape + (3,) * (kind == "Vec3f"))
    )
    path = volume.save_to_nvdb(tmp_path / "one.nvdb")
    voxels = np.concatenate([tiles, tiles + rng.integers(-12, 12, tiles.shape)])
    found, samples, places = found_here(volume, kind, voxels)
    values, active, sampled, world = found_by_openvdb(path, voxels)
    owned = {tuple(tile) for tile in tiles // 8}
    assert (active == [tuple(voxel) in owned for voxel in voxels // 8]).all()
    assert (found == values).all() and (values[~active] == BACKGROUND).all()
    assert len(np.unique(values[active])) > 40
    np.testing.assert_allclose(places, world, rtol=0, atol=4e-7 * np.abs(world).max())
    if kind != "int32":
        limit = 4 * 2.0 ** (-52 if kind == "double" else -23) * np.abs(values).max()
        np.testing.assert_allclose(samples, sampled, rtol=0, atol=limit)
