"""Problems with known solutions: spectra, mixed forms, flows and large deformations."""

import math

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem

Basis = fem.ElementBasis
REAL = wp.float64
PI = wp.constant(math.pi)
Vec2, Vec3 = wp.vec2d, wp.vec3d


# Maxwell's equations: resonances of a cavity, without spurious ones.


@fem.integrand
def vector_mass(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.dot(u(s), v(s))


@fem.integrand
def curl_curl(s: fem.Sample, u: fem.Field, v: fem.Field):
    return REAL(4.0) * wp.dot(fem.curl(u, s), fem.curl(v, s))


@fem.integrand
def curl_curl_2d(s: fem.Sample, u: fem.Field, v: fem.Field):
    return REAL(4.0) * fem.curl(u, s) * fem.curl(v, s)


def resonances(name, degree, n):
    """The first five resonances, over pi squared; gradients have the frequency 0."""
    geometry = programs.warped_geometry(name, n)
    space = fem.make_polynomial_space(
        geometry, degree=degree, dtype=REAL, element_basis=Basis.NEDELEC_FIRST_KIND
    )
    fields, cells = programs.fields_of(space), fem.Cells(geometry)
    form = curl_curl_2d if geometry.dimension == 2 else curl_curl
    a = programs.matrix_of(form, fields, cells, 2 * degree + 2)
    m = programs.matrix_of(vector_mass, fields, cells, 2 * degree + 2)
    free = np.ones(len(a), bool)
    free[fem.dirichlet(space).nodes.numpy()] = False
    found = programs.spectrum(a, m, free) / math.pi**2
    return found[found > 1e-6][:5]


@pytest.mark.parametrize(
    ("name", "degree", "n"), [("tri", 1, 5), ("tri", 2, 3), ("quad", 1, 5), ("quad", 2, 4)]
)
def test_resonances_of_a_square(name, degree, n):
    expected = np.array([1, 1, 2, 4, 4])
    errors = [np.abs(resonances(name, degree, k) / expected - 1.0).max() for k in (n, 2 * n)]
    assert errors[0] < 0.2 and programs.order_of(errors) > 2 * degree - 0.3


@pytest.mark.parametrize(("name", "degree", "n"), [("tet", 1, 3), ("hex", 1, 4), ("tet", 2, 2)])
def test_resonances_of_a_cube(name, degree, n):
    np.testing.assert_allclose(resonances(name, degree, n), [2, 2, 2, 3, 3], rtol=0.07 / degree)


# Darcy's law: flux and pressure, and the balance of each cell.


@fem.integrand
def flux_of(s: fem.Sample, domain: fem.Domain):
    x = fem.position(domain, s)
    a, b = REAL(PI) * x[0], REAL(PI) * x[1]
    return -REAL(PI) * Vec2(wp.cos(a) * wp.sin(b), wp.sin(a) * wp.cos(b))


@fem.integrand
def source(s: fem.Sample, domain: fem.Domain, q: fem.Field):
    x = fem.position(domain, s)
    p = wp.sin(REAL(PI) * x[0]) * wp.sin(REAL(PI) * x[1])
    return REAL(2.0 * PI * PI) * p * q(s)


@fem.integrand
def divergence(s: fem.Sample, u: fem.Field, q: fem.Field):
    return fem.div(u, s) * q(s)


@fem.integrand
def flux_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    e = u(s) - flux_of(s, domain)
    return wp.dot(e, e)


def darcy(name, degree, n):
    geometry = programs.warped_geometry(name, n)
    options = {"dtype": REAL, "degree": degree, "element_basis": Basis.RAVIART_THOMAS}
    flows = fem.make_polynomial_space(geometry, **options)
    pressures = fem.make_polynomial_space(
        geometry, degree=degree - 1, discontinuous=True, dtype=REAL
    )
    cells, order = fem.Cells(geometry), 2 * degree + 4
    u, v = fem.make_trial(flows), fem.make_test(flows)
    q = fem.make_test(pressures)
    m = programs.matrix_of(vector_mass, {"u": u, "v": v}, cells, order)
    b = programs.matrix_of(divergence, {"u": u, "q": q}, cells, order)
    rule = fem.RegularQuadrature(cells, order=order)
    f = fem.integrate(source, quadrature=rule, fields={"q": q}).numpy()
    k = len(f)
    system = np.block([[m, -b.T], [b, np.zeros((k, k))]])
    x = np.linalg.solve(system, np.concatenate([np.zeros(len(m)), f]))
    field = programs.field_of(flows, x[: len(m)])
    np.testing.assert_allclose(b @ x[: len(m)], f, atol=1e-11)
    return programs.norm(flux_error, {"u": field}, order, cells)


@pytest.mark.parametrize(
    ("name", "degree", "n"), [("tri", 1, 4), ("tri", 2, 3), ("quad", 1, 4), ("quad", 2, 4)]
)
def test_flux_of_darcy(name, degree, n):
    errors = [darcy(name, degree, n), darcy(name, degree, 2 * n)]
    assert programs.order_of(errors) > degree - 0.1


# A clamped plate: the deflection and its curvature as two fields.


@fem.integrand
def plate_load(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    p = fem.position(domain, s)
    x, y = p[0], p[1]
    a, b = x * x * (x - REAL(1.0)) * (x - REAL(1.0)), y * y * (y - REAL(1.0)) * (y - REAL(1.0))
    da = REAL(12.0) * x * x - REAL(12.0) * x + REAL(2.0)
    db = REAL(12.0) * y * y - REAL(12.0) * y + REAL(2.0)
    return REAL(24.0) * (a + b) * v(s) + REAL(2.0) * da * db * v(s)


@fem.integrand
def plate_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    p = fem.position(domain, s)
    x, y = p[0], p[1]
    w = x * x * (x - REAL(1.0)) * (x - REAL(1.0)) * y * y * (y - REAL(1.0)) * (y - REAL(1.0))
    return (u(s) - w) * (u(s) - w)


def plate(name, n):
    geometry = programs.warped_geometry(name, n)
    space = fem.make_polynomial_space(geometry, degree=3, dtype=REAL)
    fields, cells = programs.fields_of(space), fem.Cells(geometry)
    m, k = (
        programs.matrix_of(programs.mass, fields, cells, 8),
        programs.matrix_of(programs.diffusion, fields, cells, 8),
    )
    rule = fem.RegularQuadrature(cells, order=12)
    f = fem.integrate(plate_load, quadrature=rule, fields={"v": fields["v"]}).numpy()
    inside = ~programs.on_boundary(space.node_positions().numpy())
    half = k[:, inside]
    w = np.zeros(len(m))
    w[inside] = np.linalg.solve(half.T @ np.linalg.solve(m, half), f[inside])
    return programs.norm(plate_error, {"u": programs.field_of(space, w)}, 12, cells)


@pytest.mark.parametrize("name", ["grid2", "tri", "quad"])
def test_clamped_plate(name):
    errors = [plate(name, 4), plate(name, 8)]
    assert programs.order_of(errors) > 3.0 and errors[1] < 3e-6


# Navier-Stokes: Kovasznay's flow by Newton's method with exact tangents.

REYNOLDS = 40.0
DECAY = REYNOLDS / 2.0 - math.sqrt(REYNOLDS**2 / 4.0 + 4.0 * math.pi**2)
LAMBDA = wp.constant(DECAY)


@fem.integrand
def kovasznay(s: fem.Sample, domain: fem.Domain):
    x = fem.position(domain, s)
    e, t = wp.exp(REAL(LAMBDA) * x[0]), REAL(2.0 * PI) * x[1]
    return Vec2(REAL(1.0) - e * wp.cos(t), REAL(LAMBDA / (2.0 * PI)) * e * wp.sin(t))


@fem.integrand
def momentum(s: fem.Sample, u: fem.Field, v: fem.Field):
    g = fem.grad(u, s)
    return REAL(1.0 / 40.0) * wp.ddot(g, fem.grad(v, s)) + wp.dot(g * u(s), v(s))


@fem.integrand
def velocity_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    e = u(s) - kovasznay(s, domain)
    return wp.dot(e, e)


def flow(name, n):
    geometry = programs.warped_geometry(name, n)
    cells = fem.Cells(geometry)
    velocities = fem.make_polynomial_space(geometry, degree=2, dtype=Vec2)
    pressures = fem.make_polynomial_space(geometry, degree=1, dtype=REAL)
    u = velocities.make_field()
    fem.interpolate(kovasznay, dest=u)
    fixed = np.repeat(programs.on_boundary(velocities.node_positions().numpy()), 2)
    x = u.dof_values.numpy().reshape(-1) * fixed
    v, q = fem.make_test(velocities), fem.make_test(pressures)
    du = fem.make_trial(velocities)
    b = programs.matrix_of(divergence, {"u": du, "q": q}, cells, 6)[1:]
    k, p = len(x), np.zeros(len(b))
    rule = fem.RegularQuadrature(cells, order=6)
    tangent = fem.derivative(momentum, "u")
    free = np.concatenate([~fixed, np.ones(len(b), bool)])
    for _ in range(12):
        u = programs.field_of(velocities, x)
        a = programs.matrix_of(tangent, {"u": u, "v": v, "du": du}, cells, 6)
        r = fem.integrate(momentum, quadrature=rule, fields={"u": u, "v": v}).numpy().reshape(-1)
        residual = np.concatenate([r - b.T @ p, b @ x])
        system = np.block([[a, -b.T], [b, np.zeros((len(b), len(b)))]])
        step = np.linalg.solve(system[np.ix_(free, free)], -residual[free])
        change = np.zeros(len(free))
        change[free] = step
        x, p = x + change[:k], p + change[k:]
        if np.abs(step).max() < 1e-11:
            break
    else:
        pytest.fail("Newton's method does not converge")
    return programs.norm(velocity_error, {"u": programs.field_of(velocities, x)}, 8, cells)


@pytest.mark.parametrize("name", ["grid2", "tri", "quad"])
def test_kovasznay_flow(name):
    errors = [flow(name, 6), flow(name, 12)]
    assert programs.order_of(errors) == pytest.approx(3.0, abs=0.35)


# Hyperelasticity: the tape's forces of a stretched block, whose sides are free to shrink.

MU, BULK = 1.0, 3.0


@fem.integrand
def neo_hookean(s: fem.Sample, u: fem.Field):
    F = fem.grad(u, s) + wp.identity(n=3, dtype=REAL)
    J = wp.determinant(F)
    stretch = wp.ddot(F, F) - REAL(3.0) - REAL(2.0) * wp.log(J)
    return REAL(0.5 * MU) * stretch + REAL(0.5 * BULK) * (J - REAL(1.0)) * (J - REAL(1.0))


def lateral(stretch):
    """The lateral stretch at which lateral stress is zero, by bisection."""
    low, high = 0.1, 2.0
    for _ in range(100):
        mid = 0.5 * (low + high)
        J = stretch * mid * mid
        stress = MU * (mid - 1.0 / mid) + BULK * (J - 1.0) * stretch * mid
        low, high = (low, mid) if stress > 0.0 else (mid, high)
    return mid


@pytest.mark.parametrize("name", ["grid3", "tet", "hex"])
def test_forces_of_a_stretched_block(name):
    geometry = programs.warped_geometry(name, 2)
    space = fem.make_polynomial_space(geometry, degree=1, dtype=Vec3)
    x = space.node_positions().numpy()
    stretch = 1.6
    b = lateral(stretch)
    u = programs.field_of(space, x * [stretch - 1.0, b - 1.0, b - 1.0])
    u.dof_values.requires_grad = True
    energy = wp.zeros(1, dtype=REAL, requires_grad=True)
    with wp.Tape() as tape:
        fem.integrate(neo_hookean, domain=fem.Cells(geometry), fields={"u": u}, output=energy)
    tape.backward(energy)
    forces = u.dof_values.grad.numpy()
    residual = fem.integrate(
        fem.derivative(neo_hookean, "u", "v"), fields={"u": u, "v": fem.make_test(space)}
    ).numpy()
    np.testing.assert_allclose(forces, residual, atol=1e-13)
    free = (x[:, 0] > 1e-6) & (x[:, 0] < 1.0 - 1e-6)
    assert np.abs(forces[free]).max() < 1e-13
    J = stretch * b * b
    pull = MU * (stretch - 1.0 / stretch) + BULK * (J - 1.0) * b * b
    assert forces[x[:, 0] > 1.0 - 1e-6].sum(axis=0) == pytest.approx([pull, 0, 0], abs=1e-12)
