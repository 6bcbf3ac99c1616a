"""Quadrature rules against exact integrals of monomials."""

import itertools
from math import factorial, fsum

import numpy as np
import pytest

from warp._src.fem.cells.cell import CUBE, LINE, SQUARE, TET, TRIANGLE
from warp._src.fem.cells.polynomial import Polynomial, gauss_jacobi, quadrature_1d, rule_1d
from warp._src.fem.cells.rules import rule

ULP = np.finfo(float).eps
FAMILIES = [None, *Polynomial]


def moment(cell, powers):
    """The mean of a monomial over a cell."""
    if cell.is_simplex:
        top = np.prod([float(factorial(p)) for p in powers])
        whole = factorial(cell.dimension) / factorial(sum(powers) + cell.dimension)
        return top * whole
    return np.prod([1.0 / (p + 1) for p in powers])


def monomials(cell, order):
    powers = itertools.product(range(order + 1), repeat=cell.dimension)
    return [p for p in powers if not cell.is_simplex or sum(p) <= order]


def check(cell, order, family):
    made = rule(cell, order, family)
    x, w = cell.parameters(made.points), made.weights
    assert (w > 0.0).all()
    assert (x >= 0.0).all()
    assert (x.sum(axis=1) if cell.is_simplex else x.max(axis=1)).max() <= 1.0
    for powers in monomials(cell, order):
        value = fsum(w * np.prod(x ** np.array(powers), axis=1))
        assert abs(value - moment(cell, powers)) <= 4 * ULP, (powers, family)


@pytest.mark.parametrize("order", range(21))
@pytest.mark.parametrize("cell", [LINE, TRIANGLE, SQUARE, TET], ids=str)
def test_default_rules_are_exact(cell, order):
    check(cell, order, None)


@pytest.mark.parametrize("family", Polynomial, ids=lambda f: f.name)
@pytest.mark.parametrize("order", [0, 1, 2, 3, 5, 8, 13])
@pytest.mark.parametrize("cell", [LINE, TRIANGLE, SQUARE], ids=str)
def test_rules_of_families_are_exact(cell, order, family):
    check(cell, order, family)


@pytest.mark.parametrize("family", FAMILIES, ids=str)
@pytest.mark.parametrize("order", [0, 2, 4, 6])
@pytest.mark.parametrize("cell", [TET, CUBE], ids=str)
def test_rules_of_solids_are_exact(cell, order, family):
    check(cell, order, family)


@pytest.mark.parametrize("order", [8, 12])
@pytest.mark.parametrize(
    "family", [Polynomial.LOBATTO_GAUSS_LEGENDRE, Polynomial.EQUISPACED_CLOSED]
)
def test_collapsed_points_stay_inside(family, order):
    check(TET, order, family)


@pytest.mark.parametrize("order", [31, 40])
def test_collapsed_rules_follow_the_stored_ones(order):
    check(TRIANGLE, order, None)


def test_rules_are_equal_by_value():
    assert rule(TET, 4) == rule(TET, 4, None)
    assert rule(TET, 4) != rule(TET, 5)
    assert rule(TRIANGLE, 3).points.shape == (rule(TRIANGLE, 3).point_count, 3)


def test_newton_cotes_weights():
    """Weights of Simpson, of 3/8 and of the open rule of three points (Abramowitz, 25.4)."""
    closed, opened = Polynomial.EQUISPACED_CLOSED, Polynomial.EQUISPACED_OPEN
    np.testing.assert_array_equal(quadrature_1d(3, closed)[1], [1 / 6, 4 / 6, 1 / 6])
    np.testing.assert_array_equal(quadrature_1d(4, closed)[1], [1 / 8, 3 / 8, 3 / 8, 1 / 8])
    np.testing.assert_array_equal(quadrature_1d(3, opened)[1], [2 / 3, -1 / 3, 2 / 3])


def test_gauss_jacobi_points():
    """Two points for the factor 1 - x are the roots of 10 x^2 - 8 x + 1."""
    points, weights = gauss_jacobi(2, 1)
    np.testing.assert_allclose(points, np.sort(np.roots([10.0, -8.0, 1.0])), rtol=4 * ULP)
    np.testing.assert_allclose(weights.sum(), 0.5, rtol=4 * ULP)


@pytest.mark.parametrize("family", Polynomial, ids=lambda f: f.name)
def test_lines_have_ascending_points(family):
    points, weights = rule_1d(20, family)
    assert (np.diff(points) > 0.0).all()
    np.testing.assert_allclose(points + points[::-1], 1.0, atol=2 * ULP)
    np.testing.assert_allclose(weights, weights[::-1], atol=8 * ULP)


def test_errors():
    with pytest.raises(ValueError, match="order of 0 or more, but got -1"):
        rule(TET, -1)
    with pytest.raises(ValueError, match="expects a 'Polynomial'"):
        rule(TET, 2, "GL")
    with pytest.raises(ValueError, match="needs 2 points, but got 1"):
        quadrature_1d(1, Polynomial.LOBATTO_GAUSS_LEGENDRE)


def test_prototypes():
    points, weights = TRIANGLE.prototype.instantiate_quadrature(2)
    assert (len(points), len(points[0]), sum(weights)) == (3, 3, pytest.approx(1.0))
    assert TET.prototype.measure() == pytest.approx(1 / 6)
    assert SQUARE.prototype.center() == (0.5, 0.5, 0.0)
