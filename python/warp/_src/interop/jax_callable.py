"""`wp.jax_callable`: Python functions that launch kernels as functions of JAX."""

from __future__ import annotations

import collections
import enum
import types

from warp._src.argument_kinds import (
    CALLABLE,
    COUNT,
    DIMS,
    GRAPH_MODE,
    JAX_CALLABLE,
    NAMES,
    TEXT,
)
from warp._src.arguments import checked
from warp._src.arrays.copies import copy
from warp._src.arrays.create import empty
from warp._src.devices import devices
from warp._src.devices.graphs import ScopedCapture, capture_launch
from warp._src.interop import jax_arrays
from warp._src.interop.jax_calls import Arguments, Parameter, Plan, extents_of
from warp._src.interop.packages import load
from warp._src.types import annotations
from warp._src.types.native import ArrayType
from warp._src.weak import WeakObjects

_all = WeakObjects()


class JaxCallableGraphMode(enum.IntEnum):
    """True if the launches of a `jax_callable` become a CUDA graph."""

    NONE = 0
    """They are made one by one."""
    JAX = 1
    """JAX may record them in a graph of its own, with what is around them."""
    WARP = 2
    """A graph for each set of buffers."""
    WARP_STAGED = 3
    """A graph over buffers of its own; arguments and results are copied before and after it."""
    WARP_STAGED_EX = 4
    """The same."""


class JaxModulePreloadMode(enum.IntEnum):
    """The devices for which kernels are compiled before the first call."""

    NONE = 0
    """Nowhere: the first call does it."""
    CURRENT_DEVICE = 1
    """Nowhere, too: the first call is on that device."""
    ALL_DEVICES = 2
    """On all devices."""


@checked(
    func=CALLABLE,
    num_outputs=COUNT,
    graph_mode=GRAPH_MODE,
    vmap_method=TEXT,
    in_out_argnames=NAMES,
    stage_in_argnames=NAMES,
    stage_out_argnames=NAMES,
    output_dims=DIMS,
)
def jax_callable(
    func,
    num_outputs: int = 1,
    graph_mode: JaxCallableGraphMode = JaxCallableGraphMode.JAX,
    vmap_method: str | None = "broadcast_all",
    output_dims=None,
    in_out_argnames=None,
    stage_in_argnames=None,
    stage_out_argnames=None,
    graph_cache_max: int | None = 32,
    module_preload_mode: JaxModulePreloadMode = JaxModulePreloadMode.CURRENT_DEVICE,
    has_side_effect: bool = False,
):
    """Makes a function of JAX arrays from a Python function that launches kernels.

    `func` has parameters like a kernel: inputs first, then outputs. It is called when the compiled
    program runs, with arrays over the buffers of JAX, which it must not keep, and with values known
    while tracing for the rest. The same arguments give the same object.

    Args:
        func: a function whose parameters are annotated.
        num_outputs: number of output arrays, those of `in_out_argnames` among them.
        graph_mode: see `JaxCallableGraphMode`; graphs need CUDA.
        vmap_method: how `jax.vmap` applies, see `jax.ffi.ffi_call`. The function is called once for
            each entry of the batch.
        output_dims: shape of the outputs, or a dictionary of shapes by parameter name; by default
            that of the first array.
        in_out_argnames: names of array parameters that are input and output.
        stage_in_argnames, stage_out_argnames: names of the arrays that are copied with staged
            graphs; by default all.
        graph_cache_max: graphs of `WARP` to keep, None for all.
        module_preload_mode: see `JaxModulePreloadMode`.
        has_side_effect: keep calls whose outputs nobody uses.

    `output_dims` and `vmap_method` can also be given per call.

    Example:
        >>> def advance(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        ...     wp.launch(step, x.shape, [x], [y])
        >>> y = jax.jit(lambda x: wp.jax_callable(advance)(x)[0])(x)  # doctest: +SKIP

    Raises:
        TypeError, ValueError: the function cannot be used that way.
    """
    options = (
        *(num_outputs, JaxCallableGraphMode(graph_mode), vmap_method, _frozen(output_dims)),
        *(tuple(in_out_argnames or ()), frozenset(stage_in_argnames or ())),
        *(frozenset(stage_out_argnames or ()), has_side_effect),
    )
    if not isinstance(func, types.FunctionType):
        raise TypeError(f"jax_callable: expects a function, but got '{type(func).__name__}'")
    known = func.__dict__.setdefault("_wp_functions_of_jax_", {})
    if options not in known:
        known[options] = JaxCallable(func, *options[:3], output_dims, *options[4:])
    known[options].graph_cache_max = graph_cache_max
    if module_preload_mode == JaxModulePreloadMode.ALL_DEVICES:
        preload(func.__module__)
    return known[options]


