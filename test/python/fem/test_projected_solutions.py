"""Gradients of solutions through projectors, normalised on the tape, against differences."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem
from warp.optim import linear

REAL = wp.float64
Vec2 = wp.vec2d


@wp.kernel
def inner(x: wp.array(dtype=REAL), y: wp.array(dtype=REAL), out: wp.array(dtype=REAL)):
    i = wp.tid()
    wp.atomic_add(out, 0, x[i] * y[i])


def numbers(x):
    return x.view(REAL).flatten()


def work(name, space_of, forms, start, scale=1.0):
    """The work of a load, and its gradients by positions and by the scale of fixed values.

    forms: of the system, the load, the projector and the fixed values.
    """
    system, load, fixed, given = forms
    base = programs.geometry(name, 3)
    positions = wp.array(start, dtype=base.positions.dtype, requires_grad=True)
    height = wp.array([scale], dtype=REAL, requires_grad=True)
    geometry = type(base)(base.cell_vertices, positions)
    space, border = space_of(geometry), fem.BoundarySides(geometry)
    fields, on_border = programs.fields_of(space), programs.fields_of(space, border)
    out = wp.zeros(1, dtype=REAL, requires_grad=True)
    with wp.Tape() as tape:
        a = fem.integrate(system, fields=fields)
        b = fem.integrate(load, fields={"v": fields["v"]})
        c, u = wp.clone(b), wp.zeros_like(b)
        projector = fem.integrate(fixed, fields=on_border, assembly="nodal")
        values, v = {"height": height}, {"v": on_border["v"]}
        g = fem.integrate(given, fields=v, values=values, assembly="nodal")
        fem.project_linear_system(a, b, projector, g)
        linear.cg(a, b, u, tol=1e-14, maxiter=800)
        c, u = numbers(c), numbers(u)
        wp.launch(inner, c.shape, [c, u], [out])
    tape.backward(out)
    return float(out.numpy()[0]), positions.grad.numpy(), float(height.grad.numpy()[0])


def check(start, run):
    _, by_positions, by_height = run(start)
    h = 1e-6
    expected = (run(start, 1.0 + h)[0] - run(start, 1.0 - h)[0]) / (2.0 * h)
    assert by_height == pytest.approx(expected, rel=1e-7)
    direction = np.random.default_rng(0).standard_normal(start.shape)
    expected = (run(start + h * direction)[0] - run(start - h * direction)[0]) / (2.0 * h)
    assert (by_positions * direction).sum() == pytest.approx(expected, rel=1e-6)


# Values on the boundary.


@fem.integrand
def unit_load(s: fem.Sample, v: fem.Field):
    return v(s)


@fem.integrand
def wavy(s: fem.Sample, domain: fem.Domain, v: fem.Field, height: wp.array(dtype=REAL)):
    x = fem.position(domain, s)
    return (height[0] * wp.sin(REAL(3.0) * x[0]) + x[1] * x[1]) * v(s)


@pytest.mark.parametrize("name", ["tri", "quad"])
def test_values_on_the_boundary(name):
    def space_of(geometry):
        return fem.make_polynomial_space(geometry, degree=2, dtype=REAL)

    forms = programs.diffusion, unit_load, programs.mass, wavy
    start = programs.warped(programs.points_of_grid(3, 2))
    check(start, lambda *x: work(name, space_of, forms, *x))


# Normal components on a crooked boundary: blocks of rank 1 inside of sides, of rank 2 at vertices.


@fem.integrand
def screened(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.ddot(fem.grad(u, s), fem.grad(v, s)) + wp.dot(u(s), v(s))


@fem.integrand
def sheared_load(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    return wp.dot(Vec2(REAL(1.0), fem.position(domain, s)[0]), v(s))


@fem.integrand
def across(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    n = fem.normal(domain, s)
    return wp.dot(u(s), n) * wp.dot(v(s), n)


@fem.integrand
def inflow(s: fem.Sample, domain: fem.Domain, v: fem.Field, height: wp.array(dtype=REAL)):
    return height[0] * fem.position(domain, s)[1] * wp.dot(v(s), fem.normal(domain, s))


@pytest.mark.parametrize("name", ["tri", "quad"])
def test_normal_components(name):
    def space_of(geometry):
        return fem.make_polynomial_space(geometry, degree=2, dtype=Vec2)

    points = programs.points_of_grid(3, 2)
    start = points + 0.05 * np.random.default_rng(1).standard_normal(points.shape)
    forms = screened, sheared_load, across, inflow
    check(start, lambda *x: work(name, space_of, forms, *x))
