"""Gradients that come from outside or from several launches: seeds and sums.

Arrays are numbered as in `Call.leaves`.
"""

from __future__ import annotations

from warp._src import errors
from warp._src.arrays.array import array
from warp._src.arrays.casts import cast, casted
from warp._src.arrays.gradients import gradient_type
from warp._src.arrays.observers import Observing
from warp._src.derivatives.struct_sums import add_structs
from warp._src.types import dtypes
from warp._src.types.native import ArrayType


def with_gradient_of(contents: array, original: array) -> array:
    """An array with the contents of one and the gradient of another."""
    result = contents._view(0, contents.shape, contents.strides)
    if original.grad is not None:
        result.grad = original.grad
    return result


def as_gradient(seed: array, target: array) -> array:
    """A seed with elements like those of an array's gradient; 16 and 32 bits become each other.

    Raises:
        WarpTypeError: it has elements of another type.
    """
    expected = target.grad.dtype
    if dtypes.types_equal(seed.dtype, expected):
        return seed
    wide = gradient_type(target.dtype)
    if not any(dtypes.types_equal(seed.dtype, one) for one in (target.dtype, wide)):
        raise errors.WarpTypeError(
            f"backward: expects a gradient with elements of '{dtypes.type_repr(expected)}', but "
            f"got '{dtypes.type_repr(seed.dtype)}'"
        )
    with Observing(tape=None):
        return casted(seed, expected)


def gradient_struct(value):
    """A copy of a struct whose arrays are the gradients of its arrays."""
    result = value.__copy__()
    for name, dtype in value._wp_fields_.items():
        if isinstance(dtype, ArrayType):
            field = getattr(value, name)
            setattr(result, name, None if field is None else field.grad)
        elif dtypes.is_struct(dtype):
            setattr(result, name, gradient_struct(value._inner(name)))
    return result


def add_into(target: array, source: array) -> None:
    """Adds the elements of one array to those of another of equal size, on any devices."""
    if source.device_index != target.device_index:
        source = source.to(target.device)
    if source.shape != target.shape:
        target, source = target.flatten(), source.flatten()
    if dtypes.is_struct(target.dtype):
        add_structs(target, source)
        return
    if source.item_size > target.item_size:
        wide = casted(target, source.dtype)
        add_into(wide, source)
        cast(wide, target)
        return
    if source.item_size < target.item_size:
        source = casted(source, target.dtype)
    if source.dtype is not target.dtype:
        scalar = getattr(target.dtype, "_wp_scalar_type_", target.dtype)
        target, source = _as_scalars(target, scalar), _as_scalars(source, scalar)
    target += source


def _as_scalars(one: array, scalar) -> array:
    """The scalars of packed elements in one row."""
    if one.dtype is scalar:
        return one.flatten()
    return one.flatten().view(scalar).flatten()
