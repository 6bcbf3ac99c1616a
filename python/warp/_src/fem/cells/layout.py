"""Layouts of elements - families of basis functions, and the entities that have the nodes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


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
        side_signs: of elements with normal components: 1 for sides where they point out of the
            cell, -1 for others. In a mesh they point out of the first cell of a side.
    """

    counts: tuple
    entities: tuple
    edge_turns: tuple = ()
    face_turns: tuple = ()
    side_signs: tuple = ()
