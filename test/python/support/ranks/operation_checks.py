"""Checks of reductions and movements: values, types, strides, adjoints, bad input."""

import contextlib
import math
import os
import threading

import checking
import numpy as np

import warp as wp
import warp.distributed as wd


@wp.struct
class Particle:
    x: wp.vec3
    n: int


@wp.struct
class Cloud:
    points: wp.array(dtype=wp.vec3)


def floats(x):
    """Elements as float64, also of bfloat16, which NumPy may not know."""
    return np.array(x.list()) if x.dtype is wp.bfloat16 else x.numpy().astype(float)


def reductions(comm):
    """Every type and stride against NumPy; empty arrays."""
    ranks = range(comm.size)
    for kind in (wp.float16, wp.bfloat16, wp.float32, wp.float64, wp.int8, wp.int32, wp.int64,
                 wp.vec3, wp.mat22, wp.quat, wp.transform):  # fmt: skip
        for op in ("sum", "min", "max"):
            shape = wp.zeros(1, dtype=kind).numpy().shape[1:]
            values = [
                (np.arange(6.0 * math.prod(shape)) * (r + 1) % 7 - r).reshape(6, *shape)
                for r in ranks
            ]
            whole = wp.array(np.repeat(values[comm.rank], 2, 0), dtype=kind)
            x = whole[::2]
            wd.all_reduce(x, op)
            wanted = {"sum": np.sum, "min": np.min, "max": np.max}[op](values, axis=0)
            assert np.array_equal(floats(x), wanted.astype(float)), (kind, op)
            if comm.size > 1 and op == "sum":
                assert np.array_equal(floats(whole[1::2]), 1.0 * values[comm.rank])
    flags = wp.array([comm.rank == 0, False, True], dtype=wp.bool)
    assert wd.all_reduce(flags, "max").numpy().tolist() == [True, False, True]
    wd.all_reduce(wp.zeros(0, dtype=float))


def movements(comm):
    """Rows of scalars, vectors and structs, of different numbers on each rank."""
    ranks = range(comm.size)
    mine = np.arange(comm.rank + 2.0)[:, None] + 10 * comm.rank + np.zeros(3)
    x = wd.all_gather(wp.array(mine, dtype=wp.vec3))
    wanted = np.concatenate([np.arange(r + 2.0)[:, None] + 10 * r + np.zeros(3) for r in ranks])
    assert np.array_equal(x.numpy(), wanted)
    none = wd.all_gather(wp.zeros(2 if comm.rank == 0 else 0, dtype=Particle))
    assert none.shape == (2,)
    rows = wp.zeros(comm.size, dtype=Particle)
    data = rows.numpy()
    data["n"] = 10 * comm.rank + np.arange(comm.size)
    got, came = wd.all_to_all(wp.array(data, dtype=Particle), [1] * comm.size)
    assert came == [1] * comm.size
    assert got.numpy()["n"].tolist() == [10 * r + comm.rank for r in ranks]
    part = wd.reduce_scatter(wp.array(np.arange(7.0) * (comm.rank + 1), dtype=float))
    first, last = wd.rows_of(7, comm.rank, comm.size)
    assert np.array_equal(part.numpy(), np.arange(7.0)[first:last] * sum(r + 1 for r in ranks))
    x = wp.full((3, 4), float(comm.rank), dtype=float)[:, ::2]
    root = comm.size - 1
    assert (wd.broadcast(x, root).numpy() == root).all()
    found = comm.gather_objects({"rank": comm.rank})
    assert [one["rank"] for one in found] == list(ranks)


