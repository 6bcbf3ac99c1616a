"""Variations of forms: residuals and tangents against those written by hand, and differences."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem

RNG = np.random.default_rng(6)


@fem.integrand
def energy(s: fem.Sample, u: fem.Field, c: wp.float64):
    g, w = fem.grad(u, s), u(s)
    return 0.5 * c * wp.dot(g, g) + 0.25 * w * w * w * w


@fem.integrand
def residual(s: fem.Sample, u: fem.Field, v: fem.Field, c: wp.float64):
    w = u(s)
    return c * wp.dot(fem.grad(u, s), fem.grad(v, s)) + w * w * w * v(s)


@fem.integrand
def tangent(s: fem.Sample, u: fem.Field, v: fem.Field, w: fem.Field, c: wp.float64):
    return c * wp.dot(fem.grad(w, s), fem.grad(v, s)) + 3.0 * u(s) * u(s) * w(s) * v(s)


@fem.integrand
def neo_hookean(s: fem.Sample, u: fem.Field):
    F = wp.identity(n=3, dtype=wp.float64) + fem.grad(u, s)
    J = wp.determinant(F)
    return 0.5 * (wp.ddot(F, F) - 3.0) - wp.log(J) + wp.log(J) * wp.log(J)


@fem.integrand
def neo_hookean_residual(s: fem.Sample, u: fem.Field, v: fem.Field):
    F = wp.identity(n=3, dtype=wp.float64) + fem.grad(u, s)
    T = wp.transpose(wp.inverse(F))
    P = F - T + 2.0 * wp.log(wp.determinant(F)) * T
    return wp.ddot(P, fem.grad(v, s))


@fem.integrand
def neo_hookean_tangent(s: fem.Sample, u: fem.Field, v: fem.Field, w: fem.Field):
    F = wp.identity(n=3, dtype=wp.float64) + fem.grad(u, s)
    T = wp.transpose(wp.inverse(F))
    d = fem.grad(w, s)
    k = 1.0 - 2.0 * wp.log(wp.determinant(F))
    dP = d + k * (T * wp.transpose(d) * T) + 2.0 * wp.ddot(T, d) * T
    return wp.ddot(dP, fem.grad(v, s))


def scalar_case(name):
    space = fem.make_polynomial_space(
        programs.geometry(name, 2, wp.float64), degree=2, dtype=wp.float64
    )
    u = programs.field_of(space, RNG.standard_normal(space.node_count()))
    return space, u, (energy, residual, tangent), {"c": 1.5}


def vector_case(name):
    geo = programs.geometry(name, 2, wp.float64)
    space = fem.make_polynomial_space(geo, degree=1, dtype=wp.vec3d)
    u = programs.field_of(space, 0.05 * RNG.standard_normal(3 * space.node_count()))
    return space, u, (neo_hookean, neo_hookean_residual, neo_hookean_tangent), {}


CASES = [(scalar_case, "grid2"), (scalar_case, "tet"), (vector_case, "grid3"), (vector_case, "tet")]


@pytest.mark.usefixtures("threads")
@pytest.mark.parametrize(("make", "name"), CASES)
def test_residual_and_tangent(make, name):
    space, u, (form, first, second), values = make(name)
    domain = fem.Cells(space.geometry)
    rule = fem.RegularQuadrature(domain, order=6)
    fields = {"u": u, "v": fem.make_test(space, domain=domain)}
    common = {"quadrature": rule, "values": values}
    variation = fem.derivative(form, "u", "v")
    found = fem.integrate(variation, fields=fields, **common).numpy()
    expected = fem.integrate(first, fields=fields, **common).numpy()
    np.testing.assert_allclose(found, expected, atol=1e-13 * np.abs(expected).max())
    fields["w"] = fem.make_trial(space, domain=domain)
    expected = programs.dense(fem.integrate(second, fields=fields, **common))
    for chain in (fem.derivative(variation, "u", "w"), fem.derivative(first, "u", "w")):
        found = programs.dense(fem.integrate(chain, fields=fields, **common))
        np.testing.assert_allclose(found, expected, atol=1e-13 * np.abs(expected).max())


@pytest.mark.usefixtures("threads")
def test_newton_finds_a_minimum():
    space, u, (form, _, _), values = scalar_case("grid2")
    domain = fem.Cells(space.geometry)
    rule = fem.RegularQuadrature(domain, order=8)
    residual_form = fem.derivative(form, "u", "v")
    tangent_form = fem.derivative(residual_form, "u", "w")
    fixed = programs.on_boundary(space.node_positions().numpy())
    start = np.where(fixed, 1.0, u.dof_values.numpy())
    u.dof_values.assign(start)
    fields = {"u": u, "v": fem.make_test(space, domain=domain)}
    both = {**fields, "w": fem.make_trial(space, domain=domain)}
    norms = []
    for _ in range(6):
        r = fem.integrate(residual_form, quadrature=rule, fields=fields, values=values).numpy()
        K = programs.dense(fem.integrate(tangent_form, quadrature=rule, fields=both, values=values))
        norms.append(np.abs(r[~fixed]).max())
        step = programs.solve(K, -r, fixed, np.zeros(len(r)))
        u.dof_values.assign(u.dof_values.numpy() + step)
    assert norms[-1] < 1e-13 and norms[3] < 50.0 * norms[2] ** 2


def test_what_does_not_fit_is_named():
    with pytest.raises(ValueError, match="has no field 'q', but"):
        fem.derivative(energy, "q")
    with pytest.raises(ValueError, match="has a field 'u' already"):
        fem.derivative(energy, "u", "u")
    with pytest.raises(ValueError, match="expects a function decorated"):
        fem.derivative(len, "u")
    assert fem.derivative(fem.derivative(energy, "u"), "u").field_names == ["u", "du", "ddu"]
    space, u, (form, _, _), values = scalar_case("grid2")
    other = fem.make_polynomial_space(space.geometry, degree=1, dtype=wp.vec2d)
    with pytest.raises(ValueError, match="'v' expects a function of the values of 'u', 'float64'"):
        fields = {"u": u, "v": fem.make_test(other)}
        fem.integrate(fem.derivative(form, "u", "v"), fields=fields, values=values)
