"""Vector families of triangles and tetrahedra - spans and degrees of freedom at points."""

from __future__ import annotations

import functools
import itertools

import numpy as np

from warp._src.fem.cells import simplices
from warp._src.fem.cells.cell import TRIANGLE
from warp._src.fem.cells.definitions import Definition, make_layout, unsigned
from warp._src.fem.cells.families import monomials, total_degree
from warp._src.fem.cells.polynomial import Polynomial, quadrature_1d


@functools.cache
def _span(dimension, degree, is_curl):
    """Coefficients (functions, axes, monomials) of a basis of the polynomials of an element."""
    exponents = total_degree(dimension, degree)
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


def simplex(element) -> Definition:
    """The numbers of an element of a triangle or tetrahedron."""
    cell, degree, is_curl = element.cell, element.degree, element.map == "covariant"
    dimension = cell.dimension
    exponents, span = _span(dimension, degree, is_curl)
    center, scale = cell.vertices.mean(axis=0), 2.0
    oriented = is_curl and dimension == 3 and degree > 1
    orders = list(itertools.permutations(range(dimension + 1))) if oriented else [(0, 1, 2, 3)]
    tables, duals = [], None
    for ranks in orders:
        nodes = _simplex_nodes(element, ranks)
        places = np.array([node[1] for node in nodes])
        directions = np.array([node[2] for node in nodes])
        powers, _ = monomials(exponents, scale * (places - center))
        functionals = np.einsum("nd,nm,sdm->ns", directions, powers, span)
        tables.append(np.einsum("sn,sdm->ndm", np.linalg.inv(functionals), span))
        duals = directions if duals is None else duals

    def tabulate(coords, orientation):
        powers, slopes = monomials(exponents, scale * (cell.parameters(coords) - center))
        coefficients = tables[orientation]
        values = np.einsum("qm,ndm->qnd", powers, coefficients)
        return values, scale * np.einsum("qme,ndm->qnde", slopes, coefficients)

    entities = [node[0] for node in nodes]
    turns = _simplex_turns(cell, degree, is_curl)
    signs = None if is_curl else side_signs(cell, entities, places, directions)
    layout = make_layout(element, entities, **turns, side_signs=signs)
    weights, traces = equal_weights(element, entities)
    data = (exponents, np.array(tables), center, scale)
    return Definition(
        "vectors",
        layout,
        cell.coords(places),
        weights,
        traces,
        tabulate,
        degree,
        data,
        duals,
        len(orders),
    )


def _simplex_turns(cell, degree, is_curl):
    """Turns and signs of the nodes of edges and faces."""
    edges = edge_turns(degree, -1 if is_curl else 1)
    if cell == TRIANGLE:
        return {"edge_turns": edges}
    if is_curl:
        if degree == 1:
            return {"edge_turns": edges}
        turns = simplices.face_turns(degree + 1)
        both = [[2 * number + c for number in numbers for c in (0, 1)] for numbers in turns]
        return {"edge_turns": edges, "face_turns": unsigned(map(tuple, both))}
    return {"face_turns": unsigned(simplices.face_turns(degree + 2))}


def equal_weights(element, entities):
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


def side_signs(cell, entities, places, directions):
    """1 for the sides whose nodes have directions out of the cell, -1 for others."""
    signs, center = {}, cell.vertices.mean(axis=0)
    for entity, place, direction in zip(entities, places, directions, strict=True):
        if entity[0] == cell.dimension - 1:
            signs[entity[1]] = 1 if direction @ (place - center) > 0.0 else -1
    return tuple(signs[k] for k in range(len(signs)))


def edge_turns(degree, sign) -> tuple:
    """Turns of nodes that lie symmetrically along edges."""
    along = tuple(range(degree))
    return (along, (1,) * degree), (along[::-1], (sign,) * degree)
