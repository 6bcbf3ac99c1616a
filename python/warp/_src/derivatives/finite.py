"""The sanitizer of backward passes: finds where a gradient stops being finite.

After each record that is reversed the gradients it may have changed are looked at. The first
number that is infinite or NaN is reported with the launch, the argument, the element, the
gradients that came in, the values of the arguments there, and the operation of the kernel that it
comes from (`origin`).
"""

from __future__ import annotations

import linecache

import numpy

from warp._src import errors
from warp._src.arrays.array import array
from warp._src.arrays.casts import casted
from warp._src.arrays.gradients import gradient_type
from warp._src.derivatives.origin import find_origin
from warp._src.derivatives.tape_records import LaunchRecord
from warp._src.types import dtypes
from warp._src.types.scalars import bfloat16

# Elements shown of each array.
_SHOWN = 4


def reverse_checked(record, state) -> None:
    """Reverses a record.

    Raises:
        WarpGradientError: a gradient is not finite afterwards; names the place.
    """
    named = _gradients(record)
    before = [(name, one, _numbers(one.grad)) for name, one in named]
    for name, one, numbers in before:
        index = _first_bad(numbers)
        if index is not None:
            raise _seed_error(record, name, one, index, numbers)
    arguments = record.arguments(state) if isinstance(record, LaunchRecord) and named else None
    record.reverse(state)
    for name, one, _ in before:
        numbers = _numbers(one.grad)
        index = _first_bad(numbers)
        if index is not None:
            raise _error(record, name, one, (index, numbers[index]), before, arguments)


def _gradients(record) -> list[tuple[str, array]]:
    """Names and arrays of a record that have a gradient, each once."""
    if isinstance(record, LaunchRecord):
        named = [(name, one) for name, one in record.call.leaves if one is not None]
    else:
        named = [(f"array {i}", one) for i, one in enumerate(record.arrays())]
    found = {}
    for name, one in named:
        if one.requires_grad and one.size and not dtypes.is_struct(one.dtype):
            found.setdefault(one.grad.ptr, (name, one))
    return list(found.values())


def _numbers(one) -> numpy.ndarray:
    if dtypes.type_scalar_type(one.dtype) is bfloat16:
        # NumPy would have bits.
        one = casted(one, gradient_type(one.dtype))
    return numpy.array(one.numpy(), copy=True)


def _first_bad(numbers):
    """Index of the first number that is not finite, or None."""
    if numbers.dtype.kind != "f":
        return None
    bad = numpy.argwhere(~numpy.isfinite(numbers))
    return tuple(int(i) for i in bad[0]) if len(bad) else None


def _seed_error(record, name, one, index, numbers):
    place = record.event
    return errors.WarpGradientError(
        f"gradient of the {place}: the gradient of '{name}' is {numbers[index]} at "
        f"{_text(index)} before the launch is reversed",
        file=place.file,
        line=place.line,
        hint="check the seeds of `backward` and functions given to `record_func`",
    )


def _error(record, name, one, found, before, arguments):
    place = record.event
    index, value = found
    notes: list[str] = []
    if isinstance(record, LaunchRecord):
        notes = _origin(record, arguments, before) + _operands(record, index[: one.ndim], before)
    return errors.WarpGradientError(
        f"gradient of the {place}: the gradient of '{name}' became {value} at {_text(index)}",
        file=place.file,
        line=place.line,
        notes=tuple(notes),
    )


def _origin(record, arguments, before) -> list[str]:
    """A line about the operation in the kernel."""

    def restore():
        for _, one, numbers in before:
            one.grad.assign(array(numbers, dtype=one.grad.dtype, device="cpu"))
        wide.load()

    values, wide = arguments
    try:
        made = record.derivative(tape="checkpoints")
        found = find_origin(made, record.call, values, restore)
    except errors.WarpError:
        return []
    if found is None:
        return []
    known = ", ".join("?" if value is None else f"{value:.9g}" for value in found.operands)
    text = f"it comes from {found.operation}({known})"
    if not found.file:
        return [text]
    source = linecache.getline(found.file, found.line).strip()
    return [f"{text} at {found.file}:{found.line}:{found.column}: {source}"]


def _operands(record, element, before) -> list[str]:
    """Values of the arguments, those of arrays near the element, and gradients that came in."""
    notes = []
    incoming = {name: numbers for name, _, numbers in before}
    leaves = dict(record.call.leaves)
    for name, one in leaves.items():
        if one is None or not one.size:
            continue
        where, value = _near(one.numpy(), element[: one.ndim], one.ndim)
        text = f"{name}{where} = {value}"
        if name in incoming:
            where, value = _near(incoming[name], element[: one.ndim], one.ndim)
            text += f", its gradient was {value}"
        notes.append(text)
    for parameter, value in zip(record.call.native.parameters, record.call.values, strict=True):
        if parameter[1] in ("scalar", "composite"):
            notes.append(f"{parameter[0]} = {value}")
    return notes


def _near(numbers, element, rank):
    """The element of that index, or the first ones if there is none."""
    shape = numbers.shape[:rank]
    if len(element) == rank and all(i < n for i, n in zip(element, shape, strict=True)):
        return _text(element), numbers[element]
    flat = numbers.reshape(-1, *numbers.shape[rank:])[:_SHOWN]
    return f"[:{_SHOWN}]", flat


def _text(index) -> str:
    return "[" + ", ".join(map(str, index)) + "]"
