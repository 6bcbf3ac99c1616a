"""The kernel cache under damage, without permission, under kill and under many writers."""

import os
import shutil
import signal
import time
from pathlib import Path

import pytest

import programs
from kernel_cache import PROGRAM


def check_right(folder, count=1):
    """Run the program with its cache in `folder`; it must succeed."""
    status, out, err = programs.run(PROGRAM, count, WARP_CACHE_PATH=folder)
    assert status == 0, f"status {status}\n{out}\n{err}"
    assert out.strip() == f"right {count}"


def entries(folder):
    """All regular files under the cache folder."""
    return sorted(path for path in Path(folder).rglob("*") if path.is_file())


def test_cache_is_filled_and_used(tmp_path):
    check_right(tmp_path)
    before = {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in entries(tmp_path)}
    assert before
    check_right(tmp_path)
    after = {path: path.read_bytes() for path in entries(tmp_path)}
    assert after == {path: content for path, (_, content) in before.items()}


def damage_truncate(content):
    return [content[:k] for k in (0, 1, 7, len(content) // 2, len(content) - 1)]


def damage_flip(content):
    places = range(0, len(content), max(1, len(content) // 12))
    return [content[:k] + bytes([content[k] ^ 0x55]) + content[k + 1 :] for k in places]


def damage_foreign(content):
    return [
        b"\x7fELF" + os.urandom(500),
        b"{}",
        b"not a cache entry\n",
        bytes(len(content)),
        content + b"more",
        content + content,
    ]


@pytest.mark.parametrize("damage", [damage_truncate, damage_flip, damage_foreign])
def test_damaged_entries_are_recompiled(tmp_path, damage):
    check_right(tmp_path)
    for path in entries(tmp_path):
        content = path.read_bytes()
        for bad in damage(content):
            path.write_bytes(bad)
            check_right(tmp_path)
            path.write_bytes(content)


def test_damaged_entry_is_replaced(tmp_path):
    check_right(tmp_path)
    whole = {path: path.read_bytes() for path in entries(tmp_path)}
    for path, content in whole.items():
        path.write_bytes(content[: len(content) // 2])
    check_right(tmp_path)
    check_right(tmp_path)
    for path, content in whole.items():
        assert len(path.read_bytes()) >= len(content) // 2 + 1


def test_entry_of_another_kernel(tmp_path):
    """Contents exchanged between entries: the key inside does not match, so neither is used."""
    check_right(tmp_path, 2)
    files = entries(tmp_path)
    contents = [path.read_bytes() for path in files]
    for path, content in zip(files, contents[1:] + contents[:1]):
        path.write_bytes(content)
    check_right(tmp_path, 2)


def test_entry_that_is_a_folder_or_a_dead_link(tmp_path):
    check_right(tmp_path)
    for path in entries(tmp_path):
        path.unlink()
        path.mkdir()
    check_right(tmp_path)
    for path in list(tmp_path.rglob("*")):
        if path.is_dir() and not any(path.iterdir()):
            path.rmdir()
            path.symlink_to("/nonexistent/target")
            break
    check_right(tmp_path)


def test_cache_folder_that_cannot_be_written(tmp_path):
    blocked = tmp_path / "a file"
    blocked.write_text("in the way")
    check_right(blocked / "cache")
    check_right("/proc/no-such-folder")
    check_right("/dev/null")
    assert blocked.read_text() == "in the way"


def test_read_only_cache_is_read(tmp_path):
    check_right(tmp_path)
    for path in tmp_path.rglob("*"):
        path.chmod(0o555 if path.is_dir() else 0o444)
    tmp_path.chmod(0o555)
    try:
        check_right(tmp_path, 2)
    finally:
        tmp_path.chmod(0o755)
        for path in tmp_path.rglob("*"):
            path.chmod(0o755)


def test_cache_folder_removed_while_running(tmp_path):
    process = programs.start(PROGRAM, 20, WARP_CACHE_PATH=tmp_path / "cache")
    deadline = time.monotonic() + 60
    while process.poll() is None and time.monotonic() < deadline:
        shutil.rmtree(tmp_path / "cache", ignore_errors=True)
        time.sleep(0.005)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert out.strip() == "right 20"


def test_process_killed_while_writing(tmp_path):
    """Kill at many moments after the first entry appears; what is left must be usable."""
    killed = 0
    for attempt in range(8):
        folder = tmp_path / f"cache{attempt}"
        process = programs.start(PROGRAM, 40, WARP_CACHE_PATH=folder)
        deadline = time.monotonic() + 60
        while process.poll() is None and not (folder.exists() and entries(folder)):
            assert time.monotonic() < deadline
            time.sleep(0.0005)
        time.sleep(0.004 * attempt)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        killed += process.returncode == -signal.SIGKILL
        check_right(folder, 40)
    assert killed


def test_sixteen_processes_compile_the_same_kernels(tmp_path):
    processes = [programs.start(PROGRAM, 4, WARP_CACHE_PATH=tmp_path) for _ in range(16)]
    for process in processes:
        out, err = process.communicate(timeout=240)
        assert process.returncode == 0, err
        assert out.strip() == "right 4"
    check_right(tmp_path, 4)


def test_clear_kernel_cache(fresh_cache):
    import warp as wp

    check_right(fresh_cache)
    (fresh_cache / "keep.txt").write_text("not ours")
    wp.clear_kernel_cache()
    assert [path.name for path in entries(fresh_cache)] == ["keep.txt"]
    check_right(fresh_cache)
