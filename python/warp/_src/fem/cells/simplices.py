"""Lattices of simplices - nodes of Lagrange elements of any degree, entity by entity."""

from __future__ import annotations

import functools

import numpy as np

from warp._src.fem.cells.cell import TET, TRIANGLE, Cell


def _spread(place, vertices, size):
    spread = [0] * size
    for vertex, steps in zip(vertices, place, strict=True):
        spread[vertex] = steps
    return tuple(spread)


def interior(dimension: int, degree: int) -> list[tuple]:
    """Barycentric steps of the nodes inside of a simplex, in their order."""
    inner = degree - dimension - 1
    if inner < 0:
        return []
    if dimension == 1:
        return [(degree - t, t) for t in range(1, degree)]
    shape = TRIANGLE if dimension == 2 else TET
    return [tuple(steps + 1 for steps in place) for place, _ in lattice(shape, inner)]


@functools.cache
def lattice(cell: Cell, degree: int) -> tuple:
    """Nodes of a degree: pairs (barycentric steps, (dimension, entity, number in the entity)).

    Vertices come first, then the insides of edges in their direction, of faces, and of the cell,
    which has the order of a lattice again.
    """
    size = cell.dimension + 1
    if degree == 0:
        return (((0,) * size, (cell.dimension, 0, 0)),)
    nodes = [(_spread((degree,), (v,), size), (0, v, 0)) for v in range(size)]
    for dimension in range(1, cell.dimension + 1):
        inside = interior(dimension, degree)
        for number, vertices in enumerate(cell.entities(dimension)):
            for k, place in enumerate(inside):
                nodes.append((_spread(place, vertices, size), (dimension, number, k)))
    return tuple(nodes)


@functools.cache
def face_turns(degree: int) -> tuple:
    """For each of the six orders of a triangle's vertices, the numbers of the nodes inside when
    the vertices are sorted. Order 2 c + s: the least vertex is c, and s if the next two swap."""
    inside = interior(2, degree)
    turns = []
    for first in range(3):
        for swapped in (0, 1):
            order = [first, (first + 1 + swapped) % 3, (first + 2 - swapped) % 3]
            turns.append(tuple(inside.index(tuple(p[v] for v in order)) for p in inside))
    return tuple(turns)


def powers(steps, coordinates) -> tuple[np.ndarray, np.ndarray]:
    """Lagrange polynomials of lattice nodes and their derivatives by barycentric coordinates.

    Args:
        steps: (n, d + 1) barycentric steps of the nodes, each row of the same sum.
        coordinates: (q, d + 1) barycentric coordinates.

    Returns:
        Values (q, n) and derivatives (q, n, d + 1).
    """
    steps = np.asarray(steps)
    degree, size = int(steps[0].sum()), steps.shape[1]
    factor = np.ones((degree + 1, len(coordinates), size))
    slope = np.zeros_like(factor)
    for j in range(degree):
        term = (degree * coordinates - j) / (j + 1)
        factor[j + 1] = factor[j] * term
        slope[j + 1] = slope[j] * term + factor[j] * (degree / (j + 1))
    parts = [factor[steps[:, i], :, i].T for i in range(size)]
    slopes = [slope[steps[:, i], :, i].T for i in range(size)]
    values = np.prod(parts, axis=0)
    derivatives = np.empty((*values.shape, size))
    for i in range(size):
        others = [parts[j] for j in range(size) if j != i]
        derivatives[..., i] = slopes[i] * (np.prod(others, axis=0) if others else 1.0)
    return values, derivatives
