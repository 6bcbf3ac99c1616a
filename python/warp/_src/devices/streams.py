"""CUDA streams and events.

A stream is a queue of work on a CUDA device; work on one stream runs in order. An event is a point
in a stream that others can wait for. Both are native classes; this file has what works on the
current stream.
"""

from __future__ import annotations

from warp import _native
from warp._src.devices import devices
from warp._src.devices.devices import get_device

Stream = _native.Stream
Event = _native.Event


def cuda_index(device) -> int:
    """The number of a CUDA device; called by the constructors of streams and events."""
    device = get_device(device)
    if not device.is_cuda:
        raise RuntimeError(f"device '{device}' has no streams, expects a CUDA device")
    return device.index


def record_event(event=None, external: bool = False):
    """Records an event on the current stream of its device, a new event if none is given.

    Args:
        event: the event; one that measures time is external in every capture.
        external: in a capture, launches of the graph record it for streams and graphs outside,
            which may wait for it; without, it orders work in the graph alone.
    """
    if event is None:
        event = Event()
    return _native.current_stream(event.device_index).record_event(event, external)


def wait_event(event, external: bool = False) -> None:
    """Lets the current stream of the default device wait for an event.

    Args:
        event: the event.
        external: in a capture, launches of the graph wait for what was recorded outside of it.
    """
    devices.get_stream().wait_event(event, external)


def wait_stream(other_stream, event=None, external: bool = False) -> None:
    """Lets the current stream of the default device wait for all work queued on another one."""
    devices.get_stream().wait_stream(other_stream, event, external)


def get_event_elapsed_time(start_event, end_event, synchronize: bool = True) -> float:
    """Milliseconds between two recorded events that measure time.

    Args:
        start_event, end_event: made with `enable_timing=True`.
        synchronize: wait for the second event first.
    """
    if synchronize:
        end_event.synchronize()
    return _native.elapsed_time(start_event, end_event)
