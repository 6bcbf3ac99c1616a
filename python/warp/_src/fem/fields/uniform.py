"""Uniform fields - one value everywhere."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import warp as wp
from warp import extend
from warp._src.fem.fields.base import FieldDescription, GeometryField, References, Values
from warp._src.fem.geometry.shapes import cell_of


@dataclass(frozen=True)
class UniformDescription(FieldDescription):
    """A uniform field; its parts are (0, value, geometry)."""

    domain: object
    dtype: type
    degree = 0

    @property
    def values(self):
        """Kinds of values."""
        return Values(self.dtype, self.dtype)

    def reference(self, one_node=False):
        """Functions of reference values: the value, and a zero."""
        Real = extend.type_scalar_type(self.dtype)
        cell = cell_of(self.domain.geometry.cell)
        _, Gradient = self.values.reference_types(cell.dimension)

        @wp.func
        def value(part: Any, arg: Any, geo: Any, s: Any):
            return arg

        @wp.func
        def gradient(part: Any, arg: Any, geo: Any, s: Any):
            return Gradient(Real(0.0))

        return References(SimpleNamespace(value=value, gradient=gradient))

    def __str__(self):
        return f"uniform field of {extend.type_repr(self.dtype)}"


class UniformField(GeometryField):
    """A field with one value everywhere.

    Args:
        domain: elements on which it is defined.
        value: the value, which can be set later.
    """

    def __init__(self, domain, value):
        self.domain = domain
        kind = type(value)
        if kind in (int, float):
            kind = domain.geometry.scalar_type
        self._dtype = extend.canonical(kind)
        self.value = value

    @property
    def geometry(self):
        """Geometry of the domain, which can be set."""
        return self.domain.geometry

    @property
    def kind(self) -> str:
        """Kind of elements of the domain."""
        return "cells" if self.domain.is_cells else "sides"

    @property
    def value(self):
        """The value."""
        return self._value

    @value.setter
    def value(self, value):
        kind = type(value)
        if kind not in (int, float, bool, list, tuple) and not extend.types_equal(
            extend.canonical(kind), self._dtype
        ):
            raise TypeError(
                f"UniformField value type must remain {extend.type_repr(self._dtype)}, got "
                f"{extend.type_repr(kind)}"
            )
        self._value = self._dtype(value)

    @property
    def dtype(self):
        """Type of the value."""
        return self._dtype

    @property
    def degree(self) -> int:
        """Polynomial degree."""
        return 0

    @property
    def ArgType(self):
        """Type of the value."""
        return self._dtype

    def arg_value(self, device):
        """The value."""
        return self._value

    def bind(self, domain):
        """The description for elements of a domain's record."""
        return UniformDescription(domain, self._dtype)

    def trace(self):
        """The field on sides."""
        return UniformField(self.domain.side_domain(), self._value)
