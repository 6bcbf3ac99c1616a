"""Nonconforming fields - a discrete field of another geometry, found by position."""

import functools
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import warp as wp
from warp import extend
from warp._src.fem.domains import DomainRecord
from warp._src.fem.fields.base import FieldDescription, GeometryField
from warp._src.fem.fields.uniform import UniformField
from warp._src.fem.geometry.shapes import DIMENSIONS
from warp._src.fem.types import NULL_ELEMENT_INDEX

# Distance beyond a cell that still counts as inside, in units of the last place of the sizes.
_TOLERANCE = 16.0


@dataclass(frozen=True)
class NonconformingDescription(FieldDescription):
    """A field of another geometry; its parts are (0, arguments, geometry).

    field, background: descriptions. cells: record of the field's cells.
    """

    domain: object
    field: object
    background: object
    cells: DomainRecord
    degree: int

    def evaluations(self, one_node):
        """Functions of the operators that give values."""
        return nonconforming_functions(self)

    def check(self, name):
        """Raises where an operator has no meaning for both fields."""
        self.field.check(name)

    def __str__(self):
        return f"nonconforming {self.field}"


@functools.cache
def nonconforming_functions(description) -> SimpleNamespace:
    """The operators: at a position, those of the field, or outside of it, of the background."""
    made = {}
    for name in ("inner", "grad", "div"):
        try:
            description.field.check(name)
            pair = (description.field.operation(name, 1), description.background.operation(name, 1))
        except TypeError:
            continue
        if all(isinstance(one, wp.Function) for one in pair):
            made[name] = _at_position(description, *pair)
    for name, outer in (("inner", "outer"), ("grad", "grad_outer"), ("div", "div_outer")):
        if name in made:
            made[outer] = made[name]
    return SimpleNamespace(**made)


def _at_position(description, of_field, of_background):
    own, other = description.domain.functions, description.cells.functions
    position, lookup, place = own.element_position, other.lookup, other.element_position
    gradient, environment_of = own.element_deformation_gradient, own.element_environment_index
    real = description.domain.geometry.scalar
    epsilon = real(_TOLERANCE * (2.0**-24 if real is wp.float32 else 2.0**-53))
    is_curve = DIMENSIONS[description.domain.geometry.cell] == (
        1 if description.domain.is_cells else 2
    )
    several = description.cells.geometry.environments

    @wp.func
    def evaluate(part: Any, arg: Any, geo: Any, s: Any):
        x = position(geo, s)
        F = gradient(geo, s)
        size = wp.length(x)
        if wp.static(is_curve):
            size += wp.length(F)
        else:
            size += wp.sqrt(wp.ddot(F, F))
        reach = epsilon * size
        if wp.static(several):
            found = lookup(arg.cells, x, reach, environment_of(geo, s))
        else:
            found = lookup(arg.cells, x, reach)
        value = of_background(0, arg.background, geo, s)
        if found.element_index != NULL_ELEMENT_INDEX:
            if wp.length(x - place(arg.cells, found)) <= reach:
                value = of_field(0, arg.field, arg.cells, found)
        return value

    return evaluate


class NonconformingField(GeometryField):
    """A discrete field over elements of another geometry.

    Args:
        domain: elements on which it is defined.
        field: a discrete field of another geometry.
        background: value, or field of the domain, where that geometry is not.

    Raises:
        ValueError: the background is defined on other elements.
    """

    def __init__(self, domain, field, background=0.0):
        mine, others = domain.geometry.environment_count(), field.geometry.environment_count()
        if mine > 1 and others > 1 and mine != others:
            raise ValueError(
                f"expects geometries of matching environment counts, but got {mine} and {others}"
            )
        self.domain, self.geometry, self.field = domain, domain.geometry, field
        self.kind = "cells" if domain.is_cells else "sides"
        if not isinstance(background, GeometryField):
            background = UniformField(domain, field.dtype(background))
        elif background.geometry != domain.geometry or background.kind != self.kind:
            raise ValueError(
                f"'background' expects a field on {self.kind} of '{domain.geometry.name}', but got "
                f"one on {background.kind} of '{background.geometry.name}'"
            )
        self.background = background

    @property
    def dtype(self):
        """Type of the value."""
        return self.field.dtype

    @property
    def degree(self) -> int:
        """Polynomial degree of the field."""
        return self.field.degree

    @property
    def cells(self):
        """The cells of the field's geometry."""
        from warp._src.fem.domains import Cells

        return Cells(self.field.geometry)

    @property
    def ArgType(self):
        """Struct of the arguments of both fields, and of the field's cells."""
        return _arg_type(
            self.field.ArgType, self.cells.functions.ElementArg, self.background.ArgType
        )

    def arg_value(self, device):
        """The struct of the arguments."""
        geometry = self.field.geometry
        if not geometry.supports_cell_lookup(device):
            geometry.build_bvh(device)
        arg = self.ArgType()
        arg.field = self.field.arg_value(device)
        arg.cells = geometry.cell_arg_value(device)
        arg.background = self.background.arg_value(device)
        return arg

    @property
    def array(self):
        """The array that gradients are of."""
        return getattr(self.field, "array", None)

    def bind(self, domain):
        """The description for elements of a domain's record."""
        cells = self.cells.record
        return NonconformingDescription(
            domain, self.field.bind(cells), self.background.bind(domain), cells, self.degree
        )

    def trace(self):
        """The field on sides."""
        domain = self.domain.side_domain()
        return NonconformingField(domain, self.field, self.background.trace())


@functools.cache
def _arg_type(field, cells, background):
    fields = {"field": field, "cells": cells, "background": background}
    return extend.struct_from_fields("NonconformingArg", fields, module=__name__)
