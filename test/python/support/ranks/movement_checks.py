"""Checks that move elements and compute nothing, for a driver that runs no kernels."""

import gc
import sys
import weakref

import checking
import numpy as np

import warp as wp
import warp.distributed as wd


def halos(comm):
    """Ghosts are the neighbours' cells, of one field and of several of different types."""
    rows = 3 * comm.size
    data = np.arange(rows * 5, dtype=np.float32).reshape(rows, 5)
    blocks = wd.Blocks((rows, 5), 1, True, comm=comm)
    x, y = blocks.zeros(), blocks.zeros(wp.int64)
    for one in (x, y):
        blocks.scatter(data if comm.rank == 0 else None, one)
    around = np.pad(data, 1, mode="wrap")
    own = tuple(slice(o, o + n) for o, n in zip(blocks.offset, blocks.local, strict=True))
    blocks.halo(x)
    assert np.array_equal(x.numpy(), around[own])
    blocks.halo(x, y)
    assert np.array_equal(y.numpy(), around[own])
    whole = blocks.gather(x)
    assert (whole is None) == (comm.rank != 0)
    assert whole is None or np.array_equal(whole, data)


def collectives(comm):
    """Sums, extrema, broadcasts and gathers against NumPy, from device memory."""
    parts = [np.arange(4, dtype=np.float64) * (rank + 1) for rank in range(comm.size)]
    for op, wanted in (("sum", sum(parts)), ("max", parts[-1]), ("min", parts[0])):
        x = wp.array(parts[comm.rank], dtype=wp.float64, device=comm.device)
        assert np.array_equal(wd.all_reduce(x, op, exact=False, comm=comm).numpy(), wanted), op
    x = wp.array(parts[comm.rank], dtype=wp.float64, device=comm.device)
    assert np.array_equal(wd.all_gather(x, comm=comm).numpy(), np.concatenate(parts))
    wd.broadcast(x, 1, comm=comm)
    assert np.array_equal(x.numpy(), parts[1])


def refusals(comm):
    """A GPU for two ranks, ranks of the CPU, and disagreement are errors on all ranks."""
    with wp.ScopedDevice("cuda:0"):
        text = checking.fails(
            lambda: wd.nccl(comm.bootstrap, device="cuda:0"), f"rank {comm.rank}", "cuda:0", "gloo"
        )
    assert f"rank {1 - comm.rank} has" in text
    checking.fails(lambda: wd.nccl(comm.bootstrap, device="cpu"), "needs a GPU", "'cpu'")
    x = wp.zeros(3 + comm.rank, dtype=float, device=comm.device)
    checking.fails(lambda: wd.all_reduce(x, comm=comm), "(3,)", "(4,)", "alike on all ranks")
    other = wp.zeros(3, dtype=float, device="cpu")
    checking.fails(lambda: wd.all_reduce(other, comm=comm), "'cpu'", "'cuda:", "x.to(")


def captures(comm):
    """Messages of the host in a capture on a GPU are an error, and none in the graph."""
    x = wp.zeros(3, dtype=float, device=comm.device)
    blocks = wd.Blocks((4 * comm.size, 3), comm=comm)
    y = blocks.zeros()
    for work in (lambda: wd.all_reduce(x, exact=False, comm=comm), lambda: blocks.halo(y)):
        work()
        with wp.ScopedCapture(device=comm.device):
            words = f"rank {comm.rank}", f"by {comm.engine} in a capture", "wd.nccl"
            checking.fails(work, *words)
        work()


def graphs_hold_memory(comm):
    """A graph keeps the memory of its messages, and nothing does after it."""
    x = wp.zeros(3, dtype=float, device=comm.device)
    blocks = wd.Blocks((4 * comm.size,), comm=comm)
    y = blocks.zeros()
    for _ in range(2):
        wd.all_reduce(x, comm=comm)
        blocks.halo(y)
        alive = weakref.ref(x), weakref.ref(y)
        with wp.ScopedCapture(device=comm.device) as capture:
            wd.all_reduce(x, comm=comm)
            blocks.halo(y)
        del x, y, blocks
        gc.collect()
        assert all(one() is not None for one in alive)
        del capture
        gc.collect()
        assert not any(one() is not None for one in alive)
        x = wp.zeros(3, dtype=float, device=comm.device)
        blocks = wd.Blocks((4 * comm.size, 3), comm=comm)
        y = blocks.zeros()


def fixed_particles(comm):
    """A graph sends what fixed particles send, at each replay and in it alone."""
    particles = wd.Particles(((0, 0), (1, 1)), 0.1, comm, capacity=8)
    particles.numbers = wp.zeros(0, dtype=int, device=comm.device)
    fixed = particles.fixed(moving=2, near=3)
    x = wp.zeros(8, dtype=wp.vec2, device=comm.device)
    with wp.ScopedCapture(device=comm.device) as capture:
        (y,) = fixed.migrate(x)
        fixed.ghosts(y)
        fixed.halo(y)
    # The driver runs no kernels, so numbers of points stay as they are here.
    for value in (5, 7):
        fixed._came.zero_()
        fixed._given.fill_(value + comm.rank)
        assert fixed._came.numpy().tolist() == [0]
        wp.capture_launch(capture.graph)
        assert fixed._came.numpy().tolist() == [value + 1 - comm.rank]


if __name__ == "__main__":
    by_nccl = "--way=nccl" in sys.argv
    own = (refusals, graphs_hold_memory, fixed_particles) if by_nccl else (captures,)
    checking.run([halos, collectives, *own])
