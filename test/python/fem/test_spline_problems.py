"""Splines in boundary-value problems: slopes on the boundary, breaks inside of cells."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem
from warp.optim import linear

REAL = wp.float64


@fem.integrand
def nitsche(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field, penalty: REAL):
    n = fem.normal(domain, s)
    u_n, v_n = wp.dot(fem.grad(u, s), n), wp.dot(fem.grad(v, s), n)
    return penalty * u(s) * v(s) - u(s) * v_n - v(s) * u_n


def poisson_error(n, degree, basis):
    """L2 error with values of the boundary by Nitsche's method, rules of forms by default."""
    grid = programs.grid(2, n, REAL)
    space = fem.make_polynomial_space(grid, degree=degree, element_basis=basis, dtype=REAL)
    fields = programs.fields_of(space)
    sides = programs.fields_of(space, fem.BoundarySides(grid))
    a = fem.integrate(programs.diffusion, fields=fields)
    a += fem.integrate(nitsche, fields=sides, values={"penalty": 10.0 * degree**2 * n})
    rule = fem.RegularQuadrature(fem.Cells(grid), order=2 * degree + 4, halves=True)
    b = fem.integrate(programs.load_2d, quadrature=rule, fields={"v": fields["v"]})
    field = space.make_field()
    M = linear.preconditioner(a, "diag")
    linear.cg(a, b, field.dof_values, tol=1e-12, maxiter=5000, M=M)
    return fem.integrate(programs.error_2d, quadrature=rule, fields={"u": field}) ** 0.5


@pytest.mark.parametrize("degree", [2, 3])
def test_orders_of_smooth_splines(degree):
    errors = [poisson_error(n, degree, fem.ElementBasis.BSPLINE) for n in (8, 16)]
    assert programs.order_of(errors) == pytest.approx(degree + 1, abs=0.2)


def test_splines_of_degree_one_are_lagrange_polynomials():
    """Slopes too, which jump at the ends of cells, where points of the boundary are."""
    spline, lagrange = (
        poisson_error(8, 1, basis)
        for basis in (fem.ElementBasis.BSPLINE, fem.ElementBasis.LAGRANGE)
    )
    assert spline == pytest.approx(lagrange, rel=1e-9)


@fem.integrand
def distance_to_centres(s: fem.Sample):
    x = s.element_coords
    return wp.abs(x[0] - 0.5) * wp.abs(x[1] - 0.5)


def test_rules_of_halves_are_exact_for_pieces():
    cells = fem.Cells(programs.grid(2, 1, REAL))
    rule = fem.RegularQuadrature(cells, order=1, halves=True)
    assert fem.integrate(distance_to_centres, quadrature=rule) == pytest.approx(1 / 16, rel=1e-14)
    assert rule != fem.RegularQuadrature(cells, order=1)
    np.testing.assert_allclose(np.sum(rule.weights), 1.0, rtol=1e-15)
