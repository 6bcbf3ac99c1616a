"""Memory of arrays."""

from __future__ import annotations

from warp import _native
from warp._src import errors
from warp._src.arrays.layout import bytes_of, check_strides, type_id
from warp._src.devices import allocators
from warp._src.types import dtypes


def new_array(cls):
    """An array of a class, without memory, to be set up by the caller."""
    return _native.Array.__new__(cls)


def allocate(target, extents, dtype, device_index, pinned=False, strides=None) -> None:
    """Gives an array memory of its own, packed without `strides`; the contents are undefined."""
    item_size = dtypes.type_size_in_bytes(dtype)
    if strides is not None:
        strides = check_strides(strides, extents)
    size = bytes_of(extents, strides, item_size)
    if size >= 1 << 63:
        raise errors.WarpMemoryError(f"an array of shape {extents} has more bytes than can exist")
    if not size:
        buffer = None
    elif allocators.special:
        buffer = allocators.make_buffer(device_index, size, pinned)
    else:
        buffer = _native.Buffer(device_index, size, pinned)
    pointer = buffer.ptr if buffer is not None else 0
    target._setup(
        pointer, extents, strides, dtype, type_id(dtype), item_size, device_index, buffer, pinned
    )
