"""`wp.address_of(x)`: passes a number in memory to native code.

Values of kernels have no address. Native code gets that of a copy, which is written back after the
call, so it sees the one number and nothing around it.
"""

from __future__ import annotations

import ast

from warp._src.frontend.bindings import Value
from warp._src.types import dtypes

NAME = "address_of"
_TYPES = {bool: "bool", int: "int32"}


def place_of(node):
    """The operand of an address; other expressions as they are."""
    if not isinstance(node, ast.Call) or len(node.args) != 1 or node.keywords:
        return node
    name = node.func.attr if isinstance(node.func, ast.Attribute) else None
    name = node.func.id if isinstance(node.func, ast.Name) else name
    return node.args[0] if name == NAME else node


def type_at(context, place):
    """The type of the number at a place.

    Raises:
        WarpCodegenError: the place cannot be assigned to, or holds no number.
    """
    check_constant(context, place)
    if not isinstance(place, (ast.Name, ast.Attribute, ast.Subscript)):
        raise _elsewhere(context, place)
    value = context.slots.read(context.slots.of(place), place)
    if type(value) is not Value:
        raise _elsewhere(context, place)
    return dtypes.dtype_of(value.type)


def check_constant(context, place):
    """Rejects the name of a number known at compile time, which is nowhere in memory."""
    binding = context.env.get(place.id) if isinstance(place, ast.Name) else None
    if type(binding) is Value and context.literal(binding) is not None:
        binding = context.literal(binding)
    if type(binding) in (bool, int, float):
        made = f"wp.{_TYPES.get(type(binding), 'float32')}({binding!r})"
        raise context.type_error(
            place,
            f"'{place.id}' is the constant {binding!r} and has no address",
            f"declare it as `{place.id} = {made}`",
        )


def _elsewhere(context, node):
    return context.error(
        node,
        "native code gets addresses of numbers in variables, components and elements of arrays",
        "assign the value to a variable before",
    )