def preload(module) -> None:
    """Compiles the kernels of a module for all devices."""
    from warp._src.kernels.modules import load_module

    for device in devices.get_devices():
        load_module(module, device)


@checked(callable=JAX_CALLABLE)
def clear_jax_callable_graph_cache(callable=None) -> None:
    """Forgets the graphs of one function that `jax_callable` made, or of all of them."""
    for one in _all if callable is None else [callable]:
        one.graphs.clear()


def _frozen(dims):
    if isinstance(dims, dict):
        return tuple((name, extents_of(shape)) for name, shape in dims.items())
    return None if dims is None else extents_of(dims)


class JaxCallable:
    """A Python function as a function of JAX arrays, made by `wp.jax_callable`.

    Attributes:
        graphs: by call, device and buffers.
        graph_cache_max: how many of them to keep, None for all.
    """

    graph_cache_max = None

    def __init__(
        self,
        func,
        num_outputs,
        graph_mode,
        vmap_method,
        output_dims,
        in_out_argnames,
        stage_in_argnames,
        stage_out_argnames,
        has_side_effect,
    ):
        self.func, self.graph_mode = func, graph_mode
        self.vmap_method, self.output_dims = vmap_method, output_dims
        self.stage_in_argnames = set(stage_in_argnames)
        self.stage_out_argnames = set(stage_out_argnames)
        self.has_side_effect = has_side_effect
        names = func.__code__.co_varnames[: func.__code__.co_argcount]
        self.arguments = Arguments(
            "jax_callable", func.__name__, names, num_outputs, in_out_argnames
        )
        unknown = (self.stage_in_argnames | self.stage_out_argnames) - set(names)
        if unknown:
            raise ValueError(self.arguments.message(f"there is no argument {sorted(unknown)}"))
        self.graphs: collections.OrderedDict = collections.OrderedDict()
        _all.add(self)

    @property
    def graph_cache_size(self) -> int:
        """How many graphs are kept."""
        return len(self.graphs)

    def __call__(self, *args, output_dims=None, vmap_method=None):
        jax = load("jax")
        import numpy

        jax_arrays.register()
        arguments = self.arguments
        parameters = _parameters(self.func, arguments)
        arguments.check_kinds(parameters)
        values, shapes = arguments.check_values(jax, parameters, args)
        wanted = output_dims if output_dims is not None else self.output_dims
        dims = arguments.launch_dims(None, shapes) if wanted is None else ()
        arguments.add_outputs(shapes, parameters, wanted, dims)
        plan = Plan(parameters, values, shapes, arguments)
        recordable = self.graph_mode == JaxCallableGraphMode.JAX
        call = jax.ffi.ffi_call(
            jax_arrays.RECORDABLE_TARGET if recordable else jax_arrays.TARGET,
            plan.results_for(jax, shapes, arguments.message),
            vmap_method=vmap_method or self.vmap_method,
            input_output_aliases=plan.aliases,
            has_side_effect=self.has_side_effect,
        )
        run = _Call(self, parameters, plan)
        return call(*plan.buffers, call=numpy.int64(jax_arrays.add_callback(run.text, run)))


