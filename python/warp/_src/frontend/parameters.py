"""Parameters of builtins: conversion and type checks of arguments.

A type of a signature (`include/WarpDialect/WarpBuiltinBase.td` lists them) is a function that
converts a binding, or raises an error at the argument. Letters stand for one type or extent
throughout a call: the first argument that has one decides what it is.
"""

from __future__ import annotations

from warp._src.frontend.bindings import INT32, NativeType, TileStack, Value
from warp._src.frontend.indexed import array_of
from warp._src.types import dtypes

# Types that a letter stands for, and their name in messages; other letters stand for any type.
_KINDS = {
    **dict.fromkeys("ST", (("int", "float"), "numbers")),
    **dict.fromkeys("FGH", (("float",), "floats")),
    **dict.fromkeys("IJ", (("int",), "integers")),
}
# Defaults of these types are what they are converted to.
_UNCHANGED = ("Any", "const", "condition", "|")


class Parameter:
    """A parameter of an overload.

    Attributes:
        name, kind, default: as in the table; `...` is no default.
        type: name of its type, or the letter or scalar that it is.
        arguments: of the type.
    """

    __slots__ = ("arguments", "convert", "default", "kind", "name", "type")

    def __init__(self, name, type, kind, default):
        self.name, self.kind, self.default = name, kind, default
        self.type, *self.arguments = type if isinstance(type, tuple) else (type,)
        self.convert = _CONVERSIONS.get(self.type)
        if self.convert is None:
            is_letter = len(self.type) == 1
            self.convert = _value if is_letter else _scalar
            self.arguments = [self.type if is_letter else _native(self.type)]

    def value(self, call):
        """The argument of a call, converted."""
        given = call.given.get(self.name)
        if self.kind == "*":
            value = [self.convert(call, self, binding) for binding, _ in given]
        else:
            value = self.default if given is None else given[0]
            if value is None and self.default is None and self.type != "offsets":
                pass
            elif given is not None or self.type not in _UNCHANGED:
                value = self.convert(call, self, value)
        call.values[self.name] = value
        return value

    def accepts(self, binding) -> bool:
        """Whether an argument may be meant for this parameter rather than that of an overload."""
        if self.type in ("tile", "array") and self.arguments:
            return getattr(getattr(binding, "type", None), "kind", None) == self.type
        if self.type == "|":
            return isinstance(binding, str)
        return not isinstance(binding, str) or self.type == "Any"

    def count(self, given, rest, following) -> int:
        """Of the arguments from a variadic parameter on, how many it takes."""
        if self.type == "index" and following:
            native = getattr(given.get(self.arguments[0], (None,))[0], "type", None)
            if getattr(native, "kind", None) == "tile":
                return min(len(native.shape), len(rest))
        return max(0, len(rest) - sum(one.default is ... for one in following))

    @property
    def takes_names(self) -> bool:
        """Whether a variadic parameter takes arguments by name, too, in the order of the names."""
        return self.type in ("index", "value")

    def shown(self) -> str:
        """The parameter as a caller sees it."""
        star = "*" if self.kind == "*" else ""
        return f"{star}{self.name}" + ("" if self.default is ... else f"={_text(self.default)}")


def _text(default) -> str:
    return getattr(default, "__name__", None) or repr(default)


def _native(name):
    """The type of a scalar by its name in signatures."""
    if name == "bool":
        return NativeType.parse("i1")
    return NativeType.parse({"i": "s" + name, "u": name[0] + "i" + name[1:]}.get(name[0], name))


def known(binding):
    """A number known at compile time, or None."""
    if type(binding) is Value:
        return binding.constant()
    return getattr(binding, "value", binding)


def parts(context, binding) -> list:
    """The entries of a tuple or vector; a number is one."""
    if type(binding) is tuple or isinstance(binding, dtypes.Composite):
        return list(binding)
    if type(binding) is Value and binding.type.kind == "vec":
        builder = context.builder
        indices = [builder.constant(INT32, i) for i in range(binding.type.shape[0])]
        return [builder.extract(binding, [index]) for index in indices]
    return [binding]


# Letters.


def _bind(call, letter, found) -> bool:
    """Whether a letter stands for what was found; if it is free, it does from here on."""
    return call.letters.setdefault(letter, found) == found


def _fits(call, pattern, native) -> bool:
    """Whether a type is what a pattern says; binds letters."""
    if isinstance(pattern, tuple):
        kind, *extents, element = pattern
        return (
            native.kind == kind
            and len(extents) == len(native.shape)
            and all(want in (have, str(want)) for want, have in zip(extents, native.shape))
            and _fits(call, element, native.element)
        )
    kinds, _ = _KINDS.get(pattern, (None, None))
    if kinds is not None and native.kind not in kinds:
        return False
    return _bind(call, pattern, native)


