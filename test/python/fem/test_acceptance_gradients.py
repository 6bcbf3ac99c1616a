"""Derivatives of functionals, vectors and matrices against differences in float64."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem

RNG = np.random.default_rng(2)


@fem.integrand
def energy(s: fem.Sample, u: fem.Field, c: wp.array(dtype=wp.float64)):
    g = fem.grad(u, s)
    w = u(s)
    return 0.5 * c[0] * wp.dot(g, g) + 0.25 * w * w * w * w


@fem.integrand
def residual(s: fem.Sample, u: fem.Field, v: fem.Field, c: wp.array(dtype=wp.float64)):
    w = u(s)
    return c[0] * wp.dot(fem.grad(u, s), fem.grad(v, s)) + w * w * w * v(s)


@fem.integrand
def tangent(s: fem.Sample, w: fem.Field, u: fem.Field, v: fem.Field, c: wp.array(dtype=wp.float64)):
    k = c[0] * c[0] * (1.0 + w(s) * w(s))
    return k * wp.dot(fem.grad(u, s), fem.grad(v, s)) + w(s) * u(s) * v(s)


def space_of(name, degree, **options):
    move = None if "grid" in name else programs.warped
    geo = programs.geometry(name, 2, wp.float64, move, **options)
    return fem.make_polynomial_space(geo, degree=degree, dtype=wp.float64)


def random_field(space):
    field = programs.field_of(space, RNG.standard_normal(space.node_count()))
    field.dof_values.requires_grad = True
    return field


def difference(call, array, step=1e-5):
    """A directional derivative of `call()` by an array, and the direction."""
    start = array.numpy().copy()
    direction = RNG.standard_normal(start.shape)
    values = []
    for sign in (1.0, -1.0):
        array.assign(start + sign * step * direction)
        values.append(call())
    array.assign(start)
    return (values[0] - values[1]) / (2.0 * step), direction


def check(array, call, expected_zero=False):
    slope, direction = difference(call, array)
    found = float((array.grad.numpy() * direction).sum())
    assert found == pytest.approx(slope, rel=1e-6), (found, slope)


CELLS = [("grid3", 1), ("tri", 2), ("tet", 2), ("hex", 1)]


@pytest.mark.parametrize(("name", "degree"), CELLS)
def test_gradient_of_an_energy_is_the_residual(name, degree):
    space = space_of(name, degree)
    domain = fem.Cells(space.geometry)
    rule = fem.RegularQuadrature(domain, order=4 * degree)
    u = random_field(space)
    c = wp.array([1.5], dtype=wp.float64, requires_grad=True)
    loss = wp.zeros(1, dtype=wp.float64, requires_grad=True)
    values = {"c": c}

    def run():
        loss.zero_()
        fem.integrate(energy, quadrature=rule, fields={"u": u}, values=values, output=loss)
        return float(loss.numpy()[0])

    with wp.Tape() as tape:
        run()
    tape.backward(loss)
    test = fem.make_test(space, domain=domain)
    r = fem.integrate(residual, quadrature=rule, fields={"u": u, "v": test}, values=values)
    np.testing.assert_allclose(u.dof_values.grad.numpy(), r.numpy(), atol=1e-12)
    check(u.dof_values, run)
    check(c, run)


@pytest.mark.parametrize(("name", "degree"), CELLS)
@pytest.mark.parametrize("assembly", [None, "generic", "dispatch"])
def test_gradient_of_a_matrix(name, degree, assembly):
    gradient_of_a_matrix(name, degree, assembly, "auto")


@pytest.mark.parametrize("assembly", ["generic", "dispatch"])
@pytest.mark.parametrize("construction", ["triplets", "row_compress", "mapped", "mapped_atomic"])
def test_gradient_of_every_construction(construction, assembly):
    gradient_of_a_matrix("tri", 2, assembly, construction)


def gradient_of_a_matrix(name, degree, assembly, construction):
    space = space_of(name, degree)
    domain = fem.Cells(space.geometry)
    rule = fem.RegularQuadrature(domain, order=2 * degree)
    w = random_field(space)
    c = wp.array([1.5], dtype=wp.float64, requires_grad=True)
    fields = {"w": w, **programs.fields_of(space, domain)}
    arguments = {"quadrature": rule, "fields": fields, "values": {"c": c}, "assembly": assembly}
    arguments["bsr_options"] = {"construction": construction}
    with wp.Tape() as tape:
        matrix = fem.integrate(tangent, **arguments)
    assert matrix.values.requires_grad
    weights = RNG.standard_normal(matrix.values.shape)
    tape.backward(grads={matrix.values: wp.array(weights, dtype=wp.float64)})

    def run():
        return float((weights * fem.integrate(tangent, **arguments).values.numpy()).sum())

    check(w.dof_values, run)
    check(c, run)


@pytest.mark.parametrize(("name", "degree"), [("tri", 1), ("tet", 2), ("hex", 1)])
def test_gradient_by_positions(name, degree):
    space = space_of(name, degree, requires_grad=True)
    domain = fem.Cells(space.geometry)
    rule = fem.RegularQuadrature(domain, order=2 * degree)
    fields = programs.fields_of(space, domain)
    positions = space.geometry.positions
    with wp.Tape() as tape:
        matrix = fem.integrate(programs.diffusion, quadrature=rule, fields=fields)
    weights = RNG.standard_normal(matrix.values.shape)
    tape.backward(grads={matrix.values: wp.array(weights, dtype=wp.float64)})

    def run():
        matrix = fem.integrate(programs.diffusion, quadrature=rule, fields=fields)
        return float((weights * matrix.values.numpy()).sum())

    check(positions, run)
    u, loss = random_field(space), wp.zeros(1, dtype=wp.float64, requires_grad=True)
    c = wp.array([1.5], dtype=wp.float64)

    def functional():
        loss.zero_()
        fem.integrate(energy, quadrature=rule, fields={"u": u}, values={"c": c}, output=loss)
        return float(loss.numpy()[0])

    positions.grad.zero_()
    with wp.Tape() as tape:
        functional()
    tape.backward(loss)
    check(positions, functional)


@fem.integrand
def cubed(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    w = u(s)
    return w * w * w + fem.position(domain, s)[0] * w


def total_of(form, fields, rule, *arrays):
    """A loss whose gradient by arrays is that of an integral, and the call that makes it."""
    loss = wp.zeros(1, dtype=wp.float64, requires_grad=True)

    def run():
        loss.zero_()
        fem.integrate(form, quadrature=rule, fields=fields, output=loss)
        return float(loss.numpy()[0])

    with wp.Tape() as tape:
        run()
    tape.backward(loss)
    for array in arrays:
        check(array, run)


@pytest.mark.parametrize("reduction", ["weighted_average", "mean", "sum", "max", "min", "first"])
@pytest.mark.parametrize("name", ["grid2", "tri", "tet"])
def test_gradient_of_interpolation(name, reduction):
    space = space_of(name, 1)
    u, dest = random_field(space), random_field(space_of_same(space, 2))
    arguments = {"dest": dest, "fields": {"u": u}, "reduction": reduction}
    with wp.Tape() as tape:
        fem.interpolate(cubed, **arguments)
    weights = RNG.standard_normal(dest.dof_values.shape)
    tape.backward(grads={dest.dof_values: wp.array(weights, dtype=wp.float64)})

    def run():
        fem.interpolate(cubed, **arguments)
        return float((weights * dest.dof_values.numpy()).sum())

    check(u.dof_values, run)


def space_of_same(space, degree):
    return fem.make_polynomial_space(space.geometry, degree=degree, dtype=wp.float64)


@wp.func
def wave_of(x: wp.vec2d, c: wp.array(dtype=wp.float64)):
    return wp.sin(c[0] * x[0]) * x[1] + c[1]


def test_gradient_of_implicit_fields():
    geo = programs.geometry("quad", 3, wp.float64, programs.warped)
    c = wp.array([1.3, 0.4], dtype=wp.float64, requires_grad=True)
    field = fem.ImplicitField(fem.Cells(geo), wave_of, values={"c": c}, degree=2)
    total_of(cubed, {"u": field}, fem.RegularQuadrature(fem.Cells(geo), order=6), c)


def test_gradient_of_nonconforming_fields():
    """By the values of the field, and by those of the background, where the other mesh is not."""
    outer = programs.geometry("grid2", 4, wp.float64)
    half = wp.vec2d(0.25, 0.25), wp.vec2d(0.9, 0.8)
    inner = fem.Grid2D(wp.vec2i(3), *half, scalar_type=wp.float64)
    u = random_field(fem.make_polynomial_space(inner, degree=2, dtype=wp.float64))
    around = random_field(fem.make_polynomial_space(outer, degree=1, dtype=wp.float64))
    field = fem.NonconformingField(fem.Cells(outer), u, around)
    rule = fem.RegularQuadrature(fem.Cells(outer), order=4)
    total_of(cubed, {"u": field}, rule, u.dof_values, around.dof_values)


@pytest.mark.parametrize("name", ["tri", "hex"])
def test_gradient_through_deformed_geometries(name):
    geo = programs.geometry(name, 2, wp.float64, programs.warped)
    dtype = wp.types.vector(length=geo.dimension, dtype=wp.float64)
    moved = fem.make_polynomial_space(geo, degree=2, dtype=dtype)
    shift = 0.02 * RNG.standard_normal(moved.node_count() * geo.dimension)
    shift = programs.field_of(moved, shift)
    shift.dof_values.requires_grad = True
    deformed = shift.make_deformed_geometry()
    u = random_field(fem.make_polynomial_space(deformed, degree=1, dtype=wp.float64))
    rule = fem.RegularQuadrature(fem.Cells(deformed), order=5)
    total_of(cubed, {"u": u}, rule, u.dof_values, shift.dof_values)
