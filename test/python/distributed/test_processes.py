"""Many processes of a host: one compiles for all, and threads are as many as launchers say."""

import importlib.util
import os
import pickle
import subprocess
import sys
import time
import types

import launcher
import numpy as np
import pytest

import warp as wp
import warp.distributed as wd
from warp._src.distributed import graphs, nccl, start
from warp.distributed import DistributedError

THREADS = """
import os, warp as wp
wp.config.quiet = True
x = wp.zeros(4_000_000, dtype=float, device="cpu")
wp.map(wp.sin, x)
names = [open(f"/proc/self/task/{t}/comm").read().strip() for t in os.listdir("/proc/self/task")]
print(names.count("warp-worker") + 1)
"""


def together(count, cache):
    """CPU seconds of the first launches of each process, and their results."""
    at = time.time() + 1.0 + 0.4 * count
    command = [sys.executable, str(launcher.FOLDER / "twelve_kernels.py"), str(at)]
    env = launcher.environment(WARP_CACHE_PATH=str(cache))
    children = [
        subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True) for _ in range(count)
    ]
    rows = [child.communicate(timeout=200)[0].split() for child in children]
    return sum(float(row[0]) for row in rows), {row[1] for row in rows}


def test_one_process_compiles_for_all(tmp_path):
    alone, one = together(1, tmp_path / "one")
    warm, _ = together(1, tmp_path / "one")
    many, results = together(4, tmp_path / "many")
    assert results == one
    # All four compile without claims: four times the time of one.
    assert many < alone + 3 * warm + alone, (alone, warm, many)
    left = [name for name in os.listdir(tmp_path / "many") if name.endswith(".claim")]
    assert not left


@pytest.mark.parametrize(
    ("variables", "threads"),
    [
        ({"OMP_NUM_THREADS": "3"}, 3),
        ({"OMP_NUM_THREADS": "3", "WARP_NUM_THREADS": "2"}, 2),
        ({"OMP_NUM_THREADS": "4,2"}, 4),
    ],
)
def test_threads_of_launchers(variables, threads):
    env = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")} | variables
    done = subprocess.run(
        [sys.executable, "-c", THREADS], env=env, capture_output=True, text=True, timeout=60
    )
    assert done.stdout.strip() == str(threads), done.stdout + done.stderr


@pytest.mark.parametrize(
    ("ranks", "shares"),
    [
        # CPUs of the host are divided, and not those that a launcher has bound ranks to.
        ([("a", 8, 999, "0::/")] * 4, [2] * 4),
        ([("a", {0, 1}, 999, "0::/"), ("a", {2, 3}, 999, "0::/")], [2, 2]),
        ([("a", 3, 999, "0::/")] * 4, [1] * 4),
        # So is a quota, over the ranks of its group.
        ([("a", 64, 6, "0::/job")] * 3, [2] * 3),
        ([("a", 64, 6, "0::/one"), ("a", 64, 4, "0::/two")], [6, 4]),
        ([("a", 64, 1, "0::/job")] * 2, [1, 1]),
        # Ranks of other hosts have theirs.
        ([("a", 8, 4, "0::/"), ("b", 8, 4, "0::/")], [4, 4]),
    ],
)
def test_threads_of_ranks(ranks, shares):
    facts = [
        (host, set(range(cpus)) if isinstance(cpus, int) else cpus, quota, groups)
        for host, cpus, quota, groups in ranks
    ]
    assert [start._share_of(rank, facts) for rank in range(len(facts))] == shares


def test_the_package_is_imported_by_nobody():
    code = "import warp, sys; print([m for m in sys.modules if 'distributed' in m])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "[]", done.stdout + done.stderr


def test_engines_are_imported_when_they_are_used():
    code = """
import sys, time, warp
before = set(sys.modules)
import warp.distributed
found = {name.partition(".")[0] for name in set(sys.modules) - before}
print(sorted(found & {"mpi4py", "torch", "ray", "dask", "pymetis", "cupy"}))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "[]", done.stdout + done.stderr


def test_a_missing_engine_says_what_to_install():
    code = """
