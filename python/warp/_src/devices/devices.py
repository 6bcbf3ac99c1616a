"""Devices: `cpu` and `cuda:0`, `cuda:1`, ...

A device is looked up by name; everything below this file names it by number (-1 is the CPU). The
CUDA driver is asked the first time that a device other than `cpu` matters; a machine without one
has the device `cpu` and nothing fails until a CUDA device is asked for by name.
"""

from __future__ import annotations

import sys
import threading
import typing

from warp import _native, config
from warp._src.argument_kinds import DEVICE, EVENT, INTEGER, STREAM, above
from warp._src.arguments import checked
from warp._src.devices.builtin_allocators import custom_allocators, get_builtin_allocator
from warp._src.devices.device_facts import DeviceFacts
from warp._src.forks import shared_lock
from warp._src.version import VERSION

CPU = -1


class Device(DeviceFacts):
    """A place where kernels run and arrays live. Made by `get_device`, compared by identity."""

    @checked(index=INTEGER)
    def __init__(self, index: int, alias: str | None = None):
        self.index = index
        self.alias = alias or ("cpu" if index == CPU else f"cuda:{index}")
        self.is_cpu = index == CPU
        self.is_cuda = index != CPU
        self.ordinal = index

    @property
    def default_allocator(self):
        """The allocator of arrays while no custom allocator serves this device."""
        return get_builtin_allocator(self.index, False)

    @property
    def pinned_allocator(self):
        """The allocator of pinned arrays of the CPU; that of the device itself on a GPU."""
        return get_builtin_allocator(self.index, self.is_cpu)

    @checked()
    def get_allocator(self, pinned: bool = False):
        """The allocator of new arrays; `pinned` asks for that of pinned ones of the CPU."""
        builtin = get_builtin_allocator(self.index, pinned and self.is_cpu)
        return custom_allocators.get(self.index, builtin)

    @property
    def context(self) -> int | None:
        """The CUDA context, for other libraries; None for the CPU."""
        return None if self.is_cpu else _native.cuda_context(self.index)

    @property
    def has_context(self) -> bool:
        """True if there is a CUDA context: on CUDA devices."""
        return self.is_cuda

    def get_cuda_output_format(self, preferred_cuda_output: str | None = None) -> str | None:
        """`ptx`, which is what kernels are kept as, whatever is preferred; None for the CPU."""
        return "ptx" if self.is_cuda else None

    def get_cuda_compile_arch(self) -> int | None:
        """The compute capability that kernels are compiled for: the device's; None for the CPU."""
        return self.arch if self.is_cuda else None

    @property
    def is_primary(self) -> bool:
        """True if this is the primary context of a CUDA device."""
        return self.index not in _mapped

    @property
    def is_capturing(self) -> bool:
        """True if a graph is being recorded, on the CPU by this thread."""
        return _native.is_capturing(self.index)

    @property
    def has_stream(self) -> bool:
        """True if work is queued on streams: on CUDA."""
        return self.is_cuda

    @property
    def stream(self):
        """The stream that launches and copies use when none is named; None for the CPU."""
        if self.is_cpu:
            return None
        return _native.current_stream(self.index)

    @stream.setter
    @checked(stream=STREAM)
    def stream(self, stream):
        set_stream(stream, self)

    @property
    def null_stream(self):
        """The legacy default stream, of handle 0, which waits for other streams and they for it.

        Raises:
            RuntimeError: the device is the CPU.
        """
        if self.is_cpu:
            raise RuntimeError(f"device '{self}' has no streams, expects a CUDA device")
        return _native.Stream.from_handle(self.index, 0)

    def get_stream(self):
        """The current stream; None for the CPU."""
        return self.stream

    @checked()
    def set_stream(self, stream, sync=True):
        """Makes `stream` the current one."""
        set_stream(stream, self, sync)

    def can_access(self, other) -> bool:
        """True if kernels on this device can read memory of the other one."""
        other = get_device(other)
        if other is self or (self.is_cuda and other.is_cuda and other.context == self.context):
            return True
        if self.is_cpu or other.is_cpu:
            return False
        return _native.is_peer_access_enabled(other.index, self.index)

    def make_current(self):
        """Nothing to do: contexts are made current where they are used."""

    def __str__(self):
        return self.alias

    def __repr__(self):
        return f"'{self.alias}'"

    def __hash__(self):
        return hash(self.alias)

    def __eq__(self, other):
        if self is other:
            return True
        if isinstance(other, str):
            return self.alias == other or (other == "cuda" and self is _first_cuda())
        return False

    def __deepcopy__(self, memo):
        return self

    def __reduce__(self):
        return (get_device, (self.alias,))


