"""Translation of a kernel object to its module."""

from __future__ import annotations

import re

from warp import _native
from warp._src import errors
from warp._src.frontend.bindings import Value
from warp._src.frontend.control import plan_of
from warp._src.frontend.functions import Overload, fits_native
from warp._src.frontend.session import Session
from warp._src.frontend.translator import Translator
from warp._src.frontend.updates import updated_arguments
from warp._src.kernels.build_options import Build
from warp._src.types import dtypes
from warp._src.types.annotations import is_generic


def build_kernel(kernel):
    """Translates a kernel, and returns the module alone."""
    return translate_kernel(kernel)[0]


def translate_kernel(kernel, arguments=None, threads=1, constants=None):
    """Translates a kernel.

    Args:
        kernel: has `func` (the Python function), `key` (its name) and `option(name)`.
        arguments: native types of the arguments, where annotations leave them open.
        threads: threads of a block, if the kernel has tiles.
        constants: values of parameters, or of fields of structs, by name, that the code is for.

    Returns:
        The verified module, which holds the kernel and the functions it calls, and the session,
        which knows what launches have to do: whether there are tiles, handles of geometry, and
        winding numbers.

    Raises:
        WarpCodegenError: the function cannot be translated; says where and why.
    """
    limit = kernel.option("max_unroll")
    limit = 16 if limit is None else limit
    build = Build(kernel.option("extra_build_options"))
    translator = _translate(kernel.func, kernel.key, arguments, limit, threads, constants, build)
    budget = kernel.option("inline_budget")
    if budget is not None:
        translator.builder.set_inline_budget(budget)
    return _finish(translator), translator.session


def _finish(translator):
    translator.builder.end_function([])
    return translator.builder.finish()


def types_of_local(function, name, local) -> list:
    """Types of a kernel's local variable, several if it holds a tuple.

    Raises:
        WarpCodegenError: the function cannot be translated, or the variable holds no value.
    """
    translator = _translate(function, name, None, 16)
    found = translator.env.get(local)
    bindings = found if type(found) is tuple else (found,)
    natives = [
        binding.type if type(binding) is Value else translator.static_type(binding)
        for binding in bindings
    ]
    if any(native is None for native in natives):
        raise errors.WarpCodegenTypeError(f"'{name}' gives no value")
    return natives


def _translate(function, name, arguments, max_unroll, threads=1, constants=None, build=None):
    """The translator at the end of the function's body."""
    overload = Overload(function)
    source = overload.source
    natives = _parameter_types(overload, name, arguments)
    builder = _native.Builder(symbol_name(name))
    session = Session(builder, max_unroll, build)
    session.threads = int(threads)
    session.is_ragged = getattr(threads, "is_ragged", False)
    session.active.append(overload)
    translator = Translator(session, function, source, True)
    translator.at(source.tree)
    parameters = [parameter.name for parameter in overload.parameters]
    symbol = session.symbol(symbol_name(name))
    values = builder.begin_function(symbol, parameters, natives, True)
    values = _with_constants(translator, dict(zip(parameters, values, strict=False)), constants)
    for parameter, value in values.items():
        translator.env[parameter] = session.parameters[parameter] = value
        translator.lines[parameter] = source.line(source.tree)
    try:
        if overload.declares_result:
            raise translator.statements.kernel_returns(source.tree.returns or source.tree)
        plan_of(source, updated_arguments(function, builder.inout_arguments))
        translator.statements.body()
    except errors.WarpError as problem:
        located = translator.locate(problem)
        located.depends_on_threads = session.depends_on_threads
        raise located from problem.__cause__
    except RecursionError:
        raise translator.error(
            translator.node,
            f"kernel '{name}' is nested too deeply for Python's recursion limit",
            "split the expression, or raise `sys.setrecursionlimit`",
        ) from None
    return translator


def _with_constants(translator, values, constants) -> dict:
    """Values of the parameters by name, with constants in place of arguments and of fields."""
    builder, node = translator.builder, translator.node
    for path, constant in (constants or {}).items():
        name, _, field = path.partition(".")
        value = translator.materialize(constant, node)
        values[name] = builder.struct_set(values[name], field, value) if field else value
    return values


def _parameter_types(overload, name, arguments) -> list:
    """Native types of the parameters; those that annotations leave open are of the arguments.

    Raises:
        WarpCodegenTypeError: a parameter is a reference, or its type is not known or does not fit.
    """
    place = overload.source.place(overload.source.tree)
    given = arguments or [None] * len(overload.parameters)
    natives = []
    for parameter, argument in zip(overload.parameters, given, strict=False):
        what = f"parameter '{parameter.name}' of kernel '{name}'"
        if parameter.by_reference:
            message, hint = f"{what} cannot be a reference", "pass an array"
            raise errors.WarpCodegenTypeError(message, hint=hint, **place)
        native = parameter.native or argument
        if native is None:
            message = f"{what} is generic, its type is known at launch only"
            if not is_generic(parameter.annotation):
                message = f"{what} is a '{parameter.type_name}', which functions alone take"
            raise errors.WarpCodegenTypeError(message, **place)
        if parameter.native is None and not fits_native(parameter.annotation, native):
            raise errors.WarpCodegenTypeError(
                f"{what} expects '{dtypes.type_repr(parameter.annotation)}', but got "
                f"'{native.python_name}'",
                **place,
            )
        natives.append(native)
    return natives


def symbol_name(name: str) -> str:
    """A name that linkers and assemblers accept."""
    return re.sub(r"\W", "_", name, flags=re.ASCII)