def dot_tests(comm):
    """<A x, y> = <x, A' y> of every linear operation; replicated values count once."""
    rng = np.random.default_rng(comm.rank)
    common = np.random.default_rng(99)

    def split(n):
        return wp.array(rng.random(n), dtype=wp.float64, requires_grad=True)

    def replicated(n):
        return wp.array(common.random(n), dtype=wp.float64, requires_grad=True)

    def total(a, b, is_replicated):
        values = comm.gather_objects(float((a * b).sum()))
        return values[0] if is_replicated else sum(values)

    n = 6
    parts = wd.rows_of(n, comm.rank, comm.size)
    cases = {
        "all_reduce": (wd.all_reduce, split(n), False, replicated(n), True),
        "replicate": (wd.replicate, replicated(n), True, split(n), False),
        "broadcast": (wd.broadcast, split(n), False, replicated(n), True),
        "all_gather": (wd.all_gather, split(comm.rank + 1), False,
                       replicated(sum(range(1, comm.size + 1))), True),
        "reduce_scatter": (wd.reduce_scatter, split(n), False, split(parts[1] - parts[0]), False),
        "sum": (lambda x: wd.sum(x, exact=True), split(comm.rank + 3), False, replicated(1), True),
        "plain sum": (wd.sum, split(comm.rank), False, replicated(1), True),
    }  # fmt: skip
    counts = [(comm.rank + r) % 3 for r in range(comm.size)]
    came = [(r + comm.rank) % 3 for r in range(comm.size)]
    exchanged = split(sum(counts)), False, split(sum(came)), False
    cases["all_to_all"] = (lambda x: wd.all_to_all(x, counts)[0], *exchanged)
    for name, (operation, x, from_replicated, y, to_replicated) in cases.items():
        before = x.numpy().copy()
        with wp.Tape() as tape:
            z = operation(x)
        tape.backward(grads={z: y})
        left = total(z.numpy(), y.numpy(), to_replicated)
        right = total(before, x.grad.numpy(), from_replicated)
        if name == "broadcast":
            # The values of others do not matter, and their adjoints are zero.
            assert comm.rank == 0 or not x.grad.numpy().any()
        assert np.isclose(left, right, rtol=1e-12), (name, left, right)


