"""Vectors and functionals by sum factorisation against the plan by pairs of nodes and points."""

import numpy as np
import pytest

import warp as wp
import warp.fem as fem


@fem.integrand
def scalar_form(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    x = domain(s)
    return x[0] * wp.dot(fem.grad(u, s), fem.grad(v, s)) + u(s) * u(s) * v(s)


@fem.integrand
def vector_form(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.ddot(fem.D(u, s), fem.grad(v, s)) + wp.dot(u(s), v(s)) * fem.div(u, s)


@fem.integrand
def gradient_only(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.dot(fem.grad(u, s), fem.grad(v, s))


@fem.integrand
def energy(s: fem.Sample, u: fem.Field):
    return wp.dot(fem.grad(u, s), fem.grad(u, s)) + u(s)


def grids():
    yield fem.Grid2D(wp.vec2i(3, 2), scalar_type=wp.float64)
    yield fem.Grid3D(wp.vec3i(2, 1, 3), scalar_type=wp.float64)


@pytest.mark.parametrize("grid", list(grids()), ids=["grid2", "grid3"])
@pytest.mark.parametrize("degree", [2, 3])
@pytest.mark.parametrize("form", [scalar_form, vector_form, gradient_only])
def test_vector_equals_that_by_pairs(grid, degree, form):
    is_vector = form is vector_form
    dtype = wp.types.vector(grid.dimension, wp.float64) if is_vector else wp.float64
    space = fem.make_polynomial_space(grid, degree=degree, dtype=dtype)
    field = space.make_field()
    rng = np.random.default_rng(degree)
    field.dof_values.assign(rng.uniform(-1.0, 1.0, field.dof_values.numpy().shape))
    fields = {"u": field, "v": fem.make_test(space)}
    rule = fem.RegularQuadrature(fem.Cells(grid), 2 * degree + 1)
    found = fem.integrate(form, quadrature=rule, fields=fields)
    exact = fem.integrate(form, quadrature=rule, fields=fields, assembly="generic")
    np.testing.assert_allclose(found.numpy(), exact.numpy(), rtol=1e-11, atol=1e-13)


def test_kernel_sums_axis_by_axis():
    grid = fem.Grid3D(wp.vec3i(2, 2, 2))
    space = fem.make_polynomial_space(grid, degree=3)
    from warp._src.fem.forms.form import Form

    rule = fem.RegularQuadrature(fem.Cells(grid), 6)
    fields = {"u": space.make_field(), "v": fem.make_test(space)}
    form = Form(gradient_only, fem.Cells(grid), rule, fields, {}, wp.get_device())
    assert form.plan.lines_of("field_u") is not None and form.plan.lines_of("test") is not None


@pytest.mark.parametrize("degree", [1, 2, 4])
def test_functional(degree):
    grid = fem.Grid3D(wp.vec3i(2, 2, 2), scalar_type=wp.float64)
    space = fem.make_polynomial_space(grid, degree=degree, dtype=wp.float64)
    field = space.make_field()
    x = space.node_positions().numpy()
    field.dof_values.assign(x[:, 0] + 2.0 * x[:, 1] - x[:, 2])
    found = fem.integrate(energy, domain=fem.Cells(grid), fields={"u": field})
    assert found == pytest.approx(6.0 + 1.0, rel=1e-13)
