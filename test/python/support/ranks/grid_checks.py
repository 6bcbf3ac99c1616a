"""Checks of blocks, halos and their derivatives, on any number of ranks."""

import functools
import itertools
import mmap
import operator
import os
import traceback
import types

import checking
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import warp as wp
import warp.distributed as wd
from warp._src.distributed import failures, shared_memory

ROWS, COLUMNS, STEPS = 24, 16, 10


@wp.kernel
def relax(a: wp.array2d(dtype=float), first: wp.vec2i, b: wp.array2d(dtype=float)):
    i, j = wp.tid()
    i = i + first[0]
    j = j + first[1]
    b[i, j] = 0.25 * (a[i - 1, j] + a[i + 1, j] + a[i, j - 1] + a[i, j + 1])


@wp.kernel
def react(
    x: wp.array2d(dtype=float),
    k: wp.array(dtype=float),
    first: wp.vec2i,
    y: wp.array2d(dtype=float),
):
    i, j = wp.tid()
    i = i + first[0]
    j = j + first[1]
    c = x[i, j]
    around = x[i - 1, j] + x[i + 1, j] + x[i, j - 1] + x[i, j + 1]
    y[i, j] = c + k[0] * (around - 4.0 * c) - k[1] * c * c * c


@wp.kernel
def misfit(x: wp.array2d(dtype=float), first: wp.vec2i, terms: wp.array2d(dtype=float)):
    i, j = wp.tid()
    d = x[i + first[0], j + first[1]] - 0.3
    terms[i, j] = d * d


def initial():
    return np.random.default_rng(7).random((ROWS, COLUMNS)).astype(np.float32)


def jacobi(comm):
    """Bits of a field after relaxations, with the halo beside the interior."""
    blocks = wd.Blocks((ROWS, COLUMNS), comm=comm)
    a, b = blocks.zeros(), blocks.zeros()
    blocks.scatter(initial() if comm.rank == 0 else None, a)
    for _ in range(2 * STEPS):
        with blocks.overlap(a):
            box = blocks.interior
            wp.launch(relax, box.shape, [a, wp.vec2i(*box.start), b])
        for box in blocks.shell:
            wp.launch(relax, box.shape, [a, wp.vec2i(*box.start), b])
        a, b = b, a
    found = blocks.gather(a)
    if comm.rank:
        return None
    x = np.pad(initial(), 1)
    for _ in range(2 * STEPS):
        y = x.copy()
        y[1:-1, 1:-1] = np.float32(0.25) * (x[:-2, 1:-1] + x[2:, 1:-1] + x[1:-1, :-2] + x[1:-1, 2:])
        x = y
    assert np.abs(found - x[1:-1, 1:-1]).max() < 1e-6
    return checking.digest(found)


def loss_of(blocks, theta, x0, comm):
    first = wp.vec2i(*blocks.width)
    k = wd.replicate(theta, comm)
    states = [x0] + [blocks.zeros(requires_grad=True) for _ in range(STEPS)]
    for a, b in itertools.pairwise(states):
        blocks.halo(a)
        wp.launch(react, blocks.owned, [a, k, first, b])
    terms = wp.zeros(blocks.owned, dtype=float, requires_grad=True)
    wp.launch(misfit, blocks.owned, [states[-1], first, terms])
    return wd.sum(terms, exact=True, comm=comm)


def gradient(comm):
    """Loss, gradients of a replicated parameter and of the split initial state."""
    blocks = wd.Blocks((ROWS, COLUMNS), comm=comm)
    x0 = blocks.zeros(requires_grad=True)
    blocks.scatter(initial() if comm.rank == 0 else None, x0)
    theta = wp.array([0.2, 0.05], dtype=float, requires_grad=True)
    with wp.Tape() as tape:
        loss = loss_of(blocks, theta, x0, comm)
    for _ in range(2):
        # A second pass computes the same.
        tape.zero()
        tape.backward(loss)
    whole = blocks.gather(x0.grad)
    ghosts = x0.grad.numpy()
    if blocks.coordinates[0] > 0:
        # Adjoints of ghosts went home.
        assert not ghosts[0, 1:-1].any()
    if comm.rank:
        return None
    return [loss.numpy().tolist(), theta.grad.numpy().tolist(), whole.tolist()]


