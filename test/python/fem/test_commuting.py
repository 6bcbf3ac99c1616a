"""Interpolation by moments: the de Rham diagram commutes, and fields of the space come back."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem

CURL, DIV = fem.ElementBasis.NEDELEC_FIRST_KIND, fem.ElementBasis.RAVIART_THOMAS
CELLS = ("tri", "quad", "tet", "hex", "grid2", "grid3")
REAL = wp.float64


def geometry(name):
    move = None if name.startswith("grid") else programs.warped
    return programs.geometry(name, 2, move=move)


@wp.func
def rotation(slope: wp.mat33d):
    return wp.vec3d(slope[2, 1] - slope[1, 2], slope[0, 2] - slope[2, 0], slope[1, 0] - slope[0, 1])


@fem.integrand
def smooth(s: fem.Sample, domain: fem.Domain):
    """A field that no element has."""
    x = fem.position(domain, s)
    value = x - x
    for axis in range(len(x)):
        value[axis] = wp.sin(2.0 * x[axis]) + wp.cos(x[0] + 2.0 * x[1])
    return value


@fem.integrand
def smooth_divergence(s: fem.Sample, domain: fem.Domain):
    x = fem.position(domain, s)
    total = -3.0 * wp.sin(x[0] + 2.0 * x[1])
    for axis in range(len(x)):
        total += 2.0 * wp.cos(2.0 * x[axis])
    return total


@fem.integrand
def divergence_against(s: fem.Sample, domain: fem.Domain, u: fem.Field, q: fem.Field):
    return (fem.div(u, s) - smooth_divergence(s, domain)) * q(s)


@fem.integrand
def rotation_of(s: fem.Sample, u: fem.Field):
    return rotation(fem.grad(u, s))


@fem.integrand
def squared_divergence(s: fem.Sample, u: fem.Field):
    return fem.div(u, s) * fem.div(u, s)


@fem.integrand
def squared_rotation(s: fem.Sample, u: fem.Field):
    slope = fem.grad(u, s)
    skew = slope - wp.transpose(slope)
    return wp.ddot(skew, skew)


@fem.integrand
def gradient_of(s: fem.Sample, p: fem.Field):
    return fem.grad(p, s)


@fem.integrand
def squared(s: fem.Sample, u: fem.Field):
    return wp.length_sq(u(s))


@fem.integrand
def value_of(s: fem.Sample, u: fem.Field):
    return u(s)


def random_field(space):
    field = space.make_field()
    values = np.random.default_rng(3).standard_normal(field.dof_values.shape[0])
    field.dof_values = wp.array(values, dtype=REAL)
    return field


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("basis", [CURL, DIV], ids=lambda b: b.name)
@pytest.mark.parametrize("name", CELLS)
def test_fields_of_the_space_come_back(name, basis, degree):
    space = fem.make_polynomial_space(geometry(name), degree=degree, element_basis=basis)
    field, again = random_field(space), space.make_field()
    fem.interpolate(value_of, dest=again, fields={"u": field})
    np.testing.assert_allclose(again.dof_values.numpy(), field.dof_values.numpy(), atol=1e-11)


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("name", ["tri", "tet", "grid2", "grid3"])
def test_divergence_of_the_interpolant_is_the_projection(name, degree):
    """div of the interpolant minus div of the field is orthogonal to the divergences."""
    geo = programs.geometry(name, 2)
    space = fem.make_polynomial_space(geo, degree=degree, element_basis=DIV)
    field = space.make_field()
    fem.interpolate(smooth, dest=field)
    tests = fem.make_polynomial_space(geo, degree=degree - 1, dtype=REAL, discontinuous=True)
    rule = fem.RegularQuadrature(fem.Cells(geo), order=15)
    fields = {"u": field, "q": fem.make_test(tests)}
    found = fem.integrate(divergence_against, quadrature=rule, fields=fields).numpy()
    assert np.abs(found).max() < 2e-8


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("name", CELLS)
def test_rotations_of_gradients_vanish(name, degree):
    geo = geometry(name)
    potential = random_field(fem.make_polynomial_space(geo, degree=degree, dtype=REAL))
    field = fem.make_polynomial_space(geo, degree=degree, element_basis=CURL).make_field()
    fem.interpolate(gradient_of, dest=field, fields={"p": potential})
    cells = fem.Cells(geo)
    size = fem.integrate(squared, domain=cells, fields={"u": field})
    assert fem.integrate(squared_rotation, domain=cells, fields={"u": field}) < 1e-20 * size


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("name", ["tet", "hex", "grid3"])
def test_divergences_of_rotations_vanish(name, degree):
    geo = geometry(name)
    potential = random_field(fem.make_polynomial_space(geo, degree=degree, element_basis=CURL))
    field = fem.make_polynomial_space(geo, degree=degree, element_basis=DIV).make_field()
    fem.interpolate(rotation_of, dest=field, fields={"u": potential})
    cells = fem.Cells(geo)
    size = fem.integrate(squared, domain=cells, fields={"u": field})
    found = fem.integrate(squared_divergence, domain=cells, fields={"u": field})
    assert found < 1e-20 * size


@fem.integrand
def scaled(s: fem.Sample, domain: fem.Domain, p: fem.Field):
    x = fem.position(domain, s)
    return p(s) * p(s) * x


@pytest.mark.parametrize("basis", [CURL, DIV], ids=lambda b: b.name)
@pytest.mark.parametrize("name", ["tri", "hex"])
def test_gradients_through_interpolation(name, basis):
    """The tape differentiates sums over moments' points, against differences in float64."""
    geo = geometry(name)
    space = fem.make_polynomial_space(geo, degree=1, dtype=REAL)
    target = fem.make_polynomial_space(geo, degree=2, element_basis=basis)
    rng = np.random.default_rng(7)
    start, step = rng.uniform(0.5, 1.0, (2, space.node_count()))
    weights = rng.uniform(-1.0, 1.0, target.node_count())

    def interpolated(values):
        p, u = space.make_field(), target.make_field()
        p.dof_values = wp.array(values, dtype=REAL, requires_grad=True)
        u.dof_values = wp.zeros(target.node_count(), dtype=REAL, requires_grad=True)
        with wp.Tape() as tape:
            fem.interpolate(scaled, dest=u, fields={"p": p})
        return p, u, tape

    p, u, tape = interpolated(start)
    tape.backward(grads={u.dof_values: wp.array(weights, dtype=REAL)})
    found = p.dof_values.grad.numpy() @ step
    high, low = (
        weights @ interpolated(start + sign * 1e-6 * step)[1].dof_values.numpy()
        for sign in (1.0, -1.0)
    )
    assert found == pytest.approx((high - low) / 2e-6, rel=1e-7)


@pytest.mark.parametrize("basis", [CURL, DIV], ids=lambda b: b.name)
@pytest.mark.parametrize("name", ["tri", "tet", "hex", "grid2"])
def test_values_on_the_boundary_are_those_of_cells(name, basis):
    """Sides and cells give nodes on the boundary the same moments."""
    geo = geometry(name)
    space = fem.make_polynomial_space(geo, degree=2, element_basis=basis)
    of_cells, of_sides = space.make_field(), space.make_field()
    fem.interpolate(smooth, dest=of_cells)
    missing = -123.0
    of_sides.dof_values.fill_(missing)
    boundary = fem.BoundarySides(geo)
    restriction = fem.make_restriction(of_sides.trace(), domain=boundary)
    fem.interpolate(smooth, dest=restriction)
    found, expected = of_sides.dof_values.numpy(), of_cells.dof_values.numpy()
    is_set = found != missing
    assert 0 < is_set.sum() < len(found)
    np.testing.assert_allclose(found[is_set], expected[is_set], atol=1e-12)
