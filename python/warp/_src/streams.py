"""CUDA streams and events."""

from __future__ import annotations

from warp import _native
from warp._src import devices
from warp._src.devices import get_device


class Stream(_native.Stream):
    """A queue of work on a CUDA device. Work on one stream runs in order."""

    def __init__(self, device=None, priority: int = 0, **options):
        super().__init__(_cuda_index(device), priority)


class Event(_native.Event):
    """A point in a stream that others can wait for."""

    def __init__(self, device=None, enable_timing: bool = False, **options):
        super().__init__(_cuda_index(device), enable_timing)


def _cuda_index(device) -> int:
    device = get_device(device)
    if not device.is_cuda:
        raise RuntimeError(f"device '{device}' has no streams, expects a CUDA device")
    return device.index


def record_event(event=None):
    """Records an event on the current stream of its device."""
    if event is None:
        event = Event()
    return _native.current_stream(event.device_index).record_event(event)


def wait_event(event) -> None:
    """Lets the current stream wait for an event."""
    devices.get_stream().wait_event(event)


def wait_stream(other, event=None) -> None:
    """Lets the current stream wait for everything queued on another one."""
    devices.get_stream().wait_stream(other)


def get_event_elapsed_time(start, end, synchronize: bool = True) -> float:
    """Milliseconds between two recorded events."""
    if synchronize:
        end.synchronize()
    return _native.elapsed_time(start, end)