def halo_values(comm):
    """Ghosts of every kind of field hold what their owners have, in 1 to 3 dimensions."""
    kinds = [wp.float32, wp.float64, wp.int8, wp.float16, wp.vec3, wp.mat22]
    for shape, width, periodic in (
        ((13,), 2, True),
        ((13,), 1, False),
        ((8, 9), (1, 2), (True, False)),
        ((9, 8, 8), 1, True),
    ):
        blocks = wd.Blocks(shape, width, periodic, comm=comm)
        number = np.arange(np.prod(shape)).reshape(shape) % 100
        fields = [blocks.zeros(kind) for kind in kinds]
        for field in fields:
            inner = field.numpy().shape[len(shape) :]
            data = np.broadcast_to(number.reshape(*shape, *(1,) * len(inner)), (*shape, *inner))
            data = data.astype(field.numpy().dtype)
            blocks.scatter(data, field)
        blocks.halo(*fields)
        index = np.meshgrid(
            *[
                np.arange(o - w, o + n + w)
                for o, n, w in zip(blocks.offset, blocks.owned, blocks.width)
            ],
            indexing="ij",
        )
        outside = np.zeros(blocks.local, bool)
        for one, n, wraps in zip(index, shape, blocks.periodic):
            outside |= (one < 0) | (one >= n) if not wraps else False
        wanted = number[tuple(one % n for one, n in zip(index, shape))]
        wanted = np.where(outside, 0, wanted)
        for field in fields:
            values = field.numpy()
            lead = values.reshape(*blocks.local, -1)
            assert (lead == wanted[..., None]).all(), (shape, field.dtype, lead[..., 0], wanted)


@wp.struct
class Cell:
    mass: wp.float64
    velocity: wp.vec3
    kind: wp.int8


def halo_of_any_type(comm):
    """Structs, narrow types, strided fields and part of a field, in one message and alone."""
    blocks = wd.Blocks((4 * comm.size, 5), 1, True, ranks=(comm.size, 1), comm=comm)
    number = np.arange(20 * comm.size).reshape(4 * comm.size, 5)
    places = [
        np.arange(o - 1, o + n + 1) % extent
        for o, n, extent in zip(blocks.offset, blocks.owned, blocks.shape, strict=True)
    ]
    wanted = number[np.ix_(*places)]
    inner = (slice(1, -1), slice(1, -1))

    def started(values):
        """Values with ghosts that are no right ones yet."""
        made = np.zeros_like(values)
        made[inner] = values[inner]
        return made

    structs = np.zeros(blocks.local, dtype=wp.zeros(1, dtype=Cell).numpy().dtype)
    structs["mass"], structs["kind"] = wanted, wanted % 100
    structs["velocity"] = wanted[..., None] + np.arange(3)
    cases = [
        (wp.array(started(structs), dtype=Cell), lambda a: a.numpy(), structs),
        (wp.array(started(wanted % 100).astype(np.float32), dtype=wp.bfloat16), None, wanted % 100),
        (wp.array(started(wanted % 2 == 1), dtype=wp.bool), None, wanted % 2 == 1),
        (wp.array(started(wanted), dtype=wp.uint16), None, wanted),
        # Axes exchanged, and every other element of a wider array.
        (wp.array(started(wanted).T.copy(), dtype=float).transpose(), None, wanted),
        (wp.array(np.repeat(started(wanted), 2, 1), dtype=float)[:, ::2], None, wanted),
    ]
    for fields in (*([one] for one, *_ in cases), [one for one, *_ in cases]):
        blocks.halo(*fields)
    for field, read, values in cases:
        found = read(field) if read else np.reshape(field.list(), values.shape)
        assert np.array_equal(found, values), (field, found, values)


