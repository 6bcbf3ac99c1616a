"""Changed files whose checksums fit: whatever their fields say, loading them is refused with an
error that names the file, or works; it ends no process and writes nowhere."""

import os
import struct
import subprocess
import sys
from pathlib import Path

import pytest
from support import sealed_cases
from support.random_runs import seeds
from support.sealed_files import HEADER, hash_bytes, resealed

import warp as wp
from warp import saved


@pytest.fixture(scope="module")
def graph(tmp_path_factory):
    return sealed_cases.make_graph(str(tmp_path_factory.mktemp("graph")))


def load(graph, name, code):
    return wp.capture_load_from_bytes(graph, {name: code}, device="cpu")


@pytest.mark.parametrize("kind", ["module", "graph", "cache"])
def test_random_changes(kind, tmp_path):
    program = sealed_cases.__file__
    made = subprocess.run(
        [sys.executable, program, kind, str(tmp_path), *map(str, seeds(400))],
        capture_output=True,
        text=True,
    )
    last = made.stdout.strip().splitlines()[-2:]
    assert made.returncode == 0 and last[-1] == "done", (last, made.stderr[-2000:])


def replaced(data, old, new):
    """All places of some bytes, one after the other, with others instead."""
    at = data.find(old, HEADER)
    while at >= 0:
        yield resealed(data[:at] + new + data[at + len(old) :])
        at = data.find(old, at + 1)


def test_a_block_is_as_large_as_what_operations_reach(graph):
    """Zeros as well: 80 bytes that say they are 17 GB are not believed."""
    changed, *same = graph
    found = 0
    for larger in replaced(changed, struct.pack("<Q", 80), struct.pack("<Q", 80 + (4 << 32))):
        with pytest.raises(wp.WarpError, match="saved graph 'bytes'"):
            load(larger, *same)
        found += 1
    assert found


def test_pointers_of_updates_lead_somewhere(graph):
    """Geometry whose points, boxes or faces are nowhere."""
    changed, *same = graph
    for blocks in (4, 6, 8):
        for at in range(HEADER, len(changed) - 4 * blocks - 8):
            if struct.unpack_from("<Q", changed, at)[0] != blocks:
                continue
            places = struct.unpack_from(f"<{blocks}I", changed, at + 8)
            for i in (i for i, block in enumerate(places) if block < 64):
                lost = bytearray(changed)
                struct.pack_into("<i", lost, at + 8 + 4 * i, -1)
                try:
                    load(resealed(bytes(lost)), *same)
                except wp.WarpError as error:
                    assert sealed_cases.is_clear(error)


@pytest.mark.parametrize("offset", [-(2**63), -8, 0, 2**24 + 8, 2**62])
def test_places_of_arguments(graph, offset):
    changed, name, code = graph
    # Name, kind and type of the first argument stand before its place.
    at = code.index(b"\x01\0\0\0\0\0\0\0x") + 9
    at += 9 + struct.unpack_from("<Q", code, at + 1)[0]
    moved = resealed(code[:at] + struct.pack("<q", offset) + code[at + 8 :])
    old, new = (struct.pack("<Q", hash_bytes(one)) for one in (code, moved))
    with pytest.raises(wp.WarpError, match="the place of an argument|layout"):
        load(resealed(changed.replace(old, new)), name, moved)


def relocations(code):
    """Places of the offsets of relocations in the objects of a saved module."""
    at = code.find(b"\x7fELF")
    while at >= 0:
        (sections,) = struct.unpack_from("<Q", code, at + 40)
        size, count = struct.unpack_from("<HH", code, at + 58)
        for i in range(count):
            header = at + sections + i * size
            kind, start, length = struct.unpack_from("<4xI16xQQ", code, header)
            if kind == 4:
                yield from range(at + start, at + start + length, 24)
        at = code.find(b"\x7fELF", at + 1)


def test_relocations_stay_in_their_sections(graph):
    changed, name, code = graph
    found = 0
    for at in relocations(code):
        (info,) = struct.unpack_from("<Q", code, at + 8)
        if info & 0xFFFFFFFF not in (1, 2, 4):
            continue
        moved = resealed(code[:at] + struct.pack("<Q", 1 << 30) + code[at + 8 :])
        old, new = (struct.pack("<Q", hash_bytes(one)) for one in (code, moved))
        # Code that nothing leads to is not linked.
        try:
            load(resealed(changed.replace(old, new)), name, moved)
        except wp.WarpError as error:
            assert "is damaged, " in str(error)
            found += "cannot load compiled code" in str(error)
    assert found


def test_memory_has_a_limit(graph):
    assert wp.capture_load_from_bytes(graph[0], {graph[1]: graph[2]}, "cpu", 1 << 20)
    with pytest.raises(wp.WarpError, match="is to have at most 1000 bytes"):
        wp.capture_load_from_bytes(graph[0], {graph[1]: graph[2]}, "cpu", memory_limit=1000)
    with pytest.raises(ValueError, match="memory_limit"):
        wp.capture_load_from_bytes(graph[0], {}, "cpu", memory_limit="1 GB")


NAMES = ["../../outside/scale", "/tmp/outside-scale", "..", ".hidden", "a/b\\c", "x" * 300]


@pytest.mark.parametrize("name", NAMES)
def test_names_of_kernels_stay_in_their_folder(name, tmp_path):
    module = sealed_cases.make_module(str(tmp_path))[0]
    old = struct.pack("<Q", 5) + b"scale"
    at = module.index(old)
    new = struct.pack("<Q", len(name)) + name.encode()
    path = tmp_path / "a" / "other.warp"
    path.parent.mkdir()
    path.write_bytes(resealed(module[:at] + new + module[at + len(old) :]))
    before = set(tmp_path.rglob("*"))
    written = saved.extract(path, tmp_path / "a" / "out")
    assert all(one.parent == tmp_path / "a" / "out" / "other" for one in written)
    made = set(tmp_path.rglob("*")) - before
    assert {one for one in made if one.is_file()} == set(written)


def test_nothing_is_written_through_links(tmp_path):
    module = sealed_cases.make_module(str(tmp_path))[0]
    path, victim = tmp_path / "other.warp", tmp_path / "victim"
    path.write_bytes(module)
    victim.write_text("mine")
    (tmp_path / "out" / "other").mkdir(parents=True)
    first = saved._name(0, saved.read(path)[0])
    os.symlink(victim, tmp_path / "out" / "other" / first)
    assert saved.main([str(path), "--extract", str(tmp_path / "out")]) == 1
    assert victim.read_text() == "mine"
    os.symlink(tmp_path / "out", tmp_path / "linked")
    os.rename(tmp_path / "out" / "other", tmp_path / "out" / "moved")
    os.symlink(tmp_path, tmp_path / "out" / "other")
    assert saved.main([str(path), "--extract", str(tmp_path / "linked")]) == 1
    assert not list(tmp_path.glob("*.o"))
    # A file whose name without its ending leads upwards.
    Path(tmp_path / "...warp").write_bytes(module)
    written = saved.extract(tmp_path / "...warp", tmp_path / "up")
    assert all(one.parent == tmp_path / "up" / "_" for one in written)


def test_the_checksum_is_that_of_the_runtime(graph):
    assert resealed(graph[0]) == graph[0]
