"""Finite elements - basis functions of a reference cell, as records of plain values.

An `Element` says which basis: its numbers are worked out in float64 the first time that they are
asked for, and are the same for equal records. Nodes belong to entities of the cell (vertices,
edges, faces, the inside), which is how spaces number them.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from enum import Enum

import numpy as np

from warp._src.fem.cells.cell import Cell
from warp._src.fem.cells.polynomial import Polynomial


class ElementBasis(Enum):
    """Families of basis functions."""

    LAGRANGE = "P"
    """Lagrange polynomials: of total degree on simplices, of that degree per axis on others."""

    SERENDIPITY = "S"
    """Serendipity elements, without nodes inside; of squares and cubes."""

    NONCONFORMING_POLYNOMIAL = "dP"
    """Polynomials of total degree on any cell, discontinuous between cells."""

    NEDELEC_FIRST_KIND = "N1"
    """Nedelec elements of the first kind, for covariant spaces: H(curl)."""

    RAVIART_THOMAS = "RT"
    """Raviart-Thomas elements, for contravariant spaces: H(div)."""

    BSPLINE = "B"
    """B-splines on grids, smooth between cells."""


@dataclass(frozen=True)
class Layout:
    """Nodes of an element, by entity.

    Attributes:
        counts: nodes per vertex, edge, face (of three-dimensional cells) and in the cell.
        entities: for each node (dimension, number of the entity, number in the entity).
        edge_turns: for edges in their direction and for reversed ones, the number in the entity
            and the sign (1 or -1) that nodes of the edge have for all its cells.
        face_turns: the same for each order of the vertices of a face: order 2 c + s has the
            least vertex at c, and s is 1 if the next vertices of the face swap.
    """

    counts: tuple
    entities: tuple
    edge_turns: tuple = ()
    face_turns: tuple = ()


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

    @functools.cached_property
    def definition(self):
        """The numbers of the element."""
        from warp._src.fem.cells.definitions import definition

        return definition(self)

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
