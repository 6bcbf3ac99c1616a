"""Copies of numbers between arrays of different floats."""

from __future__ import annotations

from warp._src.arrays import hooks
from warp._src.types.dtypes import type_scalar_type

_MAX_RANK = 4


def cast(source, target) -> None:
    """Writes the components of an array's elements, converted, to those of another array.

    Args:
        source, target: arrays of one shape on one device, with elements of one shape.
    """
    inner = len(getattr(source.dtype, "_shape_", ()))
    if source.ndim + inner > _MAX_RANK and not (source.is_contiguous and target.is_contiguous):
        for i in range(source.shape[0]):
            cast(source[i], target[i])
        return
    packed = source.is_contiguous and target.is_contiguous
    source, target = components_of(source, packed), components_of(target, packed)
    kind = target.dtype
    name = f"cast_to_{kind.__name__}"
    hooks.apply(name, "kind(x0)", {"kind": kind}, name, [(None, source)], target, False, None, None)


def casted(source, dtype):
    """A packed copy of an array with elements of another type."""
    result = hooks.plain_array(shape=source.shape, dtype=dtype, device=source.device)
    cast(source, result)
    return result


def components_of(one, in_a_row=True):
    """The components of all elements, in a row if they are packed and that is wanted."""
    scalar = type_scalar_type(one.dtype)
    in_a_row = in_a_row and one.is_contiguous
    if in_a_row:
        one = one.flatten()
    if scalar is one.dtype:
        return one
    numbers = one.view(scalar)
    return numbers.flatten() if in_a_row else numbers