# Random grids: for each axis extent, width and whether it is periodic; a type and a leading axis.
_KINDS = (wp.float64, wp.float16, wp.int8, wp.vec3, wp.mat22)
_AXES = st.tuples(st.integers(1, 13), st.integers(1, 3), st.booleans())
_GRIDS = st.tuples(
    *(st.lists(_AXES, min_size=1, max_size=4), st.sampled_from(range(len(_KINDS)))),
    *(st.sampled_from((None, 2)), st.booleans()),
)


def _try_grid(comm, grid):
    """An error, or True if the grid was refused with one line; None if ghosts are right."""
    try:
        return _tried_grid(comm, *grid)
    except Exception:
        return traceback.format_exc()[-900:]


def _tried_grid(comm, axes, kind, items, overlaps):
    shape, width, periodic = zip(*axes, strict=True)
    # Arrays have four axes at most.
    items = items if len(axes) < 4 else None
    try:
        blocks = wd.Blocks(shape, width, periodic, comm=comm)
    except wd.DistributedValueError as problem:
        return True if "\n" not in str(problem) else str(problem)
    field = blocks.zeros(_KINDS[kind], items)
    lead = () if items is None else (items,)
    inner = field.numpy().shape[field.ndim :]
    rng = np.random.default_rng(len(axes))
    data = rng.integers(-99, 99, (*lead, *shape, *inner)).astype(field.numpy().dtype)
    blocks.scatter(data, field)
    if overlaps:
        blocks.overlap(field).__enter__().__exit__(None)
    else:
        blocks.halo(field)
    padded, first = data, len(lead)
    for axis, (w, wraps) in enumerate(zip(width, periodic, strict=True)):
        around = [(0, 0)] * data.ndim
        around[first + axis] = (w, w)
        padded = np.pad(padded, around, mode="wrap" if wraps else "constant")
    part = [slice(o, o + n) for o, n in zip(blocks.offset, blocks.local, strict=True)]
    if not np.array_equal(field.numpy(), padded[(*(slice(None),) * first, *part)]):
        return f"rank {comm.rank}: ghosts of {shape}, {width}, {periodic} are wrong"
    whole = blocks.gather(field)
    return None if comm.rank or np.array_equal(whole, data) else "the gathered array is another"


def random_partitions(comm):
    """Random grids against the whole array: ghosts are right, or all ranks refuse the grid.

    Rank 0 draws and shrinks for all.
    """
    refused = []

    @settings(max_examples=30, deadline=None, derandomize=True, database=None)
    @given(_GRIDS)
    def check(grid):
        comm.broadcast_object(grid)
        found = comm.gather_objects(_try_grid(comm, grid))
        assert found == [None] * comm.size or found == [True] * comm.size, found
        refused.append(found[0])

    if comm.rank == 0:
        try:
            check()
        finally:
            comm.broadcast_object(None)
        assert refused.count(None) > 8, refused
    else:
        while (grid := comm.broadcast_object(None)) is not None:
            comm.gather_objects(_try_grid(comm, grid))


def push_and_halo(comm):
    """<halo x, y> = <x, push y>, and the same for their adjoints on tapes."""
    rng = np.random.default_rng(10 + comm.rank)
    for shape, periodic in (((12,), True), ((9, 10), False), ((8, 9), True)):
        blocks = wd.Blocks(shape, 1, periodic, comm=comm)

        def field(blocks=blocks, grad=True):
            x = blocks.zeros(wp.float64, requires_grad=grad)
            x.assign(rng.random(blocks.local))
            return x

        for operation in (blocks.halo, blocks.push):
            x, y = field(), field()
            before = x.numpy().copy()
            with wp.Tape() as tape:
                operation(x)
            tape.backward(grads={x: y})
            after, adjoint = x.numpy(), x.grad.numpy()
            left = comm.gather_objects(float((after * y.numpy()).sum()))
            right = comm.gather_objects(float((before * adjoint).sum()))
            assert np.isclose(sum(left), sum(right), rtol=1e-12), (shape, operation, left, right)


