"""Arguments that calls update, found before translation."""

from __future__ import annotations

import ast
import types as python_types
import typing

from warp import _native
from warp._src.frontend.address import place_of
from warp._src.frontend.control import name_of
from warp._src.frontend.functions import overload_of
from warp._src.kernels.function import Function, NativeFunction
from warp._src.language.builtins import Builtin
from warp._src.types.annotations import Reference
from warp._src.types.native import ArrayType
from warp._src.types.tiles import TileStackType, TileType

_UNKNOWN = object()
# Annotations of parameters that are passed by reference.
_CHANGEABLE = (ArrayType, TileType, TileStackType)


def references_of(function) -> set:
    """Positions and names of the parameters of a function that are references in some overload."""
    found: set = set()
    if not any(map(_may_have_references, function.overloads)):
        return found
    for overload in map(overload_of, function.overloads):
        found |= {*overload.references, *overload.references.values()}
    return found


def _arrays_of(function) -> set:
    """Positions and names of the parameters that take what a function may change: an array, maybe
    one of the thread, a tile or a stack."""
    found: set = set()
    for one in function.overloads:
        for position, (name, annotation) in enumerate(one.__annotations__.items()):
            if annotation is typing.Any or isinstance(annotation, _CHANGEABLE):
                found |= {position, name}
    return found


def _may_have_references(function) -> bool:
    declared = function.__annotations__.values()
    return any(isinstance(one, (Reference, str)) for one in declared)


def updated_arguments(function, inout_arguments):
    """For a call in a function's body, the arguments that are updated as if they were assigned.

    All arguments count if what is called is known when it is called only: a parameter, a variable,
    an element of a tuple, what an enclosing function has (of which there may be several with one
    text), an attribute of a value.

    Args:
        function: the Python function.
        inout_arguments: gives the positions of arguments that a builtin of a name updates.
    """

    code = function.__code__
    # Python makes these tuples anew each time.
    local = frozenset(code.co_varnames + code.co_freevars)

    def updated(call):
        callee = _resolve(function, local, call.func)
        if callee is _UNKNOWN:
            return [place_of(one) for one in (*call.args, *(k.value for k in call.keywords))]
        if isinstance(callee, Function):
            keys = references_of(callee) | _arrays_of(callee)
        else:
            name = callee.key if isinstance(callee, Builtin) else name_of(call.func)
            positions = inout_arguments(name) if name else ()
            keys = {*positions, *_builtin_names(name, positions)} if positions else ()
        found = [argument for position, argument in enumerate(call.args) if position in keys]
        found += [keyword.value for keyword in call.keywords if keyword.arg in keys]
        if isinstance(callee, NativeFunction):
            # Native code gets the address of these.
            given = [*call.args, *(keyword.value for keyword in call.keywords)]
            found += [place_of(one) for one in given if place_of(one) is not one]
        return found

    return updated


def _builtin_names(name, positions) -> set[str]:
    return {
        names[position]
        for names in _native.Builder.parameter_names(name)
        for position in positions
        if position < len(names)
    }


def _resolve(function, local, node):
    """The object that a name or an attribute of a module or class is in all functions of one text;
    `None` for names of Python's own and of builtins. `local` are names of the function's own, and
    those that it captures."""
    if isinstance(node, ast.Attribute):
        owner = _resolve(function, local, node.value)
        if isinstance(owner, python_types.ModuleType):
            return getattr(owner, node.attr, None)
        return getattr(owner, node.attr, _UNKNOWN) if isinstance(owner, type) else _UNKNOWN
    if not isinstance(node, ast.Name) or node.id in local:
        return _UNKNOWN
    return function.__globals__.get(node.id)
