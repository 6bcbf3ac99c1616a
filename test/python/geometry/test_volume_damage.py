"""Grids of files and of memory that are not what they say are errors, whatever is wrong."""

import pathlib
import struct

import numpy as np
import pytest

import warp as wp

DATA = pathlib.Path(__file__).parent / "data"
# Where a grid has what: the header, then the tree, whose offsets are from its own start.
FLAGS, SIZE, NAME, TYPE, ARRAYS, ARRAY_COUNT = 20, 32, 40, 636, 640, 648
TREE, ROOT_OFFSET, LEVEL_COUNTS = 672, 672 + 24, 672 + 32
INVALID = "Invalid NanoVDB grid structure"


def put(data, at, form, *values):
    struct.pack_into("<" + form, data, at, *values)


def get(data, at, form):
    return struct.unpack_from("<" + form, data, at)[0]


def grid():
    """The bytes of a grid with numbers of voxels, and behind it an array of 100 bytes."""
    volume = wp.Volume.load_from_nvdb(DATA / "onindex.nvdb", device="cpu")
    data = bytearray(volume.array().numpy()[: volume.get_grid_info().size_in_bytes])
    end = len(data)
    data += bytes(288 + 128)
    put(data, end, "qQIIII", 288, 25, 4, 0, 0, 1)
    data[end + 32 : end + 39] = b"numbers"
    data[end + 288 :] = bytes(range(128))
    put(data, SIZE, "Q", len(data))
    put(data, ARRAYS, "qI", end, 1)
    return data


def in_file(*grids):
    """An .nvdb file without a codec."""
    about, payload = b"", b""
    for data in grids:
        one = bytearray(176)
        put(one, 0, "QQ", len(data), len(data))
        put(one, 136, "I", 1)
        about += bytes(one) + b"\0"
        payload += bytes(data)
    return struct.pack("<QIHH", 0x304244566F6E614E, 32 << 21, len(grids), 0) + about + payload


def load(*grids):
    return wp.Volume.load_from_nvdb(in_file(*grids), device="cpu")


def of_memory(data):
    return wp.Volume(wp.array(np.frombuffer(data, np.uint8), device="cpu"))


def test_what_is_right_is_loaded():
    data = grid()
    for volume in (load(data), of_memory(data)):
        assert volume.get_feature_array_count() == 1 and volume.get_voxel_count() == 339
        info = volume.get_feature_array_info(0)
        assert (info.name, info.value_size, info.value_count) == ("numbers", 4, 25)
        assert volume.feature_array(0).numpy().tobytes() == bytes(range(100))


def test_levels_do_not_overlap():
    """One of two levels, or of the last one and the arrays, begins 32 bytes too early."""
    for level in range(3):
        data = grid()
        offset = get(data, TREE + 8 * level, "q")
        put(data, TREE + 8 * level, "q", offset - 32)
        for make in (load, of_memory):
            with pytest.raises(RuntimeError, match=INVALID):
                make(data)
    data = grid()
    put(data, ARRAYS, "q", get(data, ARRAYS, "q") - 32)
    with pytest.raises(RuntimeError, match="its arrays overlap its nodes"):
        load(data)


@pytest.mark.parametrize("count", range(3))
def test_counts_of_levels(count):
    for wrong in (0, 0xFFFFFFFF):
        data = grid()
        put(data, LEVEL_COUNTS + 4 * count, "I", wrong)
        with pytest.raises(RuntimeError, match=INVALID):
            of_memory(data)


def test_names_have_an_end():
    data = grid()
    array = get(data, ARRAYS, "q")
    for name in (NAME, array + 32):
        wrong = bytearray(data)
        wrong[name : name + 256] = b"A" * 256
        for make in (load, of_memory):
            with pytest.raises(RuntimeError, match="has no end"):
                make(wrong)


def test_arrays_are_within_the_grid():
    data = grid()
    array, size = get(data, ARRAYS, "q"), len(data)
    tables = [(-1, 1), (size, 1), (size - 287, 1), (array, 2), (array, 0xFFFFFFFF)]
    for offset, count in tables:
        wrong = bytearray(data)
        put(wrong, ARRAYS, "qI", offset, count)
        with pytest.raises(RuntimeError, match=INVALID):
            of_memory(wrong)
    contents = [
        *((-(2**63), 1, 1), (-array - 1, 1, 1), (size - array + 1, 0, 1)),
        *((288, 129, 1), (288, 2**63, 3), (size - array, 1, 1)),
    ]
    for offset, count, value_size in contents:
        wrong = bytearray(data)
        put(wrong, array, "qQI", offset, count, value_size)
        with pytest.raises(RuntimeError, match=INVALID):
            of_memory(wrong)
    # In front of its description, but in the grid.
    put(data, array, "qQI", -array, 8, 1)
    assert of_memory(data).feature_array(0, dtype=wp.uint8).numpy().tobytes() == data[:8]


def test_descriptions_of_arrays_stay_as_they_were_checked():
    data = grid()
    memory = wp.array(np.frombuffer(data, np.uint8), device="cpu")
    volume = wp.Volume(memory, copy=False)
    before = volume.get_feature_array_info(0)
    put(data, get(data, ARRAYS, "q"), "qQI", -(2**40), 2**40, 8)
    memory.assign(np.frombuffer(data, np.uint8))
    assert volume.get_feature_array_info(0) == before


def test_rules_of_files():
    """A type, a size and a layout that memory may have, but no file; of later grids, too."""
    data = grid()
    other = bytearray(data)
    put(other, FLAGS, "I", get(data, FLAGS, "I") & ~32)
    odd = data + b"\0"
    put(odd, SIZE, "Q", len(odd))
    untyped = bytearray(data)
    put(untyped, TYPE, "I", 0)
    for wrong, message in (
        (other, "Unsupported NanoVDB tree layout"),
        (odd, INVALID + ".* no multiple of 32"),
        (untyped, INVALID),
    ):
        for grids in ([wrong], [data, wrong]):
            for index, one in enumerate(grids):
                put(one, 24, "II", index, len(grids))
            with pytest.raises(RuntimeError, match=message):
                load(*grids)
        put(data, 24, "II", 0, 1)
    of_memory(odd)
    rootless = bytearray(data)
    put(rootless, ROOT_OFFSET, "q", len(data))
    for index, one in enumerate((other, rootless)):
        put(one, 24, "II", index, 2)
    with pytest.raises(RuntimeError, match=INVALID):
        load(other, rootless)
