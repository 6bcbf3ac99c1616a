"""Calls of functions that users wrote in C++ (`wp.func_native`)."""

from __future__ import annotations

import ast

from warp._src.frontend import address, native_arrays, native_wrappers, updates
from warp._src.kernels import native_code
from warp._src.kernels.build_options import Build
from warp._src.types import dtypes
from warp._src.types.annotations import Reference, annotations_of
from warp._src.types.native import native_text

_FIX = "write the function in Python with `@wp.func`"


def call_native(context, function, node):
    """The result of a call, or None for a barrier of a block.

    Raises:
        WarpCodegenError: the function has other parameters than numbers, addresses of them and
            arrays.
    """
    if function.is_block_barrier:
        if context.session.block_threads() > 1:
            context.at(node)
            context.session.tiles.add_barrier()
        return None
    if isinstance(function, native_arrays.MemoryCode):
        return native_arrays.emit(context, function, node)
    if native_arrays.in_memory(function):
        return native_arrays.call(context, function, node)
    what = f"the native code of '{function.key}'"
    pointers = _pointers(context, function, node)
    if pointers or native_wrappers.needs_wrapper(function):
        return _call_wrapper(context, function, pointers, node)
    arguments, keywords = context.constructors.arguments(node)
    overload, bound = context.user_calls.select(function, arguments, keywords, node)
    values = [
        context.convert_constant(binding, parameter.native, node)
        if type(binding) in (bool, int, float) and parameter.native is not None
        else context.materialize(binding, node)
        for binding, parameter in zip(bound, overload.parameters, strict=True)
    ]
    parameters = [
        (parameter.name, str(value.type))
        for parameter, value in zip(overload.parameters, values, strict=True)
    ]
    for name, native in parameters:
        if native not in native_code.SCALARS:
            problem = f"{what}, whose parameter '{name}' is no number,"
            raise context.unsupported(node, problem, _FIX)
    result = _result_of(function)
    snippet = function.native_snippet
    if native_code.is_together(snippet):
        # Code depends on the threads of the block.
        context.session.block_threads()
    elif result not in native_code.SCALARS:
        raise context.unsupported(
            node, f"{what}, which returns no number,", _FIX, code="native-return"
        )
    place = native_code.place_of(context, node)
    build = context.session.build
    symbol = native_code.add(function.key, snippet, parameters, result, place, build)
    context.at(node)
    made = context.builder.builtin(f"_{symbol}:{result or 'si32'}", values)[0][0]
    return made if result else None


_STOP = """#ifdef __CUDACC_RTC__
__brkpt();
#else
__builtin_debugtrap();
#endif"""


def stop(context, node) -> None:
    """Stops the thread for a debugger; without one the process ends."""
    context.session.has_breakpoints = True
    place = native_code.place_of(context, node)
    symbol = native_code.add("breakpoint", _STOP, [], None, place, Build())
    context.at(node)
    context.builder.builtin(f"_{symbol}:si32", [])


def _call_wrapper(context, function, pointers, node):
    """Calls what stands for a function that changes its arguments or has an adjoint."""
    for name, annotation in annotations_of(function.func).items():
        kind = annotation.dtype if isinstance(annotation, Reference) else annotation
        if kind is not None and native_text(kind) not in native_code.SCALARS:
            problem = f"the native code of '{function.key}', whose '{name}' is no number,"
            raise context.unsupported(node, problem, _FIX)
    wrapper = native_wrappers.wrapper_of(function, pointers)
    places = [address.place_of(argument) for argument in node.args]
    keywords = [ast.keyword(one.arg, address.place_of(one.value)) for one in node.keywords]
    call = ast.copy_location(ast.Call(node.func, places, keywords), node)
    references = updates.references_of(wrapper)
    if references:
        return context.references.call_by_reference(wrapper, references, call)
    arguments = context.constructors.arguments(call)
    return context.user_calls.call_function(wrapper, *arguments, call)


def _pointers(context, function, node) -> tuple:
    """(parameter, type) for each argument that is the address of a number."""
    names = list(annotations_of(function.func))
    given = [*zip(names, node.args, strict=False), *((k.arg, k.value) for k in node.keywords)]
    found = []
    for name, argument in given:
        place = address.place_of(argument)
        if place is not argument:
            found.append((name, address.type_at(context, place)))
    return tuple(found)


def _result_of(function) -> str:
    """The text of the native type that the annotation of the result says."""
    declared = annotations_of(function.func).get("return")
    return "" if declared is None else dtypes.native_text(declared)