def products(comm):
    """Gradients of an inner product; extrema go to the lowest rank that has them."""
    rng = np.random.default_rng(comm.rank)
    x = wp.array(rng.random(5), dtype=float, requires_grad=True)
    y = wp.array(rng.random(5), dtype=float, requires_grad=True)
    with wp.Tape() as tape:
        z = wd.dot(x, y, exact=True)
    tape.backward(z)
    assert np.allclose(x.grad.numpy(), y.numpy()) and np.allclose(y.grad.numpy(), x.numpy())
    # Vectors and matrices count as their numbers, with any strides.
    for kind in (wp.vec3d, wp.mat22):
        wide = rng.random((6, 3, *kind._shape_))
        u = wp.array(wide, dtype=kind, requires_grad=True)[::2]
        with wp.Tape() as tape:
            z = wd.dot(u, u, exact=True)
        tape.backward(z)
        wanted = sum(comm.gather_objects(float((u.numpy().astype(float) ** 2).sum())))
        assert np.isclose(z.numpy()[0], wanted, rtol=1e-14), kind
        assert np.allclose(u.grad.numpy(), 2 * u.numpy()), kind
    values = np.array([[1.0, 5.0, 2.0], [3.0, 5.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    x = wp.array(values[comm.rank], dtype=float, requires_grad=True)
    with wp.Tape() as tape:
        z = wd.all_reduce(x, "max")
    tape.backward(grads={z: wp.full(3, 2.0, dtype=float)})
    wanted = 2.0 * (values[: comm.size].argmax(axis=0) == comm.rank)
    assert np.array_equal(x.grad.numpy(), wanted), (x.grad.numpy(), wanted)


def exact_sums(comm):
    """The same bits for any number of ranks, and those of a correctly rounded sum."""
    rng = np.random.default_rng(11)
    found = []
    for kind, real, span in ((wp.float32, np.float32, 18), (wp.float64, np.float64, 200)):
        with np.errstate(over="ignore"):
            x = (rng.standard_normal(3001) * 10.0 ** rng.integers(-span, span, 3001)).astype(real)
        first, last = wd.rows_of(len(x), comm.rank, comm.size)
        total = wd.sum(wp.array(x[first:last], dtype=kind), exact=True).numpy()[0]
        assert total == real(math.fsum(x.astype(float))), (total, math.fsum(x.astype(float)))
        product = wd.dot(*(wp.array(x[first:last], dtype=kind),) * 2, exact=True).numpy()[0]
        parts = wp.array(x.reshape(-1, 3001), dtype=kind) if comm.size == 1 else None
        part = np.where(np.arange(3001) % comm.size == comm.rank, x, 0)
        each = wd.all_reduce(wp.array(part, dtype=kind), exact=True)
        assert np.array_equal(each.numpy(), x) and (parts is None or parts.shape)
        found += [float(total), float(product)]
    special = np.array([np.inf, np.nan, 1e38, -0.0], np.float32)
    x = wd.all_reduce(
        wp.array(special * (comm.rank + 1 if comm.size > 1 else 1), dtype=float), exact=True
    )
    values = x.numpy()
    assert values[0] == np.inf and np.isnan(values[1]) and values[3] == 0
    assert values[2] == np.float32(1e38) or values[2] > 2.9e38
    return found


def debug_mode(comm):
    """Replicated values that differ are found in debug mode."""
    before, wp.config.mode = wp.config.mode, "debug"
    try:
        wd.replicate(wp.full(3, 1.0, dtype=float))
        if comm.size > 1:
            x = wp.full(3, float(comm.rank), dtype=float)
            checking.fails(lambda: wd.replicate(x), "other values", "broadcast")
    finally:
        wp.config.mode = before


def disagreement(comm):
    """Ranks that disagree are told on all ranks, before anything is sent."""
    if comm.size == 1:
        return
    who = f"rank {comm.rank}"
    odd = comm.rank == comm.size - 1
    x = wp.zeros(4 if odd else 3, dtype=float)
    checking.fails(lambda: wd.all_reduce(x), who, "float32 (4,)", "float32 (3,)")
    x = wp.zeros(5, dtype=wp.float64 if odd else wp.float32)
    checking.fails(lambda: wd.all_reduce(x, "max"), who, "float64", "float32")
    blocks = wd.Blocks((4 * comm.size,), ranks=(comm.size,))
    field = blocks.zeros(wp.float64 if odd else wp.float32)
    checking.fails(lambda: blocks.halo(field), who, "float64", "float32")

    def other():
        wd.broadcast(x, 0) if odd else wd.all_reduce(wp.zeros(2, dtype=wp.float64))

    checking.fails(other, who, "broadcast", "all_reduce")
    # A tape on one rank alone: the others would not take part in the adjoint.
    y = wp.ones(5 * comm.size, dtype=float, requires_grad=True)
    field = blocks.zeros(float, requires_grad=True)
    points = wd.Particles(((0.0,), (1.0,)), 0.1)
    places = wp.array([0.5], dtype=float, requires_grad=True)
    for operation in (
        lambda: wd.replicate(y),
        lambda: wd.reduce_scatter(y),
        lambda: wd.all_to_all(y, [5] * comm.size),
        lambda: blocks.halo(field),
        lambda: points.migrate(places),
    ):

        def on_a_tape(operation=operation):
            with wp.Tape() if odd else contextlib.nullcontext():
                operation()

        checking.fails(on_a_tape, who, "on a tape", "on all ranks")

    def arrays():
        points.migrate(places, *([y[:1]] if odd else []))

    checking.fails(arrays, who, "of rows of float32 (), float32 ()", "on all ranks")


def bad_input(comm):
    """Each error is one line with the rank, both sides and the fix."""
    who = f"rank {comm.rank}"
    x = wp.zeros(4, dtype=float)
    checking.fails(lambda: wd.all_reduce([1.0]), who, "list")
    checking.fails(lambda: wd.all_reduce(x[wp.array([1], dtype=int)]), who, "wp.clone")
    checking.fails(lambda: wd.all_reduce(x, "mean"), who, "'mean'")
    checking.fails(lambda: wd.all_reduce(wp.zeros(2, dtype=Particle)), who, "Particle", "fields")
    checking.fails(lambda: wd.all_reduce(wp.zeros(2, dtype=wp.bool)), who, "bool", "int32")
    clouds = wp.zeros(2, dtype=Cloud)
    checking.fails(lambda: wd.all_gather(clouds), who, "Cloud", "send the arrays themselves")
    data = np.zeros(3, np.float32)
    data.flags.writeable = False
    # Memory of the host is lent, that of a GPU a copy.
    locked = wp.array(data, copy=False, device="cpu")
    words = ["read-only", "wp.clone"] if comm.device.is_cpu else ["'cpu'", str(comm.device)]
    checking.fails(lambda: wd.all_reduce(locked), who, *words)
    checking.fails(lambda: wd.broadcast(x, comm.size), who, str(comm.size))
    checking.fails(lambda: wd.all_to_all(x, [1] * comm.size * 9), who, "counts")
    checking.fails(lambda: wd.sum(wp.zeros(2, dtype=int)), who, "int32")
    checking.fails(lambda: wd.sum(wp.zeros(2, dtype=wp.vec3)), who, "vec3f", "array first")
    checking.fails(lambda: wd.dot(x, wp.zeros(3, dtype=float)), who, "(4,)")
    checking.fails(lambda: wd.init("smoke signals"), "'smoke signals'")
    checking.fails(lambda: wd.init(timeout=-1), "-1")
    checking.fails(lambda: wd.all_reduce(x, comm=3), "wd.mpi")
    if not comm.device.is_cuda:
        checking.fails(lambda: wd.nccl(comm), who, "needs a GPU", "'cpu'")


def lifetime(comm):
    """Uses after `close`, in a fork and by two threads are errors."""
    who = f"rank {comm.rank}"
    part = comm.split(comm.rank % 2, -comm.rank)
    assert part.size == len(range(comm.rank % 2, comm.size, 2))
    x = wp.full(2, 1.0, dtype=float)
    if comm.size > 1:
        assert wd.all_reduce(x, comm=part).numpy()[0] == part.size
    part.close()
    checking.fails(lambda: wd.all_reduce(x, comm=part), f"rank {part.rank}", "closed")
    other = comm.split(0)
    blocks = wd.Blocks((4 * comm.size,), ranks=(comm.size,), comm=other)
    field = blocks.zeros(requires_grad=True)
    with wp.Tape() as tape:
        blocks.halo(field)
    with wp.ScopedCapture() if comm.device.is_cpu else contextlib.nullcontext() as capture:
        blocks.halo(field)
    other.close()
    uses = [lambda: blocks.halo(field), other.barrier, lambda: other.split(0)]
    uses += [lambda: blocks.gather(field), lambda: other.gather_objects(1)]
    if comm.size > 1:
        uses.append(tape.backward)
    if comm.size > 1 and comm.device.is_cpu:
        uses.append(lambda: wp.capture_launch(capture.graph))
    for use in uses:
        checking.fails(use, who, "closed")
    blocks = wd.Blocks((4 * comm.size,), ranks=(comm.size,), comm=comm)
    field = blocks.zeros()
    blocks.halo(field)
    import pickle

    checking.fails(lambda: pickle.dumps(comm), "wd.init")
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            text = checking.fails(lambda: wd.all_reduce(x, "min"), "fork", "wd.init")
            # An exchange that is there already.
            checking.fails(lambda: blocks.halo(field), "fork", "wd.init")
            checking.fails(comm.barrier, "fork", "wd.init")
            checking.fails(lambda: comm.gather_objects(1), "fork", "wd.init")
        except BaseException as problem:
            text = repr(problem)
        os.write(write, text.encode())
        os._exit(0)
    os.waitpid(child, 0)
    text = os.read(read, 10000).decode()
    assert who in text and "a fork" in text, text
    found = []

    def use():
        try:
            wd.all_reduce(wp.zeros(11, dtype=float), comm=comm)
        except wd.DistributedError as problem:
            found.append(str(problem))

    comm.user = threading.get_ident()
    other = threading.Thread(target=use)
    other.start()
    other.join()
    comm.user = None
    assert len(found) == 1 and "comm.split(0)" in found[0], found


def messages_in_graphs(comm):
    """On GPUs a graph replays an all-reduce, a halo, and a message of a rank to itself."""
    if not comm.device.is_cuda or not comm.supports(float, capture=True):
        return
    x = wp.array([1.0, 3.0], dtype=float)
    a, b = wp.array([5.0], dtype=float), wp.zeros(1, dtype=float)
    blocks = wd.Blocks((4 * comm.size,), periodic=True, ranks=(comm.size,), comm=comm)
    f = blocks.zeros()

    def work():
        wd.all_reduce(x, comm=comm)
        wp.map(wp.add, blocks.inner(f), 1.0, out=blocks.inner(f))
        blocks.halo(f)
        if comm.engine == "NCCL":
            # With the runtime's own work on both sides.
            wp.map(wp.add, a, 1.0, out=a)
            comm.exchange([wd.Message(comm.rank, a, b, 0, 0)])
            wp.map(wp.mul, b, 2.0, out=a)

    work()
    with wp.ScopedCapture(device=comm.device, apic=True) as capture:
        work()
    for _ in range(3):
        wp.capture_launch(capture.graph)
    assert x.list() == [1.0 * comm.size**4, 3.0 * comm.size**4], x.list()
    assert (f.numpy() == 4.0).all(), f.numpy()
    if comm.engine == "NCCL":
        assert a.list() == [110.0], a.list()
    if comm.size > 1:
        checking.fails(lambda: wp.capture_save(capture.graph, "/tmp/never.wrp"), "messages of NCCL")


CHECKS = [
    *(reductions, movements, dot_tests, products, exact_sums),
    *(debug_mode, disagreement, bad_input, lifetime, messages_in_graphs),
]