def adjoints_of_halos(comm):
    """Adjoints of ghosts, of every kind of field: whole numbers against a padded array."""
    rng = np.random.default_rng(5)
    cases = [
        ((4 * comm.size,), 2, float, None),
        ((9, 4 * comm.size), (1, 2), wp.vec3, None),
        ((4 * comm.size, 5), 1, wp.float64, 3),
        ((4, 5, 4 * comm.size), (2, 1, 2), wp.mat22, None),
        ((3, 4, 2 * comm.size, 3), 1, float, None),
        ((3, 2 * comm.size, 3, 4), (1, 2, 1, 2), wp.vec2, None),
        ((4 * comm.size,), 1, wp.float16, None),
        # With gradients of 32 bits.
        ((4 * comm.size, 3), 1, wp.float16, None),
    ]
    for (shape, width, kind, items), periodic in itertools.product(cases, (False, True)):
        blocks = wd.Blocks(shape, width, periodic, comm=comm)
        one, other = (blocks.zeros(kind, items, requires_grad=True) for _ in range(2))
        lead, inner = (() if items is None else (items,)), np.shape(one.numpy())[one.ndim :]
        # Weights of the cells of every rank, ghosts included, known to all ranks.
        owned = [blocks._box_of(rank) for rank in range(comm.size)]
        locals_ = [np.add(own.shape, 2 * np.array(blocks.width)) for own in owned]
        weights = [rng.integers(-4, 5, (*lead, *local, *inner)) for local in locals_]
        grad_type = kind
        if kind is wp.float16 and len(shape) == 2:
            grad_type, weights = wp.float32, [4095 * weight for weight in weights]
            for field in (one, other):
                field.grad = wp.zeros(blocks.local, dtype=grad_type)
        whole = np.zeros((*lead, *shape, *inner))
        for own, weight in zip(owned, weights, strict=True):
            ranges = [
                np.arange(a - w, a + n + w) for a, n, w in zip(own.start, own.shape, blocks.width)
            ]
            index = np.meshgrid(*ranges, indexing="ij")
            inside = np.ones(index[0].shape, bool)
            for place, n in zip(index, shape):
                inside &= True if periodic else (place >= 0) & (place < n)
            place = tuple(i[inside] % n for i, n in zip(index, shape))
            where = (slice(None),) * len(lead)
            np.add.at(whole, (*where, *place), weight[(*where, inside)])
        seeds = [wp.array(weights[comm.rank] * k, dtype=grad_type) for k in (1, 2)]
        for together in (False, True):
            with wp.Tape() as tape:
                if together:
                    blocks.halo(one, other)
                else:
                    blocks.halo(one)
                    with blocks.overlap(other):
                        pass
            tape.zero()
            tape.backward(grads=dict(zip((one, other), seeds, strict=True)))
            for k, field in enumerate((one, other), 1):
                found = blocks.gather(field.grad)
                assert comm.rank or np.array_equal(found, k * whole), (shape, kind, found, whole)
            if periodic:
                # Nothing is left in ghosts, all of which have an owner.
                ghosts = one.grad.numpy().copy()
                inside = [slice(w, w + n) for w, n in zip(blocks.width, blocks.owned)]
                ghosts[(*(slice(None),) * len(lead), *inside)] = 0
                assert not ghosts.any(), ghosts


