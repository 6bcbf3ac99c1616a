"""Reductions and movements of arrays over ranks, with exact adjoints on tapes.

A value is *split*, a part of it being on each rank, or *replicated*, one value with a copy on each
rank. The derivative is that of the one program over all ranks, in which a replicated value counts
once.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import warp as wp
from warp import config
from warp._src import errors
from warp._src.arrays.observers import Observers, Place
from warp._src.derivatives import cotangents
from warp._src.distributed import exact as exact_sums
from warp._src.distributed import forward
from warp._src.distributed.communicator import OPERATIONS, flat, resolve
from warp._src.distributed.failures import DistributedError, DistributedValueError
from warp._src.distributed.plans import check_plan, record, run_or_record, without_tape
from warp._src.types import dtypes

# Types that engines do not calculate with, and the ones that are used in their place.
_WIDER = {wp.float16: wp.float32, wp.bfloat16: wp.float32, wp.bool: wp.uint8}


def _scalar(dtype):
    return getattr(dtype, "_wp_scalar_type_", dtype)


def checked(comm, name, array):
    """The array of an argument, on the communicator's device.

    Raises:
        TypeError: it is none.
        DistributedError: it is read-only, or on another device.
    """
    if not isinstance(array, wp.array):
        hint = ": pass `wp.clone(x)`" if isinstance(array, wp.indexedarray) else ""
        raise errors.WarpTypeError(
            f"rank {comm.rank}: {name} expects an array, but got '{type(array).__name__}'{hint}"
        )
    if array.device != comm.device:
        raise DistributedError(
            f"rank {comm.rank}: {name}: the array is on '{array.device}', but the communicator on "
            f"'{comm.device}': use `x.to('{comm.device}')`"
        )
    if dtypes.is_struct(array.dtype):
        _check_struct(comm, name, array.dtype)
    return array


def _check_struct(comm, name, dtype) -> None:
    from warp._src.pickling import holds_arrays

    if holds_arrays(dtype):
        raise DistributedError(
            f"rank {comm.rank}: {name} of structs '{dtype.__name__}', which hold arrays, but their "
            "addresses mean nothing to other ranks: send the arrays themselves"
        )


def _writable(comm, name, array) -> None:
    if array.read_only:
        raise DistributedError(
            f"rank {comm.rank}: {name} writes its array, which is read-only: use `wp.clone(x)`"
        )


def _unflat(memory, like):
    """Memory of bytes as a contiguous array like another one."""
    strides, step = [], like.item_size
    for extent in reversed(like.shape):
        strides.insert(0, step)
        step *= extent
    return memory._view(0, like.shape, strides, like.dtype)


def _plan(comm, key, name, common, recorded=False):
    """The number of a collective plan and its step, made and checked once for each key.

    Args:
        recorded: a tape records it, so that all ranks have to take part in its adjoint.
    """
    if forward.Along.count:
        key = key, forward.Along.count
    if recorded:
        key, common = (key, "tape"), f"{common}, on a tape"
    found = comm.plans.get(key)
    if found is None or comm.closed:
        comm.check_use(name)
        found = comm.plans[key] = [check_plan(comm, name, common), 0]
    found[1] += 1
    comm.log.begin(*found)
    return found


def _is_recorded(x) -> bool:
    return Observers.tape is not None and x.requires_grad


def _described(array) -> str:
    return f"{dtypes.type_repr(array.dtype)} {array.shape}"


def _reduce(comm, array, op) -> None:
    """Combines arrays of all ranks in place, of any type and strides."""
    if not array.size:
        return
    packed = array if array.is_contiguous else array.contiguous()
    numbers = flat(packed)
    wide = _WIDER.get(numbers.dtype)
    if wide is not None:
        copy = wp.empty(numbers.size, dtype=wide, device=numbers.device)
        wp.utils.array_cast(numbers, copy)
        comm.all_reduce(copy, op)
        wp.utils.array_cast(copy, numbers)
    else:
        if not comm.supports(numbers.dtype, op):
            raise DistributedError(
                f"rank {comm.rank}: {comm.engine} has no {op} of "
                f"'{dtypes.type_repr(numbers.dtype)}': convert to int64 or float64"
            )
        comm.all_reduce(numbers, op)
    if packed is not array:
        wp.copy(array, packed)


def _check_op(comm, x, op) -> None:
    if op not in OPERATIONS:
        raise DistributedValueError(
            f"rank {comm.rank}: all_reduce expects op 'sum', 'min' or 'max', but got {op!r}"
        )
    if dtypes.is_struct(x.dtype):
        raise DistributedError(
            f"rank {comm.rank}: all_reduce of structs '{x.dtype.__name__}' has no meaning: reduce "
            "their fields, or move them by `all_gather`"
        )
    if op == "sum" and _scalar(x.dtype) is wp.bool:
        raise DistributedError(
            f"rank {comm.rank}: all_reduce has no sum of bool: convert to int32, or use op='max'"
        )


def all_reduce(x, op="sum", exact=None, comm=None):
    """Combines the arrays of all ranks in place: a split value becomes a replicated one.

    On a tape its adjoint is the identity for sums; for "min" and "max" it goes to the lowest rank
    that has the extremum.

    Args:
        x: array of any type of numbers and strides, equally shaped on all ranks.
        op: "sum", "min" or "max".
        exact: sums of float32 and float64 are rounded once, so that they do not depend on the
            engine's order; by default what `wp.config.deterministic` says.
        comm: by default that of `wd.init`.

    Returns:
        `x`.

    Raises:
        DistributedError: ranks disagree, or an array cannot be reduced.
    """
    comm = resolve(comm)
    checked(comm, "all_reduce", x)
    _check_op(comm, x, op)
    _writable(comm, "all_reduce", x)
    if exact is None:
        exact = config.deterministic not in (False, None, "", "not_guaranteed")
    exact = bool(exact) and op == "sum" and _scalar(x.dtype) in exact_sums.FORMATS
    if Observers.executor is not None:
        if op != "sum":
            return _extremum_forward(comm, x, op)
        return forward.in_place([x], lambda x: all_reduce(x, op, exact, comm))
    common = f"{op} of {_described(x)}{', exact' if exact else ''}"
    _plan(comm, ("all_reduce", common), "all_reduce", common)
    own = wp.clone(x) if Observers.tape is not None and op != "sum" else None
    if Observers.active:
        Observers.memory.writing(x, Place("all_reduce"))

    def run():
        if comm.size > 1:
            exact_sums.reduce(comm, x) if exact else _reduce(comm, x, op)

    without_tape(lambda: run_or_record(comm, "all_reduce", run))
    if own is not None and x.requires_grad and comm.size > 1:
        _record_extremum(comm, own, x)
    return x


@wp.kernel(module="warp.distributed", enable_backward=False)
def _mark_held(
    own: wp.array(dtype=Any),
    found: wp.array(dtype=Any),
    rank: int,
    size: int,
    holder: wp.array(dtype=int),
):
    i = wp.tid()
    holder[i] = wp.where(own[i] == found[i], rank, size)


@wp.kernel(module="warp.distributed", enable_backward=False)
def _keep_held(holder: wp.array(dtype=int), rank: int, grad: wp.array(dtype=Any)):
    i = wp.tid()
    if holder[i] != rank:
        grad[i] = grad[i] * grad.dtype(0.0)


def _holder_of(comm, own, x):
    """For each number the lowest rank that holds the extremum."""
    numbers = flat(own.contiguous()), flat(x.contiguous())
    holder = wp.empty(numbers[0].size, dtype=int, device=x.device)
    wp.launch(_mark_held, holder.size, [*numbers, comm.rank, comm.size, holder], device=x.device)
    if comm.size > 1:
        comm.all_reduce(holder, "min")
    return holder


def _keep_own(comm, holder, x) -> None:
    """Sets to zero the numbers that another rank holds the extremum of."""
    packed = x.contiguous()
    wp.launch(_keep_held, holder.size, [holder, comm.rank, flat(packed)], device=x.device)
    if packed is not x:
        x.assign(packed)


def _record_extremum(comm, own, x) -> None:
    """Leaves the adjoint of an extremum to the lowest rank that holds it."""
    holder = without_tape(lambda: _holder_of(comm, own, x))
    record(Observers.tape, lambda: _keep_own(comm, holder, x.grad), [x])


def _extremum_forward(comm, x, op):
    """The extremum, and the tangent of the lowest rank that holds it."""
    own = forward.values_only(lambda: without_tape(lambda: wp.clone(x)))
    holder: list = []

    def run(one):
        if not holder:
            all_reduce(one, op, comm=comm)
            holder.append(without_tape(lambda: _holder_of(comm, own, one)))
            return one
        tape = Observers.tape
        if tape is not None:
            Observers.memory.writing(one, Place("all_reduce"))
        without_tape(lambda: _keep_own(comm, holder[0], one))
        without_tape(lambda: all_reduce(one, comm=comm))
        if tape is not None and one.requires_grad:
            record(tape, lambda: _keep_own(comm, holder[0], one.grad), [one])
        return one

    return forward.in_place([x], run)


def replicate(x, comm=None):
    """A copy of a replicated value, for each rank's own use; its adjoint is summed over ranks.

    In debug mode the value is compared over all ranks.

    Raises:
        DistributedError: in debug mode, a rank has other values.
    """
    comm = resolve(comm)
    checked(comm, "replicate", x)
    if Observers.executor is not None:
        return forward.produced(x, lambda x: replicate(x, comm))
    common = _described(x)
    _plan(comm, ("replicate", common), "replicate", common, _is_recorded(x))
    if config.mode == "debug":
        _compare(comm, x)
    y = wp.clone(x)
    tape = Observers.tape
    if tape is not None and x.requires_grad and comm.size > 1:

        def backward():
            run_or_record(comm, "adjoint of replicate", lambda: _reduce(comm, y.grad, "sum"))

        record(tape, backward, [y])
    return y


def _compare(comm, x) -> None:
    values = without_tape(lambda: x.numpy().tobytes())
    found = comm.gather_objects(hash_of(values))
    for rank, one in enumerate(found):
        if one != found[0]:
            raise DistributedError(
                f"rank {comm.rank}: replicate of {_described(x)}: rank {rank} has other values "
                "than rank 0: call `wd.broadcast(x)` first"
            )


def hash_of(data: bytes) -> str:
    """A digest of bytes."""
    from _blake2 import blake2b

    return blake2b(data, digest_size=8).hexdigest()


def broadcast(x, root=0, comm=None):
    """Copies the array of a rank to all, in place; its adjoint is that of the root alone."""
    comm = resolve(comm)
    checked(comm, "broadcast", x)
    _writable(comm, "broadcast", x)
    if not isinstance(root, int) or not 0 <= root < comm.size:
        raise DistributedValueError(
            f"rank {comm.rank}: broadcast expects a root below {comm.size}, but got {root!r}"
        )
    if Observers.executor is not None:
        return forward.in_place([x], lambda x: broadcast(x, root, comm))
    common = f"from rank {root} of {_described(x)}"
    _plan(comm, ("broadcast", common), "broadcast", common)
    if Observers.active:
        Observers.memory.writing(x, Place("broadcast"))

    def run():
        if comm.size > 1 and x.size:
            packed = x if x.is_contiguous else x.contiguous()
            comm.broadcast(flat(packed, wp.uint8), root)
            if packed is not x:
                wp.copy(x, packed)

    without_tape(lambda: run_or_record(comm, "broadcast", run))
    tape = Observers.tape
    if tape is not None and x.requires_grad and comm.rank != root:
        record(tape, x.grad.zero_, [x])
    return x


class _Movement:
    """A movement of rows to a new array, and back for adjoints."""

    def __init__(self, comm, name, x, rows, deliver, backward):
        self.name = name
        self.y = wp.empty(
            (rows, *x.shape[1:]), dtype=x.dtype, device=x.device, requires_grad=x.requires_grad
        )
        packed = without_tape(x.contiguous)
        y = self.y

        def move():
            if packed.ptr != x.ptr:
                wp.copy(packed, x)
            deliver(flat(y, wp.uint8), flat(packed, wp.uint8))

        without_tape(lambda: run_or_record(comm, name, move))
        tape = Observers.tape
        if tape is None or not x.requires_grad:
            return

        def reverse():
            def run():
                found = wp.zeros(x.shape, dtype=x.dtype, device=x.device)
                backward(found, y.grad)
                cotangents.add_into(x.grad, found)
                y.grad.zero_()

            run_or_record(comm, f"adjoint of {name}", run)

        record(tape, reverse, [x, y])


def _row_bytes(x) -> int:
    return int(np.prod(x.shape[1:], dtype=np.int64)) * x.item_size


def _counts_of(comm, x) -> list:
    """The rows of each rank."""
    rows = np.zeros(comm.size, np.int64)
    rows[comm.rank] = x.shape[0]
    return [int(one) for one in comm.check_sum(rows)]


def all_gather(x, comm=None):
    """The rows of all ranks one behind the other: a split value becomes a replicated one.

    Ranks may have different numbers of rows. The adjoint of a rank is its slice.
    """
    comm = resolve(comm)
    checked(comm, "all_gather", x)
    if Observers.executor is not None:
        return forward.produced(x, lambda x: all_gather(x, comm))
    common = f"of rows of {dtypes.type_repr(x.dtype)} {x.shape[1:]}"
    _plan(comm, ("all_gather", common), "all_gather", common)
    counts = _counts_of(comm, x)
    first, step = sum(counts[: comm.rank]), _row_bytes(x)
    sizes = [step * one for one in counts]

    def deliver(out, source):
        comm.all_gather(out, source, sizes) if comm.size > 1 else wp.copy(out, source)

    def backward(found, grad):
        if x.shape[0]:
            wp.copy(found, grad[first : first + x.shape[0]])

    return _Movement(comm, "all_gather", x, sum(counts), deliver, backward).y


def rows_of(count, rank, size) -> tuple[int, int]:
    """The first row of a rank's part of so many, and the first after it."""
    return count * rank // size, count * (rank + 1) // size


