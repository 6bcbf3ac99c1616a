"""Buffers: packed memory of the parts of arrays that travel in one message."""

from __future__ import annotations

import warp as wp

_ALIGNMENT = 64


def aligned(size) -> int:
    """The first offset from a number of bytes on at which an array may begin."""
    return -(-size // _ALIGNMENT) * _ALIGNMENT


def size_of(parts) -> int | None:
    """Bytes of a packed buffer of parts, None for none."""
    total = 0
    for one in parts:
        total = aligned(total) + one.size * one.item_size
    return total or None


def memory_of(array):
    """The bytes of a contiguous array, None for an empty one."""
    if array is None or not array.size:
        return None
    if array.dtype is wp.uint8 and array.ndim == 1:
        return array
    size = array.size * array.item_size
    return array._view(0, (size,), (1,), wp.uint8)


class Buffer:
    """Packed memory of arrays with the shapes and types of others, outside of the pool.

    Args:
        likes: the others.
        memory: bytes to take, in place of new ones on the device.

    Attributes:
        bytes: all of it.
        parts: the arrays.
    """

    def __init__(self, likes, device, memory=None):
        if memory is None:
            memory = wp.empty(size_of(likes) or 0, dtype=wp.uint8, device=device)
        self.bytes = memory
        self.parts = []
        offset = 0
        for one in likes:
            offset = aligned(offset)
            self.parts.append(self._part(offset, one))
            offset += one.size * one.item_size

    def _part(self, offset, like):
        strides, step = [], like.item_size
        for extent in reversed(like.shape):
            strides.insert(0, step)
            step *= extent
        return self.bytes._view(offset, like.shape, strides, like.dtype)
