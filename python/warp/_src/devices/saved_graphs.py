"""Graphs in files: `capture_save`, and `capture_load` in another process, with or without Python.

The native half notes operations during the capture, finds the memory behind their pointers when
the graph is saved and records them again when it is loaded (`include/warp/SavedGraph.h`).
"""

from __future__ import annotations

import copyreg
import numbers
import os
from collections.abc import Mapping

from warp import _native
from warp._src import errors
from warp._src.argument_kinds import BYTES, DICT, GRAPH
from warp._src.arguments import checked
from warp._src.arrays.array import array
from warp._src.devices.devices import get_device, present
from warp._src.devices.graphs import Graph

SUFFIX = ".wrp"


def _with_suffix(path) -> str:
    path = os.fsdecode(path)
    return path if path.endswith(SUFFIX) else path + SUFFIX


def _named(graph, inputs, outputs) -> dict:
    """Arrays by name, of inputs and outputs."""
    named: dict = {}
    for arrays in (inputs or {}, outputs or {}):
        for name, value in arrays.items():
            if not isinstance(name, str) or not name:
                raise errors.WarpTypeError(f"expects strings as names of arrays, but got {name!r}")
            if not isinstance(value, array):
                raise errors.WarpTypeError(
                    f"expects an array for '{name}', but got '{type(value).__name__}'"
                )
            if value.device != graph.device:
                raise ValueError(
                    f"array '{name}' is on '{value.device}', but the graph on '{graph.device}'"
                )
            if not value.is_contiguous:
                raise ValueError(f"array '{name}' has strides, expects a contiguous one")
            known = named.setdefault(name, value)
            if known.ptr != value.ptr or known.size != value.size or known.dtype != value.dtype:
                raise ValueError(f"'{name}' names two arrays, an input and an output")
    return named


@checked(graph=GRAPH, inputs=DICT, outputs=DICT)
def capture_save(graph, path, inputs=None, outputs=None, source_fallback=False) -> None:
    """Saves a graph to a file, with the code of its kernels in a folder beside it.

    Contents of arrays are those of now. Arrays that share memory still do when the graph is loaded.
    Geometry whose ids kernels of the graph use is saved, too, and has other ids there; a number
    that no kernel uses as an id stays, whatever value it has.

    Args:
        graph: what was captured with `apic=True`.
        path: where to; the suffix ".wrp" is added if need be. The folder for "step.wrp" is
            "step_modules", and belongs to the file.
        inputs, outputs: contiguous arrays by name, which `Graph.set_param` and `get_param` know
            after loading. One array may have several names.
        source_fallback: accepted for compatibility; GPU code is saved in a form (PTX) that later
            GPUs run, too.

    Raises:
        WarpError: the graph was not captured with `apic=True`, or does what no file can hold:
            arrays in elements of arrays, deterministic sums, copies between devices, geometry that
            is gone; or files cannot be written. A graph saved there before is then still whole.
        TypeError, ValueError: something else than contiguous arrays on the graph's device.

    Example:
        >>> import warp as wp
        >>> x = wp.zeros(3, device="cpu")
        >>> with wp.ScopedCapture(device="cpu", apic=True) as capture:
        ...     x.fill_(2.0)
        >>> wp.capture_save(capture.graph, "/tmp/fill.wrp", outputs={"x": x})
        >>> loaded = wp.capture_load("/tmp/fill.wrp", device="cpu")
        >>> wp.capture_launch(loaded)
        >>> y = wp.zeros(3, device="cpu")
        >>> loaded.get_param("x", y)
        >>> print(y.numpy())
        [2. 2. 2.]
    """
    if not isinstance(graph, Graph):
        raise errors.WarpTypeError(f"expects a graph, but got '{type(graph).__name__}'")
    if not graph.apic:
        raise errors.WarpError(
            "Graph was not captured with apic=True, pass it to `capture_begin` or `ScopedCapture`"
        )
    named = _named(graph, inputs, outputs)
    path = _with_suffix(path)
    os.makedirs(os.path.dirname(os.path.abspath(path)), exist_ok=True)
    _native.save_graph(graph.native, path, named)


