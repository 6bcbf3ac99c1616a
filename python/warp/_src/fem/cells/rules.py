"""Quadrature rules - points inside of a reference cell with positive weights, of any order."""

from __future__ import annotations

import functools
import itertools
import os
from dataclasses import dataclass

import numpy as np

from warp._src.fem.cells.cell import POINT, TET, TRIANGLE, Cell
from warp._src.fem.cells.polynomial import Polynomial, gauss_jacobi, rule_1d


@dataclass(frozen=True)
class Rule:
    """Points and weights on a reference cell, as a record that is equal to others of equal numbers.

    Attributes:
        cell: the reference cell.
        point_bytes: coordinates of the points, (q, 3) float64.
        weight_bytes: weights, (q,) float64; their sum is 1.
        order: highest degree of polynomials that are integrated exactly.
    """

    cell: Cell
    point_bytes: bytes
    weight_bytes: bytes
    order: int

    @functools.cached_property
    def points(self) -> np.ndarray:
        """Coordinates, (q, 3) float64."""
        return np.frombuffer(self.point_bytes).reshape(-1, 3)

    @functools.cached_property
    def weights(self) -> np.ndarray:
        """Weights, (q,) float64."""
        return np.frombuffer(self.weight_bytes)

    @property
    def point_count(self) -> int:
        return len(self.weight_bytes) // 8

    def __repr__(self):
        return f"Rule({self.cell}, {self.point_count} points, order {self.order})"


def make_rule(cell: Cell, coords, weights, order: int) -> Rule:
    """A rule of these points, coordinates (q, 3), and weights (q,)."""
    coords = np.ascontiguousarray(coords, dtype=float)
    weights = np.ascontiguousarray(weights, dtype=float)
    return Rule(cell, coords.tobytes(), weights.tobytes(), int(order))


@functools.cache
def rule(cell: Cell, order: int, family: Polynomial | None = None, halves: bool = False) -> Rule:
    """The rule of a cell that is exact for polynomials of a degree.

    Args:
        cell: the reference cell.
        order: degree: total on simplices, per parameter on squares and cubes.
        family: points on lines that products of squares, cubes and, collapsed, simplices are made
            from. If not given: Gauss points, and on triangles and tetrahedra the rules of Xiao and
            Gimbutas (2010) or, beyond order 30 and 15, collapsed Gauss-Jacobi points.
        halves: if points are those of both halves of each line, of squares and cubes.

    Raises:
        ValueError: the order is negative, or no integer.
    """
    if isinstance(order, bool) or not isinstance(order, (int, np.integer)) or order < 0:
        raise ValueError(f"expects a quadrature order of 0 or more, but got {order!r}")
    if family is not None and not isinstance(family, Polynomial):
        raise ValueError(f"expects a 'Polynomial' as the family of points, but got {family!r}")
    if cell == POINT:
        return make_rule(cell, np.zeros((1, 3)), np.ones(1), order)
    if cell in (TRIANGLE, TET):
        found = _simplex_rule(cell, int(order)) if family is None else None
        parameters, weights = found or _collapsed(cell.dimension, int(order), family)
    else:
        points, weights = rule_1d(int(order), family or Polynomial.GAUSS_LEGENDRE)
        if halves:
            points = np.concatenate([0.5 * points, 0.5 + 0.5 * points])
            weights = np.tile(0.5 * weights, 2)
        parameters, weights = _product([(points, weights)] * cell.dimension)
    return make_rule(cell, cell.coords(parameters), weights, order)


class Prototype:
    """Numbers of a reference cell by methods, as `cell.prototype`."""

    def __init__(self, cell: Cell):
        self.cell, self.dimension = cell, cell.dimension

    def measure(self) -> float:
        """Measure in parameters."""
        return self.cell.measure

    def center(self) -> tuple:
        """Coordinates of the centre."""
        return tuple(self.cell.center.tolist())

    def instantiate_quadrature(self, order: int, family: Polynomial | None = None) -> tuple:
        """Points and weights of `rule`, as lists of tuples and of numbers."""
        made = rule(self.cell, order, family)
        return list(map(tuple, made.points.tolist())), made.weights.tolist()


# Cells know no rules, which are made from them.
Cell.prototype = property(Prototype)


def _product(lines):
    """Points and weights of products of lines, the last axis first."""
    parameters = np.array(list(itertools.product(*(points for points, _ in lines))))
    weights = functools.reduce(np.multiply.outer, (weights for _, weights in lines))
    return parameters, weights.reshape(-1)


def _simplex_rule(cell, order):
    """A symmetric or stored rule; None beyond the stored ones."""
    if order <= 1:
        return cell.vertices.mean(axis=0)[None], np.ones(1)
    if cell == TET and order == 2:
        near = (5.0 - 5.0**0.5) / 20.0
        parameters = near + (1.0 - 4.0 * near) * cell.vertices
        return parameters, np.full(4, 0.25)
    table = stored().get(f"rule {cell.name} {order}")
    return None if table is None else (table[:, :-1], table[:, -1])


def _collapsed(dimension, order, family):
    """Points of a square or cube, collapsed to a simplex: x, y (1 - x), z (1 - x) (1 - y).

    The factors (1 - x)^k of the volume go into Gauss-Jacobi weights, or into the order of other
    families. Points without weight are left out.
    """
    lines = []
    for axis in range(dimension):
        power = dimension - 1 - axis
        if family in (None, Polynomial.GAUSS_LEGENDRE):
            points, weights = gauss_jacobi(order // 2 + 1, power)
            lines.append((points, weights * (power + 1.0)))
        else:
            points, weights = rule_1d(order + power, family)
            lines.append((points, weights * (power + 1.0) * (1.0 - points) ** power))
    square, weights = _product(lines)
    square, weights = square[weights > 0.0], weights[weights > 0.0]
    left, parameters = np.ones(len(square)), np.empty_like(square)
    for axis in range(dimension):
        parameters[:, axis] = left * square[:, axis]
        left = left * (1.0 - square[:, axis])
    # Points of closed families are on the far side, where rounding must not move them out.
    while (beyond := np.flatnonzero(parameters.sum(axis=1) > 1.0)).size:
        largest = parameters[beyond].argmax(axis=1)
        parameters[beyond, largest] = np.nextafter(parameters[beyond, largest], 0.0)
    return parameters, weights


@functools.cache
def stored() -> dict:
    """Arrays by name, such as "rule triangle 5": (q, d + 1) parameters and weights of points."""
    path = os.path.join(os.path.dirname(__file__), "elements.npz")
    with np.load(path) as tables:
        return {name: tables[name] for name in tables.files}
