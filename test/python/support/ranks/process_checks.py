"""Checks of checkpoints, shared memory, warm caches and progress bars on ranks."""

import contextlib
import json
import os
import resource
import signal
import tempfile

import checking
import numpy as np

import warp as wp
import warp.distributed as wd


@wp.kernel
def double(x: wp.array(dtype=float)):
    x[wp.tid()] *= 2.0


@contextlib.contextmanager
def limited_files(most):
    """A block in which files of this process cannot grow beyond some bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    if most is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def checkpoints(comm):
    """State comes back on this number of ranks and on one."""
    folder = comm.broadcast_object(tempfile.mkdtemp(), 0) + "/state"
    shape = (9, 8)
    blocks = wd.Blocks(shape, comm=comm)
    data = np.arange(72.0).reshape(shape).astype(np.float32)
    f, g = blocks.zeros(), blocks.zeros(items=3)
    blocks.scatter(data if comm.rank == 0 else None, f)
    blocks.scatter(np.stack([data, 2 * data, 3 * data]) if comm.rank == 0 else None, g)
    rows = wp.array(np.arange(comm.rank + 1.0) + 10 * comm.rank, dtype=float)
    theta = np.array([(0.5, 3)], [("k", "f4"), ("n", "i4")])
    for step in (1, 2):
        small = wp.full(2, comm.rank + 0.5, dtype=wp.bfloat16)
        wd.save(folder, comm, blocks, f=f, g=g, rows=rows, step=step, theta=theta, small=small)
    whole = np.concatenate([np.arange(r + 1.0) + 10 * r for r in range(comm.size)])
    alone = wd.Communicator(0, 1)
    for one, grid in ((comm, blocks), (alone, wd.Blocks(shape, comm=alone))):
        state = wd.load(folder, one, grid)
        first, last = wd.rows_of(len(whole), one.rank, one.size)
        assert state["step"] == 2 and np.array_equal(state["rows"], whole[first:last])
        part = state["small"][:2] if one.size > 1 else state["small"][2 * comm.rank :][:2]
        again = wp.array(part, dtype=wp.bfloat16)
        assert np.array_equal(again.numpy().view(np.uint16), small.numpy().view(np.uint16))
        assert state["theta"].dtype == theta.dtype and state["theta"] == theta
        part = data[tuple(slice(o, o + n) for o, n in zip(grid.offset, grid.owned, strict=True))]
        assert np.array_equal(state["f"], part) and np.array_equal(state["g"][2], 3 * part)
    # Rows of a split array may be as many as cells of a field on one rank.
    line = wd.Blocks((3 * comm.size + 1,), comm=comm)
    many = 3 if comm.rank == 0 and comm.size > 1 else line.local[0]
    values = np.arange(float(many)) + 100 * comm.rank
    wd.save(folder + "-line", comm, line, values=wp.array(values, dtype=float))
    every = np.concatenate(comm.gather_objects(values))
    if comm.size > 1:
        first, last = wd.rows_of(len(every), comm.rank, comm.size)
        assert np.array_equal(wd.load(folder + "-line", comm, line)["values"], every[first:last])
    who = f"rank {comm.rank}"
    if comm.size > 1:
        words = who, "rank 1 saves ['rank1']", "rank 0 ['rank0']", "same names"
        checking.fails(lambda: wd.save(folder, comm, **{f"rank{comm.rank}": 1}), *words)
    checking.fails(lambda: wd.save(folder, comm, x={1, 2}), who, "'x' is set")
    checking.fails(lambda: wd.load(folder, comm), who, "needs `blocks`")
    other = wd.Blocks((8, 8), comm=comm)
    checking.fails(lambda: wd.load(folder, comm, other), who, "[9, 8]", "[8, 8]")
    checking.fails(lambda: wd.load(folder + "x", comm), who, "No such file")
    comm.barrier()
    if comm.rank == 0:
        with open(f"{folder}/rows.0.npy", "r+b") as file:
            file.truncate(100)
    comm.barrier()
    checking.fails(lambda: wd.load(folder, comm, blocks), who, "rank 0", "rows.0.npy")
    comm.barrier()
    if comm.rank == 0:
        with open(f"{folder}/manifest.json") as file:
            manifest = json.load(file)
        with open(f"{folder}/manifest.json", "w") as file:
            json.dump({**manifest, "format": 99}, file)
    comm.barrier()
    checking.fails(lambda: wd.load(folder, comm, blocks), who, "format 99")
    comm.barrier()
    # A file in the way: no rank can write, and all say so.
    with open(f"{folder}.rank{comm.rank}", "w"):
        pass
    blocked = f"{folder}.rank0/deeper"
    checking.fails(lambda: wd.save(blocked, comm, f=f), who, "could not write")
    whole = folder + "2"
    wd.save(whole, comm, blocks, rows=rows, step=3)
    text = checking.fails(lambda: wd.save(whole, comm, blocks, rows=rows, bad=comm), who, "'bad'")
    assert "not an array, number, text or list: leave it out" in text and "space" not in text
    # A full disk: of a rank's arrays, and of what rank 0 writes in the end.
    for rank, most in ((comm.size - 1, 1), (0, 200)):
        with limited_files(most if comm.rank == rank else None):
            words = who, f"rank {rank} could not write", "is still whole", "free space"
            checking.fails(lambda: wd.save(whole, comm, blocks, rows=rows, step=4), *words)
    assert wd.load(whole, comm, blocks)["step"] == 3


def shared_memory(comm):
    """An array that all ranks of the host see."""
    if comm.rank == 0:
        x, handle = wd.share(wp.array([1.0, 2.0, 3.0], dtype=float, device="cpu"))
    handle = comm.broadcast_object(handle if comm.rank == 0 else None, 0)
    y = handle.open()
    assert y.list() == [1.0, 2.0, 3.0]
    comm.barrier()
    if comm.rank == comm.size - 1:
        wp.launch(double, 3, [y], device="cpu")
    comm.barrier()
    assert y.list() == [2.0, 4.0, 6.0]
    comm.barrier()
    if comm.rank == 0:
        assert x.list() == [2.0, 4.0, 6.0]
    handle.close()


def shared_on_gpus(comm):
    """An array on a GPU that all ranks of the host see, from a pool or not, and a part of it."""
    if not comm.device.is_cuda:
        return
    handle = None
    if comm.rank == 0:
        x, handle = wd.share(wp.array([1.0, 2.0, 3.0, 4.0], dtype=float)[1:])
    handle = comm.broadcast_object(handle, 0)
    if comm.rank == comm.size - 1 and comm.size > 1:
        y = handle.open()
        assert y.list() == [2.0, 3.0, 4.0], y.list()
        wp.launch(double, 3, [y], device=y.device)
        wp.synchronize()
        del y
    comm.barrier()
    if comm.rank == 0 and comm.size > 1:
        assert x.list() == [4.0, 6.0, 8.0], x.list()
    comm.barrier()


def warm_and_progress(comm):
    """All ranks end after the same step when one is interrupted."""
    wd.warm([double], comm=comm)
    # Who waits for a rank that cannot compile is told of it.
    wrong = "expects a module" if comm.local_rank == 0 else "rank 0 cannot compile the kernels"
    checking.fails(lambda: wd.warm([3], comm=comm), wrong)
    with open(os.devnull, "w") as nowhere:
        assert list(wd.progress(range(4), comm, file=nowhere)) == [0, 1, 2, 3]
        seen, saved = [], []
        blocks = wd.Blocks((4 * comm.size,), comm=comm)
        field = blocks.zeros()
        try:
            for step in wd.progress(range(1000), comm, lambda: saved.append(1), file=nowhere):
                seen.append(step)
                blocks.halo(field)
                if step == 5 and comm.rank == comm.size - 1:
                    os.kill(os.getpid(), signal.SIGINT)
        except KeyboardInterrupt as problem:
            assert "stopped before step" in str(problem)
        else:
            raise AssertionError("no interrupt")
    ends = comm.gather_objects(seen[-1])
    # On GPUs the host runs ahead of the messages.
    most = 7 + comm.size if comm.device.is_cpu else 998
    assert len(set(ends)) == 1 and 5 <= ends[0] <= most and saved == [1], ends


CHECKS = [checkpoints, shared_memory, shared_on_gpus, warm_and_progress]
