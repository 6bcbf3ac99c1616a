"""Graphs: work that is recorded once and replayed with one call.

A capture records launches, copies and fills on one device instead of running them. On CUDA the
driver records what goes to the captured stream; on the CPU the runtime records what this thread
does. The graph keeps alive whatever its work touches. Inside a capture `capture_if` and
`capture_while` become branches and loops of the graph, outside they run at once.
"""

from __future__ import annotations

import enum
import threading
import typing

from warp import _native, config
from warp._src import errors
from warp._src.argument_kinds import ARRAY, GRAPH, INTEGER, NATIVE_GRAPH, NONE, STREAM
from warp._src.arguments import checked, explained
from warp._src.arrays import hooks
from warp._src.arrays.array import array
from warp._src.arrays.hooks import captures as _captures
from warp._src.arrays.observers import Observers
from warp._src.derivatives import handles
from warp._src.devices import devices
from warp._src.devices.devices import get_device
from warp._src.kernels.captured_reads import check_settled
from warp._src.kernels.modules import force_load
from warp._src.types.dtypes import type_size_in_bytes
from warp._src.types.scalars import int32

if typing.TYPE_CHECKING:
    from warp._src.devices.graph_schedules import GraphSchedule

hooks.check_settled = check_settled


class CaptureMode(enum.IntEnum):
    """Threads that may not do what a CUDA capture cannot hold: any, the capturing one, none."""

    GLOBAL = 0
    THREAD_LOCAL = 1
    RELAXED = 2


class Graph:
    """The result of `capture_end`; run it with `capture_launch`.

    Graphs from `capture_load` also give access to the arrays that were named when they were saved.

    Attributes:
        device: where it runs.
        node_count: number of operations; those inside of branches and loops are not counted.
        apic: whether `capture_save` can save it.
        is_loaded: whether it comes from a file.
        params: for each named array of a loaded graph `{"size": bytes}`.
    """

    @checked(native=NATIVE_GRAPH)
    def __init__(self, native):
        self.native = native
        self.device = devices.by_index(native.device_index)

    @property
    def node_count(self) -> int:
        """How many operations the graph has."""
        return self.native.node_count

    @property
    def apic(self) -> bool:
        """True if the capture noted what `capture_save` needs."""
        return not self.is_loaded and self.native.traced

    @property
    def is_loaded(self) -> bool:
        """True if the graph comes from a file."""
        return isinstance(self.native, _native.LoadedGraph)

    @property
    def params(self) -> dict[str, dict[str, int]]:
        """The settable parameters of a loaded graph: `{"size": bytes}` by name."""
        if not self.is_loaded:
            return {}
        return {name: {"size": size} for name, size in self.native.sizes.items()}

    @checked(arr=ARRAY)
    def set_param(self, name: str, arr) -> None:
        """Copies a contiguous array into the graph's array of a name.

        On CUDA the copy is queued on the current stream.

        Raises:
            WarpError: the graph is not loaded from a file, has no such array, or has one with
                another number of bytes.
            TypeError: `arr` is no array.
            ValueError: `arr` has strides, or is on another device.
        """
        self._transfer("set", name, arr)

    @checked(arr=ARRAY)
    def get_param(self, name: str, arr) -> None:
        """Copies the graph's array of a name into a contiguous array; errors as `set_param`."""
        self._transfer("get", name, arr)

    @checked()
    def get_param_ptr(self, name: str) -> int | None:
        """Address of the graph's array of a name, None if it has none.

        The memory is the graph's and lives as long as it does.

        Raises:
            WarpError: the graph is not loaded from a file.
        """
        self._check_loaded("get_param_ptr")
        return self.native.data(name) if name in self.native.sizes else None

    def schedule(self) -> GraphSchedule:
        """The order in which the operations run, and what keeps them from running side by side.

        Raises:
            WarpError: the graph keeps the order of its recording (`optimize=False`, debug mode, a
                graph from a file, a capture of another library).
        """
        found = None if self.is_loaded else self.native.schedule()
        if found is None:
            raise errors.WarpError(
                "the graph keeps the order of its recording: capture it with `optimize=True` to "
                "have a schedule"
            )
        from warp._src.devices.graph_schedules import GraphSchedule

        return GraphSchedule.of(found)

    @checked()
    def save_picture(self, path) -> None:
        """Draws the schedule: an SVG, or Graphviz text if the name ends in `.dot`.

        Raises:
            WarpError: as `schedule`.
        """
        self.schedule().save_picture(path)

    def _check_loaded(self, method):
        if not self.is_loaded:
            raise errors.WarpError(
                f"{method}() is only supported on loaded APIC graphs: save this one with "
                "`wp.capture_save` and load it"
            )

    def _transfer(self, verb, name, arr):
        self._check_loaded(f"{verb}_param")
        if not isinstance(arr, array):
            raise errors.WarpTypeError(
                f"expects an array for parameter '{name}', but got '{type(arr).__name__}'"
            )
        if arr.device != self.device:
            raise ValueError(
                f"device mismatch for parameter '{name}': the graph is on '{self.device}', "
                f"the array on '{arr.device}'"
            )
        size = self.native.sizes.get(name)
        if size is None:
            known = ", ".join(f"'{known}'" for known in self.native.sizes) or "none"
            raise errors.WarpError(
                f"Failed to {verb} parameter '{name}': the graph has no array of that name, it "
                f"has: {known}"
            )
        given = arr.size * type_size_in_bytes(arr.dtype)
        if given != size:
            raise errors.WarpError(
                f"Failed to {verb} parameter '{name}': it has {size} bytes, but got an array of "
                f"{given} bytes"
            )
        getattr(self.native, verb)(name, arr)

    def __repr__(self):
        return f"<graph of {self.node_count} operations on '{self.device}'>"