def _elements(pattern) -> str:
    """The elements of a pattern in words, with `of` in front; empty for any."""
    if isinstance(pattern, tuple):
        return f" of {pattern[0]}{pattern[1]}{_elements(pattern[2])}"
    _, words = _KINDS.get(pattern, (None, None))
    return f" of {words}" if words else ""


def _value(call, parameter, binding):
    """A value of a type that a letter stands for."""
    value = call.context.materialize(binding, call.node)
    letter = parameter.arguments[0]
    if _fits(call, letter, value.type):
        return value
    words = _elements(letter).removeprefix(" of ")
    other = call.letters.get(letter)
    raise call.type_error(
        parameter.name,
        f"expects {words or repr(other.python_name)} as '{parameter.name}', but got "
        f"'{value.type.python_name}'",
    )


def _scalar(call, parameter, binding):
    native = parameter.arguments[0]
    value = call.context.convert_constant(binding, native, call.node)
    if value.type == native:
        return value
    raise call.type_error(
        parameter.name,
        f"expects '{native.python_name}' as '{parameter.name}', but got '{value.type.python_name}'",
        f"use `wp.{native.python_name}(...)`",
    )


# Tiles and arrays.


def _tile(call, parameter, binding):
    value = call.context.materialize(binding, call.node)
    native = value.type
    element, shape = (*parameter.arguments, None)[:2]
    if native.kind != "tile":
        raise call.type_error(
            parameter.name,
            f"expects a tile as '{parameter.name}', but got '{native.python_name}'",
        )
    before = call.letters.get(element)
    if not _fits(call, element, native.element):
        raise _wrong_element(call, parameter, native, before)
    found = tuple(native.shape)
    if type(shape) is tuple:
        if len(found) != len(shape):
            raise call.value_error(
                parameter.name,
                f"expects a {len(shape)}D tile as '{parameter.name}', but got "
                f"'{native.python_name}'",
            )
        if not all([_bind(call, one, extent) for one, extent in zip(shape, found, strict=True)]):
            raise _wrong_extents(call, parameter, found)
    elif shape is not None and not _bind(call, shape, found):
        raise _wrong_extents(call, parameter, found)
    return value


def _wrong_element(call, parameter, native, before):
    """The error for a tile or array with elements of another type."""
    kind = native.element.kind
    if before is None:
        noun = parameter.type
        if noun == "tile" and len(parameter.arguments) > 1:
            shape = parameter.arguments[1]
            noun = f"{len(shape)}D tile" if type(shape) is tuple else noun
        return call.type_error(
            parameter.name,
            f"expects a {noun}{_elements(parameter.arguments[0])} as '{parameter.name}', but got "
            f"'{native.python_name}'",
            also=f"{call.name}() does not support "
            f"{'Warp struct' if kind == 'struct' else 'complex'} tiles",
        )
    letter = _letter(parameter)
    other = next(one.name for one in call.overload.parameters if _letter(one) == letter)
    return call.type_error(
        parameter.name,
        f"'{other}' and '{parameter.name}' arguments must have the same dtype, got "
        f"{before.python_name} and {native.element.python_name}",
    )


def _letter(parameter):
    """The letter that the elements of a parameter have, or None."""
    place = {"tile": 0, "array": 1}.get(parameter.type)
    return None if place is None else parameter.arguments[place]


def _wrong_extents(call, parameter, found):
    """The error for a shape that does not fit that of another parameter, or is not square."""
    wanted = parameter.arguments[1]
    both = [
        (one.arguments[1], one.name, tuple(call.values[one.name].type.shape))
        for one in call.overload.parameters
        if one.name in call.values and one.type == "tile" and len(one.arguments) > 1
        and not set(one.arguments[1]).isdisjoint(wanted)
    ]  # fmt: skip
    both.append((wanted, parameter.name, found))
    if type(wanted) is not tuple:
        names = " and ".join(f"'{name}'" for _, name, _ in both)
        shapes = " and ".join(str(shape) for *_, shape in both)
        return call.value_error(
            parameter.name, f"expects tiles of one shape as {names}, got {shapes}"
        )
    if len(set(wanted)) < len(wanted) and len(both) == 1:
        return call.value_error(
            parameter.name, f"expects a square tile as '{parameter.name}', but got shape {found}"
        )
    texts = " and ".join(f"[{', '.join(letters)}] of '{name}'" for letters, name, _ in both)
    shapes = " and ".join(str(shape) for *_, shape in both)
    return call.value_error(parameter.name, f"expects shapes {texts}, but got {shapes}")


def _array(call, parameter, binding):
    value = call.context.materialize(binding, call.node)
    native = value.type
    if native.kind != "array" and (parameter.arguments or array_of(native) is None):
        raise call.type_error(
            parameter.name,
            f"expects an array as '{parameter.name}', but got '{native.python_name}'",
        )
    if not parameter.arguments:
        return value
    rank, element = parameter.arguments
    before = call.letters.get(element)
    if not _fits(call, element, native.element):
        raise _wrong_element(call, parameter, native, before)
    if not _bind(call, rank, native.rank):
        raise call.value_error(
            parameter.name,
            f"expects '{parameter.name}' to have {call.letters[rank]} dimensions, but got "
            f"'{native.python_name}'",
        )
    return value


