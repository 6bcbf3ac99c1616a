"""Implicit fields - functions of the position, or of the number of a quadrature point."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from types import SimpleNamespace

import warp as wp
from warp import extend
from warp._src.fem.fields.base import FieldDescription, GeometryField
from warp._src.fem.kept import function_of_text
from warp._src.fem.types import sample_type

# `typing.Any` under a name that texts use.
_ANY = __import__("typing").Any


@dataclass(frozen=True)
class ImplicitDescription(FieldDescription):
    """A field by a function; its parts are (0, values, geometry).

    function, grad, div: functions of the position and the values. names: of the values.
    by_point: the first argument is the number of a quadrature point.
    """

    domain: object
    function: wp.Function
    grad: wp.Function | None
    div: wp.Function | None
    names: tuple
    by_point: bool
    degree: int
    derives: bool = False

    def evaluations(self, one_node):
        """Functions of the operators that give values."""
        return implicit_functions(self)

    def check(self, name):
        """Raises where an operator is not known."""

    def __str__(self):
        return f"implicit field '{self.function.key}'"


@functools.cache
def implicit_functions(description) -> SimpleNamespace:
    """The operators of an implicit field."""
    made = {"inner": _call(description, description.function)}
    if description.grad is not None:
        made["grad"] = _call(description, description.grad)
    elif description.derives and not description.by_point:
        made["grad"] = _gradient(description)
    if description.div is not None:
        made["div"] = _call(description, description.div)
    elif description.derives and made.get("grad"):
        made["div"] = _divergence(made["grad"])
    for name in ("grad", "div"):
        if name in made:
            made[f"{name}_outer"] = made[name]
    made["outer"] = made["inner"]
    return SimpleNamespace(**made)


def _names(description, **more) -> dict:
    functions = description.domain.functions
    return {"position": functions.element_position, "Any": _ANY, "wp": wp, **more}


def _arguments(description) -> str:
    first = "s.qp_index" if description.by_point else "position(geo, s)"
    return ", ".join([first, *(f"arg.{name}" for name in description.names)])


def _function(text, names):
    return wp.func(function_of_text(text, names, __name__))


def _call(description, function):
    text = (
        "def evaluate(part: Any, arg: Any, geo: Any, s: Any):\n"
        f"    return function({_arguments(description)})\n"
    )
    return _function(text, _names(description, function=function))


def _gradient(description):
    """The gradient by differentiation, for numbers and vectors."""
    from warp._src.fem.forms.terms import components

    dtype = implicit_dtype(description)
    names = _names(description, function=description.function, gradient_by=extend.gradient_by)
    if extend.type_is_matrix(dtype):
        return None
    rows = []
    for i, subscript in enumerate(components(dtype)):
        args = ", ".join(["x", *description.names])
        kinds = ", ".join(f"{name}: Any" for name in ("x", *description.names))
        names[f"component_{i}"] = _function(
            f"def component_{i}({kinds}):\n    return function({args}){subscript}\n", names
        )
        rows.append(f"gradient_by(component_{i}, 1)({_arguments(description)})[0]")
    value = rows[0] if components(dtype) == [""] else f"wp.matrix_from_rows({', '.join(rows)})"
    text = f"def slope(part: Any, arg: Any, geo: Any, s: Any):\n    return {value}\n"
    return _function(text, names)


def _divergence(gradient):
    names = {"gradient": gradient, "wp": wp, "Any": _ANY}
    text = (
        "def divergence(part: Any, arg: Any, geo: Any, s: Any):\n"
        "    return wp.trace(gradient(part, arg, geo, s))\n"
    )
    return _function(text, names)


@functools.cache
def implicit_dtype(description):
    """Type of the values."""
    functions = description.domain.functions
    names = _names(
        description,
        Geo=functions.ElementArg,
        Values=implicit_arg_type(description.function, description.names),
        Sample=sample_type(description.domain.geometry.scalar),
        evaluate=_call(description, description.function),
    )
    text = "def probe(arg: Values, geo: Geo, s: Sample):\n    result = evaluate(0, arg, geo, s)\n"
    return extend.type_of_local(function_of_text(text, names, __name__), "result")


@functools.cache
def implicit_arg_type(function, names):
    """The struct of the values."""
    declared = extend.annotations_of(function.func)
    fields = {name: declared[name] for name in names} or {"unused": wp.int32}
    return extend.struct_from_fields("ImplicitArg", fields, module=__name__)


class ImplicitField(GeometryField):
    """A field that a function gives.

    Args:
        domain: elements on which it is defined.
        func: a `@wp.func` of the position, or of the number of a quadrature point, and of values.
        values: arguments of the function, by name; attributes of `values` can be set later.
        grad_func, div_func: the gradient and divergence with the same arguments. With True as
            `grad_func`, both are derivatives of `func`.
        degree: polynomial degree, for the default order of rules.

    Raises:
        ValueError: `func` is no function of kernels, or values do not fit its parameters.
    """

    def __init__(self, domain, func, values=None, grad_func=None, div_func=None, degree=0):
        if not isinstance(func, wp.Function):
            raise ValueError(f"'func' expects a `@wp.func`, but got {extend.shown(func)}")
        self.domain, self.geometry = domain, domain.geometry
        self.kind = "cells" if domain.is_cells else "sides"
        self._derives = grad_func is True
        grad_func = None if self._derives else grad_func
        self._functions, self._degree = (func, grad_func, div_func), degree
        names = func.func.__code__.co_varnames[: func.func.__code__.co_argcount]
        declared = extend.annotations_of(func.func)
        if not names or names[0] not in declared:
            raise ValueError(
                f"'{func.key}' expects a position or the number of a point as its first parameter"
            )
        self._by_point = declared[names[0]] in (int, wp.int32)
        self._names = tuple(names[1:])
        self._arg = implicit_arg_type(func, self._names)()
        self.values = values or {}

    @property
    def values(self):
        """The values as a struct."""
        return self._arg

    @values.setter
    def values(self, values):
        if isinstance(values, type(self._arg)):
            values = {name: getattr(values, name) for name in self._names}
        if sorted(values) != sorted(self._names):
            raise ValueError(
                f"'values' of '{self._functions[0].key}' expects {list(self._names)}, but got "
                f"{sorted(values)}"
            )
        for name, value in values.items():
            setattr(self._arg, name, value)

    @property
    def dtype(self):
        """Type of the value."""
        return implicit_dtype(self.bind(self.domain.record))

    @property
    def degree(self) -> int:
        """Polynomial degree, as it was given."""
        return self._degree

    @property
    def ArgType(self):
        """Struct of the values."""
        return type(self._arg)

    def arg_value(self, device):
        """The struct of the values."""
        return self._arg

    def bind(self, domain):
        """The description for elements of a domain's record."""
        return ImplicitDescription(
            domain, *self._functions, self._names, self._by_point, self._degree, self._derives
        )

    def gradient_valid(self) -> bool:
        """True if the gradient is defined."""
        return hasattr(implicit_functions(self.bind(self.domain.record)), "grad")

    def divergence_valid(self) -> bool:
        """True if the divergence is defined."""
        return hasattr(implicit_functions(self.bind(self.domain.record)), "div")

    def trace(self):
        """The field on sides."""
        values = {name: getattr(self._arg, name) for name in self._names}
        function, grad, div = self._functions
        domain = self.domain.side_domain()
        grad = True if self._derives else grad
        return ImplicitField(domain, function, values, grad, div, self._degree)
