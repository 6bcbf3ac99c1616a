"""Sums and inner products of split arrays, the same bits for any number of ranks if exact."""

from __future__ import annotations

from typing import Any

import warp as wp
from warp import config
from warp._src import errors
from warp._src.arrays.observers import Observers
from warp._src.distributed import exact as exact_sums
from warp._src.distributed import forward
from warp._src.distributed.communicator import flat, resolve
from warp._src.distributed.failures import DistributedValueError
from warp._src.distributed.operations import _plan, _scalar, checked
from warp._src.distributed.plans import run_or_record, without_tape
from warp._src.types import dtypes


@wp.kernel(module="warp.distributed", enable_backward=True)
def _add_one(scale: wp.array(dtype=Any), out: wp.array(dtype=Any)):
    i = wp.tid()
    out[i] = out[i] + out.dtype(scale[0])


@wp.kernel(module="warp.distributed", enable_backward=True)
def _add_scaled(scale: wp.array(dtype=Any), x: wp.array(dtype=Any), out: wp.array(dtype=Any)):
    i = wp.tid()
    out[i] = out[i] + x.dtype(scale[0]) * x[i]


def is_exact(exact) -> bool:
    """True if sums are to be exact: what was asked for, else what the configuration says."""
    if exact is None:
        return config.deterministic not in (False, None, "", "not_guaranteed")
    return bool(exact)


def sum(x, exact=None, comm=None):
    """The sum of all elements of a split array, over all ranks.

    Args:
        x: array of float32 or float64, of any length on each rank.
        exact: the sum is rounded once and has the same bits for any number of ranks; by default
            what `wp.config.deterministic` says.
        comm: by default that of `wd.init`.

    Returns:
        An array of one element, a replicated value. On a tape its adjoint is added to all elements.

    Raises:
        TypeError: `x` is no array of float32 or float64.
    """
    return _reduced("sum", [x], exact, comm)


def dot(x, y, exact=None, comm=None):
    """The inner product of split arrays, over all ranks, in float64; otherwise as `sum`.

    Vectors, matrices and quaternions count as their numbers.

    Raises:
        ValueError: the arrays differ in type or length.
    """
    return _reduced("dot", [x, y], exact, comm)


def _checked(comm, name, arrays) -> list:
    for one in arrays:
        checked(comm, name, one)
        if (one.dtype if name == "sum" else _scalar(one.dtype)) not in exact_sums.FORMATS:
            raise errors.WarpTypeError(
                f"rank {comm.rank}: {name} expects arrays of float32 or float64, but got "
                f"'{dtypes.type_repr(one.dtype)}': write such numbers to an array first"
            )
    first, last = arrays[0], arrays[-1]
    if first.dtype is not last.dtype or first.shape != last.shape:
        raise DistributedValueError(
            f"rank {comm.rank}: {name} expects arrays of one type and shape, but got {first!r} "
            f"and {last!r}"
        )
    return [flat(one if one.is_contiguous else one.contiguous()) for one in arrays]


def _reduced(name, arrays, exact, comm):
    comm = resolve(comm)
    exact = is_exact(exact)
    if Observers.executor is not None:
        forward.values_only(lambda: without_tape(lambda: _checked(comm, name, arrays)))
        return forward.summed(arrays, lambda *arrays: _reduced(name, arrays, exact, comm))
    numbers = without_tape(lambda: _checked(comm, name, arrays))
    x = arrays[0]
    common = f"of {dtypes.type_repr(x.dtype)}{', exact' if exact else ''}"
    _plan(comm, (name, common), name, common)
    result = x.dtype if name == "sum" else wp.float64
    grads = any(one.requires_grad for one in arrays)
    out = wp.empty(1, dtype=result, device=x.device, requires_grad=grads)
    work = _exact if exact else _plain
    without_tape(lambda: work(comm, name, numbers, out))
    if Observers.tape is not None and grads:
        _record(arrays, numbers, out)
    return out


def _exact(comm, name, numbers, out) -> None:
    digits = wp.zeros(exact_sums.FORMATS[out.dtype], dtype=wp.int64, device=out.device)
    exact_sums.add_digits(numbers, digits)
    if comm.size > 1:
        run_or_record(comm, name, lambda: comm.all_reduce(digits))
    table = digits.reshape((digits.size, 1))
    wp.launch(exact_sums._ROUND[out.dtype], 1, [table, out], device=out.device)


def _plain(comm, name, numbers, out) -> None:
    if name == "sum":
        wp.utils.array_sum(numbers[0], out=out)
    elif numbers[0].dtype is wp.float64:
        wp.utils.array_inner(*numbers, out=out)
    else:
        wide = [wp.empty(one.size, dtype=wp.float64, device=out.device) for one in numbers]
        for target, source in zip(wide, numbers, strict=True):
            wp.utils.array_cast(source, target)
        wp.utils.array_inner(*wide, out=out)
    if comm.size > 1:
        run_or_record(comm, name, lambda: comm.all_reduce(out))


def _record(arrays, numbers, out) -> None:
    def backward():
        for k, one in enumerate(arrays):
            if not one.requires_grad or not one.size:
                continue
            grad = one.grad
            packed = grad if grad.is_contiguous else grad.contiguous()
            target = flat(packed)
            if len(arrays) == 1:
                wp.launch(_add_one, target.size, [out.grad, target], device=out.device)
            else:
                other = numbers[1 - k]
                wp.launch(_add_scaled, target.size, [out.grad, other, target], device=out.device)
            if packed is not grad:
                grad.assign(packed)
        out.grad.zero_()

    Observers.tape.add_function(backward, [*arrays, out])