def reduce_scatter(x, comm=None):
    """The rank's part of the sum of all arrays: partial sums become a split value.

    Rank r gets the rows from `n * r // size` to `n * (r + 1) // size`. The adjoint of all parts is
    gathered.
    """
    comm = resolve(comm)
    checked(comm, "reduce_scatter", x)
    _check_op(comm, x, "sum")
    if Observers.executor is not None:
        return forward.produced(x, lambda x: reduce_scatter(x, comm))
    common = f"of {_described(x)}"
    _plan(comm, ("reduce_scatter", common), "reduce_scatter", common, _is_recorded(x))
    ends = [rows_of(x.shape[0], rank, comm.size) for rank in range(comm.size)]
    first, last = ends[comm.rank]
    step = _row_bytes(x)

    def deliver(out, source):
        total = wp.clone(_unflat(source, x))
        _reduce(comm, total, "sum")
        if last > first:
            wp.copy(out, flat(total[first:last], wp.uint8))

    def backward(found, grad):
        sizes = [step * (b - a) for a, b in ends]
        comm.all_gather(flat(found, wp.uint8), flat(grad.contiguous(), wp.uint8), sizes)

    if comm.size == 1:

        def backward(found, grad):
            wp.copy(found, grad)

    return _Movement(comm, "reduce_scatter", x, last - first, deliver, backward).y