def _parameters(func, arguments) -> list[Parameter]:
    import inspect

    found = []
    declared = inspect.get_annotations(func, eval_str=True)
    for name in arguments.names:
        if name not in declared:
            raise TypeError(arguments.message(f"parameter '{name}' has no annotation"))
        kind = annotations.resolve(declared[name])
        if isinstance(kind, ArrayType):
            found.append(Parameter(name, kind.dtype, kind.ndim))
        else:
            found.append(Parameter(name))
    return found


class _Call:
    """A traced call: what XLA calls when the program runs."""

    def __init__(self, owner, parameters, plan):
        self.owner, self.entries = owner, plan.entries
        self.names = [one.name for one in parameters]
        # Buffers in the order of the parameters: arguments, where there are, and results.
        self.layout = {
            i: jax_arrays.Buffer(one.dtype, entry[2])
            for i, (one, entry) in enumerate(zip(parameters, plan.entries, strict=True))
            if len(entry) > 1
        }
        self.staged: dict = {}
        import inspect

        func = owner.func
        shown = [(one.name, one.dtype, one.rank) for one in parameters]
        try:
            source = inspect.getsource(func)
        except OSError:
            source = func.__code__.co_code.hex()
        self.text = f"{func.__module__}.{func.__qualname__} {source} {shown} {plan.entries}"

    def __call__(self, index, stream, arguments, results) -> None:
        mode = self.owner.graph_mode
        if index == devices.CPU and mode > JaxCallableGraphMode.JAX:
            wanted = f"graph mode {mode.name} needs a CUDA device, but got the CPU"
            raise ValueError(self.owner.arguments.message(wanted))
        given = [
            (results if self.entries[i][0] else arguments)[self.entries[i][1]] for i in self.layout
        ]
        with jax_arrays.Place(index, stream) as place:
            for addresses in jax_arrays.entries(list(self.layout.values()), given):
                self._run(place, addresses, mode)

    def _arrays(self, addresses, device) -> dict:
        """The arrays of a call; JAX takes those that are no outputs for immutable."""
        found = {
            i: one.array(address, device)
            for (i, one), address in zip(self.layout.items(), addresses, strict=True)
        }
        for i, one in found.items():
            if not self.entries[i][0]:
                one._protect()
        return found

    def _run(self, place, addresses, mode) -> None:
        arrays = self._arrays(addresses, place.device)
        if mode <= JaxCallableGraphMode.JAX:
            self._call(arrays)
        elif mode == JaxCallableGraphMode.WARP:
            key = (id(self), place.device.index, tuple(addresses))
            capture_launch(self._graph(key, place, arrays), place.stream)
        else:
            self._run_staged(place, arrays)

    def _call(self, arrays) -> None:
        self.owner.func(
            *(arrays[i] if i in arrays else entry[0] for i, entry in enumerate(self.entries))
        )

    def _graph(self, key, place, arrays):
        graphs = self.owner.graphs
        if key not in graphs:
            with ScopedCapture(stream=place.stream) as capture:
                self._call(arrays)
            # The call is kept with its graph, so that no other gets its number.
            graphs[key] = (capture.graph, self)
            limit = self.owner.graph_cache_max
            while limit is not None and len(graphs) > max(limit, 1):
                graphs.popitem(last=False)
        graphs.move_to_end(key)
        return graphs[key][0]

    def _run_staged(self, place, arrays) -> None:
        """Runs a graph over memory of its own between copies to it and from it."""
        owner, index = self.owner, place.device.index
        first = index not in self.staged
        if first:
            self.staged[index] = {
                i: empty(one.shape, one.dtype, place.device) for i, one in arrays.items()
            }
        own = self.staged[index]
        num_inputs = owner.arguments.num_inputs
        for i, one in arrays.items():
            chosen = not owner.stage_in_argnames or self.names[i] in owner.stage_in_argnames
            if i < num_inputs and (first or chosen):
                copy(own[i], one)
        key = (id(self), index)
        capture_launch(self._graph(key, place, own), place.stream)
        for i, one in arrays.items():
            chosen = not owner.stage_out_argnames or self.names[i] in owner.stage_out_argnames
            if self.entries[i][0] and chosen:
                copy(one, own[i])
