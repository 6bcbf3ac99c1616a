"""Fields - values over the elements of a geometry: a description for kernels, and arrays.

Operators of fields become functions of kernels in one way for all fields. A field says how its
value and gradient by reference coordinates are found at a sample (`reference`), in degrees of
freedom; the map of the element and the mapper of the space make values in space of them.
"""

import functools
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import warp as wp
from warp import extend
from warp._src.fem.fields.curvature import curved_gradient, needs_curvature
from warp._src.fem.geometry.derived import of_gradient
from warp._src.fem.geometry.shapes import DIMENSIONS
from warp._src.fem.types import Field, make_free_sample

# The sample's degrees of freedom say that it is a point whose values are known.
MARK = -7
_OUTER = {"outer": "inner", "grad_outer": "grad", "div_outer": "div"}
_EVALUATIONS = ("inner", "grad", "div", "outer", "grad_outer", "div_outer", "curl_grad")
_ALIASES = {"()": "inner", "eval_inner": "inner", "eval_grad_inner": "grad"}


@dataclass(frozen=True)
class Values:
    """Kinds of values of a field.

    dof: type of a degree of freedom; value: of the value; map: identity, covariant, contravariant.
    mapper: makes values of degrees of freedom, None if they are the same.
    """

    dof: type
    value: type
    map: str = "identity"
    mapper: object = None

    def reference_types(self, dimension: int) -> tuple:
        """Types of the value and of the gradient in reference coordinates."""
        real = extend.type_scalar_type(self.dof)
        if self.map != "identity":
            return (
                wp.types.vector(dimension, real),
                wp.types.matrix((dimension, dimension), real),
            )
        if extend.type_size(self.dof) > 1 or extend.type_is_vector(self.dof):
            # Components of a matrix are numbered row by row.
            shape = extend.type_size(self.dof), dimension
            return self.dof, wp.types.matrix(shape, real)
        return self.dof, wp.types.vector(dimension, real)


class FieldDescription(extend.Description, Field):
    """The compile-time part of a field.

    Attributes:
        domain: record of the elements it is evaluated on. values: kinds of its values.
        degree: polynomial degree.
    """

    def operation(self, name, count):
        name = _ALIASES.get(name, name)
        if name == "degree":
            return extend.Static(self.degree)
        if name == "scalar_type":
            return extend.Static(self.domain.geometry.scalar)
        if name == "cells":
            return self.in_cells()
        if name in _EVALUATIONS:
            self.check(name)
            if name == "curl_grad" and self.values.map != "covariant":
                name = "grad"
            if self.domain.is_cells:
                name = _OUTER.get(name, name)
            return getattr(self.evaluations(count > 1), name, None)
        return getattr(self.node_functions(), name, None)

    def evaluations(self, one_node):
        """Functions of the operators that give values."""
        return field_functions(self, one_node)

    def check(self, name):
        """Raises where an operator has no meaning for the kind of values."""
        value = self.values.value
        if name in ("grad", "grad_outer", "curl_grad") and extend.type_is_matrix(value):
            shown = name.removesuffix("_grad")
            raise TypeError(f"'{shown}' is not defined for fields of matrices, as {self}")
        if not name.startswith("div"):
            return
        if not (extend.type_is_vector(value) or extend.type_is_matrix(value)):
            raise TypeError(f"'{name}' is not defined for fields of numbers, as {self}")
        rows, dimension = value._shape_[0], self.domain.geometry.dimension
        if rows != dimension:
            raise TypeError(
                f"'{name}' expects values with {dimension} rows, as space has dimensions, but got "
                f"{rows} of {self}"
            )

    def in_cells(self):
        """The field in cells, of a trace."""
        return extend.Recast(self)

    def node_functions(self):
        """Operators of nodes."""
        return SimpleNamespace()


class NodesDescription(FieldDescription):
    """The compile-time part of a field whose values are of `nodes`."""

    @property
    def values(self):
        """Kinds of values."""
        return self.nodes.values

    @property
    def degree(self):
        """Polynomial degree."""
        return self.nodes.space.degree


