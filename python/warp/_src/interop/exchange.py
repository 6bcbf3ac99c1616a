"""Parts that all exchanges with other libraries share: element types, layouts, streams, ownership.

An array made from foreign memory holds the foreign object as its owner. Nothing is copied. Streams
are ordered on the device, by events: the side that will use the memory waits for the side that
wrote it, and the host waits for nobody.
"""

from __future__ import annotations

import ctypes
import math

from warp import _native
from warp._src import errors
from warp._src.arrays.allocation import new_array
from warp._src.arrays.layout import check_shape, element_type, type_id
from warp._src.devices import devices
from warp._src.types import dtypes, scalars

# Numbers that stand for streams in DLPack and in the CUDA array interface.
LEGACY_STREAM = 1
PER_THREAD_STREAM = 2


def packed_strides(extents, item_size) -> tuple:
    """Byte strides of a row-major array without gaps."""
    strides, step = [], item_size
    for extent in reversed(extents):
        strides.insert(0, step)
        step *= max(extent, 1)
    return tuple(strides)


def same_bits(source, target) -> bool:
    """True if memory of scalars of one type may be read as the other: integers of any sign."""
    if source is target:
        return True
    integers = issubclass(source, scalars.int_base) and issubclass(target, scalars.int_base)
    to_bool = target is scalars.bool
    same_size = ctypes.sizeof(source._type_) == ctypes.sizeof(target._type_)
    return integers and same_size and not to_bool


def fold(scalar, extents, strides, dtype, bare=False):
    """Element type, extents and strides in bytes, once trailing extents became part of elements.

    Args:
        scalar: scalar type of the foreign memory.
        extents: its extents; none at all is a single number.
        strides: its strides in bytes, None if packed.
        dtype: element type that is wanted, None for the scalar.
        bare: launches may take the array for one of scalars: a single element has the stride of
            its components.

    Raises:
        TypeError: the memory holds other scalars.
        ValueError: trailing extents or strides do not fit, or more than four dimensions remain.
    """
    dtype = scalar if dtype is None else element_type(dtype)
    own = getattr(dtype, "_wp_scalar_type_", dtype)
    if dtypes.is_struct(dtype) or not same_bits(scalar, own):
        raise errors.WarpTypeError(
            f"expects elements of type '{dtypes.type_repr(dtype)}', "
            f"but got memory of '{scalar.__name__}'"
        )
    item_size = ctypes.sizeof(scalar._type_)
    strides = packed_strides(extents, item_size) if strides is None else tuple(strides)
    inner = tuple(getattr(dtype, "_shape_", ()))
    outer = len(extents) - len(inner)
    if inner:
        if outer < 0 or tuple(extents[outer:]) != inner:
            raise errors.WarpShapeError(
                f"expects inner dimensions {inner} for elements of type "
                f"'{dtypes.type_repr(dtype)}', but got shape {tuple(extents)}"
            )
        if math.prod(extents) and strides[outer:] != packed_strides(inner, item_size):
            raise errors.WarpShapeError(
                f"expects packed inner dimensions for elements of type "
                f"'{dtypes.type_repr(dtype)}', but got strides {strides} in bytes"
            )
    if not outer:
        return dtype, (1,), (item_size if bare else dtypes.type_size_in_bytes(dtype),)
    extents, strides = check_shape(extents[:outer]), strides[:outer]
    if any(stride < 0 for stride in strides):
        raise errors.WarpShapeError(
            f"expects strides of at least 0, but got {strides} in bytes, copy the data before"
        )
    return dtype, extents, strides


def alias(cls, pointer, layout, index, owner, pinned=False, read_only=False):
    """An array, of a class of arrays, over foreign memory; `layout` is what `fold` gave."""
    dtype, extents, strides = layout
    result = new_array(cls)
    size = dtypes.type_size_in_bytes(dtype)
    result._setup(pointer, extents, strides, dtype, type_id(dtype), size, index, owner, pinned)
    if read_only:
        result._protect()
    return result


def current_handle(index: int) -> int:
    """The current stream of a device, as other libraries name it."""
    _native.share_with_others()
    return _native.current_stream(index).cuda_stream or LEGACY_STREAM


def _is_recording(index: int) -> bool:
    """True if a graph is being recorded: it runs later, and cannot wait for other streams."""
    return devices.by_index(index).is_capturing


def let_wait(handle: int, index: int) -> None:
    """Lets a foreign stream wait for all work on the current stream of a device."""
    _native.share_with_others()
    current = _native.current_stream(index)
    if handle != (current.cuda_stream or LEGACY_STREAM) and not _is_recording(index):
        _native.Stream.from_handle(index, handle).wait_stream(current)


def wait_for(handle: int, index: int) -> None:
    """Lets the current stream of a device wait for all work on a foreign stream."""
    _native.share_with_others()
    current = _native.current_stream(index)
    if handle != (current.cuda_stream or LEGACY_STREAM) and not _is_recording(index):
        current.wait_stream(_native.Stream.from_handle(index, handle))


def cuda_index(ordinal: int) -> int:
    """The number of a CUDA device that another library names.

    Raises:
        ValueError: there is no such device here.
    """
    return devices.get_device(f"cuda:{ordinal}").index
