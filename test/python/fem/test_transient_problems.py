"""Problems in time and at a frequency with known solutions: turning pulses, heat, waves."""

import math

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem

REAL = wp.float64
PI = wp.constant(math.pi)
Vec2 = wp.vec2d


# Transport: a pulse that turns by a quarter, by upwind fluxes of discontinuous elements.


@wp.func
def turning(x: Vec2):
    return Vec2(REAL(0.5) - x[1], x[0] - REAL(0.5))


@fem.integrand
def carried_in_cells(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    return u(s) * wp.dot(turning(fem.position(domain, s)), fem.grad(v, s))


@fem.integrand
def upwind(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    speed = wp.dot(turning(fem.position(domain, s)), fem.normal(domain, s))
    return -fem.jump(v, s) * (
        speed * fem.average(u, s) + REAL(0.5) * wp.abs(speed) * fem.jump(u, s)
    )


@fem.integrand
def outflow(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    speed = wp.dot(turning(fem.position(domain, s)), fem.normal(domain, s))
    return -wp.max(speed, REAL(0.0)) * u(s) * v(s)


@fem.integrand
def pulse(s: fem.Sample, domain: fem.Domain, center: Vec2):
    d = fem.position(domain, s) - center
    return wp.exp(REAL(-60.0) * wp.dot(d, d))


@fem.integrand
def pulse_load(s: fem.Sample, domain: fem.Domain, v: fem.Field, center: Vec2):
    return pulse(s, domain, center) * v(s)


@fem.integrand
def pulse_error(s: fem.Sample, domain: fem.Domain, u: fem.Field, center: Vec2):
    e = u(s) - pulse(s, domain, center)
    return e * e


@fem.integrand
def total(s: fem.Sample, u: fem.Field):
    return u(s)


def turned_pulse(name, degree, n):
    geometry = programs.warped_geometry(name, n)
    space = fem.make_polynomial_space(geometry, degree=degree, discontinuous=True, dtype=REAL)
    cells, order = fem.Cells(geometry), 2 * degree + 4
    rule = fem.RegularQuadrature(cells, order=order)
    m = programs.matrix_of(programs.mass, programs.fields_of(space), cells, order)
    a = programs.matrix_of(carried_in_cells, programs.fields_of(space), cells, order)
    for domain, form in ((fem.Sides(geometry), upwind), (fem.BoundarySides(geometry), outflow)):
        a = a + programs.matrix_of(form, programs.fields_of(space, domain), domain, order)
    start, end = Vec2(0.7, 0.5), Vec2(0.5, 0.7)
    load = {"quadrature": rule, "fields": {"v": fem.make_test(space)}, "values": {"center": start}}
    u = np.linalg.solve(m, fem.integrate(pulse_load, **load).numpy())
    masses = [np.ones(len(m)) @ m @ u]
    norms = [u @ m @ u]
    step, steps = np.linalg.solve(m, a), 30 * n
    dt = 0.5 * math.pi / steps
    for _ in range(steps):
        stage = u
        for k in (4.0, 3.0, 2.0, 1.0):
            stage = u + dt / k * (step @ stage)
        u = stage
        norms.append(u @ m @ u)
    field = programs.field_of(space, u)
    masses.append(float(fem.integrate(total, quadrature=rule, fields={"u": field})))
    assert np.diff(norms).max() < 1e-14
    error = programs.norm(pulse_error, {"u": field}, order, cells, values={"center": end})
    return error, abs(masses[1] / masses[0] - 1.0)


@pytest.mark.parametrize(("name", "degree", "n"), [("grid2", 1, 8), ("tri", 2, 6), ("quad", 2, 8)])
def test_a_turning_pulse(name, degree, n):
    """Norms never grow, a little mass leaves through the boundary, and errors have their order."""
    (first, _), (second, lost) = turned_pulse(name, degree, n), turned_pulse(name, degree, 2 * n)
    assert programs.order_of([first, second]) > degree + 0.5
    assert lost < 1e-3


# Heat: backward differences of second order in time.


@fem.integrand
def heat_error(s: fem.Sample, domain: fem.Domain, u: fem.Field, scale: REAL):
    x = fem.position(domain, s)
    e = u(s) - scale * wp.sin(REAL(PI) * x[0]) * wp.sin(REAL(PI) * x[1])
    return e * e


@pytest.mark.parametrize("name", ["grid2", "tri", "quad"])
def test_order_of_heat_in_time(name):
    geometry = programs.warped_geometry(name, 6)
    space = fem.make_polynomial_space(geometry, degree=4, dtype=REAL)
    cells = fem.Cells(geometry)
    m, a = (
        programs.matrix_of(form, programs.fields_of(space), cells, 10)
        for form in (programs.mass, programs.diffusion)
    )
    x = space.node_positions().numpy()
    free = ~programs.on_boundary(x)
    m, a = (one[np.ix_(free, free)] for one in (m, a))
    start, rate, end = np.prod(np.sin(np.pi * x), axis=1), 2.0 * math.pi**2, 0.1

    def error(steps):
        dt = end / steps
        before, now = math.exp(rate * dt) * start[free], start[free]
        for _ in range(steps):
            rhs = m @ (2.0 * now - 0.5 * before)
            before, now = now, np.linalg.solve(1.5 * m + dt * a, rhs)
        u = np.zeros(len(x))
        u[free] = now
        values = {"scale": math.exp(-rate * end)}
        return programs.norm(
            heat_error, {"u": programs.field_of(space, u)}, 12, cells, values=values
        )

    errors = [error(16), error(32), error(64)]
    assert programs.order_of(errors) == pytest.approx(2.0, abs=0.06)


# Sound: a plane wave leaves through an absorbing boundary.


@fem.integrand
def wave_source(s: fem.Sample, domain: fem.Domain, v: fem.Field, k: Vec2, is_imaginary: int):
    """(i |k| + i k . n) exp(i k . x), the flux of a wave less what the boundary absorbs."""
    phase = wp.dot(k, fem.position(domain, s))
    flux = wp.dot(k, fem.normal(domain, s)) - wp.length(k)
    part = wp.where(is_imaginary == 1, wp.cos(phase), -wp.sin(phase))
    return flux * part * v(s)


@fem.integrand
def wave_error(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field, k: Vec2):
    phase = wp.dot(k, fem.position(domain, s))
    d = Vec2(u(s) - wp.cos(phase), v(s) - wp.sin(phase))
    return wp.dot(d, d)


@pytest.mark.parametrize(
    ("name", "degree", "n"), [("tri", 1, 10), ("tri", 3, 3), ("grid2", 2, 5), ("quad", 3, 4)]
)
def test_a_plane_wave_through_an_absorbing_boundary(name, degree, n):
    k = Vec2(5.0, 3.0)

    def error(n):
        geometry = programs.warped_geometry(name, n)
        space = fem.make_polynomial_space(geometry, degree=degree, dtype=REAL)
        cells, border, order = fem.Cells(geometry), fem.BoundarySides(geometry), 2 * degree + 4
        a, m = (
            programs.matrix_of(form, programs.fields_of(space), cells, order)
            for form in (programs.diffusion, programs.mass)
        )
        c = programs.matrix_of(programs.mass, programs.fields_of(space, border), border, order)
        rule = fem.RegularQuadrature(border, order=order)
        v = fem.make_test(space, domain=border)
        real, imaginary = (
            fem.integrate(
                wave_source, quadrature=rule, fields={"v": v}, values={"k": k, "is_imaginary": part}
            ).numpy()
            for part in (0, 1)
        )
        size = math.sqrt(34.0)
        u = np.linalg.solve(a - size**2 * m - 1j * size * c, real + 1j * imaginary)
        fields = {"u": programs.field_of(space, u.real), "v": programs.field_of(space, u.imag)}
        return programs.norm(wave_error, fields, order, cells, values={"k": k})

    errors = [error(n), error(2 * n)]
    assert programs.order_of(errors) > degree + 1.0 - 0.3


# A drum: leapfrog with lumped masses of Lobatto nodes keeps a discrete energy.


@pytest.mark.parametrize(("dimension", "degree"), [(2, 2), (2, 4), (3, 2)])
def test_energy_of_a_drum(dimension, degree):
    geometry = programs.grid(dimension, 2, REAL)
    space = fem.make_polynomial_space(geometry, degree=degree, dtype=REAL)
    fields, cells = programs.fields_of(space), fem.Cells(geometry)
    rule = fem.NodalQuadrature(cells, space)
    lumped = fem.integrate(programs.mass, quadrature=rule, fields=fields)
    m = programs.dense(lumped)
    np.testing.assert_allclose(m, np.diag(np.diag(m)), atol=1e-17)
    nodal = fem.integrate(programs.mass, fields=fields, assembly="nodal")
    np.testing.assert_allclose(programs.dense(nodal), m, atol=1e-16)
    x = space.node_positions().numpy()
    free = ~programs.on_boundary(x)
    m = np.diag(m)[free]
    a = programs.matrix_of(programs.diffusion, fields)[np.ix_(free, free)]
    half = 1.0 / np.sqrt(m)
    frequencies = np.sqrt(np.linalg.eigvalsh(a * half * half[:, None]))
    # The first frequency is exact to the order of the rule.
    assert frequencies[0] == pytest.approx(math.pi * math.sqrt(dimension), rel=0.02)
    dt = 1.9 / frequencies[-1]
    before = np.prod(np.sin(np.pi * x[free]), axis=1)
    now = before * math.cos(frequencies[0] * dt)
    energies = []
    for _ in range(200):
        step = now - before
        energies.append(step @ (m * step) / dt**2 + now @ a @ before)
        before, now = now, 2.0 * now - before - dt**2 * (a @ now) / m
    assert np.ptp(energies) < 1e-11 * energies[0]
