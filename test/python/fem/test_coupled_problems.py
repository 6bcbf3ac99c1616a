"""Coupled and nonlinear problems with known solutions: heat and stress, contact, minimal surfaces,
multipliers on boundaries, and a disk."""

import math

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem

REAL = wp.float64
PI = wp.constant(math.pi)
Vec2, Vec3 = wp.vec2d, wp.vec3d


# Heat and stress: a linear temperature bends a free body without stress.

LAME = (1.5, 1.0)
EXPANSION = 0.3


@fem.integrand
def elastic(s: fem.Sample, u: fem.Field, v: fem.Field):
    e = fem.D(u, s)
    stress = REAL(2.0) * e + REAL(1.5) * wp.trace(e) * wp.identity(n=3, dtype=REAL)
    return wp.ddot(stress, fem.D(v, s))


@fem.integrand
def expansion(s: fem.Sample, t: fem.Field, v: fem.Field):
    return REAL(EXPANSION * (3.0 * LAME[0] + 2.0 * LAME[1])) * t(s) * fem.div(v, s)


@fem.integrand
def stress_energy(s: fem.Sample, u: fem.Field, t: fem.Field):
    e = fem.D(u, s) - REAL(EXPANSION) * t(s) * wp.identity(n=3, dtype=REAL)
    return wp.ddot(e, e)


@pytest.mark.parametrize("name", ["grid3", "tet"])
def test_linear_temperatures_bend_a_free_body(name):
    geometry = programs.geometry(name, 2)
    space = fem.make_polynomial_space(geometry, degree=2, dtype=Vec3)
    temperatures = fem.make_polynomial_space(geometry, degree=1, dtype=REAL)
    slope = np.array([1.0, -0.5, 2.0])
    t = programs.field_of(temperatures, temperatures.node_positions().numpy() @ slope + 0.2)
    cells = fem.Cells(geometry)
    a = programs.matrix_of(elastic, programs.fields_of(space), cells, 4)
    rule = fem.RegularQuadrature(cells, order=4)
    fields = {"t": t, "v": fem.make_test(space)}
    f = fem.integrate(expansion, quadrature=rule, fields=fields).numpy().reshape(-1)
    # Loads are in equilibrium, so that a pseudo-inverse leaves out rigid motions alone.
    u = np.linalg.lstsq(a, f, rcond=1e-11)[0]
    assert np.abs(a @ u - f).max() < 1e-12
    found = programs.norm(stress_energy, {"u": programs.field_of(space, u), "t": t}, 4, cells)
    assert found < 1e-12
    # Strain a (T0 + b . x) I of u = a (T0 x + (b . x) x - |x|^2 b / 2), up to a rigid motion.
    x = space.node_positions().numpy()
    exact = 0.2 * x + (x @ slope)[:, None] * x - 0.5 * (x * x).sum(1)[:, None] * slope
    difference = u.reshape(-1, 3) - EXPANSION * exact
    rigid = [np.tile(e, (len(x), 1)) for e in np.eye(3)] + [np.cross(e, x) for e in np.eye(3)]
    rigid = np.array(rigid).reshape(6, -1).T
    rest = difference.reshape(-1)
    rest = rest - rigid @ np.linalg.lstsq(rigid, rest, rcond=None)[0]
    assert np.abs(rest).max() < 1e-11


# Contact: a block pressed onto a round obstacle by a penalty of the depth.


@fem.integrand
def elastic_2d_energy(s: fem.Sample, u: fem.Field):
    e = fem.D(u, s)
    tr = wp.trace(e)
    return wp.ddot(e, e) + REAL(0.75) * tr * tr


@fem.integrand
def contact_energy(s: fem.Sample, domain: fem.Domain, u: fem.Field, lift: REAL):
    x = fem.position(domain, s)
    place = x + u(s)
    d = x[0] - REAL(0.5)
    below = wp.where(fem.normal(domain, s)[1] < REAL(-0.5), REAL(1.0), REAL(0.0))
    depth = wp.max(lift - REAL(0.5) * d * d - place[1], REAL(0.0))
    return REAL(5.0e3) * below * depth * depth


