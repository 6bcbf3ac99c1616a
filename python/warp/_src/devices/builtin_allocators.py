"""The allocator of a device: the custom one that a user set, or the runtime's own."""

from __future__ import annotations

import functools

from warp import _native

# By number of the device; `allocators` sets them.
custom_allocators: dict = {}


class DeviceAllocator:
    """Gives the memory that arrays of a device have while no custom allocator serves them.

    On a CUDA device it is a pool's while `wp.is_mempool_enabled`.
    """

    def __init__(self, index: int, pinned: bool):
        self._index, self._pinned = index, pinned
        self._live: dict[int, _native.Buffer] = {}

    def allocate(self, size_in_bytes: int) -> int:
        """The address of new memory; the contents are undefined.

        Raises:
            WarpMemoryError: the device has no such amount left.
        """
        buffer = _native.Buffer(self._index, size_in_bytes, self._pinned)
        self._live[buffer.ptr] = buffer
        return buffer.ptr

    def deallocate(self, ptr: int, size_in_bytes: int) -> None:
        """Frees memory.

        Raises:
            ValueError: the address is not of this allocator, or was freed before.
        """
        if self._live.pop(ptr, None) is None:
            raise ValueError(f"this allocator has no memory at {ptr:#x}")


@functools.cache
def get_builtin_allocator(index: int, pinned: bool) -> DeviceAllocator:
    """The allocator of a device that has no custom one."""
    return DeviceAllocator(index, pinned)
