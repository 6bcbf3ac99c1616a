"""Memory pools, access of devices to each other's memory, and sharing between processes."""

from __future__ import annotations

import enum

from warp import _native
from warp._src.argument_kinds import ARRAY, DEVICE, NUMBER
from warp._src.arguments import checked
from warp._src.devices import devices
from warp._src.devices.devices import get_device, resolve_index


class MemoryKind(enum.IntEnum):
    """The kind of memory that backs an array."""

    UNKNOWN = 0
    HOST = 1
    PINNED = 2
    CUDA_DEVICE = 3
    CUDA_MEMPOOL = 4
    CUDA_MANAGED = 5


# ---- Pools ---------------------------------------------------------------------------------------


def _with_pool(device):
    device = get_device(device)
    if not device.is_cuda:
        raise ValueError(f"expects a CUDA device, which has a memory pool, but got '{device}'")
    if not device.is_mempool_supported:
        raise RuntimeError(f"device '{device}' does not support memory pools")
    return device


def is_mempool_supported(device) -> bool:
    """True if a device has a stream-ordered memory pool."""
    return get_device(device).is_mempool_supported


def is_mempool_enabled(device) -> bool:
    """True if new arrays of a device come from its pool."""
    return get_device(device).is_mempool_enabled


@checked()
def set_mempool_enabled(device, enable: bool) -> None:
    """Lets new arrays of a device come from its pool, or not.

    Raises:
        ValueError, RuntimeError: the device has no pool.
    """
    device = get_device(device)
    if enable:
        _with_pool(device)
    elif not device.is_cuda:
        return
    _native.set_pool_enabled(device.index, bool(enable))


@checked(threshold=NUMBER)
def set_mempool_release_threshold(device, threshold: int | float) -> None:
    """Sets how much freed memory the pool keeps.

    Args:
        device: a CUDA device.
        threshold: bytes, or a float from 0 to 1 as a share of the device's memory.
    """
    device = _with_pool(device)
    if isinstance(threshold, float) and 0 < threshold <= 1:
        threshold = threshold * device.total_memory
    _native.set_pool_release_threshold(device.index, max(0, int(threshold)))


def get_mempool_release_threshold(device=None) -> int:
    """How many bytes of freed memory the pool keeps."""
    return _native.pool_release_threshold(_with_pool(device).index)


def get_mempool_used_mem_current(device=None) -> int:
    """Bytes in use from the pool."""
    return _native.pool_use(_with_pool(device).index)[0]


def get_mempool_used_mem_high(device=None) -> int:
    """Bytes that were in use from the pool at most."""
    return _native.pool_use(_with_pool(device).index)[1]


# ---- Access --------------------------------------------------------------------------------------


def is_peer_access_supported(target_device, peer_device) -> bool:
    """True if the hardware lets `peer_device` reach the memory of `target_device`."""
    target, peer = get_device(target_device), get_device(peer_device)
    if not target.is_cuda or not peer.is_cuda:
        return False
    return _native.can_peers_link(target.index, peer.index)


def is_peer_access_enabled(target_device, peer_device) -> bool:
    """True if `peer_device` may reach memory of `target_device` that comes from no pool."""
    target, peer = get_device(target_device), get_device(peer_device)
    if not target.is_cuda or not peer.is_cuda:
        return False
    return _native.is_peer_access_enabled(target.index, peer.index)


@checked()
def set_peer_access_enabled(target_device, peer_device, enable: bool) -> None:
    """Lets `peer_device` reach memory of `target_device` that comes from no pool, or not.

    Raises:
        ValueError: one of them is the CPU.
        RuntimeError: the devices are not connected.
    """
    target, peer = get_device(target_device), get_device(peer_device)
    if not target.is_cuda or not peer.is_cuda:
        if enable:
            raise ValueError(f"expects two CUDA devices, but got '{target}' and '{peer}'")
        return
    _native.set_peer_access_enabled(target.index, peer.index, bool(enable))


def is_mempool_access_supported(target_device, peer_device) -> bool:
    """True if `peer_device` can be given access to the memory pool of `target_device`."""
    target = get_device(target_device)
    return target.is_mempool_supported and is_peer_access_supported(target, peer_device)


def is_mempool_access_enabled(target_device, peer_device) -> bool:
    """True if `peer_device` may reach the memory pool of `target_device`."""
    target, peer = get_device(target_device), get_device(peer_device)
    if not target.is_cuda or not peer.is_cuda:
        return False
    return _native.is_pool_access_enabled(target.index, peer.index)


