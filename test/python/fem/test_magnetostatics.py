"""Magnetostatics: curl curl A = J with the field B = curl A, of first order with edge elements."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem
from warp.optim import linear

PI = wp.constant(float(np.pi))


@fem.integrand
def field(s: fem.Sample, domain: fem.Domain):
    """B of A = (sin y sin z, sin z sin x, sin x sin y), each argument times pi."""
    x = PI * fem.position(domain, s)
    a, b = wp.vec3d(wp.sin(x[0]), wp.sin(x[1]), wp.sin(x[2])), wp.vec3d()
    c = wp.vec3d(wp.cos(x[0]), wp.cos(x[1]), wp.cos(x[2]))
    b[0] = PI * a[0] * (c[1] - c[2])
    b[1] = PI * a[1] * (c[2] - c[0])
    b[2] = PI * a[2] * (c[0] - c[1])
    return b


@fem.integrand
def curl_curl(s: fem.Sample, u: fem.Field, v: fem.Field):
    return 4.0 * wp.dot(fem.curl(u, s), fem.curl(v, s))


@fem.integrand
def current(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    """(curl B, v) by parts: v has no tangential part on the boundary."""
    return 2.0 * wp.dot(field(s, domain), fem.curl(v, s))


@fem.integrand
def squared_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    return wp.length_sq(2.0 * fem.curl(u, s) - field(s, domain))


@fem.integrand
def squared(s: fem.Sample, domain: fem.Domain):
    return wp.length_sq(field(s, domain))


@fem.integrand
def bend(s: fem.Sample, domain: fem.Domain):
    """Maps the unit cube to itself; faces stay."""
    x = fem.position(domain, s)
    bump = 0.08 * wp.sin(PI * x[0]) * wp.sin(PI * x[1]) * wp.sin(PI * x[2])
    return x + bump * wp.vec3d(1.0, -0.7, 0.4)


def bent(n):
    """A grid that a field deforms, as the peer's example has it."""
    positions = fem.make_polynomial_space(programs.grid(3, n, wp.float64), degree=2, dtype=wp.vec3d)
    positions = positions.make_field()
    fem.interpolate(bend, dest=positions)
    return positions.make_deformed_geometry(relative=False)


def relative_error(geo, degree):
    space = fem.make_polynomial_space(
        geo, degree=degree, element_basis=fem.ElementBasis.NEDELEC_FIRST_KIND, dtype=wp.vec3d
    )
    cells, boundary = fem.Cells(geo), fem.BoundarySides(geo)
    rule = fem.RegularQuadrature(cells, order=2 * degree + 4)
    fields = programs.fields_of(space)
    A = fem.integrate(curl_curl, quadrature=rule, fields=fields)
    b = fem.integrate(current, quadrature=rule, fields={"v": fields["v"]})
    fixed = fem.dirichlet(space, boundary)
    fixed.project(A, b)
    u = space.make_field()
    # The load is orthogonal to gradients, so that the iteration stays away from them.
    linear.cg(A, b, u.dof_values, tol=1e-10, maxiter=4000, M=linear.preconditioner(A, "diag"))
    error = fem.integrate(squared_error, quadrature=rule, fields={"u": u})
    return np.sqrt(error / fem.integrate(squared, quadrature=rule))


CASES = [("grid3", 1), ("tet", 1), ("hex", 1), ("bent", 1), ("tet", 2), ("bent", 2)]


@pytest.mark.parametrize(("name", "degree"), CASES)
def test_order_of_the_magnetic_field(name, degree):
    move = programs.warped if name in ("tet", "hex") else None
    sizes = (4, 8) if degree == 1 else (2, 4)
    errors = [
        relative_error(bent(n) if name == "bent" else programs.geometry(name, n, move=move), degree)
        for n in sizes
    ]
    assert programs.order_of(errors) > degree - 0.15, errors
    assert errors[-1] < 0.25
