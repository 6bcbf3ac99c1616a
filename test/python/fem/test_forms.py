"""Forms on grids: functionals, vectors and matrices against integrals by hand; interpolation."""

import numpy as np
import pytest

import warp as wp
import warp.fem as fem
from warp.sparse import bsr_mv


@fem.integrand
def square_of_x(s: fem.Sample, domain: fem.Domain):
    x = fem.position(domain, s)
    return x[0] * x[0]


@fem.integrand
def energy(s: fem.Sample, u: fem.Field):
    g = fem.grad(u, s)
    return u(s) * u(s) + wp.dot(g, g)


@fem.integrand
def load(s: fem.Sample, domain: fem.Domain, v: fem.Field, k: float):
    return k * domain(s)[1] * v(s)


@fem.integrand
def diffusion(s: fem.Sample, u: fem.Field, v: fem.Field, nu: float):
    return nu * wp.dot(fem.grad(u, s), fem.grad(v, s))


@fem.integrand
def mass(s: fem.Sample, u: fem.Field, v: fem.Field):
    return u(s) * v(s)


@fem.integrand
def linear(s: fem.Sample, domain: fem.Domain, k: float):
    x = domain(s)
    return k * x[0] - x[1]


@pytest.fixture
def grid():
    return fem.Grid2D(wp.vec2i(4, 3))


def linear_field(space):
    field = space.make_field()
    x = space.node_positions().numpy()
    field.dof_values.assign(x[:, 0] + 2.0 * x[:, 1])
    return field


def test_functional_of_position(grid):
    cells = fem.Cells(grid)
    found = fem.integrate(square_of_x, quadrature=fem.RegularQuadrature(cells, 2))
    assert found == pytest.approx(1.0 / 3.0, rel=1e-6)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_functional_of_field(grid, degree):
    field = linear_field(fem.make_polynomial_space(grid, degree=degree))
    quadrature = fem.RegularQuadrature(fem.Cells(grid), 2 * degree)
    found = fem.integrate(energy, quadrature=quadrature, fields={"u": field})
    # (x + 2 y)^2 + 1 + 4 on the unit square.
    exact = 1.0 / 3.0 + 4.0 * 0.25 + 4.0 / 3.0 + 5.0
    assert found == pytest.approx(exact, rel=3e-6)


@pytest.mark.parametrize("degree", [1, 2])
def test_vector_tests_polynomials(grid, degree):
    space = fem.make_polynomial_space(grid, degree=degree)
    test = fem.make_test(space)
    rule = fem.RegularQuadrature(test.domain, 3)
    vector = fem.integrate(load, quadrature=rule, fields={"v": test}, values={"k": 2.0})
    x = space.node_positions().numpy()
    # Sums with values of 1 and of y give the integrals of 2 y and 2 y^2.
    assert vector.numpy().sum() == pytest.approx(1.0, rel=1e-5)
    assert vector.numpy() @ x[:, 1] == pytest.approx(2.0 / 3.0, rel=1e-5)


@pytest.mark.parametrize("degree", [1, 2])
def test_matrices_act_on_linear_fields(grid, degree):
    space = fem.make_polynomial_space(grid, degree=degree)
    fields = {"u": fem.make_trial(space), "v": fem.make_test(space)}
    stiffness = fem.integrate(diffusion, fields=fields, values={"nu": 3.0})
    masses = fem.integrate(mass, fields=fields)
    u = linear_field(space).dof_values
    product = wp.zeros_like(u)
    bsr_mv(stiffness, u, product)
    assert product.numpy() @ u.numpy() == pytest.approx(15.0, rel=1e-5)
    bsr_mv(masses, u, product)
    assert product.numpy() @ u.numpy() == pytest.approx(1.0 / 3.0 + 1.0 + 4.0 / 3.0, rel=1e-5)


@pytest.mark.parametrize("reduction", ["weighted_average", "mean", "max", "min", "first"])
def test_interpolation_at_nodes_is_exact_for_linear_functions(grid, reduction):
    space = fem.make_polynomial_space(grid, degree=2)
    field = space.make_field()
    fem.interpolate(linear, dest=field, values={"k": 3.0}, reduction=reduction)
    x = space.node_positions().numpy()
    np.testing.assert_allclose(field.dof_values.numpy(), 3.0 * x[:, 0] - x[:, 1], atol=1e-6)


