"""Allocators of array memory: pools, custom allocators, and the tracker's hook.

The native buffer serves almost all requests. `special` names the reasons to look here instead;
while it is empty, allocating an array costs nothing more.
"""

from __future__ import annotations

import typing

from warp import _native
from warp._src.arguments import checked
from warp._src.devices import devices
from warp._src.devices.builtin_allocators import custom_allocators
from warp._src.devices.call_sites import call_site


@typing.runtime_checkable
class Allocator(typing.Protocol):
    """The protocol of a custom allocator; `memory_kind` is an optional attribute."""

    def allocate(self, size_in_bytes: int) -> int:
        """The address of new memory on the device whose context is current."""

    def deallocate(self, ptr: int, size_in_bytes: int) -> None:
        """Frees memory; work that uses it comes before what the current stream gets next."""


special: set = set()


class CudaManagedAllocator:
    """Gives arrays memory that host and devices share by moving pages."""

    def allocate(self, size_in_bytes: int) -> int:
        """Managed memory for the device whose context is current, or for the default one."""
        context = _native.current_context()
        index = _native.map_context(context) if context else devices.resolve_index("cuda")
        return _native.allocate_managed(index, size_in_bytes)

    def deallocate(self, ptr: int, size_in_bytes: int) -> None:
        """Frees the memory once the device is done with it."""
        context = _native.current_context()
        index = _native.map_context(context) if context else devices.resolve_index("cuda")
        _native.free_managed(index, ptr)


class CurrentContext(_native.Scope):
    """Makes the context of a device the driver's current one for a block."""

    _previous: tuple = ()

    def __init__(self, device: int):
        self.context = _native.cuda_context(device)

    def _enter(self):
        self._previous = (_native.current_context(),)
        _native.set_current_context(self.context)

    def _restore(self):
        if self._previous:
            _native.set_current_context(*self._previous)
        self._previous = ()


class CustomBuffer(_native.Finalized):
    """Memory of a custom allocator, freed with the last array over it."""

    tracked = False

    def __init__(self, allocator, device: int, size: int):
        self.allocator, self.device, self.size, self.ptr = allocator, device, size, 0
        with CurrentContext(device):
            self.ptr = int(allocator.allocate(size) or 0)
        if not self.ptr:
            raise MemoryError(f"the allocator of '{devices.by_index(device)}' gave no memory")

    def track(self, site: str) -> None:
        self.tracked = True
        _native.tracker_add(self.ptr, self.size, self.device, site)

    def _release(self):
        if not self.ptr:
            return
        if self.tracked:
            _native.tracker_remove(self.ptr)
        try:
            _native.join_streams(_native.current_stream(self.device))
            context = CurrentContext(self.device)
        except RuntimeError:
            return
        with context:
            # Never twice, also where an interrupt ends it.
            ptr, self.ptr = self.ptr, 0
            self.allocator.deallocate(ptr, self.size)


def make_buffer(device: int, size: int, pinned: bool):
    """Memory for an array while something in `special` asks for more than the usual."""
    allocator = custom_allocators.get(device)
    if allocator is None:
        buffer = _native.Buffer(device, size, pinned)
    else:
        buffer = CustomBuffer(allocator, device, size)
    if "tracker" in special:
        buffer.track(call_site())
    return buffer


def _check(allocator) -> None:
    if allocator is None:
        return
    for name in ("allocate", "deallocate"):
        if not callable(getattr(allocator, name, None)):
            raise TypeError(
                f"expects an allocator with methods 'allocate' and 'deallocate', but "
                f"'{type(allocator).__name__}' has no '{name}'"
            )


@checked()
def set_device_allocator(device, allocator: Allocator | None) -> None:
    """Lets an allocator serve the arrays of a CUDA device; None goes back to the built-in one.

    Raises:
        RuntimeError: the device is the CPU.
        TypeError: the object is no allocator.
    """
    device = devices.get_device(device)
    if not device.is_cuda:
        raise RuntimeError(f"expects a CUDA device for an allocator, but got '{device}'")
    # It gets memory back at once, whatever launches wait for their code.
    _native.share_with_others()
    _check(allocator)
    if allocator is None:
        custom_allocators.pop(device.index, None)
    else:
        custom_allocators[device.index] = allocator
    (special.add if custom_allocators else special.discard)("allocator")


def get_device_allocator(device) -> Allocator | None:
    """The custom allocator of a device, or None."""
    return custom_allocators.get(devices.resolve_index(device))


def set_cuda_allocator(allocator: Allocator | None) -> None:
    """Lets an allocator serve the arrays of all CUDA devices.

    Raises:
        RuntimeError: there is no CUDA device.
    """
    _check(allocator)
    if not devices.get_cuda_devices():
        raise RuntimeError("expects a CUDA device for an allocator, but there is none")
    for device in devices.get_cuda_devices():
        set_device_allocator(device, allocator)


class ScopedAllocator(_native.Scope):
    """Lets an allocator serve the arrays of a device for a block."""

    @checked()
    def __init__(self, device, allocator: Allocator | None):
        self.device = devices.get_device(device)
        if not self.device.is_cuda:
            raise RuntimeError(f"expects a CUDA device for an allocator, but got '{self.device}'")
        _check(allocator)
        self.allocator = allocator

    _saved: tuple = ()

    def _enter(self):
        self._saved = (get_device_allocator(self.device),)
        set_device_allocator(self.device, self.allocator)
        return self

    def _restore(self):
        if self._saved:
            set_device_allocator(self.device, *self._saved)
        self._saved = ()