def pressed(geometry, lift):
    """Displacements, the upward force of the obstacle, and the reaction of the fixed top."""
    space = fem.make_polynomial_space(geometry, degree=2, dtype=Vec2)
    cells, border = fem.Cells(geometry), fem.BoundarySides(geometry)
    rules = [fem.RegularQuadrature(domain, order=6) for domain in (cells, border)]
    options = [{}, {"values": {"lift": lift}}]
    x = space.node_positions().numpy()
    fixed = np.repeat(x[:, 1] > 1.0 - 1e-9, 2)
    u = np.zeros(x.size)
    for _ in range(30):
        field = programs.field_of(space, u)
        r, k = [], []
        for energy, rule, more in zip(
            (elastic_2d_energy, contact_energy), rules, options, strict=True
        ):
            known = {"u": field.trace() if rule is rules[1] else field}
            test = fem.make_test(space, domain=rule.domain)
            trial = fem.make_trial(space, domain=rule.domain)
            residual = fem.derivative(energy, "u", "v")
            tangent = fem.derivative(residual, "u", "w")
            given = {"quadrature": rule, **more}
            r.append(fem.integrate(residual, fields={**known, "v": test}, **given).numpy())
            fields = {**known, "v": test, "w": trial}
            k.append(programs.dense(fem.integrate(tangent, fields=fields, **given)))
        rest = (r[0] + r[1]).reshape(-1)
        step = programs.solve(k[0] + k[1], -rest, fixed, np.zeros(len(u)))
        u = u + step
        if np.abs(step).max() < 1e-12:
            break
    else:
        pytest.fail("Newton's method does not converge")
    return u, -r[1][:, 1].sum(), (r[0] + r[1])[fixed.reshape(-1, 2)[:, 0], 1].sum()


@pytest.mark.parametrize("name", ["grid2", "tri", "quad"])
def test_forces_of_contact_are_in_balance(name):
    geometry = programs.warped_geometry(name, 4)
    u, force, reaction = pressed(geometry, 0.02)
    assert force > 1e-3
    # The top holds what the obstacle pushes.
    assert force == pytest.approx(-reaction, rel=1e-10)
    _, none, _ = pressed(geometry, -0.2)
    assert none == 0.0
    _, more, _ = pressed(geometry, 0.04)
    assert more > 2.0 * force


# Minimal surfaces: Scherk's, by Newton's method with derivatives of the area.


@fem.integrand
def area(s: fem.Sample, u: fem.Field):
    g = fem.grad(u, s)
    return wp.sqrt(REAL(1.0) + wp.dot(g, g))


@fem.integrand
def scherk_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    x = fem.position(domain, s)
    e = u(s) - (wp.log(wp.cos(x[1])) - wp.log(wp.cos(x[0])))
    return e * e


def scherk(name, degree, n):
    geometry = programs.warped_geometry(name, n)
    space = fem.make_polynomial_space(geometry, degree=degree, dtype=REAL)
    rule = fem.RegularQuadrature(fem.Cells(geometry), order=2 * degree + 4)
    x = space.node_positions().numpy()
    fixed = programs.on_boundary(x)
    residual = fem.derivative(area, "u", "v")
    tangent = fem.derivative(residual, "u", "w")
    fields = programs.fields_of(space)
    v, w = fields["v"], fields["u"]
    # The harmonic surface is near enough to start from.
    a, values = programs.matrix_of(programs.diffusion, fields), np.log(np.cos(x)) @ [-1.0, 1.0]
    u = programs.solve(a, np.zeros(len(x)), fixed, values)
    for _ in range(12):
        field = programs.field_of(space, u)
        r = fem.integrate(residual, quadrature=rule, fields={"u": field, "v": v}).numpy()
        k = fem.integrate(tangent, quadrature=rule, fields={"u": field, "v": v, "w": w})
        step = programs.solve(programs.dense(k), -r, fixed, np.zeros(len(u)))
        u = u + step
        if np.abs(step).max() < 1e-12:
            break
    else:
        pytest.fail("Newton's method does not converge")
    found = programs.field_of(space, u)
    return programs.norm(scherk_error, {"u": found}, 2 * degree + 6, fem.Cells(geometry))


@pytest.mark.parametrize(("name", "degree"), [("tri", 1), ("grid2", 2), ("quad", 3), ("tri", 3)])
def test_order_of_a_minimal_surface(name, degree):
    errors = [scherk(name, degree, 4), scherk(name, degree, 8)]
    assert programs.order_of(errors) == pytest.approx(degree + 1.0, abs=0.35)


# Multipliers: values on the boundary by functions of sides.


@wp.func
def smooth(x: Vec2):
    """A function whose flux through the boundary is 0 at corners, so that hats have it there."""
    w = x[1] * (REAL(1.0) - x[1])
    return x[0] * x[0] * w * w


