"""Vector families of elements - Nedelec's of the first kind and that of Raviart and Thomas.

Degrees of freedom are components at points: along edges or faces, across sides, and along the axes
inside. Points in edges and faces and the components there are the same for all their cells, up to
signs, so tangential or normal components are continuous. Degree 1 has the usual one per edge or
side, the integral of the component.

Squares and cubes have products of Lagrange polynomials, at Gauss points along an axis and at
Gauss-Lobatto points along others. Simplices have the polynomials of degree k - 1 and those of
degree k that Nedelec (1980) adds, in monomials around the centre.
"""

from __future__ import annotations

import functools
import itertools

import numpy as np

from warp._src.fem.cells import simplices
from warp._src.fem.cells.cell import CUBE, SQUARE, TET, TRIANGLE
from warp._src.fem.cells.definitions import (
    Definition,
    box_entity,
    lagrange_1d,
    make_layout,
    square_turns,
)
from warp._src.fem.cells.families import monomials
from warp._src.fem.cells.polynomial import Polynomial, quadrature_1d


def vector_valued(element) -> Definition:
    """The numbers of a Nedelec or Raviart-Thomas element.

    Raises:
        ValueError: the cell has no such element.
    """
    if element.cell in (SQUARE, CUBE):
        return _box(element)
    if element.cell in (TRIANGLE, TET):
        return _simplex(element)
    raise ValueError(f"{element.basis.name} needs a cell of 2 or 3 axes, but got {element.cell}")


def _weights(element, entities):
    """Weights of nodes over the cell and over each of its sides."""
    count = len(entities)
    side = element.cell.dimension - 1
    on_side = sum(1 for e in entities if e[0] == side and e[1] == 0)
    if side == 2:
        vertices = set(element.cell.faces[0])
        edges = [k for k, e in enumerate(element.cell.edges) if vertices.issuperset(e)]
        on_side += sum(1 for e in entities if e[0] == 1 and e[1] in edges)
    traces = [1.0 / on_side if e[0] <= side else 0.0 for e in entities]
    return np.full(count, 1.0 / count), np.array(traces)


# Squares and cubes.


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
    signs = None if is_curl else _side_signs(cell, entities, at, np.eye(cell.dimension)[axes])
    layout = make_layout(element, entities, **turns, side_signs=signs)
    data = (gauss, lobatto, np.column_stack((axes, places)), is_curl)
    duals = np.eye(cell.dimension)[axes]
    weights, traces = _weights(element, entities)
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


def _side_signs(cell, entities, places, directions):
    """1 for the sides whose nodes have directions out of the cell, -1 for others."""
    signs, center = {}, cell.vertices.mean(axis=0)
    for entity, place, direction in zip(entities, places, directions, strict=True):
        if entity[0] == cell.dimension - 1:
            signs[entity[1]] = 1 if direction @ (place - center) > 0.0 else -1
    return tuple(signs[k] for k in range(len(signs)))


def _box_turns(cell, degree, is_curl):
    """Turns and signs of the nodes of edges and faces."""
    edges = _edge_turns(degree, -1 if is_curl else 1)
    if cell == SQUARE:
        return {"edge_turns": edges}
    if not is_curl:
        turns = square_turns(degree**2)
        return {"face_turns": tuple((numbers, (1,) * len(numbers)) for numbers in turns)}
    faces = tuple(_tangential_turn(degree, order) for order in range(8))
    return {"edge_turns": edges, "face_turns": faces if degree > 1 else None}


def _edge_turns(degree, sign):
    along = tuple(range(degree))
    return (along, (1,) * degree), (along[::-1], (sign,) * degree)


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


# Triangles and tetrahedra.


def _exponents(dimension, degree):
    every = itertools.product(range(degree + 1), repeat=dimension)
    return np.array(sorted((e for e in every if sum(e) <= degree), key=lambda e: (sum(e), e)))


@functools.cache
def _span(dimension, degree, is_curl):
    """Coefficients (functions, axes, monomials) of a basis of the polynomials of an element."""
    exponents = _exponents(dimension, degree)
    index = {tuple(e): k for k, e in enumerate(exponents.tolist())}
    made = []
    for e, axis in itertools.product(exponents.tolist(), range(dimension)):
        if sum(e) < degree:
            one = np.zeros((dimension, len(exponents)))
            one[axis, index[tuple(e)]] = 1.0
            made.append(one)
    plain = len(made)

    def times(e, axis):
        return index[tuple(n + (a == axis) for a, n in enumerate(e))]

    for e in exponents.tolist():
        if sum(e) != degree - 1:
            continue
        for kind in range(1 if not is_curl or dimension == 2 else 3):
            one = np.zeros((dimension, len(exponents)))
            if not is_curl:
                for axis in range(dimension):
                    one[axis, times(e, axis)] = 1.0
            elif dimension == 2:
                one[0, times(e, 1)], one[1, times(e, 0)] = -1.0, 1.0
            else:
                u, v = (kind + 1) % 3, (kind + 2) % 3
                one[u, times(e, v)], one[v, times(e, u)] = -1.0, 1.0
            made.append(one)
    made = np.array(made).reshape(len(made), -1)
    # The functions that are added are not independent for curls in space.
    added = made[plain:]
    _, sizes, rows = np.linalg.svd(added, full_matrices=False)
    made = np.concatenate((made[:plain], rows[sizes > 1e-10 * sizes[0]]))
    return exponents, made.reshape(len(made), dimension, -1)