DeviceLike = Device | str | None

_cpu = Device(CPU)
_cuda: list[Device] = []
# Devices that are contexts which users mapped, by number.
_mapped: dict[int, Device] = {}
_state = {"initialized": False, "default": None, "cuda": None}

# Device numbers by everything that may name a device; the fast path of launches. `None` is the
# default device and "cuda" the CUDA device that was last the default: both are there once the
# runtime is initialized, and while no thread has a default device of its own.
index_of: dict = {"cpu": CPU, _cpu: CPU}


def is_initialized() -> bool:
    """True if the devices have been looked for."""
    return _state["initialized"]


def initialize() -> None:
    """Finds the devices; the first call prints one line unless `wp.config.quiet`."""
    if _state["initialized"]:
        return
    _state["initialized"] = True
    for index in range(_native.cuda_device_count()):
        device = Device(index)
        _cuda.append(device)
        index_of[device] = index_of[device.alias] = index
    if _cuda:
        _state["cuda"] = _cuda[0]
    _set_default(_cuda[0] if _cuda else _cpu)
    if not config.enable_mempools_at_init:
        for device in _cuda:
            _native.set_pool_enabled(device.index, False)
    if not config.quiet:
        found = ", ".join(f"{d.alias} ({d.name})" for d in [_cpu, *_cuda])
        print(
            f"warp-mlir {VERSION}: {found}; kernel cache {_native.cache_directory()}",
            file=sys.stderr,
        )


def _set_default(device) -> None:
    if _own.device is not None:
        _own.device = device
        return
    _state["default"] = device
    if device.is_cuda:
        _state["cuda"] = device
    _name_default()


def _name_default() -> None:
    """Puts the names whose meaning changes where launches find them, or out of there."""
    for name, device in ((None, _state["default"]), ("cuda", _state["cuda"])):
        if device is None or OwnDefault.blocks:
            index_of.pop(name, None)
        else:
            index_of[name] = device.index


class _Own(threading.local):
    """The default device of a thread, None where it is that of the process."""

    device = None


_own = _Own()


class OwnDefault(_native.Scope):
    """Makes a device the default of this thread alone, for a block."""

    # The entered contexts, by their ids.
    blocks: typing.ClassVar[dict] = {}
    _lock = shared_lock()
    _saved: tuple = ()

    def __init__(self, device):
        self.device = device

    def _enter(self):
        initialize()
        self._saved = (_own.device,)
        _own.device = self.device
        with self._lock:
            self.blocks[id(self)] = self
            _name_default()
        return self.device

    def _restore(self):
        if self._saved:
            (_own.device,) = self._saved
            with self._lock:
                self.blocks.pop(id(self), None)
                _name_default()
        self._saved = ()


def _first_cuda():
    initialize()
    own = _own.device
    return own if own is not None and own.is_cuda else _state["cuda"]


def by_index(index: int) -> Device:
    """The device of a number."""
    if index == CPU:
        return _cpu
    initialize()
    return _mapped[index] if index in _mapped else _cuda[index]


def map_cuda_device(alias: str, context: int | None = None) -> Device:
    """Gives a CUDA context a device name.

    Args:
        alias: the name, which must be new.
        context: address of the CUDA context; by default the one that is current on this thread.
            The primary context of a device only gives that device a second name.

    Raises:
        RuntimeError: the name is taken, or there is no context.
    """
    initialize()
    if alias in index_of:
        raise RuntimeError(f"there is a device '{alias}' already")
    context = int(getattr(context, "value", context) or _native.current_context())
    if not context:
        raise RuntimeError("expects a CUDA context, but none is current on this thread")
    index = _native.map_context(context)
    if index >= len(_cuda) and index not in _mapped:
        _mapped[index] = Device(index, alias)
    device = by_index(index)
    index_of[alias] = index_of[device] = index
    return device


@checked()
def unmap_cuda_device(alias: str) -> None:
    """Takes a name that `map_cuda_device` gave back.

    Raises:
        RuntimeError: there is no such name.
    """
    if alias not in index_of or alias in ("cpu", "cuda") or alias in (d.alias for d in _cuda):
        raise RuntimeError(f"no device was mapped as '{alias}'")
    del index_of[alias]


def resolve_index(device) -> int:
    """The number of a device given by name, object or None for the default."""
    try:
        return index_of[device]
    except (KeyError, TypeError):
        return get_device(device).index