def _key(device, stream):
    if device.is_cpu:
        return threading.get_ident()
    return (device.index, stream._handle)


def _place(device, stream):
    """Device, stream (None on the CPU) and key of a capture."""
    if stream is not None:
        device = stream.device
    else:
        device = get_device(device)
        stream = device.stream if device.is_cuda else None
    return device, stream, _key(device, stream)


@checked(capture_mode=INTEGER)
def capture_begin(
    device=None,
    stream=None,
    force_module_load=None,
    external=False,
    apic=False,
    capture_mode=CaptureMode.THREAD_LOCAL,
    optimize=None,
) -> None:
    """Begins to record a graph.

    Args:
        device: device to record on, by default the current one.
        stream: CUDA stream to record on, by default the device's current one.
        force_module_load: translate the kernels of all modules before; not needed, since kernels
            may be compiled and loaded while a graph is recorded.
        external: somebody else is capturing the stream already and will end it.
        apic: note the operations, so that `capture_save` can save the graph.
        capture_mode: how strict the driver is with what a graph cannot hold.
        optimize: let each operation come behind those alone whose memory it shares, so that others
            run beside it; False keeps the order of recording. None is
            `wp.config.optimize_graphs`, by default True on GPUs; in debug mode graphs keep the
            order.

    Raises:
        WarpError: a graph is being recorded there already.
    """
    device, stream, key = _place(device, stream)
    _check_free(device, key)
    if force_module_load:
        force_load(device)
    if config.verify_cuda and device.is_cuda:
        raise errors.WarpError("cannot capture a graph while `wp.config.verify_cuda` is on")
    if device.is_cuda and not external:
        # Gradients of geometry cannot change while kernels are recorded.
        handles.show_gradients()
    _native.set_fuses_launches(config.fuse_graphs)
    _native.set_fuses_rows(config.fuse_rows)
    _captures[key] = _native.Capture(
        device.index, stream, int(capture_mode), external, bool(apic), _order(optimize, device)
    )


def _order(optimize, device) -> int:
    """0: as recorded, 1: by dependencies, 2: both, compared."""
    wished = config.optimize_graphs if optimize is None else optimize
    if config.mode == "debug" or not (device.is_cuda if wished is None else wished):
        return 0
    return 2 if config.verify_graphs else 1


def _check_free(device, key) -> None:
    if key in _captures:
        raise errors.WarpError(f"a graph is being captured on '{device}' already")


@checked()
def capture_end(device=None, stream=None) -> Graph:
    """Ends the recording and returns the graph.

    Raises:
        WarpError: nothing is being recorded there, or something was done that a graph cannot hold.
    """
    device, stream, key = _place(device, stream)
    if key not in _captures:
        raise errors.WarpError(f"no graph is being captured on '{device}'")
    with _Ending(key) as capture:
        graph = hooks.graph_makers.get(key, Graph)(capture.end())
    return graph


class _Ending(_native.Scope):
    """A block in which a capture ends; then there is none, whatever happens."""

    capture = None

    def __init__(self, key):
        self.key = key

    def _enter(self):
        self.capture = _captures[self.key]
        return self.capture

    def _restore(self):
        if self.capture is not None:
            _forget(self.key)
            self.capture.abandon()
        self.capture = None


def _forget(key):
    """Takes a capture off the list; gives it, or None."""
    hooks.graph_makers.pop(key, None)
    return _captures.pop(key, None)


def capture_launch(graph, stream=None) -> None:
    """Runs a graph: on CUDA queued on `stream` or the current one, on the CPU at once.

    Raises:
        TypeError: `graph` is none.
        RuntimeError: a tape records.
    """
    if type(graph) is not Graph:
        if isinstance(graph, Graph):
            graph.launch(stream, _launch)
            return
        raise errors.WarpLaunchTypeError(f"expects a graph, but got '{type(graph).__name__}'")
    _launch(graph, stream)


def _launch(graph, stream) -> None:
    if _captures:
        for capture in _captures.values():
            capture.hold(graph.native)
    if Observers.tape is not None:
        raise errors.WarpError(
            "a graph cannot be recorded on a tape: capture the backward pass with the rest, or "
            "launch the graph outside of the tape's block"
        )
    try:
        graph.native.launch(stream)
    except TypeError as error:
        raise explained(error, "wp.capture_launch", stream=(STREAM | NONE, stream)) from None