def _simplex_nodes(element, ranks):
    """(entity, place, direction) of each node for an order of the vertices."""
    cell, k, is_curl = element.cell, element.degree, element.map == "covariant"
    corners, dimension = cell.vertices, cell.dimension
    gauss, _ = quadrature_1d(k, Polynomial.GAUSS_LEGENDRE)
    nodes = []
    if is_curl or dimension == 2:
        for number, (a, b) in enumerate(cell.edges):
            tangent = corners[b] - corners[a]
            direction = tangent if is_curl else np.array([tangent[1], -tangent[0]])
            for i, s in enumerate(gauss):
                nodes.append(((1, number, i), corners[a] + s * tangent, direction))
    if dimension == 3:
        inside = simplices.interior(2, k + 1 if is_curl else k + 2)
        total = k - 2 if is_curl else k - 1
        for number, face in enumerate(cell.faces):
            for i, steps in enumerate(inside):
                # Points inside of the face: a lattice whose ends are moved inwards.
                mix = (np.array(steps, float) - 2.0 / 3.0) / (total + 1.0)
                place = mix @ corners[list(face)]
                if is_curl:
                    v = sorted(face, key=lambda vertex: ranks[vertex])
                    for c in (0, 1):
                        direction = corners[v[c + 1]] - corners[v[0]]
                        nodes.append(((2, number, 2 * i + c), place, direction))
                else:
                    a, b, c = corners[list(face)]
                    nodes.append(((2, number, i), place, 0.5 * np.cross(b - a, c - a)))
    inner = k - dimension if is_curl else k - 2
    if inner >= 0:
        number = 0
        for steps, _ in simplices.lattice(cell, inner):
            mix = (np.array(steps, float) + 1.0 / (dimension + 1)) / (inner + 1.0)
            for direction in np.eye(dimension):
                nodes.append(((dimension, 0, number), mix @ corners, direction))
                number += 1
    return nodes


def _simplex(element):
    cell, degree, is_curl = element.cell, element.degree, element.map == "covariant"
    dimension = cell.dimension
    exponents, span = _span(dimension, degree, is_curl)
    center, scale = cell.vertices.mean(axis=0), 2.0
    oriented = is_curl and dimension == 3 and degree > 1
    orders = list(itertools.permutations(range(dimension + 1))) if oriented else [(0, 1, 2, 3)]
    tables, duals = [], []
    for ranks in orders:
        nodes = _simplex_nodes(element, ranks)
        places = np.array([node[1] for node in nodes])
        directions = np.array([node[2] for node in nodes])
        powers, _ = monomials(exponents, scale * (places - center))
        functionals = np.einsum("nd,nm,sdm->ns", directions, powers, span)
        tables.append(np.einsum("sn,sdm->ndm", np.linalg.inv(functionals), span))
        duals.append(directions)

    def tabulate(coords, orientation):
        powers, slopes = monomials(exponents, scale * (cell.parameters(coords) - center))
        coefficients = tables[orientation]
        values = np.einsum("qm,ndm->qnd", powers, coefficients)
        return values, scale * np.einsum("qme,ndm->qnde", slopes, coefficients)

    entities = [node[0] for node in nodes]
    turns = _simplex_turns(cell, degree, is_curl)
    signs = None if is_curl else _side_signs(cell, entities, places, directions)
    layout = make_layout(element, entities, **turns, side_signs=signs)
    weights, traces = _weights(element, entities)
    data = (exponents, np.array(tables), center, scale, np.array(duals))
    return Definition(
        "vectors",
        layout,
        cell.coords(places),
        weights,
        traces,
        tabulate,
        degree,
        data,
        duals[0],
        len(orders),
    )


def _simplex_turns(cell, degree, is_curl):
    """Turns and signs of the nodes of edges and faces."""
    edges = _edge_turns(degree, -1 if is_curl else 1)
    if cell == TRIANGLE:
        return {"edge_turns": edges}
    if is_curl:
        if degree == 1:
            return {"edge_turns": edges}
        turns = simplices.face_turns(degree + 1)
        both = [[2 * number + c for number in numbers for c in (0, 1)] for numbers in turns]
        faces = tuple((tuple(numbers), (1,) * len(numbers)) for numbers in both)
        return {"edge_turns": edges, "face_turns": faces}
    turns = simplices.face_turns(degree + 2)
    return {"face_turns": tuple((numbers, (1,) * len(numbers)) for numbers in turns)}
