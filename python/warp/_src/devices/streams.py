"""CUDA streams and events.

A stream is a queue of work on a CUDA device; work on one stream runs in order. An event is a point
in a stream that others can wait for. Both are native classes; this file has what works on the
current stream.
"""

from __future__ import annotations

import copyreg

from warp import _native
from warp._src import errors
from warp._src.argument_kinds import EVENT, NONE, STREAM
from warp._src.arguments import checked, explained
from warp._src.devices import devices
from warp._src.devices.devices import get_device

Stream = _native.Stream
Event = _native.Event


def _refuse(value):
    raise TypeError(
        f"cannot pickle a '{type(value).__name__}': make one on the device where it is to be used"
    )


copyreg.pickle(Stream, _refuse)
copyreg.pickle(Event, _refuse)


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

    Raises:
        TypeError: `event` is none.
    """
    if event is None:
        event = Event()
    try:
        return _native.current_stream(event.device_index).record_event(event, external)
    except (AttributeError, TypeError) as error:
        raise explained(error, "wp.record_event", event=(EVENT, event)) from None


def _current(what):
    """The current stream of the default device.

    Raises:
        RuntimeError: the device has no streams.
    """
    stream = devices.get_stream()
    if stream is None:
        raise errors.WarpError(
            f"wp.{what}(): the default device '{get_device()}' has no streams, expects a CUDA "
            "device"
        )
    return stream


def wait_event(event, external: bool = False) -> None:
    """Lets the current stream of the default device wait for an event.

    Args:
        event: the event.
        external: in a capture, launches of the graph wait for what was recorded outside of it.

    Raises:
        TypeError: `event` is none.
        RuntimeError: the default device has no streams.
    """
    try:
        _current("wait_event").wait_event(event, external)
    except TypeError as error:
        raise explained(error, "wp.wait_event", event=(EVENT, event)) from None


def wait_stream(other_stream, event=None, external: bool = False) -> None:
    """Lets the current stream of the default device wait for all work queued on another one.

    Raises:
        TypeError: `other_stream` is none.
        RuntimeError: the default device has no streams.
    """
    try:
        _current("wait_stream").wait_stream(other_stream, event, external)
    except TypeError as error:
        given = {"other_stream": (STREAM, other_stream), "event": (EVENT | NONE, event)}
        raise explained(error, "wp.wait_stream", **given) from None


@checked(start_event=EVENT, end_event=EVENT)
def get_event_elapsed_time(start_event, end_event, synchronize: bool = True) -> float:
    """Milliseconds between two recorded events that measure time.

    Args:
        start_event, end_event: made with `enable_timing=True`.
        synchronize: wait for the second event first.
    """
    if synchronize:
        end_event.synchronize()
    return _native.elapsed_time(start_event, end_event)