def adjoints_of_some_fields(comm):
    """Populations that cross a face, structs, fields without a gradient, replays of adjoints."""
    rng = np.random.default_rng(11 + comm.rank)
    blocks = wd.Blocks((6 * comm.size, 5), 1, True, comm=comm)
    velocities = np.array([*itertools.product((-1, 0, 1), repeat=2)])
    for items in (velocities, [0, 3, 8]):
        x = blocks.zeros(wp.float64, items=9, requires_grad=True)
        before, y = rng.random(x.shape), rng.random(x.shape)
        x.assign(before)
        with wp.Tape() as tape:
            blocks.halo(x, items=items)
        tape.backward(grads={x: wp.array(y, dtype=wp.float64)})
        left = sum(comm.gather_objects(float((x.numpy() * y).sum())))
        right = sum(comm.gather_objects(float((before * x.grad.numpy()).sum())))
        assert np.isclose(left, right, rtol=1e-12), (items, left, right)
    x, other, counts = blocks.zeros(requires_grad=True), blocks.zeros(), blocks.zeros(wp.int32)
    cells = blocks.zeros(Cell, requires_grad=True)
    seed = np.zeros(cells.shape, cells.numpy().dtype)
    seed["velocity"] = 2.0
    seeds = {x: wp.full(x.shape, 1.0, dtype=float), cells: wp.array(seed, dtype=Cell)}
    with wp.Tape() as tape:
        blocks.halo(other, x, counts, cells)
    tape.backward(grads=seeds)
    found = [float(x.grad.numpy().sum()), float(cells.grad.numpy()["velocity"].sum())]
    # All adjoints are somewhere still.
    wanted = [x.size, 6 * x.size]
    assert np.allclose(np.sum(comm.gather_objects(found), 0), comm.size * np.array(wanted)), found
    if comm.device.is_cuda:
        return
    tape.zero()
    with wp.ScopedCapture(device=comm.device) as capture:
        with wp.Tape() as tape:
            blocks.halo(x)
        x.grad.fill_(1.0)
        tape.backward()
    for _ in range(3):
        wp.capture_launch(capture.graph)
        values = x.grad.numpy()
        assert values.sum() == x.size and not values[0].any(), values


def adjoints_in_shared_memory(comm):
    """The same adjoints through memory of the host, of all ranks and of some; none without room."""

    def alone(comm, size):
        # The last rank is on a host of its own.
        memory = failures.memory_of_host(comm, size)
        return mmap.mmap(-1, size) if comm.rank == comm.size - 1 else memory

    def known(rank):
        return log.last(rank) if (rank < last) == (comm.rank < last) else (0, 0, 0)

    last, log = comm.size - 1, comm.log
    with pytest.MonkeyPatch.context() as changed:
        changed.setattr(shared_memory, "SMALLEST", 0)
        wanted = gradient(comm)
        same = close if comm.device.is_cuda else operator.eq
        adjoints_of_halos(comm)
        adjoints_of_some_fields(comm)
        changed.setattr(shared_memory, "memory_of_host", alone)
        changed.setattr(
            comm, "log", types.SimpleNamespace(last=known, begin=log.begin, own=log.own)
        )
        assert same(gradient(comm), wanted)
        adjoints_of_some_fields(comm)
        changed.undo()
        changed.setattr(shared_memory, "SMALLEST", 0)
        if comm.rank == 0:
            changed.setattr(os, "posix_fallocate", no_room)
        assert same(gradient(comm), wanted)


def close(found, wanted):
    """The gradients of two passes on a GPU, whose threads add to the parameter's in no order."""
    return wanted is None or all(
        np.allclose(a, b, rtol=1e-5, atol=1e-6) for a, b in zip(found, wanted, strict=True)
    )


def no_room(*_):
    """The system has no memory for a file."""
    raise OSError(28, "No space left on device")


