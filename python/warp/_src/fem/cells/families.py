"""Scalar families of elements - serendipity, discontinuous polynomials, B-splines."""

from __future__ import annotations

import functools
import itertools
import math

import numpy as np

from warp._src.fem.cells import simplices
from warp._src.fem.cells.cell import CUBE, SQUARE, TET, TRIANGLE
from warp._src.fem.cells.definitions import (
    Definition,
    make_layout,
    tensor_products,
)
from warp._src.fem.cells.polynomial import is_closed, quadrature_1d
from warp._src.fem.cells.rules import rule


def monomials(exponents, x) -> tuple[np.ndarray, np.ndarray]:
    """Products of powers of the columns of x (q, d) and their gradients: (q, m), (q, m, d)."""
    x, exponents = np.asarray(x), np.asarray(exponents)
    parts = [x[:, a, None] ** exponents[:, a] for a in range(x.shape[1])]
    slopes = [
        exponents[:, a] * x[:, a, None] ** np.maximum(exponents[:, a] - 1, 0)
        for a in range(x.shape[1])
    ]
    axes = range(x.shape[1])
    gradients = [
        functools.reduce(np.multiply, [slopes[a] if a == b else parts[a] for a in axes])
        for b in axes
    ]
    return functools.reduce(np.multiply, parts), np.stack(gradients, axis=-1)


def total_degree(dimension, degree) -> np.ndarray:
    """Exponents of the monomials of a total degree, the lowest first."""
    every = itertools.product(range(degree + 1), repeat=dimension)
    return np.array(sorted((e for e in every if sum(e) <= degree), key=lambda e: (sum(e), e)))


def _nodal(cell, exponents, places) -> tuple:
    """The basis of monomials of 2 x - 1 that is dual to values at places: what kernels need of it,
    and its tabulation."""
    coefficients = np.linalg.inv(monomials(exponents, 2.0 * places - 1.0)[0]).T

    def tabulate(coords, orientation):
        made, slopes = monomials(exponents, 2.0 * cell.parameters(coords) - 1.0)
        return made @ coefficients.T, 2.0 * np.einsum("qmd,nm->qnd", slopes, coefficients)

    return (exponents, coefficients), tabulate


def _superlinear(exponents) -> int:
    return sum(e for e in exponents if e > 1)


def serendipity(element) -> Definition:
    """Serendipity elements of Arnold and Awanou (2011) on squares and cubes: the span of the
    monomials of superlinear degree k, with nodes at vertices and in edges.

    Raises:
        ValueError: of other cells and degrees, or nodes that leave the ends out.
    """
    cell, degree, family = element.cell, element.degree, element.variant
    if cell in (TRIANGLE, TET) and degree == 2:
        from warp._src.fem.cells.definitions import lagrange

        return lagrange(element)
    if cell not in (SQUARE, CUBE) or degree > 3:
        raise ValueError(
            f"serendipity elements have degree 2 or 3 on squares and cubes, but got degree "
            f"{degree} on a {cell}"
        )
    if not is_closed(family):
        raise ValueError(f"serendipity elements need nodes at vertices, but {family.name} has none")
    points, line_weights = quadrature_1d(degree + 1, family)
    entities = [(0, v, 0) for v in range(len(cell.corners))]
    per_axis = 2 ** (cell.dimension - 1)
    for k in range(degree - 1):
        for offset in range(per_axis):
            entities += [(1, axis * per_axis + offset, k) for axis in range(cell.dimension)]
    places = []
    for dimension, number, k in entities:
        vertices = cell.vertices[list(cell.entities(dimension)[number])]
        at = vertices[0] if dimension == 0 else (points[k + 1], vertices)
        if dimension == 1:
            at = vertices[0] + points[k + 1] * (vertices[1] - vertices[0])
        places.append(at)
    places = np.array(places)
    most = itertools.product(range(degree + 1), repeat=cell.dimension)
    exponents = np.array([e for e in most if _superlinear(e) <= degree])
    data, tabulate = _nodal(cell, exponents, places)
    corner = 1.0 / (len(cell.corners) * degree**cell.dimension)
    beside = (1.0 - corner * len(cell.corners)) / (len(entities) - len(cell.corners))
    weights = np.array([corner if e[0] == 0 else beside for e in entities])
    return Definition(
        "polynomial",
        make_layout(element, entities),
        cell.coords(places),
        weights,
        _serendipity_traces(cell, degree, entities, line_weights),
        tabulate,
        degree + (1 if cell == SQUARE else 2),
        data,
    )


