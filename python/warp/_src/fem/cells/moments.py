"""Moments of vector families - interpolation that commutes with curl and divergence.

A Nedelec or Raviart-Thomas element is determined by integrals of tangential or normal components
over edges, sides and the inside, times polynomials (Nedelec 1980). The interpolant of a field has
the field's moments, so the divergence of the interpolant is the projection of the divergence, and
the interpolant of a gradient is a gradient.
"""

from __future__ import annotations

import functools
import itertools

import numpy as np

from warp._src.fem.cells.cell import LINE
from warp._src.fem.cells.families import monomials
from warp._src.fem.cells.rules import rule

# Moments of fields that are no polynomials are exact to the digits of float32 on coarse meshes.
_LEAST_ORDER = 7


@functools.cache
def interpolation_weights(element) -> tuple[np.ndarray, np.ndarray]:
    """Points (p, 3), and weights (orientations, n, p, d): the sum over points of a weight times the
    field at the point, in the reference cell, is a node's degree of freedom."""
    points, parts = [], []
    for size in range(1, element.cell.dimension + 1):
        for vertices in element.cell.entities(size):
            places, made = _of_entity(element, size, vertices)
            points.append(places)
            parts.append(made)
    sizes = [len(places) for places in points]
    moments = np.zeros((element.node_count, sum(sizes), element.cell.dimension))
    row = column = 0
    for made, count in zip(parts, sizes, strict=True):
        moments[row : row + len(made), column : column + count] = made
        row, column = row + len(made), column + count
    points = element.cell.coords(np.concatenate(points))
    weights = []
    for orientation in range(element.orientation_count):
        basis, _ = element.tabulate(points, orientation)
        values = np.einsum("jpd,pnd->jn", moments, basis)
        made = np.linalg.solve(values, moments.reshape(len(moments), -1)).reshape(moments.shape)
        made[np.abs(made) < 1e-11 * np.abs(made).max()] = 0.0
        weights.append(made)
    return points, np.array(weights)


def _of_entity(element, size, vertices):
    """Points in an entity of `size` axes, and weights (moments, points, d) of its moments."""
    cell = element.cell
    corners = cell.vertices[list(vertices)]
    far = range(1, size + 1) if cell.is_simplex else [1 << k for k in reversed(range(size))]
    axes = np.array([corners[k] - corners[0] for k in far])
    shape = {1: LINE, cell.dimension - 1: cell.side, cell.dimension: cell}[size]
    points = rule(shape, max(_LEAST_ORDER, 2 * element.degree + 3))
    at = shape.parameters(points.points)
    made = [np.zeros((0, len(at), cell.dimension))]
    for direction, exponents in _tests(element, size, axes):
        tests = monomials(exponents, 2.0 * at - 1.0)[0] * points.weights[:, None]
        made.append(tests.T[:, :, None] * direction)
    return corners[0] + at @ axes, np.concatenate(made)


def _tests(element, size, axes):
    """(direction, exponents of the monomials that the component is tested with)."""
    degree, dimension = element.degree, element.cell.dimension
    is_simplex = element.cell.is_simplex
    if element.map == "covariant":
        directions, along, across, total = axes, degree - 1, degree - 2, degree - size
    elif size == dimension:
        directions, along, across, total = axes, degree - 2, degree - 1, degree - 2
    elif size == dimension - 1:
        normal = np.cross(*axes) if size == 2 else np.array([axes[0, 1], -axes[0, 0]])
        directions, along, across, total = normal[None], degree - 1, degree - 1, degree - 1
    else:
        return
    for number, direction in enumerate(directions):
        most = [total if is_simplex else along if a == number else across for a in range(size)]
        made = itertools.product(*(range(m + 1) for m in most))
        exponents = [e for e in made if not is_simplex or sum(e) <= total]
        if exponents:
            yield direction, np.array(exponents).reshape(-1, size)
