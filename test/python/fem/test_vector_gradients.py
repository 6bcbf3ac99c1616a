"""Gradients of vectors by dof values on the tape, for each plan, against differences."""

import numpy as np
import pytest

import warp as wp
import warp.fem as fem


@fem.integrand
def residual(s: fem.Sample, u: fem.Field, v: fem.Field):
    return u(s) * wp.dot(fem.grad(u, s), fem.grad(v, s)) + u(s) * u(s) * v(s)


@fem.integrand
def energy(s: fem.Sample, u: fem.Field):
    return u(s) * wp.dot(fem.grad(u, s), fem.grad(u, s))


def field_of(space, values):
    field = space.make_field()
    field.dof_values = wp.array(values, dtype=wp.float64, requires_grad=True)
    return field


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("assembly", [None, "generic"])
def test_vector(degree, assembly):
    grid = fem.Grid2D(wp.vec2i(3, 2), scalar_type=wp.float64)
    space = fem.make_polynomial_space(grid, degree=degree, dtype=wp.float64)
    rng = np.random.default_rng(degree)
    values, weights, step = rng.uniform(-1.0, 1.0, (3, space.node_count()))
    rule = fem.RegularQuadrature(fem.Cells(grid), 3 * degree)

    def vector(at):
        field = field_of(space, at)
        fields = {"u": field, "v": fem.make_test(space)}
        out = wp.zeros(space.node_count(), dtype=wp.float64, requires_grad=True)
        tape = wp.Tape()
        with tape:
            fem.integrate(residual, quadrature=rule, fields=fields, output=out, assembly=assembly)
        return field, out, tape

    field, out, tape = vector(values)
    tape.backward(grads={out: wp.array(weights, dtype=wp.float64)})
    found = field.dof_values.grad.numpy() @ step
    h = 1e-6
    high, low = (vector(values + sign * h * step)[1].numpy() @ weights for sign in (1.0, -1.0))
    assert found == pytest.approx((high - low) / (2.0 * h), rel=1e-7)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_functional(degree):
    grid = fem.Grid3D(wp.vec3i(2, 1, 2), scalar_type=wp.float64)
    space = fem.make_polynomial_space(grid, degree=degree, dtype=wp.float64)
    rng = np.random.default_rng(degree)
    values, step = rng.uniform(-1.0, 1.0, (2, space.node_count()))
    rule = fem.RegularQuadrature(fem.Cells(grid), 3 * degree)

    def total(at):
        field = field_of(space, at)
        out = wp.zeros(1, dtype=wp.float64, requires_grad=True)
        tape = wp.Tape()
        with tape:
            fem.integrate(energy, quadrature=rule, fields={"u": field}, output=out)
        return field, out, tape

    field, out, tape = total(values)
    tape.backward(out)
    found = field.dof_values.grad.numpy() @ step
    h = 1e-6
    high, low = (total(values + sign * h * step)[1].numpy()[0] for sign in (1.0, -1.0))
    assert found == pytest.approx((high - low) / (2.0 * h), rel=1e-7)