@checked()
def set_mempool_access_enabled(target_device, peer_device, enable: bool) -> None:
    """Lets `peer_device` reach the memory pool of `target_device`, or not.

    Raises:
        ValueError: one of them is the CPU.
        RuntimeError: there is no pool, or the devices are not connected.
    """
    target, peer = get_device(target_device), get_device(peer_device)
    if not target.is_cuda or not peer.is_cuda:
        if enable:
            raise ValueError(f"expects two CUDA devices, but got '{target}' and '{peer}'")
        return
    _native.set_pool_access_enabled(target.index, peer.index, bool(enable))


@checked(resource=ARRAY | DEVICE)
def can_access(device, resource) -> bool:
    """True if kernels on a device can use an array.

    Raises:
        TypeError: `resource` is no array, or the annotation of one.
    """
    if not issubclass(type(resource), _native.Array):
        kind = type(resource).__name__
        problem = f"can_access() expects Warp arrays, but got '{kind}'"
        if getattr(resource, "_wp_array_annotation_", False):
            problem = (
                f"can_access() expects a concrete Warp array, but got the annotation {resource!r}"
            )
        raise TypeError(problem)
    index = resolve_index(device)
    return _native.can_access(index, resource.device_index, resource.ptr or 0)


def memory_kind(array) -> MemoryKind:
    """The kind of memory that backs an array."""
    # `isinstance` takes an annotation for an array.
    if not issubclass(type(array), _native.Array):
        return MemoryKind.UNKNOWN
    if array.device_index < 0 and not array.pinned:
        return MemoryKind.HOST
    return MemoryKind(_native.memory_kind(array.device_index, array.ptr or 0))


class ScopedMempool(_native.Scope):
    """Lets new arrays of a device come from its pool, or not, for a block."""

    @checked()
    def __init__(self, device, enable: bool):
        self.device, self.enable = get_device(device), enable

    _saved = None

    def _enter(self):
        self._saved = is_mempool_enabled(self.device)
        set_mempool_enabled(self.device, self.enable)

    def _restore(self):
        if self._saved is not None:
            set_mempool_enabled(self.device, self._saved)
        self._saved = None


class ScopedMempoolAccess(_native.Scope):
    """Gives a device access to the memory pool of another one for a block, or takes it."""

    @checked()
    def __init__(self, target_device, peer_device, enable: bool):
        self.devices, self.enable = (target_device, peer_device), enable

    _saved = None

    def _enter(self):
        self._saved = is_mempool_access_enabled(*self.devices)
        set_mempool_access_enabled(*self.devices, self.enable)

    def _restore(self):
        if self._saved is not None:
            set_mempool_access_enabled(*self.devices, self._saved)
        self._saved = None


class ScopedPeerAccess(_native.Scope):
    """Gives a device access to the plain memory of another one for a block, or takes it."""

    @checked()
    def __init__(self, target_device, peer_device, enable: bool):
        self.devices, self.enable = (target_device, peer_device), enable

    _saved = None

    def _enter(self):
        self._saved = is_peer_access_enabled(*self.devices)
        set_peer_access_enabled(*self.devices, self.enable)

    def _restore(self):
        if self._saved is not None:
            set_peer_access_enabled(*self.devices, self._saved)
        self._saved = None


# ---- Other processes -----------------------------------------------------------------------------

HANDLE_BYTES = 64


def ipc_handle(array) -> bytes:
    """The bytes with which another process uses the memory of an array, see `from_ipc_handle`."""
    if array.device_index == devices.CPU:
        raise RuntimeError("expects an array on a CUDA device to share with another process")
    _native.share_with_others()
    handle, offset = _native.export_memory(array.device_index, array.ptr or 0)
    return handle + (offset.to_bytes(8, "little") if offset else b"")


class Imported(_native.Finalized):
    """Memory of another process, closed with the last array over it."""

    def __init__(self, device: int, handle: bytes):
        self.device = device
        self.ptr = _native.import_memory(device, handle)

    ptr = None

    def _release(self):
        ptr, self.ptr = self.ptr, None
        if ptr is not None:
            _native.close_imported(self.device, ptr)


def event_from_ipc_handle(handle: bytes, device=None):
    """An event of another process, from what `event.ipc_handle()` gave there.

    Raises:
        RuntimeError: the device is no CUDA device, or the handle leads nowhere.
    """
    device = get_device(device)
    if not device.is_cuda:
        raise RuntimeError(f"expects a CUDA device for an event, but got '{device}'")
    return _native.import_event(device.index, handle)