def test_sum_counts_the_cells_of_a_node(grid):
    space = fem.make_polynomial_space(grid, degree=1)
    field = space.make_field()
    fem.interpolate(linear, dest=field, values={"k": 0.0}, reduction="sum")
    counts = np.full((5, 4), 4.0)
    counts[[0, -1]] /= 2.0
    counts[:, [0, -1]] /= 2.0
    x = space.node_positions().numpy()
    np.testing.assert_allclose(field.dof_values.numpy(), -counts.ravel() * x[:, 1], atol=1e-6)


def test_interpolation_at_points_and_elements(grid):
    cells = fem.Cells(grid)
    quadrature = fem.RegularQuadrature(cells, 2)
    values = wp.zeros(quadrature.total_point_count(), dtype=float)
    fem.interpolate(linear, dest=values, at=quadrature, values={"k": 3.0})
    assert values.numpy().mean() == pytest.approx(1.0, rel=1e-6)
    values = wp.zeros(12, dtype=float)
    fem.interpolate(linear, dest=values, at=cells, values={"k": 3.0})
    centers = np.meshgrid((np.arange(4) + 0.5) / 4, (np.arange(3) + 0.5) / 3, indexing="ij")
    exact = 3.0 * centers[0].ravel() - centers[1].ravel()
    np.testing.assert_allclose(values.numpy(), exact, atol=1e-6)


def test_errors_name_both_sides(grid):
    space = fem.make_polynomial_space(grid, degree=1)
    test = fem.make_test(space)
    with pytest.raises(ValueError, match="expects a field 'v', but got none"):
        fem.integrate(load, domain=fem.Cells(grid), values={"k": 1.0})
    with pytest.raises(ValueError, match="has no field 'w', but \\['v'\\]"):
        fem.integrate(load, fields={"v": test, "w": test}, values={"k": 1.0})
    with pytest.raises(ValueError, match="expects a value 'k', but got none"):
        fem.integrate(load, fields={"v": test})
    with pytest.raises(ValueError, match="trial function, but no test function"):
        fields = {"v": fem.make_trial(space)}
        fem.integrate(load, fields=fields, values={"k": 1.0})
    other = fem.make_test(fem.make_polynomial_space(fem.Grid2D(wp.vec2i(2, 2)), degree=1))
    with pytest.raises(ValueError, match="a quadrature, test or trial function is defined on"):
        fem.integrate(load, domain=fem.Cells(grid), fields={"v": other}, values={"k": 1.0})
    with pytest.raises(ValueError, match="expects 20 values, one per node, but got 3"):
        space.make_field().dof_values = wp.zeros(3, dtype=float)


@fem.integrand
def quartic(s: fem.Sample, u: fem.Field):
    value = u(s)
    return value * value * value * value


@fem.integrand
def quartic_slope(s: fem.Sample, u: fem.Field, v: fem.Field):
    return 4.0 * u(s) * u(s) * u(s) * v(s)


@pytest.mark.parametrize("degree", [1, 2])
def test_default_order_is_that_of_the_integrand(grid, degree):
    space = fem.make_polynomial_space(grid, degree=degree)
    field = space.make_field()
    rng = np.random.default_rng(degree)
    field.dof_values.assign(rng.uniform(-1.0, 1.0, space.node_count()))
    rule = fem.RegularQuadrature(fem.Cells(grid), 4 * degree + 4)
    exact = fem.integrate(quartic, quadrature=rule, fields={"u": field})
    found = fem.integrate(quartic, domain=fem.Cells(grid), fields={"u": field})
    assert found == pytest.approx(exact, rel=1e-5)
    fields = {"u": field, "v": fem.make_test(space)}
    exact = fem.integrate(quartic_slope, quadrature=rule, fields=fields).numpy()
    found = fem.integrate(quartic_slope, fields=fields).numpy()
    np.testing.assert_allclose(found, exact, atol=1e-5 * abs(exact).max())
