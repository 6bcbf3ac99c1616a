"""Quadrature on an interval - nodes and weights of any count for four families of points."""

from __future__ import annotations

import functools
import math
from enum import Enum
from fractions import Fraction

import numpy as np
from numpy.polynomial import legendre


class Polynomial(Enum):
    """Families of points in an interval."""

    GAUSS_LEGENDRE = "GL"
    """Gauss points, inside the interval: n of them are exact to degree 2 n - 1."""

    LOBATTO_GAUSS_LEGENDRE = "LGL"
    """Gauss-Lobatto points, with both ends: exact to degree 2 n - 3."""

    EQUISPACED_CLOSED = "closed"
    """Equally spaced points, with both ends."""

    EQUISPACED_OPEN = "open"
    """Equally spaced points, without the ends."""

    def __str__(self):
        return self.value


def is_closed(family: Polynomial) -> bool:
    """True if the points of a family include the ends of the interval."""
    return family in (Polynomial.LOBATTO_GAUSS_LEGENDRE, Polynomial.EQUISPACED_CLOSED)


@functools.cache
def gauss_jacobi(count: int, power: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights in [0, 1] for integrals with the factor (1 - x)^power.

    Eigenvalues of the Jacobi matrix (Golub and Welsch 1969), then Newton steps on the polynomial.
    """
    k = np.arange(count, dtype=np.longdouble)
    a = np.longdouble(power)
    diagonal = np.where(
        k + a > 0, -(a * a) / np.maximum((2 * k + a) * (2 * k + a + 2), 1e-300), 0.0
    )
    n = k[1:]
    beside = 4 * n * n * (n + a) ** 2 / ((2 * n + a) ** 2 * ((2 * n + a) ** 2 - 1))
    sides = np.sqrt(beside).astype(float)
    matrix = np.diag(diagonal.astype(float)) + np.diag(sides, 1) + np.diag(sides, -1)
    x = np.linalg.eigvalsh(matrix).astype(np.longdouble)
    for _ in range(3):
        values, slopes = _orthonormal(x, diagonal, beside)
        x = x - values[-1] / slopes[-1]
    values, _ = _orthonormal(x, diagonal, beside)
    weights = 1.0 / ((a + 1.0) * (values[:-1] ** 2).sum(axis=0))
    return np.asarray((1.0 + x) / 2.0, dtype=float), np.asarray(weights, dtype=float)


def _orthonormal(x, diagonal, beside):
    """Polynomials of a Jacobi matrix and their derivatives at x, each (n + 1, x); the last, whose
    roots are the points, is scaled freely."""
    values, slopes = [np.ones_like(x)], [np.zeros_like(x)]
    for k in range(len(diagonal)):
        value, slope = (x - diagonal[k]) * values[k], values[k] + (x - diagonal[k]) * slopes[k]
        if k > 0:
            back = np.sqrt(beside[k - 1])
            value, slope = value - back * values[k - 1], slope - back * slopes[k - 1]
        scale = np.sqrt(beside[k]) if k < len(beside) else 1.0
        values.append(value / scale)
        slopes.append(slope / scale)
    return np.array(values), np.array(slopes)


def _lobatto(count):
    """Ends and roots of the derivative of a Legendre polynomial, made exact by Newton steps."""
    last = np.zeros(count)
    last[-1] = 1.0
    slope = legendre.legder(last)
    x = np.sort(legendre.legroots(slope).real) if count > 2 else np.zeros(0)
    for _ in range(3):
        x = x - legendre.legval(x, slope) / legendre.legval(x, legendre.legder(slope))
    x = 0.5 * (x - x[::-1])
    x = np.concatenate(([-1.0], x, [1.0]))
    weights = 2.0 / (count * (count - 1) * legendre.legval(x, last) ** 2)
    return 0.5 + 0.5 * x, 0.5 * weights


def _newton_cotes(points):
    """Weights that are exact for polynomials of degree n - 1, by rational numbers."""
    weights = []
    for i, x in enumerate(points):
        factor, scale = [Fraction(1)], Fraction(1)
        for j, y in enumerate(points):
            if i == j:
                continue
            scale *= x - y
            low, high = [-y * c for c in factor] + [0], [0] + factor
            factor = [a + b for a, b in zip(low, high, strict=True)]
        weights.append(sum(c / (k + 1) for k, c in enumerate(factor)) / scale)
    return np.array([float(w) for w in weights])


def _equispaced(count, closed):
    if closed:
        return [Fraction(i, count - 1) for i in range(count)]
    return [Fraction(i + 1, count + 1) for i in range(count)]


@functools.cache
def _rule_1d(count, family):
    if family is Polynomial.GAUSS_LEGENDRE:
        points, weights = gauss_jacobi(count, 0)
    elif family is Polynomial.LOBATTO_GAUSS_LEGENDRE:
        points, weights = _lobatto(count)
    else:
        exact = _equispaced(count, is_closed(family))
        points, weights = np.array([float(x) for x in exact]), _newton_cotes(exact)
    points.flags.writeable = weights.flags.writeable = False
    return points, weights


def quadrature_1d(point_count: int, family: Polynomial) -> tuple[np.ndarray, np.ndarray]:
    """Points in [0, 1], ascending, and weights of the rule with the highest degree on them.

    Args:
        point_count: number of points.
        family: where the points lie. Equally spaced ones are those of Newton and Cotes, whose
            weights are not all positive from 3 open or 9 closed points on.

    Raises:
        ValueError: the family needs more points, or is none.
    """
    if not isinstance(family, Polynomial):
        raise ValueError(f"expects a 'Polynomial' as the family of points, but got {family!r}")
    least = 2 if is_closed(family) else 1
    if point_count < least:
        raise ValueError(f"family {family.name!r} needs {least} points, but got {point_count}")
    return _rule_1d(int(point_count), family)


@functools.cache
def rule_1d(order: int, family: Polynomial) -> tuple[np.ndarray, np.ndarray]:
    """Points and positive weights in [0, 1] that are exact to a degree.

    Equally spaced points get the weights of Newton and Cotes if they are positive, else more points
    and the shortest vector of weights (Wilson 1970), which is positive if there are enough.
    """
    half = order // 2
    if family is Polynomial.GAUSS_LEGENDRE:
        return quadrature_1d(half + 1, family)
    if family is Polynomial.LOBATTO_GAUSS_LEGENDRE:
        return quadrature_1d(max(2, half + 2), family)
    closed = is_closed(family)
    count = max(2 if closed else 1, 2 * half + 1)
    points, weights = quadrature_1d(count, family)
    while not (weights > 0.0).all():
        count += 1 + count // 8
        points = np.array([float(x) for x in _equispaced(count, closed)])
        basis = legendre.legvander(2.0 * points - 1.0, 2 * half + 1)
        moments = np.zeros(2 * half + 2)
        moments[0] = 1.0
        q, r = np.linalg.qr(basis)
        weights = q @ np.linalg.solve(r.T, moments)
        weights = weights + q @ np.linalg.solve(r.T, moments - basis.T @ weights)
    return points, weights


def lagrange_scales(coords: np.ndarray) -> np.ndarray:
    """Reciprocals of the products of differences of each point to the others: the factors of the
    Lagrange polynomials with these points."""
    coords = np.asarray(coords, dtype=float)
    return np.array(
        [
            1.0 / math.prod(x - y for j, y in enumerate(coords) if j != i)
            for i, x in enumerate(coords)
        ]
    )
