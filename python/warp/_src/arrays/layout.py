"""Element types and shapes of arrays: what is allowed, and the runtime's number for a type."""

from __future__ import annotations

from warp import _native
from warp._src.types import dtypes

MAX_EXTENT = 2**31 - 1


def bytes_spanned(array) -> int:
    """Bytes from the first element of an array to the end of the last one."""
    if not array.size:
        return 0
    steps = zip(array.shape, array.strides, strict=True)
    return array.item_size + sum((extent - 1) * stride for extent, stride in steps)


def element_type(dtype):
    """The canonical element type for what a user gave as `dtype`.

    Raises:
        TypeError: arrays of it are not possible.
    """
    try:
        return dtypes.canonical(dtype)
    except TypeError as error:
        raise TypeError(f"cannot make an array of this element type: {error}") from None


def check_shape(shape) -> tuple:
    """A shape as a tuple of at most four valid extents.

    Raises:
        TypeError, ValueError: it is none.
    """
    if shape is None:
        raise ValueError("expects a `shape`")
    extents = (shape,) if hasattr(shape, "__index__") else tuple(shape)
    if not 1 <= len(extents) <= 4:
        raise ValueError(f"expects 1 to 4 dimensions, but got {len(extents)}")
    try:
        extents = tuple(extent.__index__() for extent in extents)
    except AttributeError:
        raise TypeError(f"expects integers as extents, but got {shape!r}") from None
    for axis, extent in enumerate(extents):
        if extent < 0:
            raise ValueError(f"expects extents of at least 0, but got {extent} in dimension {axis}")
        if extent > MAX_EXTENT:
            raise ValueError(
                f"expects extents of at most {MAX_EXTENT}, but got {extent} in dimension {axis}"
            )
    return extents


def type_id(dtype) -> int:
    """Number of an element type in the runtime."""
    found = _type_ids.get(dtype)
    if found is None:
        found = _type_ids[dtype] = _native.type_id(dtypes.native_text(dtype))
    return found


_type_ids: dict = {}
