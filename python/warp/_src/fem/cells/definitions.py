"""Numbers of finite elements - nodes, layouts and tables of each family."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from warp._src.fem.cells import simplices
from warp._src.fem.cells.cell import LINE, POINT, TET, TRIANGLE
from warp._src.fem.cells.layout import Layout
from warp._src.fem.cells.polynomial import (
    Polynomial,
    is_closed,
    lagrange_scales,
    quadrature_1d,
)


@dataclass(frozen=True, eq=False)
class Definition:
    """The numbers that a record stands for; `Element` documents the fields.

    Attributes:
        kind: which functions of kernels evaluate the basis.
        data: the numbers that those need.
    """

    kind: str
    layout: Layout
    node_coords: np.ndarray
    node_weights: np.ndarray
    trace_weights: np.ndarray
    tabulate: Callable
    monomial_degree: int
    data: object = None
    duals: np.ndarray | None = None
    orientation_count: int = 1


def lagrange(element) -> Definition:
    """Lagrange elements, and the constants of degree 0."""
    if element.degree == 0:
        return _constant(element)
    return _lattice(element) if element.cell in (TRIANGLE, TET) else _tensor(element)


def make_layout(element, entities, edge_turns=None, face_turns=None, side_signs=None) -> Layout:
    """A layout from the entity of each node; entities of a dimension have equally many. Turns are
    those of values at points, which keep their sign, if they are not given."""
    dimension = element.cell.dimension
    counts = [0, 0, 0, 0]
    for d in range(dimension + 1):
        of_first = sum(1 for e in entities if e[0] == d and e[1] == 0)
        counts[3 if d == dimension else d] = of_first
    edges, faces = counts[1], counts[2]
    if edge_turns is None and edges:
        along = tuple(range(edges))
        edge_turns = unsigned((along, along[::-1]))
    if face_turns is None and faces:
        is_simplex = element.cell == TET
        face_turns = simplices.face_turns(element.degree) if is_simplex else square_turns(faces)
        face_turns = unsigned(face_turns)
    turns = (edge_turns or (), face_turns or ())
    return Layout(tuple(counts), tuple(entities), *turns, tuple(side_signs or ()))


def unsigned(turns) -> tuple:
    """Turns of nodes that keep their sign, by their numbers."""
    return tuple((numbers, (1,) * len(numbers)) for numbers in turns)


def square_turns(count) -> tuple:
    """For each of the eight orders of a square's vertices, the numbers of the nodes of a regular
    grid inside: rows along the axis from the least vertex to the lesser of its neighbours."""
    m = round(count**0.5)
    turns = []
    for corner, swapped in itertools.product(range(4), (0, 1)):
        numbers = []
        for i, j in itertools.product(range(m), repeat=2):
            i, j = m - 1 - i if corner & 2 else i, m - 1 - j if corner & 1 else j
            numbers.append(j * m + i if swapped else i * m + j)
        turns.append(tuple(numbers))
    return tuple(turns)


def _constant(element):
    cell = element.cell

    def tabulate(coords, orientation):
        ones = np.ones((len(coords), 1))
        return ones, np.zeros((len(coords), 1, cell.dimension))

    entities = ((cell.dimension, 0, 0),)
    layout = make_layout(element, entities)
    one = np.ones(1)
    return Definition("constant", layout, cell.center[None], one, one, tabulate, 0)


def barycentric(cell, coords) -> np.ndarray:
    """Barycentric coordinates of points of a simplex, (q, d + 1)."""
    if cell == TRIANGLE:
        return coords
    parameters = coords[:, : cell.dimension]
    return np.column_stack((1.0 - parameters.sum(axis=1), parameters))


def _lattice(element):
    """Lagrange elements of triangles and tetrahedra."""
    cell, degree = element.cell, element.degree
    nodes = simplices.lattice(cell, degree)
    steps = np.array([place for place, _ in nodes])

    def tabulate(coords, orientation):
        values, slopes = simplices.powers(steps, barycentric(cell, coords))
        return values, slopes[..., 1:] - slopes[..., :1]

    entities = [entity for _, entity in nodes]
    layout = make_layout(element, entities)
    coords = cell.coords(steps[:, 1:] / degree)
    weights = _lattice_weights(cell, degree, entities)
    sides = TRIANGLE if cell == TET else LINE
    traces = _trace_weights(sides, degree, entities)
    return Definition("lattice", layout, coords, weights, traces, tabulate, degree, steps)


@functools.cache
def _entity_weights(dimension, degree):
    """Weights of the nodes at vertices, in edges, in faces and inside of a simplex.

    Degrees 1 and 3 of triangles and 1 of tetrahedra integrate the basis functions. Where those
    integrals are not positive, weights are the ones of least error for monomials of twice the
    degree, and from degree 4 on they are equal.
    """
    nodes = simplices.lattice({1: LINE, 2: TRIANGLE, 3: TET}[dimension], degree)
    kinds = np.array([entity[0] for _, entity in nodes])
    equal = np.full(dimension + 1, 1.0 / len(nodes))
    if dimension == 1:
        _, weights = quadrature_1d(degree + 1, Polynomial.EQUISPACED_CLOSED)
        return np.array([weights[0], weights[1]]) if (weights > 0).all() else equal
    if degree == 1 or degree > 3 or (dimension == 3 and degree == 2):
        return equal
    if dimension == 2 and degree == 3:
        return np.array([1.0 / 30.0, 3.0 / 40.0, 9.0 / 20.0])
    fitted = {(2, 2): (0.022335964126, 0.310997369207, 0.0)}
    fitted[3, 3] = (0.007348845656, 0.020688129855, 0.180586764778, 0.0)
    weights = np.array(fitted[dimension, degree])
    return weights / weights[kinds].sum()


def _lattice_weights(cell, degree, entities):
    weights = _entity_weights(cell.dimension, degree)
    return np.array([weights[entity[0]] for entity in entities])


def _trace_weights(side, degree, entities):
    weights = np.append(_entity_weights(side.dimension, degree), 0.0)
    return np.array([weights[min(e[0], side.dimension + 1)] for e in entities])


def box_entity(cell, place, last):
    """Entity of the node at a place (numbers per axis, 0 to `last`) of a square or cube."""
    dimension = cell.dimension
    inside = [axis for axis in range(dimension) if 0 < place[axis] < last]
    ends = [int(p == last) for p in place]
    if not inside:
        return 0, int("".join(map(str, ends)), 2), 0
    step = last - 1
    if len(inside) == dimension:
        number = 0
        for p in place:
            number = number * step + p - 1
        return dimension, 0, number
    if len(inside) == 1:
        axis = inside[0]
        number = axis
        for shift in range(1, dimension):
            number = 2 * number + ends[(axis + shift) % dimension]
        return 1, number, place[axis] - 1
    axis = next(a for a in range(dimension) if a not in inside)
    u, v = (axis + 1) % dimension, (axis + 2) % dimension
    return 2, 2 * axis + ends[axis], (place[u] - 1) * step + place[v] - 1


def lagrange_1d(points, x) -> tuple[np.ndarray, np.ndarray]:
    """Lagrange polynomials of points and their derivatives at x: (q, n) each."""
    scales = lagrange_scales(points)
    count = len(points)
    values, slopes = np.empty((len(x), count)), np.empty((len(x), count))
    for i in range(count):
        value, slope = np.full(len(x), scales[i]), np.zeros(len(x))
        for k in range(count):
            if k != i:
                delta = x - points[k]
                slope = slope * delta + value
                value = value * delta
        values[:, i], slopes[:, i] = value, slope
    return values, slopes


def tensor_products(parts, slopes) -> tuple[np.ndarray, np.ndarray]:
    """Products of values per axis, and their gradients, of all places, last axis first."""

    def product(factors):
        made = factors[0]
        for factor in factors[1:]:
            made = (made[:, :, None] * factor[:, None, :]).reshape(len(made), -1)
        return made

    axes = range(len(parts))
    gradients = [product([slopes[a] if a == b else parts[a] for a in axes]) for b in axes]
    return product(parts), np.stack(gradients, axis=-1)


def _tensor(element):
    """Lagrange elements of lines, squares and cubes: products of polynomials of one parameter."""
    cell, degree, family = element.cell, element.degree, element.variant
    if cell == POINT:
        return _constant(element)
    points, weights = quadrature_1d(degree + 1, family)
    if degree == 1:
        weights = np.full(2, 0.5)
    places = list(np.ndindex(*(degree + 1,) * cell.dimension))

    def tabulate(coords, orientation):
        axes = [lagrange_1d(points, coords[:, a]) for a in range(cell.dimension)]
        return tensor_products([a[0] for a in axes], [a[1] for a in axes])

    if is_closed(family):
        entities = [box_entity(cell, place, degree) for place in places]
    else:
        entities = [(cell.dimension, 0, k) for k in range(len(places))]
    node_weights = np.array([np.prod([weights[i] for i in place]) for place in places])
    traces = np.zeros(len(places))
    if is_closed(family):
        for k, place in enumerate(places):
            end = next((a for a, i in enumerate(place) if i in (0, degree)), None)
            if end is not None:
                traces[k] = np.prod([weights[i] for a, i in enumerate(place) if a != end])
    coords = cell.coords(np.array([[points[i] for i in place] for place in places]))
    layout = make_layout(element, entities)
    data = np.stack((points, lagrange_scales(points)))
    return Definition("tensor", layout, coords, node_weights, traces, tabulate, degree, data)