def _serendipity_traces(cell, degree, entities, line):
    """Weights of nodes on a side: those of the line, or of the serendipity element of a square."""
    if cell == SQUARE:
        return np.array([line[0] if e[0] == 0 else line[1 + e[2]] for e in entities])
    corner = 0.25 / degree**2
    beside = (0.25 - corner) / (degree - 1)
    return np.array([corner if e[0] == 0 else beside for e in entities])


def _embedding(cell, degree):
    """Corners of the simplex inside of a cell whose lattice has the nodes: equilateral ones as
    large as fit into squares and cubes, and smaller copies of triangles and tetrahedra, whose
    sizes make the weights of nodes nearly exact for twice the degree."""
    if cell == SQUARE:
        side = 1.5 / math.sqrt(3.0)
        low = 0.5 - 0.25
        return np.array([[0.5 - side / 2, low], [0.5 + side / 2, low], [0.5, low + 0.75]])
    if cell == CUBE:
        height = 2.0 / 3.0
        side = math.sqrt(1.5) * height
        depth = math.sqrt(0.75) * side
        x, y, z = 0.5 - side / 2, 0.5 - depth / 3, 0.5 - height / 4
        base = [[x, y, z], [x + side, y, z], [0.5, y + depth, z], [0.5, 0.5, z + height]]
        return np.array(base)
    large = {1: 2.0 / 3.0, 2: 0.7790770484375, 3: 0.8429443359375}
    if cell == TRIANGLE:
        scale = 1.5 * large.get(degree, 1.0) - 0.5
    else:
        scale = {1: 5**-0.5, 2: 0.6123779297, 3: 0.7153564453}.get(degree, 1.0)
    center = cell.vertices.mean(axis=0)
    return center + scale * (cell.vertices - center)


def nonconforming(element) -> Definition:
    """Polynomials of total degree whose nodes are a lattice of a simplex inside of the cell."""
    cell, degree = element.cell, element.degree
    inside = {2: TRIANGLE, 3: TET}.get(cell.dimension)
    if inside is None:
        raise ValueError(f"discontinuous polynomials need a cell of 2 or 3 axes, but got {cell}")
    steps = np.array([place for place, _ in simplices.lattice(inside, degree)])
    corners = _embedding(cell, degree)
    places = corners[0] + (steps[:, 1:] / degree) @ (corners[1:] - corners[0])
    data, tabulate = _nodal(cell, total_degree(cell.dimension, degree), places)
    made = rule(cell, degree)
    weights = made.weights @ tabulate(made.points, 0)[0]
    if not (weights > 0.0).all():
        weights = np.full(len(steps), 1.0 / len(steps))
    entities = [(cell.dimension, 0, k) for k in range(len(steps))]
    traces = np.zeros(len(steps))
    layout = make_layout(element, entities)
    coords = cell.coords(places)
    return Definition("polynomial", layout, coords, weights, traces, tabulate, degree, data)


def spline(degree: int, x) -> tuple[np.ndarray, np.ndarray]:
    """The cardinal B-spline of a degree around 0 and its derivative."""
    x = np.asarray(x, dtype=float)
    value, slope = np.zeros_like(x), np.zeros_like(x)
    for k in range(degree + 2):
        sign = (-1) ** k * math.comb(degree + 1, k) / math.factorial(degree)
        left = np.maximum(0.5 * (degree + 1) - k - np.abs(x), 0.0)
        value += sign * left**degree
        # The derivative at the ends of the support is 0 for degree 1.
        slope -= sign * degree * np.where(left > 0.0, left ** (degree - 1), 0.0) * np.sign(x)
    return value, slope


def bspline(element) -> Definition:
    """Products of cardinal B-splines around vertices of a grid, some outside of the cell."""
    cell, degree = element.cell, element.degree
    if cell not in (SQUARE, CUBE):
        raise ValueError(f"B-splines need a square or cube, but got a {cell}")
    pad = degree // 2
    places = np.arange(2 * pad + 2) - float(pad)

    def tabulate(coords, orientation):
        axes = [spline(degree, coords[:, a, None] - places) for a in range(cell.dimension)]
        if degree == 1:
            # The slope at an end of the cell is the one inside.
            axes = [(value, np.broadcast_to((-1.0, 1.0), value.shape)) for value, _ in axes]
        return tensor_products([a[0] for a in axes], [a[1] for a in axes])

    nodes = np.array(list(itertools.product(places, repeat=cell.dimension)))
    equal = np.full(len(nodes), 1.0 / len(nodes))
    sides = np.full(len(nodes), 1.0 / len(places))
    layout = make_layout(element, [(cell.dimension, 0, k) for k in range(len(nodes))])
    coords = cell.coords(nodes)
    return Definition("splines", layout, coords, equal, sides, tabulate, degree, places)
