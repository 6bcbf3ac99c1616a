"""`.nvdb` files: those of NVIDIA Warp, round trips, damage.

data/float.nvdb, data/onindex.nvdb were written by NVIDIA Warp 1.19: i + 10 j + 100 k in (10, 9, 5)
voxels with the background -7, and 339 voxels that have numbers.
"""

import io
import pathlib

import numpy as np
import pytest

import warp as wp

DATA = pathlib.Path(__file__).parent / "data"


@wp.kernel
def look(id: wp.uint64, out: wp.array3d(dtype=float)):
    i, j, k = wp.tid()
    out[i, j, k] = wp.volume_lookup_f(id, i - 1, j - 1, k - 1)


def lookups(volume):
    out = wp.zeros((12, 11, 7), dtype=float, device=volume.device)
    wp.launch(look, dim=out.shape, inputs=[volume.id, out], device=volume.device)
    return out.numpy()


def expected():
    i, j, k = np.indices((10, 9, 5))
    values = np.full((12, 11, 7), -7.0)
    values[1:11, 1:10, 1:6] = i + 10 * j + 100 * k
    return values


def test_file_of_another_program(device):
    volume = wp.Volume.load_from_nvdb(DATA / "float.nvdb", device=device)
    assert (lookups(volume) == expected()).all()
    info = volume.get_grid_info()
    assert (info.type_str, info.grid_count, volume.dtype) == ("float", 1, wp.float32)
    assert list(info.translation) == [-1.0, 2.0, 3.0]
    assert volume.get_voxel_size() == (0.5, 0.25, 2.0)


def test_numbers_of_voxels_in_a_file_of_another_program(device):
    @wp.kernel
    def number(id: wp.uint64, voxel: wp.array(dtype=wp.vec3i), out: wp.array(dtype=int)):
        i = wp.tid()
        v = voxel[i]
        out[i] = wp.volume_lookup_index(id, v[0], v[1], v[2])

    with open(DATA / "onindex.nvdb", "rb") as file:
        volume = wp.Volume.load_from_nvdb(file, device=device)
    assert volume.is_index and volume.dtype is None
    voxels = volume.get_voxels()
    assert len(np.unique(voxels.numpy(), axis=0)) == volume.get_voxel_count() == 339
    given = wp.array(voxels.numpy(), dtype=wp.vec3i, device=device)
    out = wp.zeros(339, dtype=int, device=device)
    wp.launch(number, dim=339, inputs=[volume.id, given, out], device=device)
    assert (out.numpy() == np.arange(339)).all()


@pytest.mark.parametrize("codec", ["none", "zip"])
def test_what_is_saved_is_loaded(tmp_path, codec):
    values = expected()[1:11, 1:10, 1:6]
    volume = wp.Volume.load_from_numpy(values, (-1, 2, 3), (0.5, 0.25, 2), -7.0, device="cpu")
    path = volume.save_to_nvdb(tmp_path / "grid.nvdb", codec)
    again = wp.Volume.load_from_nvdb(path, device="cpu")
    assert (lookups(again) == expected()).all()
    assert (again.array().numpy() == volume.array().numpy()).all()


def two_grids():
    first = wp.Volume.load_from_numpy(np.zeros((8, 8, 8)), device="cpu").array().numpy().copy()
    second = wp.Volume.load_from_numpy(expected()[1:11, 1:10, 1:6], bg_value=-7.0, device="cpu")
    second = second.array().numpy().copy()
    for index, grid in enumerate((first, second)):
        grid[24:32] = np.array([index, 2], dtype="<u4").view(np.uint8)
    return np.concatenate([first, second])


def test_several_grids(tmp_path):
    volume = wp.Volume(wp.array(two_grids(), dtype=wp.uint8, device="cpu"))
    following = volume.load_next_grid()
    assert (lookups(following) == expected()).all()
    assert following.load_next_grid() is None
    with pytest.raises(RuntimeError, match="load_next_grid"):
        following.save_to_nvdb(tmp_path / "second.nvdb")
    path = volume.save_to_nvdb(tmp_path / "two.nvdb", "zip")
    again = wp.Volume.load_from_nvdb(path, device="cpu").load_next_grid()
    assert (lookups(again) == expected()).all()


def test_damaged_files_are_errors():
    data = (DATA / "float.nvdb").read_bytes()
    for wrong, message in (
        (b"", "too short"),
        (b"x" * 1000, "signature"),
        (data[:1000], "ends after"),
        (data[:8] + b"\0\0\0\0" + data[12:], "version"),
        (data[:14] + b"\7\0" + data[16:], "codec"),
        (data[:900] + bytes(100) + data[1000:], "damaged"),
    ):
        with pytest.raises(RuntimeError, match=message):
            wp.Volume.load_from_nvdb(wrong, device="cpu")


def test_counts_that_a_damaged_grid_claims_are_checked(tmp_path):
    path = wp.Volume.load_from_nvdb(DATA / "onindex.nvdb", device="cpu").save_to_nvdb(
        tmp_path / "plain.nvdb"
    )
    data = bytearray(pathlib.Path(path).read_bytes())
    tree = len(data) - wp.Volume.load_from_nvdb(path, device="cpu").get_grid_info().size_in_bytes
    tree += 672
    # Fewer voxels than are active, more than there are numbers, and a packed grid that says it has
    # more bytes than fit into memory.
    for count in (338, 2**40):
        wrong = data.copy()
        wrong[tree + 56 : tree + 64] = count.to_bytes(8, "little")
        with pytest.raises(RuntimeError, match="damaged"):
            wp.Volume.load_from_nvdb(bytes(wrong), device="cpu")
    packed = bytearray((DATA / "float.nvdb").read_bytes())
    packed[16:24] = (2**63).to_bytes(8, "little")
    with pytest.raises(RuntimeError, match="do not unpack to 9223372036854775808"):
        wp.Volume.load_from_nvdb(bytes(packed), device="cpu")


def test_bits_that_flip_never_crash(tmp_path):
    """A damaged grid is refused, or is walked within its bytes."""
    path = wp.Volume.load_from_nvdb(DATA / "float.nvdb", device="cpu").save_to_nvdb(
        tmp_path / "plain.nvdb"
    )
    data = np.frombuffer(pathlib.Path(path).read_bytes(), dtype=np.uint8)
    rng = np.random.default_rng(3)
    loaded = 0
    for turn in range(300):
        copy = data.copy()
        # Headers, the root and masks of nodes hold all that leads anywhere.
        where = rng.integers(0, 1400 if turn % 2 else len(data), 3)
        copy[where] ^= (1 << rng.integers(0, 8, 3)).astype(np.uint8)
        try:
            volume = wp.Volume.load_from_nvdb(io.BytesIO(copy.tobytes()), device="cpu")
        except RuntimeError:
            continue
        lookups(volume)
        loaded += 1
    assert 0 < loaded < 300


def test_levels_without_nodes_may_lie_anywhere(tmp_path):
    points = wp.zeros((0, 3), dtype=wp.int32, device="cpu")
    empty = wp.Volume.allocate_by_voxels(points, 0.1, device="cpu")
    data = bytearray(pathlib.Path(empty.save_to_nvdb(tmp_path / "empty.nvdb")).read_bytes())
    tree = len(data) - empty.get_grid_info().size_in_bytes + 672
    for level, place in enumerate((0, 1, 2**64 - 1)):
        data[tree + 8 * level : tree + 8 * level + 8] = place.to_bytes(8, "little")
    read = wp.Volume.load_from_nvdb(bytes(data), device="cpu")
    assert (lookups(read) == 0.0).all() and read.get_voxel_count() == 0
