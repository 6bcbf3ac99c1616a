"""Traces and views of fields, whose values change after they were made."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem


@fem.integrand
def value(s: fem.Sample, u: fem.Field):
    return u(s)


@fem.integrand
def volume(s: fem.Sample):
    return 1.0


@fem.integrand
def value_of_test(s: fem.Sample, v: fem.Field):
    return v(s)


def field():
    geo = programs.geometry("tri", 3)
    made = fem.make_polynomial_space(geo, degree=2, dtype=wp.float64).make_field()
    made.dof_values.fill_(1.0)
    return geo, made


def test_a_trace_follows_its_field():
    """The boundary of the unit square has length 4, whatever array the field has."""
    geo, u = field()
    trace, sides = u.trace(), fem.BoundarySides(geo)
    assert trace.cell_field is u and u.cell_field is u
    assert fem.integrate(value, domain=sides, fields={"u": trace}) == pytest.approx(4.0)
    u.dof_values = wp.array(np.full(u.dof_values.shape[0], 3.0), dtype=wp.float64)
    assert fem.integrate(value, domain=sides, fields={"u": trace}) == pytest.approx(12.0)
    trace.dof_values = wp.array(np.full(u.dof_values.shape[0], 2.0), dtype=wp.float64)
    assert fem.integrate(value, domain=fem.Cells(geo), fields={"u": u}) == pytest.approx(2.0)


def test_a_trace_has_the_gradient_of_its_field():
    geo, u = field()
    u.dof_values = wp.clone(u.dof_values, requires_grad=True)
    out = wp.zeros(1, dtype=wp.float64, requires_grad=True)
    with wp.Tape() as tape:
        fem.integrate(value, domain=fem.BoundarySides(geo), fields={"u": u.trace()}, output=out)
    tape.backward(out)
    assert u.dof_values.grad.numpy().sum() == pytest.approx(4.0)


def test_other_views_follow_their_field():
    """A displacement by x doubles lengths, a second one triples them."""
    geo = programs.geometry("tri", 3)
    u = fem.make_polynomial_space(geo, degree=1, dtype=wp.vec2d).make_field()
    x = u.space.node_positions().numpy()
    moved = u.make_deformed_geometry()
    for size in (2.0, 3.0):
        u.dof_values = wp.array((size - 1.0) * x, dtype=wp.vec2d)
        assert fem.integrate(volume, domain=fem.Cells(moved)) == pytest.approx(size**2)
    inner = programs.geometry("quad", 2)
    p = fem.make_polynomial_space(geo, degree=1, dtype=wp.float64).make_field()
    known = fem.NonconformingField(fem.Cells(inner), p)
    for size in (2.0, 3.0):
        p.dof_values = wp.array(np.full(p.dof_values.shape[0], size), dtype=wp.float64)
        found = fem.integrate(value, domain=fem.Cells(inner), fields={"u": known})
        assert found == pytest.approx(size)


def test_local_test_function():
    geo, u = field()
    v = fem.make_test(u.space)
    local = fem.field.LocalTestField(v)
    assert local.global_field is v
    found, expected = (fem.integrate(value_of_test, fields={"v": one}) for one in (local, v))
    np.testing.assert_array_equal(found.numpy(), expected.numpy())


def test_restriction_names_its_space():
    geo, u = field()
    assert fem.make_restriction(u, domain=fem.Cells(geo)).space is u.space


def test_shape_of_a_basis():
    geo, u = field()
    basis = u.space.basis
    assert basis.shape.element == basis.element
    assert basis.value is basis.shape.Value.Scalar
