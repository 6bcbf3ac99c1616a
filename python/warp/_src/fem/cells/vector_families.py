"""Vector families of elements - Nedelec of the first kind, Raviart-Thomas; squares and cubes.

Degrees of freedom are components at points: along edges or faces, across sides, and along the axes
inside. Points in edges and faces and the components there are the same for all their cells, up to
signs, so tangential or normal components are continuous. Degree 1 has the usual one per edge or
side, the integral of the component.

Squares and cubes have products of Lagrange polynomials, at Gauss points along an axis and at
Gauss-Lobatto points along others. Simplices have the polynomials of degree k - 1 and those of
degree k that Nedelec (1980) adds, in monomials around the centre.
"""

from __future__ import annotations

import itertools

import numpy as np

from warp._src.fem.cells.cell import CUBE, SQUARE, TET, TRIANGLE
from warp._src.fem.cells.definitions import (
    Definition,
    box_entity,
    lagrange_1d,
    make_layout,
    square_turns,
    unsigned,
)
from warp._src.fem.cells.polynomial import Polynomial, quadrature_1d
from warp._src.fem.cells.vector_simplices import edge_turns, equal_weights, side_signs, simplex


def vector_valued(element) -> Definition:
    """The numbers of a Nedelec or Raviart-Thomas element.

    Raises:
        ValueError: the cell has no such element.
    """
    if element.cell in (SQUARE, CUBE):
        return _box(element)
    if element.cell in (TRIANGLE, TET):
        return simplex(element)
    raise ValueError(f"{element.basis.name} needs a cell of 2 or 3 axes, but got {element.cell}")


def _box(element):
    cell, degree = element.cell, element.degree
    is_curl = element.map == "covariant"
    gauss, _ = quadrature_1d(degree, Polynomial.GAUSS_LEGENDRE)
    lobatto, _ = quadrature_1d(degree + 1, Polynomial.LOBATTO_GAUSS_LEGENDRE)
    nodes = []
    for axis in range(cell.dimension):
        own = [(a == axis) == is_curl for a in range(cell.dimension)]
        for place in itertools.product(*(range(degree + (not o)) for o in own)):
            entity = _box_node(cell, degree, axis, own, place)
            nodes.append((entity, axis, place, own))
    nodes.sort(key=lambda node: node[0])
    entities = _renumbered(cell, [node[0] for node in nodes])
    axes = np.array([node[1] for node in nodes])
    places = np.array([node[2] for node in nodes])
    at = np.array(
        [
            [(gauss if o else lobatto)[i] for i, o in zip(place, own, strict=True)]
            for _, _, place, own in nodes
        ]
    )

    def tabulate(coords, orientation):
        x = coords[:, : cell.dimension]
        lines = [(lagrange_1d(gauss, c), lagrange_1d(lobatto, c)) for c in x.T]
        values = np.zeros((len(x), len(nodes), cell.dimension))
        gradients = np.zeros((*values.shape, cell.dimension))
        for n, (_, axis, place, own) in enumerate(nodes):
            parts = [lines[a][0 if o else 1] for a, o in enumerate(own)]
            parts = [(part[0][:, i], part[1][:, i]) for part, i in zip(parts, place, strict=True)]
            values[:, n, axis] = np.prod([part[0] for part in parts], axis=0)
            for b in range(cell.dimension):
                factors = [part[a == b] for a, part in enumerate(parts)]
                gradients[:, n, axis, b] = np.prod(factors, axis=0)
        return values, gradients

    turns = _box_turns(cell, degree, is_curl)
    signs = None if is_curl else side_signs(cell, entities, at, np.eye(cell.dimension)[axes])
    layout = make_layout(element, entities, **turns, side_signs=signs)
    data = (gauss, lobatto, np.column_stack((axes, places)), is_curl)
    duals = np.eye(cell.dimension)[axes]
    weights, traces = equal_weights(element, entities)
    coords = cell.coords(at)
    return Definition("box_vectors", layout, coords, weights, traces, tabulate, degree, data, duals)


def _box_node(cell, degree, axis, own, place):
    """Entity of a node: Gauss points are inside of the cell along their axis."""
    # Places of a lattice of the next degree, whose ends are those of the Lobatto points.
    last = degree + 1
    ends = {degree: last}
    spread = [i + 1 if o else ends.get(i, i) for i, o in zip(place, own, strict=True)]
    dimension, number, _ = box_entity(cell, spread, last)
    if dimension == cell.dimension:
        return dimension, 0, (axis, *place)
    if dimension == 1:
        along = next(a for a in range(cell.dimension) if 0 < spread[a] < last)
        return 1, number, place[along] if own[along] else place[along] - 1
    normal = next(a for a in range(3) if spread[a] in (0, last))
    u, v = (normal + 1) % 3, (normal + 2) % 3
    if own[u] and own[v]:
        return 2, number, place[u] * degree + place[v]
    if own[u]:
        return 2, number, place[u] * (degree - 1) + place[v] - 1
    return 2, number, degree * (degree - 1) + (place[u] - 1) * degree + place[v]


def _renumbered(cell, entities):
    """Entities with numbers in place of keys for the nodes inside of the cell."""
    first = next((k for k, e in enumerate(entities) if e[0] == cell.dimension), len(entities))
    inner = [(cell.dimension, 0, k) for k in range(len(entities) - first)]
    return entities[:first] + inner


def _box_turns(cell, degree, is_curl):
    """Turns and signs of the nodes of edges and faces."""
    edges = edge_turns(degree, -1 if is_curl else 1)
    if cell == SQUARE:
        return {"edge_turns": edges}
    if not is_curl:
        return {"face_turns": unsigned(square_turns(degree**2))}
    faces = tuple(_tangential_turn(degree, order) for order in range(8))
    return {"edge_turns": edges, "face_turns": faces if degree > 1 else None}


def _tangential_turn(degree, order):
    """Numbers and signs of the nodes of a face with two tangential components."""
    corner, swapped = divmod(order, 2)
    flips, first = (corner >> 1, corner & 1), degree * (degree - 1)
    numbers, signs = [], []
    for component in (0, 1):
        sizes = (degree, degree - 1) if component == 0 else (degree - 1, degree)
        for i, j in itertools.product(range(sizes[0]), range(sizes[1])):
            i, j = sizes[0] - 1 - i if flips[0] else i, sizes[1] - 1 - j if flips[1] else j
            kind = component
            if swapped:
                i, j, kind = j, i, 1 - component
            numbers.append(kind * first + i * (degree - 1 + kind) + j)
            signs.append(-1 if flips[component] else 1)
    return tuple(numbers), tuple(signs)