@checked(graph=GRAPH)
def capture_debug_dot_print(graph, path, verbose=True) -> None:
    """Writes a graph as a Graphviz file."""
    graph.native.write_dot(str(path), verbose)


def is_conditional_graph_supported() -> bool:
    """True if the CUDA driver has branches and loops in graphs. Graphs on the CPU always do."""
    return _native.supports_conditional_graphs()


class ScopedCapture(_native.Scope):
    """Records a block as a graph; arguments as for `capture_begin`.

    Attributes:
        graph: the graph, once the block is left without an error.

    Example:
        >>> import warp as wp
        >>> a = wp.zeros(4, device="cpu")
        >>> with wp.ScopedCapture(device="cpu") as capture:
        ...     a.fill_(2.0)
        >>> wp.capture_launch(capture.graph)
    """

    @checked(capture_mode=INTEGER)
    def __init__(
        self,
        device=None,
        stream=None,
        force_module_load=None,
        external=False,
        apic=False,
        capture_mode=CaptureMode.THREAD_LOCAL,
        optimize=None,
    ):
        self.device, self.stream = device, stream
        self.options = (force_module_load, external, apic, capture_mode, optimize)
        self.active = False
        self.graph = self._key = None

    def _check(self):
        device, _, key = _place(self.device, self.stream)
        _check_free(device, key)

    def _enter(self):
        self.device, stream, self._key = _place(self.device, self.stream)
        capture_begin(self.device, stream, *self.options)
        self.active = True
        return self

    def _leave(self, kind, *exception):
        capture = _captures.get(self._key)
        if kind is None and capture is not None:
            self.graph = hooks.graph_makers.get(self._key, Graph)(capture.end())

    def _restore(self):
        self.active = False
        capture = _forget(self._key)
        if capture is not None:
            capture.abandon()
        self._key = None


def _active(condition, stream):
    """The capture that a branch on `condition` belongs to, or None."""
    if not isinstance(condition, array):
        raise errors.WarpTypeError(
            f"expects an array as condition, but got '{type(condition).__name__}'"
        )
    if condition.dtype is not int32 or condition.size == 0:
        raise errors.WarpTypeError(
            f"expects an array of int32 with one element as condition, but got {condition!r}"
        )
    if not _captures:
        return None
    return _captures.get(_place(condition.device, stream)[2])


def _holds(condition, stream) -> bool:
    """The value of a condition now.

    Engines fill the condition ahead of their loop: launches that wait for code go on waiting then,
    and the code of the loop's first turn is made meanwhile.
    """
    if condition.device.is_cuda and stream is not None:
        stream.synchronize()
    if condition.device.is_cuda:
        filled = _native.queued_value(condition.ptr)
        if filled is not None:
            return bool(filled)
    return bool(condition.flatten()[:1].numpy()[0])


def _run(body, stream, arguments) -> None:
    if isinstance(body, Graph):
        capture_launch(body, stream)
    elif callable(body):
        body(**arguments)
    elif body is not None:
        raise errors.WarpTypeError(
            f"expects a function or a graph as body, but got '{type(body).__name__}'"
        )


class _Body(_native.Scope):
    """A block that records the body of a branch or loop, which also an exception ends."""

    depth = None

    def __init__(self, capture, handle, loop):
        self.capture, self.handle, self.loop = capture, handle, loop

    def _enter(self):
        self.depth = self.capture.depth
        self.capture.begin_body(self.handle, self.loop)

    def _restore(self):
        if self.depth is not None:
            self.capture.end_bodies(self.depth)
        self.depth = None


@checked(condition=ARRAY)
def capture_if(condition, on_true=None, on_false=None, stream=None, **kwargs) -> None:
    """Runs one of two functions or graphs, by the value of an array of one int32.

    Inside a capture the choice is part of the graph and made at each replay; otherwise it is made
    now.

    Args:
        condition: array whose first element is zero or not.
        on_true, on_false: functions, called with the keyword arguments, or graphs.
        stream: stream that the condition was written on, by default the device's current one.
    """
    if on_true is None and on_false is None:
        return
    capture = _active(condition, stream)
    if capture is None:
        _run(on_true if _holds(condition, stream) else on_false, stream, kwargs)
        return
    branches = [
        (capture.add_condition(condition, negated), body)
        for negated, body in ((False, on_true), (True, on_false))
        if body is not None
    ]
    for handle, body in branches:
        with _Body(capture, handle, False):
            _run(body, stream, kwargs)


@checked(condition=ARRAY)
def capture_while(condition, while_body, stream=None, **kwargs) -> None:
    """Runs a function or graph as long as an array of one int32 is not zero.

    Inside a capture the loop is part of the graph; otherwise it runs now.

    Args:
        condition: array whose first element is looked at before each turn.
        while_body: function, called with the keyword arguments, or graph.
        stream: stream that the condition was written on, by default the device's current one.
    """
    capture = _active(condition, stream)
    if capture is None:
        while _holds(condition, stream):
            _run(while_body, stream, kwargs)
        return
    handle = capture.add_condition(condition, False)
    with _Body(capture, handle, True):
        _run(while_body, stream, kwargs)
        capture.update_condition(handle, condition, False)
