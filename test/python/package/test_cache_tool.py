"""`python -m warp.cache`: what is in the kernel cache, and what of it goes."""

import os
import subprocess
import sys
import time

import pytest

import programs
import warp.cache

PROGRAM = programs.write_program(
    """
import numpy as np
import warp as wp

@wp.kernel
def first(x: wp.array(dtype=float)):
    x[wp.tid()] = 1.0

@wp.kernel
def second(x: wp.array(dtype=float)):
    x[wp.tid()] = 2.0

x = wp.zeros(1000, dtype=float, device="cpu")
wp.launch(first, 1000, [x], device="cpu")
wp.launch(second, 1000, [x], device="cpu")
assert (x.numpy() == 2.0).all()
"""
)


@pytest.fixture
def folder(tmp_path):
    """A cache with two kernels, one of which was not used for ten days."""
    status, _, err = programs.run(PROGRAM, WARP_CACHE_PATH=tmp_path)
    assert status == 0, err
    (tmp_path / "notes.txt").write_text("not ours")
    return tmp_path


def call(folder, *arguments):
    process = subprocess.run(
        [sys.executable, "-m", "warp.cache", *arguments, "--folder", folder],
        capture_output=True,
        text=True,
        timeout=120,
    )
    return process.returncode, process.stdout, process.stderr


def files(folder):
    return sorted(path.suffix for path in folder.iterdir() if path.suffix != ".txt")


def make_old(folder, days, kernel=None):
    then = time.time() - days * 86400
    for path in folder.iterdir():
        os.utime(path, (then, then))


def test_size_and_list(folder):
    status, out, _ = call(folder)
    assert status == 0
    total = sum(path.stat().st_size for path in folder.iterdir() if path.suffix != ".txt")
    assert str(folder) in out and "of at most 4 GiB" in out
    assert f"{total / 1024:.1f} KiB" in out
    status, out, _ = call(folder, "list")
    assert status == 0
    assert [line.split()[-1] for line in sorted(out.splitlines())].count("first") >= 1
    assert "second" in out and "damaged" not in out
    (folder / ("0" * 64 + ".code")).write_bytes(b"WARPCODE damaged")
    assert "(damaged)" in call(folder, "list")[1]


def test_clear_by_kernel(folder):
    before = len(files(folder))
    status, out, _ = call(folder, "clear", "--kernel", "no_such_kernel")
    assert (status, out) == (0, "0 files removed\n")
    assert len(files(folder)) == before
    status, out, _ = call(folder, "clear", "--kernel", "first")
    assert status == 0 and int(out.split()[0]) >= 1
    assert 0 < len(files(folder)) < before
    assert programs.run(PROGRAM, WARP_CACHE_PATH=folder)[0] == 0


def test_times_of_lanes_are_entries(folder):
    """They are counted, named after the code that they are of, and go with it."""
    codes = list(folder.glob("*.code"))
    for code in codes:
        code.with_suffix(".lanes").write_text("lanes 1 scalar 2\n")
    out = call(folder)[1]
    counts = {line.split()[-4]: line.split() for line in out.splitlines() if "of lanes" in line}
    assert counts["lanes"][-3] == str(len(codes))
    assert "(damaged)" not in call(folder, "list")[1]
    assert call(folder, "clear", "--kernel", "first")[0] == 0
    assert len(list(folder.glob("*.lanes"))) == len(list(folder.glob("*.code"))) < len(codes)


def test_clear_by_age(folder):
    before = len(files(folder))
    assert call(folder, "clear", "--older-than", "1")[1] == "0 files removed\n"
    make_old(folder, 10)
    assert call(folder, "clear", "--older-than", "11")[1] == "0 files removed\n"
    assert call(folder, "clear", "--older-than", "9.5")[1] == f"{before} files removed\n"
    assert files(folder) == [] and (folder / "notes.txt").exists()


def test_clear_all(folder):
    assert call(folder, "clear")[0] == 0
    assert files(folder) == [] and (folder / "notes.txt").exists()
    assert programs.run(PROGRAM, WARP_CACHE_PATH=folder)[0] == 0


def test_wrong_arguments(folder, tmp_path):
    for arguments in (
        ["list", "--kernel", "first"],
        ["clear", "--older-than", "-1"],
        ["clear", "--older-than", "nan"],
        ["empty"],
    ):
        status, _, err = call(folder, *arguments)
        assert status == 2 and "error: " in err, arguments
    status, _, err = call(tmp_path / "nowhere")
    assert status == 2 and "no folder" in err
    with pytest.raises(ValueError, match="no negative number"):
        warp.cache.clear(older_than=-1)


def test_a_use_counts(folder):
    """A process that reads an entry uses it."""
    make_old(folder, 10)
    assert programs.run(PROGRAM, WARP_CACHE_PATH=folder)[0] == 0
    assert call(folder, "clear", "--older-than", "9")[1] == "0 files removed\n"


def test_out_of_disk(tmp_path):
    """Files that cannot be written cost one notice; nothing half-written stays."""
    program = programs.write_program(
        """
import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))
"""
        + PROGRAM.read_text()
    )
    status, _, err = programs.run(program, WARP_CACHE_PATH=tmp_path)
    assert status == 0, err
    assert err.count("cannot write to kernel cache") == 1
    assert list(tmp_path.iterdir()) == []
    assert programs.run(PROGRAM, WARP_CACHE_PATH=tmp_path)[0] == 0
    assert len(files(tmp_path)) >= 4


def test_two_processes_within_a_limit(tmp_path):
    """A cache that is too small for anything is a cache that is empty."""
    both = [
        programs.start(PROGRAM, WARP_CACHE_PATH=tmp_path, WARP_KERNEL_CACHE_LIMIT="0.000001")
        for _ in range(2)
    ]
    for process in both:
        _, err = process.communicate(timeout=120)
        assert process.returncode == 0, err