import sys
sys.modules["mpi4py"] = None
import warp as wp, warp.distributed as wd
wp.config.quiet = True
try:
    wd.init("mpi")
except Exception as problem:
    print(problem)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert "mpi4py" in done.stdout and "install it" in done.stdout, done.stdout + done.stderr


def test_more_ranks_than_gpus_and_launchers_that_show_one(monkeypatch):
    chosen = []
    monkeypatch.setattr(start.wp, "get_cuda_device_count", lambda: 1)
    monkeypatch.setattr(start.wp, "get_device", chosen.append)
    monkeypatch.setattr(start.wp, "set_device", lambda device: None)
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    with pytest.raises(DistributedError, match=r"rank 3: no GPU is left for it, 2 ranks .* have 1"):
        start._device(3, 1, 2, None)
    # A launcher shows each rank its own GPU as the only one.
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "3")
    start._device(3, 1, 2, None)
    assert chosen == ["cuda:0"]


def test_ranks_without_gpus_beside_ranks_with_some():
    comm = types.SimpleNamespace(rank=0, device="cuda:0", gather_objects=lambda one: [one, "cpu"])
    with pytest.raises(DistributedError, match="rank 0: init: rank 1 computes on 'cpu'"):
        start._check_devices(comm)
    comm.gather_objects = lambda one: ["cuda:0", "cuda:1"]
    start._check_devices(comm)


def test_libraries_that_are_not_there(monkeypatch):
    """NCCL says what to install; without METIS nodes are split along their numbers."""
    monkeypatch.setattr(nccl, "_candidates", lambda: ["libnothing.so.2"])
    with pytest.raises(DistributedError, match=r"rank 3: wd.nccl: .* install nvidia-nccl-cu12"):
        nccl._load(3)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    ends = np.arange(9), np.arange(9)[::-1]
    assert graphs.owners_of(*ends, 9, 3, "metis").tolist() == [0] * 3 + [1] * 3 + [2] * 3


def test_metis_cuts_fewer_edges():
    """Parts of equal sizes, with fewer edges between them than rows or a curve have."""
    pytest.importorskip("pymetis")
    n, ranks = 24, 5
    number = np.arange(n * n).reshape(n, n)
    a = np.concatenate([number[1:].ravel(), number[:, 1:].ravel()])
    b = np.concatenate([number[:-1].ravel(), number[:, :-1].ravel()])
    points = np.stack(np.unravel_index(np.arange(n * n), (n, n)), 1)
    cut = {}
    for by in ("rows", "hilbert", "metis"):
        owners = graphs.owners_of(np.r_[a, b], np.r_[b, a], n * n, ranks, by, points)
        counts = np.bincount(owners, minlength=ranks)
        assert counts.max() <= 1.05 * n * n / ranks
        cut[by] = (owners[a] != owners[b]).sum()
    assert cut["metis"] < min(cut["rows"], cut["hilbert"]), cut


def test_a_handle_opens_the_array_itself_where_it_was_made(device):
    """CUDA opens no handle in the process that it comes from; pickles have the handle alone."""
    array = wp.array([1.0, 2.0, 3.0], dtype=float, device=device)
    made, handle = wd.share(array)
    assert handle.open().numpy().tolist() == [1.0, 2.0, 3.0]
    handle.open().fill_(4.0)
    assert made.numpy().tolist() == [4.0] * 3
    assert pickle.loads(pickle.dumps(handle)).array is None
    handle.close()
    # As it is for memory of a GPU.
    kept = wd.Shared("", float, (3,), b"handle", str(device), made)
    assert kept.open().ptr == made.ptr
    copy = pickle.loads(pickle.dumps(kept))
    assert copy.open().ptr == made.ptr
    kept.close()
    with pytest.raises(RuntimeError):
        copy.open()
    with pytest.raises(RuntimeError):
        kept.open()