@fem.integrand
def smooth_load(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    x = fem.position(domain, s)
    w = x[1] * (REAL(1.0) - x[1])
    bend = REAL(2.0) - REAL(12.0) * w
    return -(REAL(2.0) * w * w + x[0] * x[0] * bend) * v(s)


@fem.integrand
def imposed(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    return smooth(fem.position(domain, s)) * v(s)


@fem.integrand
def smooth_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    e = u(s) - smooth(fem.position(domain, s))
    return e * e


@fem.integrand
def flux_through(s: fem.Sample, u: fem.Field):
    return u(s)


@pytest.mark.parametrize("name", ["tri", "grid2", "quad"])
def test_multipliers_on_the_boundary(name):
    def error(n):
        geometry = programs.warped_geometry(name, n)
        space = fem.make_polynomial_space(geometry, degree=2, dtype=REAL)
        multipliers = fem.make_polynomial_space(geometry, degree=1, dtype=REAL)
        border = fem.BoundarySides(geometry)
        a = programs.matrix_of(programs.diffusion, programs.fields_of(space))
        u, q = fem.make_trial(space, domain=border), fem.make_test(multipliers, domain=border)
        b = programs.matrix_of(programs.mass, {"u": u, "v": q}, border, 6)
        rule = fem.RegularQuadrature(border, order=8)
        g = fem.integrate(imposed, quadrature=rule, fields={"v": q}).numpy()
        used = np.abs(b).sum(axis=1) > 0.0
        assert (used == programs.on_boundary(multipliers.node_positions().numpy())).all()
        b, g, k = b[used], g[used], len(a)
        system = np.block([[a, b.T], [b, np.zeros((len(b), len(b)))]])
        cells = fem.Cells(geometry)
        rule = fem.RegularQuadrature(cells, order=10)
        f = fem.integrate(smooth_load, quadrature=rule, fields={"v": fem.make_test(space)}).numpy()
        x = np.linalg.solve(system, np.concatenate([f, g]))
        # Multipliers are inward fluxes.
        flux = np.zeros(multipliers.node_count())
        flux[used] = x[k:]
        flux = programs.field_of(multipliers, flux).trace()
        out = float(fem.integrate(flux_through, domain=border, fields={"u": flux}))
        assert out == pytest.approx(-2.0 / 30.0, rel=1e-12)
        return programs.norm(smooth_error, {"u": programs.field_of(space, x[:k])}, 8, cells)

    assert programs.order_of([error(4), error(8)]) == pytest.approx(3.0, abs=0.3)


# A disk: isoparametric cells and values on the curved boundary by Nitsche's method.


@fem.integrand
def nitsche(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field, size: REAL):
    n = fem.normal(domain, s)
    flux_u, flux_v = wp.dot(fem.grad(u, s), n), wp.dot(fem.grad(v, s), n)
    return size * u(s) * v(s) - u(s) * flux_v - v(s) * flux_u


@fem.integrand
def bump(s: fem.Sample, domain: fem.Domain):
    x = fem.position(domain, s)
    return wp.cos(REAL(0.5 * PI) * wp.dot(x, x))


@fem.integrand
def bump_load(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    x = fem.position(domain, s)
    r = wp.dot(x, x)
    a = REAL(0.5 * PI)
    return REAL(4.0) * a * (wp.sin(a * r) + a * r * wp.cos(a * r)) * v(s)


@fem.integrand
def bump_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    e = u(s) - bump(s, domain)
    return e * e


def disk(x):
    """The square, mapped onto the disk."""
    p = 2.0 * x - 1.0
    return p * np.sqrt(1.0 - 0.5 * (p * p)[:, ::-1])


@pytest.mark.parametrize("name", ["tri", "grid2"])
@pytest.mark.parametrize("degree", [2, 3])
def test_order_on_a_disk(name, degree):
    def error(n):
        geometry = programs.curved(programs.geometry(name, n), disk, degree)
        space = fem.make_polynomial_space(geometry, degree=degree, dtype=REAL)
        cells, border, order = fem.Cells(geometry), fem.BoundarySides(geometry), 2 * degree + 4
        a = programs.matrix_of(programs.diffusion, programs.fields_of(space), cells, order)
        options = {"size": 10.0 * degree**2 * n}
        a = a + programs.matrix_of(
            nitsche, programs.fields_of(space, border), border, order, **options
        )
        rule = fem.RegularQuadrature(cells, order=order)
        f = fem.integrate(bump_load, quadrature=rule, fields={"v": fem.make_test(space)}).numpy()
        u = programs.field_of(space, np.linalg.solve(a, f))
        return programs.norm(bump_error, {"u": u}, order, cells)

    # Cells at the corners of the square are flat there, which costs a part of the order.
    errors = [error(4), error(8)]
    assert programs.order_of(errors) > degree + 0.4
