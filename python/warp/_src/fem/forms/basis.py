"""Bases of a plan - basis functions at its points, from tables where the points are known."""

import functools
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.fields.nodes import locations, signed_weights
from warp._src.fem.kept import Record, hashed


@hashed
@dataclass(frozen=True)
class Basis(Record):
    """Basis functions of a space at the points of a plan.

    rule: points that all elements share, or None; domain: record; half: 1 for the outer cell.
    """

    nodes: object
    domain: object
    rule: object
    half: int = 0

    @property
    def is_tabulated(self) -> bool:
        """True if values are read from a table."""
        element = self.nodes.element
        known = element is not None and self.rule is not None and self.domain.is_cells
        return known and element.orientation_count == 1

    @property
    def types(self) -> tuple:
        """Types of a basis function and of its gradient by reference coordinates."""
        real, dimension = self.domain.geometry.scalar, self.nodes.cell_dimension
        vector = wp.types.vector(dimension, real)
        if self.nodes.values.map == "identity":
            return real, vector
        return vector, wp.types.matrix((dimension, dimension), real)

    def make_functions(self) -> SimpleNamespace:
        """Makes functions of (table, topology argument, geometry argument, sample, point, node)."""
        return _basis_functions(self)


@functools.cache
def table_type(basis: Basis):
    """The struct that holds the tables of a basis."""
    value, gradient = basis.types
    fields = {"unused": wp.int32}
    if basis.is_tabulated:
        fields = {"values": wp.array2d(dtype=value), "gradients": wp.array2d(dtype=gradient)}
    return extend.struct_from_fields("BasisTable", fields, module=__name__)


@functools.cache
def table_value(basis: Basis, device):
    """The struct with the tables on a device: made once per basis."""
    table = table_type(basis)()
    if basis.is_tabulated:
        value, gradient = basis.types
        values, gradients = basis.nodes.element.tabulate(basis.rule.points)
        table.values = wp.array(np.ascontiguousarray(values), dtype=value, device=device)
        table.gradients = wp.array(np.ascontiguousarray(gradients), dtype=gradient, device=device)
    return table


def _basis_functions(basis: Basis) -> SimpleNamespace:
    Table, sign = table_type(basis), basis.nodes.topology.functions.element_node_sign
    if basis.is_tabulated and sign is None:

        @wp.func
        def value(table: Table, topology: Any, geo: Any, s: Any, q: int, k: int):
            return table.values[q, k]

        @wp.func
        def gradient(table: Table, topology: Any, geo: Any, s: Any, q: int, k: int):
            return table.gradients[q, k]

    elif basis.is_tabulated:

        @wp.func
        def value(table: Table, topology: Any, geo: Any, s: Any, q: int, k: int):
            return sign(geo, topology, s.element_index, k) * table.values[q, k]

        @wp.func
        def gradient(table: Table, topology: Any, geo: Any, s: Any, q: int, k: int):
            return sign(geo, topology, s.element_index, k) * table.gradients[q, k]

    else:
        at = locations(basis.domain, basis.half)
        cell_arg, cell, coords = at.cell_arg, at.cell, at.coords
        weight, weight_gradient = signed_weights(basis.nodes)

        @wp.func
        def value(table: Table, topology: Any, geo: Any, s: Any, q: int, k: int):
            return weight(cell_arg(geo), topology, cell(geo, s), coords(geo, s), k)

        @wp.func
        def gradient(table: Table, topology: Any, geo: Any, s: Any, q: int, k: int):
            return weight_gradient(cell_arg(geo), topology, cell(geo, s), coords(geo, s), k)

    return SimpleNamespace(value=value, gradient=gradient)
