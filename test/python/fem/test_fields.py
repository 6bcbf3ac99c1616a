"""Uniform, implicit, nonconforming and trace fields against integrals by hand."""

import numpy as np
import pytest

import warp as wp
import warp.fem as fem
from warp.sparse import bsr_mv


@wp.func
def parabola(x: wp.vec2, a: float):
    return wp.vec2(a * x[0] * x[0], x[1])


@fem.integrand
def derivatives(s: fem.Sample, u: fem.Field, v: fem.Field):
    g = fem.grad(u, s)
    return g[0, 0] + v(s) + fem.div(u, s)


@fem.integrand
def value(s: fem.Sample, u: fem.Field):
    return u(s)


@fem.integrand
def flux(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    return u(s) * fem.normal(domain, s)


@fem.integrand
def penalty(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    normal = fem.normal(domain, s)
    return fem.jump(u, s) * fem.jump(v, s) - fem.average(u, s) * wp.dot(
        fem.grad_average(v, s), normal
    )


@pytest.fixture
def grid():
    return fem.Grid2D(wp.vec2i(4, 3))


def test_implicit_field_has_derivatives(grid):
    cells = fem.Cells(grid)
    u = fem.ImplicitField(cells, parabola, {"a": 3.0}, grad_func=True, degree=2)
    v = fem.UniformField(cells, 2.0)
    rule = fem.RegularQuadrature(cells, 2)
    found = fem.integrate(derivatives, quadrature=rule, fields={"u": u, "v": v})
    assert found == pytest.approx(3.0 + 2.0 + 4.0, rel=1e-6)
    u.values.a = 1.0
    v.value = 0.0
    found = fem.integrate(derivatives, quadrature=rule, fields={"u": u, "v": v})
    assert found == pytest.approx(1.0 + 2.0, rel=1e-6)


@pytest.mark.parametrize("scale", [1e-5, 1e-3, 1.0, 1e3])
def test_nonconforming_indicator_at_all_scales(scale):
    inner = fem.Grid2D(
        wp.vec2i(5, 5),
        bounds_lo=wp.vec2(0.25 * scale, 0.25 * scale),
        bounds_hi=wp.vec2(0.75 * scale, 0.75 * scale),
    )
    one = fem.make_polynomial_space(inner, degree=1).make_field()
    one.dof_values.fill_(1.0)
    cells = fem.Cells(fem.Grid2D(wp.vec2i(4, 4), bounds_hi=wp.vec2(scale, scale)))
    field = fem.NonconformingField(cells, one)
    found = fem.integrate(value, quadrature=fem.RegularQuadrature(cells, 2), fields={"u": field})
    assert found == pytest.approx(0.25 * scale**2, rel=1e-5)


def test_trace_integrates_over_the_boundary(grid):
    field = fem.make_polynomial_space(grid, degree=1).make_field()
    field.dof_values.assign(field.space.node_positions().numpy()[:, 0])
    boundary = fem.BoundarySides(grid)
    rule = fem.RegularQuadrature(boundary, 2)
    found = fem.integrate(flux, quadrature=rule, fields={"u": field.trace()})
    np.testing.assert_allclose(np.array(found), [1.0, 0.0], atol=1e-6)
    with pytest.raises(ValueError, match="defined on cells, but the domain has sides; use its"):
        fem.integrate(flux, quadrature=rule, fields={"u": field})


def test_sides_couple_both_cells(grid):
    space = fem.make_polynomial_space(grid, degree=1, discontinuous=True)
    sides = fem.Sides(grid)
    fields = {
        "u": fem.make_trial(space, domain=sides),
        "v": fem.make_test(space, domain=sides),
    }
    matrix = fem.integrate(penalty, fields=fields)
    x = space.node_positions().numpy()[:, 0]
    ones = wp.array(np.ones(len(x)), dtype=float)
    product = wp.zeros_like(ones)
    bsr_mv(matrix, ones, product)
    # The average gradient of v = x is (1, 0): normals of 3 lines inside and one at each end.
    assert product.numpy() @ x == pytest.approx(-(3.0 + 1.0 - 1.0), rel=1e-5)
    assert product.numpy().sum() == pytest.approx(0.0, abs=1e-5)
    # A jump of 1 at x = 0.5 in u and v.
    step = np.where(space.node_positions().numpy()[:, 0] > 0.5, 1.0, 0.0)
    cell = np.repeat(np.arange(12), 4) // 3
    step = np.where(cell >= 2, 1.0, 0.0)
    bsr_mv(matrix, wp.array(step, dtype=float), product)
    assert product.numpy() @ step == pytest.approx(1.0, rel=1e-4)


@fem.integrand
def value_at(s: fem.Sample, domain: fem.Domain, u: fem.Field, points: wp.array(dtype=wp.vec2)):
    return u(fem.lookup(domain, points[s.qp_index]))


@fem.integrand
def moved_load(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    return u(fem.lookup(domain, 0.5 * domain(s))) * v(s)


def test_fields_at_positions_that_are_looked_up(grid):
    space = fem.make_polynomial_space(grid, degree=2)
    field = space.make_field()
    x = space.node_positions().numpy()
    field.dof_values.assign(x[:, 0] * x[:, 1])
    points = np.random.default_rng(1).uniform(0.0, 1.0, (50, 2)).astype(np.float32)
    values = wp.zeros(50, dtype=float)
    fem.interpolate(
        value_at,
        dest=values,
        at=fem.Cells(grid),
        dim=50,
        fields={"u": field},
        values={"points": wp.array(points, dtype=wp.vec2)},
    )
    np.testing.assert_allclose(values.numpy(), points[:, 0] * points[:, 1], atol=1e-6)
    # The field at half of the position, tested with functions that sum to 1.
    fields = {"u": field, "v": fem.make_test(space)}
    rule = fem.RegularQuadrature(fem.Cells(grid), 6)
    found = fem.integrate(moved_load, quadrature=rule, fields=fields)
    assert found.numpy().sum() == pytest.approx(0.25 * 0.25, rel=1e-5)


def test_values_stay_when_a_field_is_bound_to_another_grid():
    """Simulations keep values of points from step to step, whose grid is another each time."""
    spaces = [fem.make_polynomial_space(fem.Grid2D(wp.vec2i(n, 1)), degree=0) for n in (4, 2, 5, 5)]
    field = spaces[0].make_field()
    values = field.dof_values
    values.assign([1.0, 2.0, 3.0, 4.0])
    for space, expected in zip(
        spaces, ([1, 2, 3, 4], [1, 2], [1, 2, 0, 0, 0], [1, 2, 0, 0, 0]), strict=True
    ):
        field.rebind(space, fem.make_space_partition(space_topology=space.topology))
        assert field.space is space
        np.testing.assert_array_equal(field.dof_values.numpy(), expected)
    assert values.numpy().tolist() == [1.0, 2.0, 3.0, 4.0]
