"""Pieces of cells for pictures - triangles, tetrahedra and hexahedra of nodes, and cells of VTK."""

from __future__ import annotations

import itertools

import numpy as np

from warp._src.fem.cells import simplices
from warp._src.fem.cells.cell import CUBE, SQUARE, TET, TRIANGLE
from warp._src.fem.cells.layout import ElementBasis
from warp._src.fem.grids import grid_to_hexes, grid_to_quads, grid_to_tets, grid_to_tris

_LAGRANGE, _SERENDIPITY = ElementBasis.LAGRANGE, ElementBasis.SERENDIPITY
_DISCONTINUOUS, _SPLINE = ElementBasis.NONCONFORMING_POLYNOMIAL, ElementBasis.BSPLINE


def _lattice_pieces(cell, degree):
    """Simplices between the nodes of a lattice, by Kuhn's triangulation: in sums of the steps the
    simplex is n >= X >= Y >= Z, which unit cubes cut into paths of axes fill."""
    size = cell.dimension
    numbers = {}
    for k, (steps, _) in enumerate(simplices.lattice(cell, degree)):
        numbers[tuple(int(n) for n in np.cumsum(steps[:0:-1])[::-1])] = k
    pieces = []
    for start in itertools.product(range(degree), repeat=size):
        for path in itertools.permutations(range(size)):
            at, piece = list(start), [numbers.get(tuple(start))]
            for axis in path:
                at[axis] += 1
                piece.append(numbers.get(tuple(at)))
            if None not in piece:
                pieces.append(piece)
    return np.array(pieces)


def _serendipity_triangles(element):
    """A triangle at each corner, and a fan of the nodes in edges."""
    places = element.node_coords[:, :2] - 0.5
    around = sorted(range(len(places)), key=lambda k: np.arctan2(places[k, 1], places[k, 0]))
    count = len(around)
    corners = [
        [around[k - 1], around[k], around[(k + 1) % count]] for k in range(count) if around[k] < 4
    ]
    inner = [k for k in around if k >= 4]
    return np.array(corners + [[inner[0], a, b] for a, b in itertools.pairwise(inner[1:])])


def _spline_middle(element, whole):
    """The piece between the middle nodes: the cell itself."""
    pieces = whole(*(len(element.definition.data) - 1,) * element.cell.dimension)
    return pieces[len(pieces) // 2][None]


def _triangles(element):
    cell, basis, degree = element.cell, element.basis, element.degree
    if cell.dimension != 2 or degree == 0:
        return None
    if (cell == TRIANGLE and basis is _LAGRANGE) or basis is _DISCONTINUOUS:
        return _lattice_pieces(TRIANGLE, degree)
    if cell == SQUARE and basis is _LAGRANGE:
        return grid_to_tris(degree, degree)
    if basis is _SERENDIPITY:
        return _serendipity_triangles(element)
    if basis is _SPLINE:
        return _spline_middle(element, grid_to_quads)[0][[[0, 1, 2], [0, 2, 3]]]
    return None


def _tets(element):
    cell, basis, degree = element.cell, element.basis, element.degree
    if cell.dimension != 3 or degree == 0:
        return None
    if (cell == TET and basis is _LAGRANGE) or basis is _DISCONTINUOUS:
        return _lattice_pieces(TET, degree)
    return grid_to_tets(degree, degree, degree) if basis is _LAGRANGE else None


def _hexes(element):
    if element.cell != CUBE or element.degree == 0:
        return None
    if element.basis is _SPLINE:
        return _spline_middle(element, grid_to_hexes)
    degree = element.degree
    return grid_to_hexes(degree, degree, degree) if element.basis is _LAGRANGE else None


def _vtk_places(dimension, degree):
    """Places of the nodes of a square or cube in the order of VTK's Lagrange cells."""
    inner = range(1, degree)
    ends = [(0, 0), (degree, 0), (degree, degree), (0, degree)]
    around = [(t, 0) for t in inner], [(degree, t) for t in inner]
    around = [*around, [(t, degree) for t in inner], [(0, t) for t in inner]]
    square = [place for edge in around for place in edge]
    if dimension == 2:
        return [*ends, *square, *((x, y) for y in inner for x in inner)]
    places = [(*end, z) for z in (0, degree) for end in ends]
    places += [(*place, z) for z in (0, degree) for place in square]
    places += [(*end, t) for end in ends for t in inner]
    for axis, end in itertools.product(range(3), (0, degree)):
        for b, a in itertools.product(inner, repeat=2):
            place = [a, b]
            place.insert(axis, end)
            places.append(tuple(place))
    return places + [(x, y, z) for z in inner for y in inner for x in inner]


def _vtk(element):
    """Nodes of the cells of VTK in an element, and the type of the cells."""
    cell, basis, degree = element.cell, element.basis, element.degree
    if degree == 0:
        return np.zeros((1, 1), int), 1
    if basis is _DISCONTINUOUS or (cell in (TRIANGLE, TET) and basis is _LAGRANGE):
        types = (5, 69) if cell.dimension == 2 else (10, 71)
        return np.arange(element.node_count)[None], types[degree > 1]
    if basis is _LAGRANGE:
        shape = (degree + 1,) * cell.dimension
        places = np.array(_vtk_places(cell.dimension, degree))
        types = (9, 70) if cell == SQUARE else (12, 72)
        return np.ravel_multi_index(places.T, shape)[None], types[degree > 1]
    if basis is _SPLINE:
        whole, kind = (grid_to_quads, 9) if cell == SQUARE else (grid_to_hexes, 12)
        return _spline_middle(element, whole), kind
    if basis is _SERENDIPITY and cell == SQUARE:
        return _serendipity_triangles(element), 5
    if basis is _SERENDIPITY:
        return np.array([[0, 4, 6, 2, 1, 5, 7, 3]]), 12
    return None


_PIECES = {"node_triangulation": _triangles, "node_tets": _tets, "node_hexes": _hexes}


def has_pieces(element, name: str) -> bool:
    """True if the nodes of an element have pieces of this name."""
    return (_vtk if name == "vtk_cells" else _PIECES[name])(element) is not None


def pieces_of(basis, name: str):
    """Pieces of all cells by the numbers of their nodes, (pieces, n): triangles, tetrahedra or
    hexahedra; for "vtk_cells" numbers of nodes, each cell's count first, and a type per cell."""
    kind = None
    if name == "vtk_cells":
        pieces, kind = _vtk(basis.element)
    else:
        pieces = _PIECES[name](basis.element)
    nodes = basis.topology.element_node_indices().numpy()
    cells = nodes[:, pieces].reshape(-1, pieces.shape[1])
    if kind is None:
        return cells
    counts = np.full((len(cells), 1), pieces.shape[1])
    return np.hstack((counts, cells)).ravel(), np.full(len(cells), kind, dtype=np.int8)
