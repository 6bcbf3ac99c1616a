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
    **dict.fromkeys("ST", (("int", "float"), " of numbers")),
    **dict.fromkeys("FGH", (("float",), " of floats")),
    **dict.fromkeys("IJ", (("int",), " of integers")),
}
# Defaults of these types are what they are converted to.
_UNCHANGED = ("Any", "const", "condition", "|")


class Parameter:
    """A parameter of an overload.

    Attributes:
        name, kind, default: as in the table; `...` is no default.
        type: name of its type.
        arguments: of the type.
        convert: the function for the type. is_ready: the default need not be converted.
    """

    __slots__ = ("arguments", "convert", "default", "is_ready", "kind", "name", "type")

    def __init__(self, name, type, kind, default):
        self.name, self.kind, self.default = name, kind, default
        self.type, *self.arguments = type if isinstance(type, tuple) else (type,)
        self.convert = _CONVERSIONS.get(self.type, _scalar)
        self.is_ready = self.type in _UNCHANGED or (default is None and self.type != "offsets")

    def value(self, call):
        """The argument of a call, converted."""
        given = call.given.get(self.name)
        if given is None:
            value = self.default if self.is_ready else self.convert(call, self, self.default)
        elif self.kind == "*":
            value = [self.convert(call, self, binding) for binding, _ in given]
        else:
            left_out = given[0] is None and self.default is None and self.is_ready
            value = None if left_out else self.convert(call, self, given[0])
        call.values[self.name] = value
        return value

    def accepts(self, binding) -> bool:
        """True if an argument may be meant for this parameter, rather than another overload's."""
        if self.type in ("tile", "array") and self.arguments:
            return getattr(getattr(binding, "type", None), "kind", None) == self.type
        return isinstance(binding, str) == (self.type == "|") or self.type == "Any"

    def count(self, given, rest, following) -> int:
        """The number of arguments that a variadic parameter takes of those from its place on."""
        if self.type == "index" and following:
            native = getattr(given.get(self.arguments[0], (None,))[0], "type", None)
            if getattr(native, "kind", None) == "tile":
                return min(len(native.shape), len(rest))
        return max(0, len(rest) - sum(one.default is ... for one in following))

    @property
    def takes_names(self) -> bool:
        """True if a variadic parameter takes arguments by name, too, in the order of the names."""
        return self.type in ("index", "value")

    def shown(self) -> str:
        """The parameter as a caller sees it."""
        name = "*" * (self.kind == "*") + self.name
        if self.default is ...:
            return name
        return f"{name}={getattr(self.default, '__name__', None) or repr(self.default)}"


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


# Values.


def _unchanged(call, parameter, binding):
    return binding


def _value(call, parameter, binding):
    return call.context.materialize(binding, call.node)


def _integer(call, parameter, binding):
    value = call.context.materialize(binding, call.node)
    if value.type.kind == "int":
        return value
    raise call.unexpected(parameter, "an integer", value, "use `int(...)`")


def _scalar(call, parameter, binding):
    name = parameter.type
    text = "i1" if name == "bool" else {"i": f"s{name}", "u": f"ui{name[1:]}"}.get(name[0], name)
    native = NativeType.parse(text)
    value = call.context.convert_constant(binding, native, call.node)
    if value.type == native:
        return value
    name = native.python_name
    raise call.unexpected(parameter, f"'{name}'", value, f"use `wp.{name}(...)`")


def _stack(call, parameter, binding):
    if type(binding) is TileStack:
        return binding
    hint = "use `wp.tile_stack(capacity=..., dtype=...)`"
    raise call.unexpected(parameter, "a stack", binding, hint)


# Tiles and arrays.


def _fits(call, pattern, native) -> bool:
    """True if a type is what a pattern says; binds the letters that are free."""
    if isinstance(pattern, tuple):
        kind, *extents, element = pattern
        is_same = native.kind == kind and list(native.shape) == extents
        return is_same and _fits(call, element, native.element)
    kinds, _ = _KINDS.get(pattern, (None, None))
    if kinds is not None and native.kind not in kinds:
        return False
    return call.letters.setdefault(pattern, native) == native


def _elements(pattern) -> str:
    """The elements of a pattern in words, with `of` in front; empty for any."""
    if isinstance(pattern, tuple):
        return f" of {pattern[0]}{pattern[1]}{_elements(pattern[2])}"
    return _KINDS.get(pattern, (None, ""))[1]


def _check_element(call, parameter, native, pattern, noun):
    """Compares the element of a tile or an array with a pattern."""
    before = call.letters.get(pattern)
    if _fits(call, pattern, native.element):
        return
    if before is None:
        family = "Warp struct" if native.element.kind == "struct" else "complex"
        raise call.unexpected(
            parameter, noun + _elements(pattern), native,
            code="tile-elements", facts={"name": call.name, "elements": family},
        )  # fmt: skip
    other = next(
        one.name for one in call.overload.parameters
        if one.type in ("tile", "array") and pattern in one.arguments
    )  # fmt: skip
    raise call.error(
        parameter, "type",
        f"'{other}' and '{parameter.name}' arguments must have the same dtype, got "
        f"{before.python_name} and {native.element.python_name}",
    )  # fmt: skip


