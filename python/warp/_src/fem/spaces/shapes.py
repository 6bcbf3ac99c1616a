"""Shape functions - finite elements as objects with makers of functions of kernels."""

from __future__ import annotations

import functools
from enum import Enum

import warp as wp
from warp._src.fem.cells.element import Element, make_element
from warp._src.fem.cells.functions import element_functions
from warp._src.fem.cells.layout import ElementBasis


class Value(Enum):
    """Kinds of basis functions."""

    Scalar = 0
    """Numbers."""
    CovariantVector = 1
    """Vectors of covariant spaces."""
    ContravariantVector = 2
    """Vectors of contravariant spaces."""


def value_kind(element: Element | None) -> Value:
    """Kind of the basis functions of an element."""
    kinds = {"covariant": Value.CovariantVector, "contravariant": Value.ContravariantVector}
    return kinds.get(element.map if element else "identity", Value.Scalar)


class ShapeFunction:
    """Basis functions of an element.

    Attributes:
        element: the record of the element.
        scalar_type: scalar type of coordinates and values.
        ORDER: polynomial degree.
        NODES_PER_ELEMENT: number of nodes.
        VERTEX_NODE_COUNT, EDGE_NODE_COUNT, FACE_NODE_COUNT, INTERIOR_NODE_COUNT: nodes per vertex,
            inside of each edge and face, and of the cell.
        value: kind of basis functions.
    """

    Value = Value

    def __init__(self, element: Element, scalar_type: type = wp.float32):
        self.element, self.scalar_type = element, scalar_type
        self.ORDER, self.NODES_PER_ELEMENT = element.degree, element.node_count
        counts = element.layout.counts
        self.VERTEX_NODE_COUNT, self.EDGE_NODE_COUNT = counts[0], counts[1]
        self.FACE_NODE_COUNT, self.INTERIOR_NODE_COUNT = counts[2], counts[3]

    @property
    def value(self) -> Value:
        """Kind of basis functions."""
        return value_kind(self.element)

    @property
    def family(self):
        """The rule that places the nodes, a `Polynomial`."""
        return self.element.variant

    @property
    def name(self) -> str:
        """Cell, family and degree in one word."""
        element = self.element
        return f"{element.cell}_{element.basis.value}{element.degree}_{element.variant}"

    @property
    def functions(self):
        """Functions of kernels."""
        return element_functions(self.element, self.scalar_type)

    def make_node_coords_in_element(self) -> wp.Function:
        """A function of kernels of (node): the node's coordinates."""
        return self.functions.node_coords

    def make_node_quadrature_weight(self) -> wp.Function:
        """A function of kernels of (node): the node's weight in a rule over the cell."""
        return self.functions.node_weight

    def make_trace_node_quadrature_weight(self) -> wp.Function:
        """A function of kernels of (node): the node's weight in a rule over a side."""
        return self.functions.trace_weight

    def make_element_inner_weight(self) -> wp.Function:
        """A function of kernels of (coordinates, node): a basis function."""
        return self.functions.value

    def make_element_inner_weight_gradient(self) -> wp.Function:
        """A function of kernels of (coordinates, node): a gradient by parameters."""
        return self.functions.gradient


@functools.cache
def make_element_shape_function(
    element,
    degree: int,
    element_basis: ElementBasis | None = None,
    family=None,
    scalar_type: type | None = None,
) -> ShapeFunction:
    """Basis functions of a reference cell.

    Args:
        element: the cell.
        degree: polynomial degree.
        element_basis: family of basis functions; Lagrange if not given.
        family: where the nodes lie, a `Polynomial`.
        scalar_type: scalar type of coordinates; float32 if not given.

    Raises:
        ValueError: the cell has no such element.
    """
    made = make_element(element, degree, element_basis, family)
    return ShapeFunction(made, wp.float32 if scalar_type is None else scalar_type)


class ConstantShapeFunction(ShapeFunction):
    """The constant of a cell."""

    def __init__(self, element, scalar_type: type = wp.float32):
        super().__init__(make_element(element, 0), scalar_type)