@functools.cache
def field_functions(description, one_node: bool = False) -> SimpleNamespace:
    """The operators of a field that give values: functions of its parts and a sample."""
    reference = description.reference(one_node)
    return SimpleNamespace(
        inner=_value_of(description, reference, 0),
        grad=_gradient_of(description, reference, 0),
        div=_divergence_of(description, reference, 0),
        outer=_value_of(description, reference, 1),
        grad_outer=_gradient_of(description, reference, 1),
        div_outer=_divergence_of(description, reference, 1),
        curl_grad=_gradient_of(description, reference, 0, is_curved=False),
    )


@wp.func
def unchanged(x: Any):
    """The argument."""
    return x


def inverse_map(domain, half):
    """A function of (argument of elements, sample): reference coordinates by position."""
    functions = domain.functions
    if domain.is_cells:
        return functions.inverse_deformation_gradient
    side = "outer" if half else "inner"
    return getattr(functions, f"element_{side}_inverse_deformation_gradient")


def forward_map(domain, half):
    """A function of (argument of elements, sample): position by reference coordinates."""
    if domain.is_cells:
        return domain.functions.deformation_gradient
    from warp._src.fem.fields.nodes import locations

    at, cells = locations(domain, half), domain.cells.functions
    cell_arg, cell, coords = at.cell_arg, at.cell, at.coords
    gradient = cells.deformation_gradient

    @wp.func
    def of_cell(geo: Any, s: Any):
        return gradient(cell_arg(geo), make_free_sample(cell(geo, s), coords(geo, s)))

    return of_cell


def _maps(description, half):
    """The gradient of the map of elements, and its inverse."""
    return forward_map(description.domain, half), inverse_map(description.domain, half)


def _from_dofs(description):
    mapper = description.values.mapper
    return unchanged if mapper is None else mapper.functions[0]


def _stretch(description):
    """A function of the gradient of the map of cells: the ratio of measures, of every sign."""
    geometry = description.domain.geometry
    return of_gradient(DIMENSIONS[geometry.cell], geometry.dimension)[0]


def _value_of(description, reference, half):
    kind = description.values.map
    value = reference[half].value
    stretch, one = _stretch(description), description.domain.geometry.scalar(1.0)
    forward, inverse = _maps(description, half)
    to_value = _from_dofs(description)
    if kind == "identity":

        @wp.func
        def field_value(part: Any, arg: Any, geo: Any, s: Any):
            return to_value(value(part, arg, geo, s))

    elif kind == "covariant":

        @wp.func
        def field_value(part: Any, arg: Any, geo: Any, s: Any):
            return wp.transpose(inverse(geo, s)) * value(part, arg, geo, s)

    else:

        @wp.func
        def field_value(part: Any, arg: Any, geo: Any, s: Any):
            F = forward(geo, s)
            return F * (value(part, arg, geo, s) * (one / stretch(F)))

    return _with_node(field_value, reference)


def _gradient_of(description, reference, half, is_curved=None):
    kind = description.values.map
    if is_curved is None:
        is_curved = needs_curvature(description.domain, kind, "grad")
    gradient = reference[half].gradient
    stretch, one = _stretch(description), description.domain.geometry.scalar(1.0)
    forward, inverse = _maps(description, half)
    if is_curved:
        field_gradient = curved_gradient(description, reference, half, forward, inverse, stretch)

    elif kind == "covariant":

        @wp.func
        def field_gradient(part: Any, arg: Any, geo: Any, s: Any):
            to_space = inverse(geo, s)
            return wp.transpose(to_space) * gradient(part, arg, geo, s) * to_space

    elif kind == "contravariant":

        @wp.func
        def field_gradient(part: Any, arg: Any, geo: Any, s: Any):
            F = forward(geo, s)
            return F * (gradient(part, arg, geo, s) * (one / stretch(F))) * inverse(geo, s)

    elif extend.type_size(description.values.dof) > 1:

        @wp.func
        def field_gradient(part: Any, arg: Any, geo: Any, s: Any):
            return gradient(part, arg, geo, s) * inverse(geo, s)

    else:

        @wp.func
        def field_gradient(part: Any, arg: Any, geo: Any, s: Any):
            return wp.transpose(inverse(geo, s)) * gradient(part, arg, geo, s)

    return _with_node(field_gradient, reference)