@checked()
def capture_load(path, device=None, memory_limit=None) -> Graph:
    """Loads a graph that `capture_save` wrote.

    Reading trusts nothing that is in the files, so loading runs none of their code and writes
    nothing but the graph's own memory. To launch the graph runs that code with the rights of the
    process: launch graphs of people whose programs you would run.

    Args:
        path: the file; the suffix ".wrp" is added if need be. Its folder has to be beside it.
        device: where it shall run, by default the current device: the CPU for a graph that was
            captured there, a GPU no older than that of the capture for others.
        memory_limit: most bytes of memory that the graph may take; by default all that is free.

    Raises:
        WarpError: files are missing, damaged, of another release's format or for another kind of
            device; the graph needs more memory than is free, or than `memory_limit`; or this
            thread is capturing.
        ValueError: `memory_limit` is no number of bytes.
    """
    path = _with_suffix(path)
    device = get_device(device)
    limit = _checked_limit(memory_limit)
    try:
        return Graph(_native.LoadedGraph.load(path, device.index, limit))
    except errors.WarpError as error:
        raise _failed(path, error) from None


def _checked_limit(limit) -> int:
    most = 2**64 - 1
    if limit is None:
        return most
    if not isinstance(limit, numbers.Integral) or not 0 <= limit <= most:
        raise ValueError(f"memory_limit has to be a number of bytes, but got {limit!r}")
    return int(limit)


@checked(data=BYTES, modules=DICT)
def capture_load_from_bytes(data, modules=None, device=None, memory_limit=None) -> Graph:
    """Loads a graph from the contents of the files that `capture_save` wrote.

    Args:
        data: contents of the ".wrp" file, anything with a contiguous buffer.
        modules: contents of the files in the folder beside it, by name; not needed for a graph
            without launches. Others than the graph needs are ignored.
        device, memory_limit: as for `capture_load`.

    Raises:
        TypeError: something is no buffer, `modules` no mapping, or a name no string.
        ValueError: a buffer is not contiguous, or as for `capture_load`.
        WarpError: as for `capture_load`.
    """
    modules = {} if modules is None else modules
    if not isinstance(modules, Mapping):
        raise TypeError(
            f"modules must be a mapping from filename to bytes, got {type(modules).__name__}"
        )
    code = {}
    for name, contents in modules.items():
        if not isinstance(name, str):
            raise TypeError(f"Module names must be strings, got {type(name).__name__}")
        code[name] = _bytes(contents, f"Module '{name}'")
    device = get_device(device)
    limit = _checked_limit(memory_limit)
    try:
        contents = _bytes(data, "data")
        native = _native.LoadedGraph.from_bytes(contents, code, device.index, "bytes", limit)
    except errors.WarpError as error:
        raise _failed("bytes", error) from None
    return Graph(native)


def _bytes(data, what) -> bytes:
    try:
        view = memoryview(data)
    except TypeError:
        raise TypeError(f"{what} must be a bytes-like object, got {type(data).__name__}") from None
    if not view.c_contiguous:
        raise ValueError(f"{what} must be a C-contiguous buffer")
    return view.tobytes()


def _failed(origin, error):
    return errors.WarpError(f"Failed to load APIC graph from {origin}: {error.message}")


def _reduce(graph) -> tuple:
    """A graph as the files that `capture_save` writes.

    Raises:
        TypeError: it was captured without `apic=True`.
    """
    import tempfile

    if not graph.apic:
        raise TypeError(
            "cannot pickle a graph: capture it with `apic=True`, or capture the work anew where "
            "it is to run"
        )
    with tempfile.TemporaryDirectory() as folder:
        capture_save(graph, f"{folder}/graph.wrp")
        files = {}
        for place, _, names in os.walk(folder):
            for name in names:
                with open(os.path.join(place, name), "rb") as file:
                    files[name] = file.read()
    return _load, (files.pop("graph.wrp"), files, str(graph.device))


def _load(data, modules, device):
    return capture_load_from_bytes(data, modules, device=present(device))


copyreg.pickle(Graph, _reduce)