def get_device(ident: DeviceLike = None) -> Device:
    """The device of a name: `cpu`, `cuda`, `cuda:0`; None is the current default.

    Raises:
        ValueError: there is no such device; the message says why.
    """
    if isinstance(ident, Device):
        return ident
    if isinstance(ident, str) and ident == "cpu":
        return _cpu
    if ident is None:
        initialize()
        return _own.device or _state["default"]
    try:
        # Other libraries have devices of their own.
        name = ident if isinstance(ident, str) else str(ident)
    except Exception:
        name = type(ident).__name__
    if name == "cpu":
        return _cpu
    initialize()
    if name == "cuda" and _cuda:
        return _first_cuda()
    index = index_of.get(name)
    if index is None:
        raise ValueError(_unknown_device(name if len(name) < 100 else type(ident).__name__))
    return by_index(index)


def _unknown_device(ident) -> str:
    known = ", ".join(f"'{device.alias}'" for device in [_cpu, *_cuda])
    message = f"no device '{ident}', there is: {known}"
    reason = "" if _cuda else _native.cuda_unavailable_reason()
    return f"{message} (no CUDA device: {reason})" if reason else message


def set_device(ident: DeviceLike) -> None:
    """Makes a device the default."""
    device = get_device(ident)
    initialize()
    _set_default(device)


def get_devices() -> list[Device]:
    """All devices."""
    initialize()
    return [_cpu, *_cuda, *(d for d in _mapped.values() if d.alias in index_of)]


def get_preferred_device() -> Device:
    """The first CUDA device, or the CPU where there is none."""
    initialize()
    return _cuda[0] if _cuda else _cpu


def is_cpu_available() -> bool:
    """True if there is the device `cpu`: always."""
    return True


def is_cuda_available() -> bool:
    """True if there is a CUDA device."""
    initialize()
    return bool(_cuda)


def present(alias) -> str | None:
    """The name of a device if it is here, else None, which names the current one."""
    return alias if is_device_available(alias) else None


def is_device_available(device) -> bool:
    """True if `device` is one of this machine's."""
    return device in get_devices()


def get_cuda_devices() -> list[Device]:
    """The CUDA devices, by their numbers."""
    initialize()
    return list(_cuda)


def get_cuda_device_count() -> int:
    """How many CUDA devices there are."""
    initialize()
    return len(_cuda)


@checked(ordinal=INTEGER)
def get_cuda_device(ordinal: int | None = None) -> Device:
    """The CUDA device of a number, or the current one.

    Raises:
        RuntimeError: there is no such device.
    """
    return get_device("cuda" if ordinal is None else f"cuda:{ordinal}")


def get_cuda_driver_version() -> tuple[int, int] | None:
    """Version of the CUDA driver, None without one."""
    version = _native.cuda_driver_version()
    return (version // 1000, version % 1000 // 10) if version else None


def get_cuda_toolkit_version() -> tuple[int, int] | None:
    """None: compiled kernels need the driver alone."""
    return None


def get_stream(device: DeviceLike = None):
    """The current stream of a CUDA device."""
    return _cuda_device(device).stream


@checked()
def set_stream(stream, device: DeviceLike = None, sync: bool = False) -> None:
    """Makes a stream the current one of its device; `sync` lets it wait for the former one."""
    if device is None:
        device = stream.device
    device = _cuda_device(device)
    if sync:
        stream.wait_stream(device.stream)
    _native.set_current_stream(device.index, stream)


def _cuda_device(device) -> Device:
    device = get_device(device)
    if not device.is_cuda:
        raise RuntimeError(f"device '{device}' has no streams, expects a CUDA device")
    return device


def synchronize() -> None:
    """Waits for all devices, and raises what kernels reported in debug mode."""
    _native.synchronize_all()


def synchronize_device(device: DeviceLike = None) -> None:
    """Waits for all work of one device."""
    _native.synchronize_device(resolve_index(device))


@checked(stream_or_device=STREAM | DEVICE)
def synchronize_stream(stream_or_device=None) -> None:
    """Waits for one stream, or for the current stream of a device."""
    if isinstance(stream_or_device, _native.Stream):
        stream_or_device.synchronize()
        return
    stream = get_device(stream_or_device).stream
    if stream is not None:
        stream.synchronize()


@checked(event=EVENT)
def synchronize_event(event) -> None:
    """Waits until the work before an event has been done."""
    event.synchronize()


above.get_device = get_device
