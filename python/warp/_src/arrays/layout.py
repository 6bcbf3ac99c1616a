"""Element types and shapes of arrays: what is allowed, and the runtime's number for a type."""

from __future__ import annotations

import itertools
import math
import operator

from warp import _native
from warp._src import errors
from warp._src.argument_kinds import above
from warp._src.arguments import shown, spelled
from warp._src.types import dtypes

MAX_EXTENT = 2**31 - 1
MAX_RANK = 4


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
    try:
        extents = (operator.index(shape),)
    except TypeError:
        try:
            # One more than an array may have, of what may have no end.
            extents = tuple(itertools.islice(shape, MAX_RANK + 1))
        except TypeError:
            raise TypeError(f"expects integers as extents, but got {shown(shape)}") from None
    if not 1 <= len(extents) <= MAX_RANK:
        got = len(shape) if hasattr(shape, "__len__") else "more"
        raise ValueError(f"expects 1 to 4 dimensions, but got {got}")
    try:
        extents = tuple(map(operator.index, extents))
    except TypeError:
        raise TypeError(f"expects integers as extents, but got {spelled(shape)}") from None
    for axis, extent in enumerate(extents):
        if extent < 0:
            raise errors.WarpShapeError(
                f"expects extents of at least 0, but got {extent} in dimension {axis}",
                code="extent-negative",
            )
        if extent > MAX_EXTENT:
            raise errors.WarpShapeError(
                f"expects extents of at most {MAX_EXTENT}, but got {extent} in dimension {axis}",
                code="extent-large",
            )
    return extents


def check_strides(strides, extents) -> tuple:
    """Byte strides of an array as a tuple, one for each extent.

    Raises:
        ValueError: there are more or fewer.
        NotImplementedError: one is negative.
    """
    try:
        strides = (operator.index(strides),)
    except TypeError:
        strides = tuple(int(stride) for stride in strides)
    if len(strides) != len(extents):
        raise errors.WarpShapeError(
            f"expects {len(extents)} strides for shape {extents}, but got {len(strides)}",
            code="stride-count",
            facts={"expected": len(extents), "given": len(strides)},
        )
    if min(strides) < 0:
        raise NotImplementedError(
            f"Negative strides are not supported, but got {strides}: arrays ascend in memory; "
            "reverse the indices in the kernel, or copy the elements in the other order"
        )
    return strides


def bytes_of(extents, strides, item_size) -> int:
    """Bytes from the first element of an array to the end of its last."""
    count = math.prod(extents)
    if not count or strides is None:
        return count * item_size
    spans = (stride * (extent - 1) for extent, stride in zip(extents, strides, strict=True))
    return item_size + sum(spans)


def type_id(dtype) -> int:
    """Number of an element type in the runtime."""
    found = _type_ids.get(dtype)
    if found is None:
        found = _type_ids[dtype] = _native.type_id(dtypes.native_text(dtype))
    return found


_type_ids: dict = {}


above.check_shape = check_shape