def _shape(call, parameter, binding):
    """A shape as ints."""
    found = [known(extent) for extent in parts(call.context, binding)]
    if not all(isinstance(extent, int) and type(extent) is not bool for extent in found):
        raise call.value_error(
            parameter.name,
            f"expects a {parameter.name} of compile time constants",
            also="shape must be a tuple of constants",
        )
    if not 1 <= len(found) <= 4 or min(found) < 1:
        raise call.value_error(
            parameter.name,
            f"expects 1 to 4 positive extents, but got {tuple(found)}",
            also=f"{call.name}() output must have between one and four dimensions, got "
            f"{len(found)}",
        )
    return [int(extent) for extent in found]


def _rank(call, parameter) -> int:
    """Dimensions of the tile or array that a parameter is about."""
    native = call.values[parameter.arguments[0]].type
    return native.rank if native.kind == "array" else len(native.shape)


def _offsets(call, parameter, binding):
    """An index per dimension; none given are zero."""
    rank = _rank(call, parameter)
    if binding is None:
        return [call.builder.constant(INT32, 0)] * rank
    found = [call.context.materialize(part, call.node) for part in parts(call.context, binding)]
    if len(found) != rank:
        other = parameter.arguments[0]
        raise call.value_error(
            parameter.name,
            f"expects {rank} indices as '{parameter.name}', one for each dimension of '{other}', "
            f"but got {len(found)}",
            also=f"{call.name}() offset argument must have the same number of dimensions as the "
            f"array to load from, got {len(found)} indices for an array with {rank} dimensions"
            if "load" in call.name
            else f"{call.name}() '{other}' argument must have {len(found)} dimensions, got {rank}",
        )
    for one in found:
        if one.type.kind != "int":
            raise call.type_error(
                parameter.name, f"expects integers as offsets, but got '{one.type.python_name}'"
            )
    return found


def _axis(call, parameter, binding):
    """A dimension as an int."""
    rank = _rank(call, parameter)
    found = known(binding)
    if not isinstance(found, int) or not 0 <= found < rank:
        kind = call.values[parameter.arguments[0]].type.kind
        raise call.value_error(
            parameter.name,
            f"axis must be a dimension of the {kind}, which has {rank}, got {found}",
            also=f"{call.name}() axis argument must be valid axis of the {kind}, got {found}.",
        )
    return found


def _stack(call, parameter, binding):
    if type(binding) is TileStack:
        return binding
    raise call.type_error(
        parameter.name,
        f"expects a stack as '{parameter.name}', but got '{call.context.type_name(binding)}'",
        "use `wp.tile_stack(capacity=..., dtype=...)`",
    )


# What is known when the kernel is compiled.


def _dtype(call, parameter, binding):
    return call.constructors.native(binding, call.place(parameter.name))


def _const(call, parameter, binding):
    found = known(binding)
    wanted = parameter.arguments[0] if parameter.arguments else None
    kinds = {"int": int, "float": float, "bool": bool}
    if type(found) is kinds.get(wanted, type(found)) and isinstance(found, (int, float)):
        return found
    raise call.value_error(
        parameter.name,
        f"expects a compile-time constant{f' of type {wanted!r}' if wanted else ''} as "
        f"'{parameter.name}', but got '{call.context.type_name(binding)}'",
    )


def _condition(call, parameter, binding):
    return call.expressions.truth(binding, call.place(parameter.name))


def _choice(call, parameter, binding):
    if isinstance(binding, str) and binding in parameter.arguments:
        return binding
    *others, last = map(repr, parameter.arguments)
    raise call.value_error(
        parameter.name,
        f"{parameter.name} must be {', '.join(others)} or {last}, got {binding!r}",
        also=f"{parameter.name} must be the string literal {others[0]} or {(*others, last)[1]}",
    )


def _unchanged(call, parameter, binding):
    return binding


def _integer(call, parameter, binding):
    value = call.context.materialize(binding, call.node)
    if value.type.kind == "int":
        return value
    raise call.type_error(
        parameter.name,
        f"expects an integer as '{parameter.name}', but got '{value.type.python_name}'",
        "use `int(...)`",
    )


def _any_value(call, parameter, binding):
    return call.context.materialize(binding, call.node)


_CONVERSIONS = {
    "Any": _unchanged,
    "array": _array,
    "axis": _axis,
    "condition": _condition,
    "const": _const,
    "dtype": _dtype,
    "index": _unchanged,
    "int": _integer,
    "offsets": _offsets,
    "shape": _shape,
    "stack": _stack,
    "tile": _tile,
    "value": _any_value,
    "|": _choice,
}