def capture(comm):
    """A captured step replays its messages, with the bits of an eager one."""
    blocks = wd.Blocks((ROWS, COLUMNS), comm=comm)
    found = []
    for captured in (False, True):
        a, b, total = blocks.zeros(), blocks.zeros(), wp.zeros(1, dtype=float)
        blocks.scatter(initial() if comm.rank == 0 else None, a)

        def step(a=a, b=b, total=total):
            with blocks.overlap(a):
                box = blocks.interior
                wp.launch(relax, box.shape, [a, wp.vec2i(*box.start), b])
            for box in blocks.shell:
                wp.launch(relax, box.shape, [a, wp.vec2i(*box.start), b])
            wp.copy(a, b)
            wp.copy(total, wd.sum(blocks.inner(a), exact=True, comm=comm))

        if captured and comm.device.is_cuda and not comm.supports(float, capture=True):
            with wp.ScopedCapture(device=comm.device):
                checking.fails(step, "capture", "NCCL")
            return found[0]
        if captured:
            with wp.ScopedCapture(device=comm.device) as capture:
                step()
            for _ in range(6):
                wp.capture_launch(capture.graph)
        else:
            for _ in range(6):
                step()
        found.append((checking.digest(blocks.inner(a).numpy()), float(total.numpy()[0])))
    assert found[0] == found[1], found
    with wp.ScopedCapture(device=comm.device, apic=True) as capture:
        blocks.halo(a)
    if comm.size > 1:
        checking.fails(lambda: wp.capture_save(capture.graph, "/tmp/never.wrp"), "halo")
    return found[0]


def bad_blocks(comm):
    """Extents, widths and fields that do not fit, each one line."""
    who = f"rank {comm.rank}"
    checking.fails(lambda: wd.Blocks((0, 4)), who, "(0, 4)")
    checking.fails(lambda: wd.Blocks((2 * comm.size,), width=3), who, "width")
    if comm.size > 1:
        checking.fails(lambda: wd.Blocks((comm.size - 1,)), who, "fewer ranks")
        ranks = (comm.size, 1)
        checking.fails(lambda: wd.Blocks((comm.size, 9), 2, ranks=ranks), who, "axis 0", "1 for")
        checking.fails(lambda: wd.Blocks((9, 9), ranks=(1, 1)), who, "(1, 1)")
    checking.fails(lambda: wd.Blocks((8.5, 8)), who, "integers as shape", "8.5")
    checking.fails(lambda: wd.Blocks((8, 8), 1.5), who, "integers as width", "1.5")
    blocks = wd.Blocks((8, 8))
    # All ranks tell of what one of them gives.
    for data, words in ((np.zeros((3, 8)), "(3, 8)"), (None, "()")):
        given = data if comm.rank == 0 else None
        scatter = functools.partial(blocks.scatter, given, blocks.zeros())
        checking.fails(scatter, who, "rank 0 gives", words, "(8, 8)")
    # One of the shape of own cells would be cut.
    own = wp.zeros(blocks.owned)
    checking.fails(lambda: blocks.gather(own), who, f"gather has shape {own.shape}", "blocks.zeros")
    several = blocks.zeros(items=3)
    checking.fails(lambda: blocks.halo(several, items=[0, 3]), who, "3 entries", "[0, 3]")
    checking.fails(lambda: blocks.halo(several, items=np.zeros((3, 1))), who, "(3, 1)", "2 columns")
    checking.fails(lambda: blocks.halo(wp.zeros((8, 8))), who, "(8, 8)", "blocks.zeros")
    checking.fails(lambda: blocks.halo([1.0]), who, "list")
    checking.fails(blocks.halo, who)
    x = blocks.zeros()
    some = wp.array([0, 1], dtype=int)
    checking.fails(lambda: blocks.halo(x[some]), who, "indexedarray")
    data = np.zeros(blocks.local, np.float32)
    data.flags.writeable = False
    # Memory of the host is lent, that of a GPU a copy.
    locked = wp.array(data, copy=False, device="cpu")
    words = ["read-only"] if comm.device.is_cpu else ["'cpu'", str(comm.device)]
    checking.fails(lambda: blocks.halo(locked), who, *words)


CHECKS = [
    *(jacobi, gradient, halo_values, halo_of_any_type, random_partitions, push_and_halo),
    *(adjoints_of_halos, adjoints_of_some_fields, adjoints_in_shared_memory, capture, bad_blocks),
]
