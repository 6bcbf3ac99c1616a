"""`.nvdb` files that NanoVDB writes, read here, and the other way round (test/exchange)."""

import pathlib
import subprocess

import numpy as np
import pytest

import warp as wp

PROGRAM = pathlib.Path(wp.__file__).parents[2] / "bin" / "nvdb-exchange"
pytestmark = pytest.mark.skipif(not PROGRAM.exists(), reason="NanoVDB's headers are not installed")


@wp.kernel
def look(id: wp.uint64, out: wp.array3d(dtype=wp.float64)):
    i, j, k = wp.tid()
    x, y, z = i - 1, j - 1, k - 1
    found = wp.float64(wp.volume_lookup_f(id, x, y, z)) + wp.volume_lookup(id, x, y, z, wp.float64)
    found += wp.float64(wp.volume_lookup_i(id, x, y, z))
    found += wp.float64(wp.volume_lookup(id, x, y, z, wp.int64))
    out[i, j, k] = found + wp.float64(wp.volume_lookup_v(id, x, y, z)[2])


def run(*arguments):
    done = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def lookups(volume):
    """Values of voxels; of other types than the grid's they are 0."""
    out = wp.zeros((12, 11, 7), dtype=wp.float64, device=volume.device)
    wp.launch(look, dim=out.shape, inputs=[volume.id, out], device=volume.device)
    return out.numpy()


def read_by_nanovdb(path):
    return np.array(run("read", path).split(), dtype=float).reshape(12, 11, 7)


def expected():
    values = np.full((12, 11, 7), -7.0)
    i, j, k = np.indices((10, 9, 5))
    values[1:11, 1:10, 1:6] = i + 10 * j + 100 * k
    return values


@pytest.mark.parametrize(
    "kind, codec",
    [
        *((kind, "none") for kind in ("double", "int32", "int64", "Vec3f")),
        ("float", "zip"),
        ("float", "blosc"),
    ],
)
def test_what_nanovdb_writes_is_read(tmp_path, device, kind, codec):
    path = tmp_path / "one.nvdb"
    run("write", kind, codec, path)
    volume = wp.Volume.load_from_nvdb(path, device=device)
    assert (lookups(volume) == expected()).all()
    info = volume.get_grid_info()
    assert (info.name, info.type_str) == ("field", kind)
    assert list(info.translation) == [-1, 2, 3] and volume.get_voxel_size() == (0.5, 0.5, 0.5)


@pytest.mark.parametrize("kind, off", [("Fp4", 20), ("Fp8", 1.0), ("Fp16", 0.004), ("FpN", 20)])
def test_numbers_of_a_few_bits_are_those_of_nanovdb(tmp_path, device, kind, off):
    path = tmp_path / "one.nvdb"
    run("write", kind, "none", path)
    volume = wp.Volume.load_from_nvdb(path, device=device)
    found = lookups(volume)
    assert (found == read_by_nanovdb(path)).all()
    assert 0 < np.abs(found - expected()).max() <= off
    assert volume.dtype is wp.float32 and volume.get_tile_count() == 4
    again = wp.Volume.load_from_nvdb(volume.save_to_nvdb(tmp_path / "again.nvdb"), device="cpu")
    assert (read_by_nanovdb(tmp_path / "again.nvdb") == found).all()
    assert (lookups(again) == found).all()


@pytest.mark.parametrize(
    "dtype, codec",
    [
        *((dtype, "none") for dtype in (np.float64, np.int32, np.int64)),
        (np.float32, "zip"),
        (np.float32, "blosc"),
    ],
)
def test_what_is_saved_nanovdb_reads(tmp_path, dtype, codec):
    values = expected()[1:11, 1:10, 1:6].astype(dtype)
    background = {np.float32: -7.0, np.float64: wp.float64(-7), np.int32: -7}.get(
        dtype, wp.int64(-7)
    )
    volume = wp.Volume.load_from_numpy(values, (0, 0, 0), 1.0, background, device="cpu")
    path = volume.save_to_nvdb(tmp_path / "one.nvdb", codec)
    assert (read_by_nanovdb(path) == expected()).all()


@pytest.mark.parametrize("kind", ["Fp4", "FpN"])
def test_damaged_numbers_of_a_few_bits_are_refused_or_read(tmp_path, kind):
    path = tmp_path / "one.nvdb"
    run("write", kind, "none", path)
    data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    rng = np.random.default_rng(5)
    loaded = 0
    for turn in range(60):
        copy = data.copy()
        # Headers and the root, or leaves, which are last.
        where = (
            rng.integers(0, 1100, 2) if turn % 2 else rng.integers(len(data) - 1600, len(data), 2)
        )
        copy[where] ^= (1 << rng.integers(0, 8, 2)).astype(np.uint8)
        try:
            lookups(wp.Volume.load_from_nvdb(copy.tobytes(), device="cpu"))
        except RuntimeError:
            continue
        loaded += 1
    assert 0 < loaded < 60