def _matrix_divergence(description, reference, half):
    """Divergence of a field of matrices: sum over rows of derivatives by the row's coordinate."""
    values, gradient = description.values, reference[half].gradient
    inverse, to_value = inverse_map(description.domain, half), _from_dofs(description)
    rows, columns = values.value._shape_
    Real, Dof = extend.type_scalar_type(values.dof), values.dof
    Row, size = wp.types.vector(columns, Real), extend.type_size(values.dof)
    is_matrix, width = extend.type_is_matrix(values.dof), columns

    @wp.func
    def field_divergence(part: Any, arg: Any, geo: Any, s: Any):
        slopes = gradient(part, arg, geo, s) * inverse(geo, s)
        total = Row()
        for i in range(rows):
            dof = Dof()
            for k in range(size):
                if wp.static(is_matrix):
                    dof[k // width, k % width] = slopes[k, i]
                else:
                    dof[k] = slopes[k, i]
            total += to_value(dof)[i]
        return total

    return _with_node(field_divergence, reference)


def _divergence_of(description, reference, half):
    if extend.type_is_matrix(description.values.value):
        return _matrix_divergence(description, reference, half)
    if not extend.type_is_vector(description.values.value):
        return None
    is_curved = needs_curvature(description.domain, description.values.map, "div")
    gradient = _gradient_of(description, reference, half, is_curved)

    @wp.func
    def field_divergence(part: Any, arg: Any, geo: Any, s: Any):
        return wp.trace(gradient(part, arg, geo, s))

    return _with_node(field_divergence, reference)


def _with_node(function, reference):
    """A function of a node, too, if the reference values are those of one node."""
    if not reference.one_node:
        return function

    @wp.func
    def of_node(part: Any, arg: Any, geo: Any, s: Any, node: int):
        return function(node, arg, geo, s)

    return of_node


class References:
    """Functions of reference values for the inner and the outer cell of a sample."""

    def __init__(self, inner, outer=None, one_node=False):
        self.sides = inner, outer or inner
        self.one_node = one_node

    def __getitem__(self, half):
        return self.sides[half]


class GeometryField(Field):
    """Base of fields over a geometry.

    Attributes:
        geometry: the geometry. domain_record: of the elements that it is evaluated on.
    """

    geometry = None
    kind = "cells"

    @property
    def description(self):
        """The compile-time part."""
        raise NotImplementedError

    def arg_value(self, device):
        """The run-time part, a struct or number."""
        return 0

    @property
    def ArgType(self):
        """Type of the run-time part."""
        return wp.int32

    @property
    def element_kind(self):
        """Cells, or sides for a trace."""
        from warp._src.fem.types import ElementKind

        return ElementKind.CELL if self.kind == "cells" else ElementKind.SIDE

    @property
    def dtype(self):
        """Type of the value."""
        return self.description.values.value

    @property
    def degree(self) -> int:
        """Polynomial degree, for the default order of rules."""
        return self.description.degree

    def gradient_valid(self) -> bool:
        """True if the gradient is defined."""
        return not extend.type_is_matrix(self.dtype)

    def divergence_valid(self) -> bool:
        """True if the divergence is defined."""
        shape = getattr(self.dtype, "_shape_", ())
        return len(shape) > 0 and shape[0] == self.geometry.dimension

    @property
    def gradient_dtype(self):
        """Type of the gradient."""
        real, dimension = extend.type_scalar_type(self.dtype), self.geometry.dimension
        if extend.type_is_vector(self.dtype):
            return wp.types.matrix((self.dtype._length_, dimension), real)
        return wp.types.vector(dimension, real)

    @property
    def name(self) -> str:
        """Name in messages."""
        return type(self).__name__

    def make_deformed_geometry(self, relative=True, **options):
        """The geometry with positions moved by the field, or given by it if not relative."""
        from warp._src.fem.geometry.deformed import DeformedGeometry

        return DeformedGeometry(self, relative=relative, **options)


FieldLike = GeometryField