def all_to_all(x, counts, comm=None):
    """Sends the first `counts[0]` rows to rank 0, the next to rank 1, and so on.

    Returns:
        The rows that came, those of rank 0 first, and their numbers by rank.

    Raises:
        ValueError: the counts are not as many as ranks, or not those of all rows.
    """
    comm = resolve(comm)
    checked(comm, "all_to_all", x)
    counts = [int(one) for one in counts]
    if len(counts) != comm.size or sum(counts) != x.shape[0] or min(counts) < 0:
        raise DistributedValueError(
            f"rank {comm.rank}: all_to_all expects {comm.size} counts of {x.shape[0]} rows in all, "
            f"but got {counts}"
        )
    if Observers.executor is not None:
        return forward.produced(x, lambda x: all_to_all(x, counts, comm))
    common = f"of rows of {dtypes.type_repr(x.dtype)} {x.shape[1:]}"
    _plan(comm, ("all_to_all", common), "all_to_all", common, _is_recorded(x))
    table = np.zeros((comm.size, comm.size), np.int64)
    table[comm.rank] = counts
    found = comm.check_sum(table.reshape(-1)).reshape(comm.size, comm.size)
    came = [int(one) for one in found[:, comm.rank]]
    step = _row_bytes(x)
    given, taken = [step * one for one in counts], [step * one for one in came]

    def deliver(out, source):
        if comm.size > 1:
            comm.all_to_all(out, source, taken, given)
        else:
            wp.copy(out, source)

    def backward(found, grad):
        ends = flat(found, wp.uint8), flat(grad.contiguous(), wp.uint8)
        if comm.size > 1:
            comm.all_to_all(*ends, given, taken)
        else:
            wp.copy(*ends)

    return _Movement(comm, "all_to_all", x, sum(came), deliver, backward).y, came


def barrier(comm=None) -> None:
    """Waits for all ranks."""
    resolve(comm).barrier()
