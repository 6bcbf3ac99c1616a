"""Paused captures: a capture ends for a while, so that a library can do what no graph holds."""

from __future__ import annotations

import typing

from warp._src.argument_kinds import GRAPH
from warp._src.arguments import checked
from warp._src.devices import graphs
from warp._src.devices.devices import get_device

if typing.TYPE_CHECKING:
    from warp import _native
    from warp._src.devices.devices import DeviceLike


def is_capturing(device: DeviceLike = None) -> bool:
    """True if a graph is being captured on a device, by default the current one.

    Example:
        >>> import warp as wp
        >>> from warp import extend
        >>> with wp.ScopedCapture(device="cpu"):
        ...     extend.is_capturing("cpu")
        True
    """
    return get_device(device).is_capturing


@checked()
def capture_pause(device: DeviceLike = None, stream: _native.Stream | None = None) -> graphs.Graph:
    """Ends the capture on a device or stream for a while; work runs at once until it goes on.

    Args:
        device: by default the current one.
        stream: CUDA stream that is captured, by default the device's current one.

    Returns:
        The graph of the work so far, for `capture_resume`.

    Raises:
        WarpError: no graph is being captured there.

    Example:
        >>> import warp as wp
        >>> from warp import extend
        >>> x = wp.zeros(2, device="cpu")
        >>> with wp.ScopedCapture(device="cpu") as capture:
        ...     x.fill_(1.0)
        ...     paused = extend.capture_pause("cpu")
        ...     found = x.numpy().tolist()
        ...     extend.capture_resume(paused, "cpu")
        >>> wp.capture_launch(capture.graph)
        >>> found, x.numpy().tolist()
        ([0.0, 0.0], [1.0, 1.0])
    """
    return graphs.capture_end(device, stream)


@checked(graph=GRAPH)
def capture_resume(
    graph: graphs.Graph, device: DeviceLike = None, stream: _native.Stream | None = None
) -> None:
    """Goes on with a capture; the work so far becomes one operation of the new graph.

    A graph that was paused cannot be saved (`wp.capture_save`): a saved graph is one capture.

    Args:
        graph: of `capture_pause`.
        device, stream: as for `capture_pause`.

    Raises:
        WarpError: a graph is being captured there already.

    Example:
        >>> import warp as wp
        >>> from warp import extend
        >>> with wp.ScopedCapture(device="cpu"):
        ...     extend.capture_resume(extend.capture_pause("cpu"), "cpu")
    """
    graphs.capture_begin(device, stream)
    graphs.capture_launch(graph, stream)
