"""Memory of arrays."""

from __future__ import annotations

from warp import _native
from warp._src import errors
from warp._src.arrays.layout import type_id
from warp._src.devices import allocators
from warp._src.types import dtypes


def new_array(cls):
    """An array of a class, without memory, to be set up by the caller."""
    return _native.Array.__new__(cls)


def allocate(target, extents, dtype, device_index, pinned=False) -> None:
    """Gives an array packed memory of its own; the contents are undefined."""
    size = item_size = dtypes.type_size_in_bytes(dtype)
    for extent in extents:
        size *= extent
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
        pointer, extents, None, dtype, type_id(dtype), item_size, device_index, buffer, pinned
    )
