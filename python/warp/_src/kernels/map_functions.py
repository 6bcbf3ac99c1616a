"""Functions that `wp.map` is given, as kernels call them, and functions made from text."""

from __future__ import annotations

import itertools
import types as python_types
import typing

from warp._src import errors
from warp._src.argument_kinds import CALLABLE
from warp._src.arguments import checked, shown
from warp._src.kernels.function import Function
from warp._src.kernels.modules import get_module
from warp._src.language.builtins import Builtin

_functions: dict = {}
_numbers = itertools.count()


def define(name, text, names):
    """Defines a function from text that the front end finds again."""
    import linecache

    file = f"<{name} {next(_numbers)}>"
    linecache.cache[file] = (len(text), None, text.splitlines(True), file)
    names = {"__name__": "warp.map", **names}
    exec(compile(text, file, "exec"), names)
    return names[name]


def function_of(func):
    """The function as kernels call it, and what it is known by."""
    if isinstance(func, (Function, Builtin)):
        return func, func
    if not isinstance(func, python_types.FunctionType):
        raise TypeError(f"map: expects a function, but got '{type(func).__name__}'")
    cells = tuple(cell.cell_contents for cell in func.__closure__ or ())
    identity = (func.__code__, cells, func.__defaults__, tuple(type(value) for value in cells))
    try:
        known = _functions.get(identity)
    except TypeError:
        identity, known = func, _functions.get(func)
    if known is None:
        made = _from_lambda(func) if func.__name__ == "<lambda>" else func
        known = _functions[identity] = Function(_generic(made), _identifier(func))
    return known, identity


@checked(func=CALLABLE)
def create_warp_function(func):
    """Makes a function that kernels can call from a Python function or a lambda.

    Args:
        func: its parameters take any type where they have no annotation.

    Returns:
        The function, whose name comes from its source, and the module that it belongs to.

    Raises:
        TypeError: `func` is no function.
        WarpCodegenError: the source of a lambda cannot be found.

    Example:
        >>> import warp as wp
        >>> def double(x):
        ...     return 2.0 * x
        >>> function, module = wp.utils.create_warp_function(double)  # doctest: +SKIP
    """
    import hashlib
    import inspect
    import textwrap

    if isinstance(func, Function):
        return func, get_module(func.__module__)
    if not isinstance(func, python_types.FunctionType):
        raise errors.WarpArgumentError(
            f"wp.utils.create_warp_function(): argument 'func' expects a function of Python, but "
            f"got {shown(func)}"
        )
    made, _ = function_of(func)
    text = textwrap.dedent(inspect.getsource(func))
    name = "func_" + hashlib.sha256(text.encode()).hexdigest()[:16]
    return Function(made.func, name), get_module(func.__module__)


def _identifier(func) -> str:
    return "lambda" if func.__name__ == "<lambda>" else func.__name__


def _generic(func):
    """A copy whose parameters without annotations take any type."""
    made = python_types.FunctionType(
        func.__code__, func.__globals__, func.__name__, func.__defaults__, func.__closure__
    )
    made.__kwdefaults__ = func.__kwdefaults__
    made.__module__ = func.__module__
    parameters = func.__code__.co_varnames[: func.__code__.co_argcount]
    made.__annotations__ = {name: typing.Any for name in parameters} | func.__annotations__
    return made


def _from_lambda(func):
    """A `def` of what a lambda says.

    Raises:
        WarpCodegenError: the source cannot be found.
    """
    import ast
    import linecache

    code = func.__code__
    lines = linecache.getlines(code.co_filename, func.__globals__)
    try:
        tree = ast.parse("".join(lines))
    except SyntaxError:
        tree = ast.Module([], [])
    found = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Lambda)
        and node.lineno == code.co_firstlineno
        and [argument.arg for argument in node.args.args]
        == list(code.co_varnames[: code.co_argcount])
    ]
    texts = {ast.unparse(node.body) for node in found}
    if len(texts) > 1:
        texts = {text for text in texts if _same_code(text, code)}
    if len(texts) != 1:
        raise errors.WarpCodegenError("source of the lambda is not available", hint="use `def`")
    closure = dict(
        zip(code.co_freevars, (cell.cell_contents for cell in func.__closure__ or ()), strict=True)
    )
    parameters = ", ".join(code.co_varnames[: code.co_argcount])
    made = define(
        "function",
        f"def function({parameters}):\n    return {texts.pop()}\n",
        {**func.__globals__, **closure},
    )
    made.__defaults__ = func.__defaults__
    return made


def _same_code(text, code) -> bool:
    """True if an expression is what a lambda was compiled from."""
    parameters = ", ".join(code.co_varnames[: code.co_argcount])
    outer = f"def outer({', '.join(code.co_freevars)}):\n    return lambda {parameters}: {text}\n"
    names: dict = {}
    exec(compile(outer, "<lambda>", "exec"), names)
    made = next(
        c for c in names["outer"].__code__.co_consts if isinstance(c, python_types.CodeType)
    )
    return (made.co_code, made.co_consts, made.co_names) == (
        code.co_code,
        code.co_consts,
        code.co_names,
    )
