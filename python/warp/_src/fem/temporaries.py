"""Scratch memory - pool that lends arrays to repeated assemblies.

Without a store an array comes from the device's allocator and goes back when it is no longer used.
A store keeps the memory, so that an assembly in a loop allocates once.
"""

from __future__ import annotations

import bisect
import math

import warp as wp
from warp import extend


class Temporary(wp.array):
    """An array that may be given back before it is garbage."""

    _pool = None

    def release(self) -> None:
        """Returns the memory to the store; a tape that records keeps it until it is garbage."""
        pool, self._pool = self._pool, None
        if pool is not None and not extend.is_recording():
            pool.give_back(self)

    def detach(self) -> Temporary:
        """Takes the memory out of the store for good, and returns the array."""
        self._pool = None
        return self


class _Pool:
    """Free memory of one device, by size."""

    def __init__(self, device, pinned):
        self.device, self.pinned = device, pinned
        self._sizes: list[int] = []
        self._blocks: list = []

    def lend(self, shape, dtype):
        """An array over a free block, or over a new one if none is large enough."""
        size = wp.types.type_size_in_bytes(dtype) * math.prod(shape)
        at = bisect.bisect_left(self._sizes, size)
        # A block of more than twice the size is left for arrays that need it.
        if at < len(self._sizes) and self._sizes[at] <= 2 * size + 4096:
            self._sizes.pop(at)
            block = self._blocks.pop(at)
        else:
            block = wp.empty(size, dtype=wp.uint8, device=self.device, pinned=self.pinned)
        array = Temporary(
            ptr=block.ptr,
            capacity=block.size,
            shape=shape,
            dtype=dtype,
            device=self.device,
            pinned=self.pinned,
        )
        array._block, array._pool = block, self
        return array

    def give_back(self, array) -> None:
        """Puts the memory of an array among the free blocks."""
        at = bisect.bisect_left(self._sizes, array._block.size)
        self._sizes.insert(at, array._block.size)
        self._blocks.insert(at, array._block)


class TemporaryStore:
    """Memory for temporaries that lasts over calls of `integrate` and `interpolate`.

    Example:
        >>> from warp import fem
        >>> store = fem.TemporaryStore()
        >>> a = fem.borrow_temporary(store, shape=1000, dtype=float, device="cpu")
        >>> address = a.ptr
        >>> a.release()
        >>> fem.borrow_temporary(store, shape=1000, dtype=float, device="cpu").ptr == address
        True
    """

    _default_store: TemporaryStore | None = None

    def __init__(self):
        self._pools: dict = {}

    def clear(self) -> None:
        """Frees what is not lent."""
        self._pools = {}

    def borrow(self, shape, dtype, pinned=False, device=None, requires_grad=False) -> Temporary:
        """An array of the store, with undefined content; its gradient is zero.

        Args:
            shape: extents, or the number of elements.
            dtype: element type.
            pinned: host memory that CUDA devices reach directly.
            device: where the array lives.
            requires_grad: if it has a gradient.
        """
        device = wp.get_device(device)
        shape = (shape,) if isinstance(shape, int) else tuple(shape)
        key = (device.alias, bool(pinned))
        pool = self._pools.get(key)
        if pool is None:
            pool = self._pools[key] = _Pool(device, pinned)
        array = pool.lend(shape, extend.canonical(dtype))
        if requires_grad:
            array.requires_grad = True
        return array


def set_default_temporary_store(temporary_store: TemporaryStore | None) -> None:
    """Sets the store of calls that are given none; None allocates anew each time."""
    TemporaryStore._default_store = temporary_store


def borrow_temporary(
    temporary_store, shape, dtype, pinned=False, requires_grad=False, device=None
) -> Temporary:
    """An array of a store with undefined content; `release()` gives it back.

    Args:
        temporary_store: the store; None is the default store, if there is one.
        shape: extents, or the number of elements.
        dtype: element type.
        pinned: host memory that CUDA devices reach directly.
        requires_grad: if it has a gradient.
        device: where the array lives.
    """
    store = temporary_store or TemporaryStore._default_store
    if store is None or extend.is_capturing(wp.get_device(device)):
        shape = (shape,) if isinstance(shape, int) else tuple(shape)
        return Temporary(
            shape=shape, dtype=dtype, pinned=pinned, device=device, requires_grad=requires_grad
        )
    return store.borrow(shape, dtype, pinned, device, requires_grad)


def borrow_temporary_like(array, temporary_store) -> Temporary:
    """An array of a store with shape, type and device of another one."""
    return borrow_temporary(
        temporary_store,
        array.shape,
        array.dtype,
        pinned=array.pinned,
        requires_grad=array.requires_grad,
        device=array.device,
    )