def _tile(call, parameter, binding):
    value = call.context.materialize(binding, call.node)
    native = value.type
    element, shape = (*parameter.arguments, None)[:2]
    is_fixed = type(shape) is tuple
    noun = f"a {len(shape)}D tile" if is_fixed else "a tile"
    if native.kind != "tile":
        raise call.unexpected(parameter, noun, value)
    _check_element(call, parameter, native, element, noun)
    found = tuple(native.shape)
    if is_fixed and len(found) != len(shape):
        raise call.unexpected(parameter, noun, value, kind="value")
    bind = call.letters.setdefault
    pairs = zip(shape, found, strict=True) if is_fixed else [(shape, found)]
    if shape is not None and not all([bind(*pair) == pair[1] for pair in pairs]):
        raise _wrong_extents(call, parameter, found)
    return value


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
    shapes = " and ".join(str(shape) for *_, shape in both)
    if type(wanted) is not tuple:
        names = " and ".join(f"'{name}'" for _, name, _ in both)
        message = f"expects tiles of one shape as {names}, got {shapes}"
    elif len(both) == 1:
        message = f"expects a square tile as '{parameter.name}', but got shape {found}"
    else:
        texts = " and ".join(f"[{', '.join(letters)}] of '{name}'" for letters, name, _ in both)
        message = f"expects shapes {texts}, but got {shapes}"
    return call.error(parameter, "value", message)


def _array(call, parameter, binding):
    value = call.context.materialize(binding, call.node)
    native = value.type
    if native.kind != "array" and (parameter.arguments or array_of(native) is None):
        raise call.unexpected(parameter, "an array", value)
    if parameter.arguments:
        rank, element = parameter.arguments
        _check_element(call, parameter, native, element, "an array")
        if call.letters.setdefault(rank, native.rank) != native.rank:
            raise call.unexpected(parameter, f"{call.letters[rank]} dimensions", value)
    return value


def _shape(call, parameter, binding):
    """A shape as ints."""
    found = [known(extent) for extent in parts(call.context, binding)]
    if not all(isinstance(extent, int) and type(extent) is not bool for extent in found):
        raise call.error(
            parameter, "value", f"expects a {parameter.name} of compile time constants",
            code="tile-shape",
        )  # fmt: skip
    if not 1 <= len(found) <= 4 or min(found) < 1:
        raise call.error(
            parameter, "value", f"expects 1 to 4 positive extents, but got {tuple(found)}",
            code="tile-rank", facts={"name": call.name, "count": len(found)},
        )  # fmt: skip
    return [int(extent) for extent in found]


def _rank(call, parameter) -> int:
    """Dimensions of the tile or array that a parameter is about."""
    native = call.values[parameter.arguments[0]].type
    return native.rank if native.kind == "array" else len(native.shape)


def _offsets(call, parameter, binding):
    """An index per dimension; none given are zero."""
    rank, other = _rank(call, parameter), parameter.arguments[0]
    if binding is None:
        return [call.builder.constant(INT32, 0)] * rank
    found = [call.context.materialize(part, call.node) for part in parts(call.context, binding)]
    if len(found) != rank:
        raise call.error(
            parameter, "value",
            f"expects as many indices as '{parameter.name}' as '{other}' has dimensions, {rank}, "
            f"but got {len(found)}",
            code="tile-offset" if "load" in call.name else "tile-indices",
            facts={"name": call.name, "other": other, "count": len(found), "rank": rank},
        )  # fmt: skip
    for one in found:
        if one.type.kind != "int":
            raise call.unexpected(parameter, "integers", one, "use `int(...)`")
    return found


def _axis(call, parameter, binding):
    """A dimension as an int."""
    rank, found = _rank(call, parameter), known(binding)
    if isinstance(found, int) and 0 <= found < rank:
        return found
    kind = call.values[parameter.arguments[0]].type.kind
    raise call.error(
        parameter, "value",
        f"axis must be a dimension of the {kind}, which has {rank}, got {found}",
        code="tile-axis", facts={"name": call.name, "kind": kind, "found": found},
    )  # fmt: skip


# Known when the kernel is compiled.


def _dtype(call, parameter, binding):
    return call.constructors.native(binding, call.place(parameter.name))


def _const(call, parameter, binding):
    found = known(binding)
    wanted = {"int": int, "float": float}.get(*parameter.arguments or ("",), object)
    if isinstance(found, (int, float)) and isinstance(found, wanted):
        return found
    noun = "".join(f" '{name}'" for name in parameter.arguments)
    raise call.unexpected(parameter, f"a compile-time constant{noun}", binding, kind="value")


def _condition(call, parameter, binding):
    return call.expressions.truth(binding, call.place(parameter.name))


def _choice(call, parameter, binding):
    choices = parameter.arguments
    if isinstance(binding, str) and binding in choices:
        return binding
    *others, last = map(repr, choices)
    raise call.error(
        parameter, "value",
        f"{parameter.name} must be {', '.join(others)} or {last}, got {binding!r}",
        code="choice",
        facts={"name": parameter.name, "first": choices[0], "second": choices[1]},
    )  # fmt: skip


_CONVERSIONS = {
    **dict.fromkeys(("Any", "index"), _unchanged),
    **{"array": _array, "axis": _axis, "condition": _condition, "const": _const, "dtype": _dtype},
    **{"int": _integer, "offsets": _offsets, "shape": _shape, "stack": _stack, "tile": _tile},
    **{"value": _value, "|": _choice},
}
