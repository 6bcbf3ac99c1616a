"""Discontinuous Galerkin: interior penalty converges, upwind transport conserves mass."""

import math

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem


@fem.integrand
def interior_penalty(
    s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field, penalty: wp.float64
):
    n = fem.normal(domain, s)
    flux_u = wp.dot(fem.grad_average(u, s), n)
    flux_v = wp.dot(fem.grad_average(v, s), n)
    jump_u, jump_v = fem.jump(u, s), fem.jump(v, s)
    return (
        penalty * fem.measure_ratio(domain, s) * jump_u * jump_v - jump_u * flux_v - jump_v * flux_u
    )


@fem.integrand
def boundary_penalty(
    s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field, penalty: wp.float64
):
    n = fem.normal(domain, s)
    weight = penalty * fem.measure_ratio(domain, s)
    flux_u, flux_v = wp.dot(fem.grad(u, s), n), wp.dot(fem.grad(v, s), n)
    return weight * u(s) * v(s) - u(s) * flux_v - v(s) * flux_u


def penalty_error(name, degree, n):
    move = programs.warped if name == "quad" else None
    geo = programs.geometry(name, n, wp.float64, move)
    space = fem.make_polynomial_space(geo, degree=degree, discontinuous=True, dtype=wp.float64)
    values = {"penalty": 8.0 * degree * degree}
    cells, sides, boundary = fem.Cells(geo), fem.Sides(geo), fem.BoundarySides(geo)
    # Sides of the boundary are in both: their jump is zero.
    a = programs.dense(fem.integrate(programs.diffusion, fields=programs.fields_of(space, cells)))
    for form, domain in ((interior_penalty, sides), (boundary_penalty, boundary)):
        fields = programs.fields_of(space, domain)
        a += programs.dense(fem.integrate(form, fields=fields, values=values))
    np.testing.assert_allclose(a, a.T, atol=1e-12 * np.abs(a).max())
    test = fem.make_test(space, domain=cells)
    rule = fem.RegularQuadrature(cells, order=2 * degree + 2)
    b = fem.integrate(programs.load_2d, quadrature=rule, fields={"v": test}).numpy()
    field = programs.field_of(space, np.linalg.solve(a, b))
    return programs.norm(programs.error_2d, {"u": field}, 2 * degree + 4, cells)


CASES = [("grid2", 1, 8), ("grid2", 2, 6), ("grid2", 3, 4), ("tri", 1, 10), ("tri", 2, 6)]
CASES += [("tri", 3, 4), ("quad", 1, 8), ("quad", 2, 6)]


@pytest.mark.parametrize(("name", "degree", "n"), CASES)
def test_interior_penalty_converges(name, degree, n):
    errors = [penalty_error(name, degree, n), penalty_error(name, degree, 2 * n)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(degree + 1, abs=0.15), errors


@fem.integrand
def transport(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    x = fem.position(domain, s)
    velocity = wp.vec2d(0.5 - x[1], x[0] - 0.5)
    return -u(s) * wp.dot(velocity, fem.grad(v, s))


@fem.integrand
def upwind(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    x = fem.position(domain, s)
    velocity = wp.vec2d(0.5 - x[1], x[0] - 0.5)
    speed = wp.dot(velocity, fem.normal(domain, s))
    flux = speed * fem.average(u, s) + 0.5 * wp.abs(speed) * fem.jump(u, s)
    return flux * fem.jump(v, s)


@pytest.mark.parametrize("name", ["grid2", "tri"])
def test_upwind_transport_conserves_mass(name):
    geo = programs.geometry(name, 5, wp.float64)
    space = fem.make_polynomial_space(geo, degree=2, discontinuous=True, dtype=wp.float64)
    a = programs.dense(fem.integrate(transport, fields=programs.fields_of(space)))
    interior = fem.Sides(geo)
    a += programs.dense(fem.integrate(upwind, fields=programs.fields_of(space, interior)))
    m = programs.dense(fem.integrate(programs.mass, fields=programs.fields_of(space)))
    ones = np.ones(len(a))
    # The sum over all test functions is the flux through the boundary, which has no jumps.
    assert np.abs(ones @ a).max() < 1e-13
    rng = np.random.default_rng(0)
    u = rng.standard_normal(len(a))
    moved = np.linalg.solve(m + 0.02 * a, m @ u)
    assert abs(ones @ m @ (moved - u)) < 1e-13
    assert moved @ m @ moved < u @ m @ u


def test_jump_of_a_continuous_field_is_zero():
    @fem.integrand
    def squared_jump(s: fem.Sample, u: fem.Field):
        return fem.jump(u, s) * fem.jump(u, s)

    @fem.integrand
    def squared_average(s: fem.Sample, u: fem.Field):
        return fem.average(u, s) * fem.average(u, s)

    for name in ("grid2", "grid3", "tri", "tet"):
        geo = programs.geometry(name, 2, wp.float64)
        space = fem.make_polynomial_space(geo, degree=2, dtype=wp.float64)
        points = space.node_positions().numpy()
        field = programs.field_of(space, 1.0 + points[:, 0]).trace()
        sides = fem.Sides(geo)
        assert programs.norm(squared_jump, {"u": field}, 4, sides) < 1e-14
        assert programs.norm(squared_average, {"u": field}, 4, sides) > 1.0
