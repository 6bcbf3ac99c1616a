"""Calls of functions that users wrote in C++ (`wp.func_native`)."""

from __future__ import annotations

from warp._src import errors
from warp._src.frontend.functions import annotations_of
from warp._src.kernels import native_code
from warp._src.types import dtypes

_FIX = "write the function in Python with `@wp.func`"


def call_native(context, function, node):
    """The result of a call, or None for a barrier of a block that is one thread.

    Raises:
        WarpCodegenError: the function has other parameters than numbers, or Clang is not installed
            or refuses it.
    """
    if function.is_block_barrier and context.session.block_threads() == 1:
        return None
    what = f"the native code of '{function.key}'"
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
    if result not in native_code.SCALARS:
        raise context.unsupported(node, f"{what}, which returns no number,", _FIX)
    if function.adj_native_snippet is not None:
        raise context.unsupported(node, f"{what} with an adjoint in native code", _FIX)
    try:
        symbol = native_code.add(function.key, function.native_snippet, parameters, result)
    except errors.WarpCompileError as problem:
        raise context.error(node, str(problem)) from None
    context.at(node)
    return context.builder.builtin(f"_{symbol}:{result}", values)[0][0]


def _result_of(function) -> str:
    """The text of the native type that the annotation of the result says."""
    declared = annotations_of(function.func).get("return")
    return "" if declared is None else dtypes.native_text(declared)
