"""Finite elements - basis functions of a reference cell, as records of plain values.

An `Element` says which basis: its numbers are worked out in float64 the first time that they are
asked for, and are the same for equal records. Nodes belong to entities of the cell (vertices,
edges, faces, the inside), which is how spaces number them.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from warp._src.fem.cells import definitions
from warp._src.fem.cells.cell import Cell
from warp._src.fem.cells.layout import ElementBasis, Layout
from warp._src.fem.cells.polynomial import Polynomial


@dataclass(frozen=True)
class Element:
    """A finite element on a reference cell.

    Attributes:
        cell: the reference cell.
        basis: family of basis functions.
        degree: polynomial degree.
        variant: where the nodes lie, for Lagrange and serendipity elements.
    """

    cell: Cell
    basis: ElementBasis
    degree: int
    variant: Polynomial

    def __reduce__(self):
        # The numbers are worked out anew.
        return Element, (self.cell, self.basis, self.degree, self.variant)

    @functools.cached_property
    def definition(self):
        """The numbers of the element."""
        basis = self.basis
        if basis is ElementBasis.LAGRANGE:
            return definitions.lagrange(self)
        if self.map != "identity":
            from warp._src.fem.cells.vector_families import vector_valued

            return vector_valued(self)
        from warp._src.fem.cells import families

        makers = {
            ElementBasis.SERENDIPITY: families.serendipity,
            ElementBasis.NONCONFORMING_POLYNOMIAL: families.nonconforming,
            ElementBasis.BSPLINE: families.bspline,
        }
        return makers[basis](self)

    @property
    def node_count(self) -> int:
        return len(self.definition.node_coords)

    @property
    def map(self) -> str:
        """How values go to a cell of a mesh: "identity", "covariant" or "contravariant"."""
        maps = {ElementBasis.NEDELEC_FIRST_KIND: "covariant"}
        return {**maps, ElementBasis.RAVIART_THOMAS: "contravariant"}.get(self.basis, "identity")

    @property
    def value_shape(self) -> tuple:
        return () if self.map == "identity" else (self.cell.dimension,)

    @property
    def layout(self) -> Layout:
        return self.definition.layout

    @property
    def node_coords(self) -> np.ndarray:
        """Coordinates of the nodes, (n, 3)."""
        return self.definition.node_coords

    @property
    def node_weights(self) -> np.ndarray:
        """Weights of the nodes as points of a rule over the cell, (n,); their sum is 1."""
        return self.definition.node_weights

    @property
    def trace_weights(self) -> np.ndarray:
        """Weights of the nodes as points of a rule over each side that they lie on, (n,)."""
        return self.definition.trace_weights

    @property
    def node_duals(self) -> np.ndarray:
        """The value at a node times this, or its product, is the node's degree of freedom: (n,) or
        (n, d)."""
        duals = self.definition.duals
        return np.ones(self.node_count) if duals is None else duals

    @property
    def is_continuous(self) -> bool:
        """True if nodes on sides are shared by cells, so that spaces may be conforming."""
        return any(count > 0 for count in self.layout.counts[: self.cell.dimension])

    @property
    def orientation_count(self) -> int:
        """Numbers of orders of a cell's vertices that give other basis functions."""
        return self.definition.orientation_count

    def tabulate(self, coords, orientation: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Basis functions at points.

        Args:
            coords: (q, 3) coordinates of points.
            orientation: which order of vertices, less than `orientation_count`.

        Returns:
            Values (q, n) or (q, n, d), and gradients by parameters (q, n, d) or (q, n, d, d): the
            derivative is the last index.
        """
        return self.definition.tabulate(np.asarray(coords, float).reshape(-1, 3), orientation)

    @property
    def monomial_degree(self) -> int:
        """Highest degree of the polynomials in one parameter or, of simplices, in all."""
        return self.definition.monomial_degree


@functools.cache
def make_element(
    cell: Cell,
    degree: int,
    basis: ElementBasis | None = None,
    variant: Polynomial | None = None,
) -> Element:
    """The record of an element.

    Args:
        degree: polynomial degree; 0 is a constant for every family.
        basis: family; Lagrange if not given.
        variant: where the nodes of Lagrange and serendipity elements lie on squares and cubes;
            at Gauss-Lobatto points if not given.

    Raises:
        ValueError: the cell has no such element.
    """
    if isinstance(degree, bool) or not isinstance(degree, (int, np.integer)) or degree < 0:
        raise ValueError(f"expects a degree of 0 or more, but got {degree!r}")
    basis = ElementBasis.LAGRANGE if basis is None else basis
    variant = Polynomial.LOBATTO_GAUSS_LEGENDRE if variant is None else variant
    if not isinstance(basis, ElementBasis):
        raise ValueError(f"expects an 'ElementBasis', but got {basis!r}")
    if not isinstance(variant, Polynomial):
        raise ValueError(f"expects a 'Polynomial' as the family of nodes, but got {variant!r}")
    if degree == 0 or (basis is ElementBasis.SERENDIPITY and degree == 1):
        basis = ElementBasis.LAGRANGE
    element = Element(cell, basis, int(degree), variant)
    element.definition  # noqa: B018 - raises if there is none
    return element
