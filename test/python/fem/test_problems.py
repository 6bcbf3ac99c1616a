"""Problems with known solutions: spectra, mixed forms, flows, large deformations, periodic and
refined grids, surfaces, and grids that do not conform."""

import math

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem

Basis = fem.ElementBasis
REAL = wp.float64
PI = wp.constant(math.pi)
Vec2, Vec3, Mat2, Mat3 = wp.vec2d, wp.vec3d, wp.mat22d, wp.mat33d


def warped(name, n):
    return programs.geometry(name, n, REAL, None if "grid" in name else programs.warped)


def curved(geometry, move, degree=2):
    """The geometry with the nodes of a polynomial map at other places."""
    vector = wp.types.vector(geometry.dimension, REAL)
    space = fem.make_polynomial_space(geometry, degree=degree, dtype=vector)
    field = programs.field_of(space, move(space.node_positions().numpy()))
    return field.make_deformed_geometry(relative=False)


def spectrum(a, m, free):
    """The eigenvalues of a generalised symmetric problem, ascending."""
    lower = np.linalg.cholesky(m[np.ix_(free, free)])
    half = np.linalg.solve(lower, a[np.ix_(free, free)])
    return np.linalg.eigvalsh(np.linalg.solve(lower, half.T))


def dense(form, fields, domain=None, order=None, **values):
    rule = None if order is None else fem.RegularQuadrature(domain, order=order)
    return programs.dense(
        fem.integrate(
            form, domain=None if rule else domain, quadrature=rule, fields=fields, values=values
        )
    )


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
    geometry = warped(name, n)
    space = fem.make_polynomial_space(
        geometry, degree=degree, dtype=REAL, element_basis=Basis.NEDELEC_FIRST_KIND
    )
    fields, cells = programs.fields_of(space), fem.Cells(geometry)
    form = curl_curl_2d if geometry.dimension == 2 else curl_curl
    a = dense(form, fields, cells, 2 * degree + 2)
    m = dense(vector_mass, fields, cells, 2 * degree + 2)
    free = np.ones(len(a), bool)
    free[fem.dirichlet(space).nodes.numpy()] = False
    found = spectrum(a, m, free) / math.pi**2
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
    geometry = warped(name, n)
    options = {"dtype": REAL, "degree": degree, "element_basis": Basis.RAVIART_THOMAS}
    flows = fem.make_polynomial_space(geometry, **options)
    pressures = fem.make_polynomial_space(
        geometry, degree=degree - 1, discontinuous=True, dtype=REAL
    )
    cells, order = fem.Cells(geometry), 2 * degree + 4
    u, v = fem.make_trial(flows), fem.make_test(flows)
    q = fem.make_test(pressures)
    m = dense(vector_mass, {"u": u, "v": v}, cells, order)
    b = dense(divergence, {"u": u, "q": q}, cells, order)
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
    geometry = warped(name, n)
    space = fem.make_polynomial_space(geometry, degree=3, dtype=REAL)
    fields, cells = programs.fields_of(space), fem.Cells(geometry)
    m, k = dense(programs.mass, fields, cells, 8), dense(programs.diffusion, fields, cells, 8)
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
    geometry = warped(name, n)
    cells = fem.Cells(geometry)
    velocities = fem.make_polynomial_space(geometry, degree=2, dtype=Vec2)
    pressures = fem.make_polynomial_space(geometry, degree=1, dtype=REAL)
    u = velocities.make_field()
    fem.interpolate(kovasznay, dest=u)
    fixed = np.repeat(programs.on_boundary(velocities.node_positions().numpy()), 2)
    x = u.dof_values.numpy().reshape(-1) * fixed
    v, q = fem.make_test(velocities), fem.make_test(pressures)
    du = fem.make_trial(velocities)
    b = dense(divergence, {"u": du, "q": q}, cells, 6)[1:]
    k, p = len(x), np.zeros(len(b))
    rule = fem.RegularQuadrature(cells, order=6)
    tangent = fem.derivative(momentum, "u")
    free = np.concatenate([~fixed, np.ones(len(b), bool)])
    for _ in range(12):
        u = programs.field_of(velocities, x)
        a = dense(tangent, {"u": u, "v": v, "du": du}, cells, 6)
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
    geometry = warped(name, 2)
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


# Surfaces: spherical harmonics, on curved cells.


def sphere(kind, n):
    cells, corners = [], []
    line = np.linspace(-1.0, 1.0, n + 1)
    for axis in range(3):
        for sign in (-1.0, 1.0):
            first = sum(map(len, corners))
            a, b = np.meshgrid(line, line, indexing="ij")
            face = np.stack([np.full_like(a, sign), a * sign, b], -1).reshape(-1, 3)
            corners.append(np.roll(face, axis, axis=1))
            for i, j in np.ndindex(n, n):
                at = first + i * (n + 1) + j
                cells.append((at, at + n + 1, at + n + 2, at + 1))
    corners = np.concatenate(corners)
    _, first, index = np.unique(
        np.round(corners, 9), axis=0, return_index=True, return_inverse=True
    )
    cells, corners = index.reshape(-1)[np.array(cells)], corners[first]
    if kind == "Trimesh3D":
        cells = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    mesh = getattr(fem, kind)(wp.array(cells, dtype=int), wp.array(corners, dtype=Vec3))
    return curved(mesh, lambda x: x / np.linalg.norm(x, axis=1, keepdims=True), 3)


@fem.integrand
def one(s: fem.Sample, domain: fem.Domain):
    return fem.position(domain, s)[0] * REAL(0.0) + REAL(1.0)


@pytest.mark.parametrize("kind", ["Trimesh3D", "Quadmesh3D"])
def test_harmonics_of_a_sphere(kind):
    geometry = sphere(kind, 3)
    cells = fem.Cells(geometry)
    area = float(fem.integrate(one, quadrature=fem.RegularQuadrature(cells, order=10)))
    assert area == pytest.approx(4.0 * math.pi, rel=1e-3)
    space = fem.make_polynomial_space(geometry, degree=3, dtype=REAL)
    fields = programs.fields_of(space)
    a, m = dense(programs.diffusion, fields, cells, 8), dense(programs.mass, fields, cells, 8)
    found = spectrum(a, m, np.ones(len(a), bool))[:9]
    np.testing.assert_allclose(found, [0, 2, 2, 2, 6, 6, 6, 6, 6], rtol=4e-3, atol=1e-10)


# A periodic domain: nodes of opposite sides are one.


@fem.integrand
def carried(s: fem.Sample, u: fem.Field, v: fem.Field):
    flow = Vec2(REAL(1.0), REAL(0.5))
    return REAL(0.05) * wp.dot(fem.grad(u, s), fem.grad(v, s)) + wp.dot(flow, fem.grad(u, s)) * v(s)


@pytest.mark.parametrize(("name", "degree"), [("grid2", 2), ("tri", 3), ("quad", 2)])
def test_decay_of_a_periodic_wave(name, degree):
    """The growth of exp(2 pi i (x + y)) under transport and diffusion is its exact exponent."""

    def exponent(n):
        geometry = warped(name, n)
        space = fem.make_polynomial_space(geometry, degree=degree, dtype=REAL)
        fields, cells = programs.fields_of(space), fem.Cells(geometry)
        a, m = dense(carried, fields, cells, 8), dense(programs.mass, fields, cells, 8)
        x = space.node_positions().numpy()
        places = np.round(np.where(x > 1.0 - 1e-9, 0.0, x), 9)
        _, first, number = np.unique(places, axis=0, return_index=True, return_inverse=True)
        tie = np.zeros((len(x), len(first)))
        tie[np.arange(len(x)), number.reshape(-1)] = 1.0
        a, m = tie.T @ a @ tie, tie.T @ m @ tie
        values = np.linalg.eigvals(np.linalg.solve(m, a))
        return values[np.abs(values - exact).argmin()]

    k = 2.0 * np.pi * np.array([1.0, 1.0])
    exact = 0.05 * (k @ k) + 1j * (k @ [1.0, 0.5])
    errors = [abs(exponent(4) - exact), abs(exponent(8) - exact)]
    assert programs.order_of(errors) > 2.0 * degree - 0.6


# Adaptive grids: interior penalties across levels.


def refined():
    fine = np.array([(i, j, k) for i, j, k in np.ndindex(2, 4, 4)])
    coarse = np.array([(1, j, k) for j, k in np.ndindex(2, 2)])
    grids = [
        wp.Volume.allocate_by_voxels(wp.array(v, dtype=wp.vec3i), h, translation=(0.5 * h,) * 3)
        for v, h in ((fine, 0.25), (coarse, 0.5))
    ]
    made = fem.adaptive_nanogrid_from_hierarchy(grids)
    return fem.AdaptiveNanogrid(made.cell_grid, made.cell_level, made.level_count, scalar_type=REAL)


@fem.integrand
def penalties(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    n = fem.normal(domain, s)
    flux_u = wp.dot(fem.grad_average(u, s), n)
    flux_v = wp.dot(fem.grad_average(v, s), n)
    ju, jv = fem.jump(u, s), fem.jump(v, s)
    return REAL(80.0) * ju * jv - ju * flux_v - jv * flux_u


@fem.integrand
def nitsche(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    n = fem.normal(domain, s)
    flux_u, flux_v = wp.dot(fem.grad(u, s), n), wp.dot(fem.grad(v, s), n)
    return REAL(80.0) * u(s) * v(s) - u(s) * flux_v - v(s) * flux_u


@fem.integrand
def quadratic(s: fem.Sample, domain: fem.Domain):
    x = fem.position(domain, s)
    return x[0] * x[0] - REAL(2.0) * x[0] * x[1] + x[2] * (x[1] - REAL(1.0)) + REAL(0.5)


@fem.integrand
def nitsche_load(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    n = fem.normal(domain, s)
    return quadratic(s, domain) * (REAL(80.0) * v(s) - wp.dot(fem.grad(v, s), n))


@fem.integrand
def constant_load(s: fem.Sample, v: fem.Field):
    return REAL(-2.0) * v(s)


@fem.integrand
def quadratic_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    return (u(s) - quadratic(s, domain)) * (u(s) - quadratic(s, domain))


@pytest.mark.parametrize("make", [refined, lambda: warped("hex", 2), lambda: warped("grid3", 2)])
def test_quadratic_solutions_across_levels(make):
    """Discontinuous quadratic elements give a quadratic solution to rounding, where cells of two
    sizes share sides, too."""
    geometry = make()
    cells, sides, border = fem.Cells(geometry), fem.Sides(geometry), fem.BoundarySides(geometry)
    move = "Hexmesh" in geometry.name
    space = fem.make_polynomial_space(geometry, degree=2, discontinuous=True, dtype=REAL)
    order = 8
    a = dense(programs.diffusion, programs.fields_of(space, cells), cells, order)
    a += dense(penalties, programs.fields_of(space, sides), sides, order)
    a += dense(nitsche, programs.fields_of(space, border), border, order)
    rule, on_border = (
        fem.RegularQuadrature(cells, order=6),
        fem.RegularQuadrature(border, order=order),
    )
    v = fem.make_test(space, domain=cells)
    b = fem.integrate(constant_load, quadrature=rule, fields={"v": v}).numpy()
    v = fem.make_test(space, domain=border)
    b = b + fem.integrate(nitsche_load, quadrature=on_border, fields={"v": v}).numpy()
    u = programs.field_of(space, np.linalg.solve(a, b))
    limit = 2e-3 if move else 1e-12
    assert programs.norm(quadratic_error, {"u": u}, 8, cells) < limit
    v = fem.make_test(space, domain=cells)
    volume = float(fem.integrate(one, quadrature=rule))
    assert volume == pytest.approx(1.0, abs=1e-13)


# Grids that do not conform: values pass between them.


@fem.integrand
def passed(s: fem.Sample, domain: fem.Domain, source: fem.Field, v: fem.Field):
    return source(s) * v(s)


@pytest.mark.parametrize(
    ("one_name", "other_name"), [("tri", "quad"), ("grid2", "tri"), ("tet", "grid3")]
)
def test_linear_fields_pass_between_grids(one_name, other_name):
    first, second = warped(one_name, 3), warped(other_name, 4)
    space = fem.make_polynomial_space(first, degree=1, dtype=REAL)
    x = space.node_positions().numpy()
    slopes = np.array([1.0, -2.0, 0.5][: x.shape[1]])
    field = programs.field_of(space, x @ slopes + 0.25)
    cells = fem.Cells(second)
    source = fem.NonconformingField(cells, field)
    target = fem.make_polynomial_space(second, degree=1, dtype=REAL)
    fields = programs.fields_of(target)
    m = dense(programs.mass, fields, cells, 4)
    rule = fem.RegularQuadrature(cells, order=4)
    b = fem.integrate(passed, quadrature=rule, fields={"source": source, "v": fields["v"]}).numpy()
    y = target.node_positions().numpy()
    # Maps of quadrilaterals are inverted to a few units in the last place.
    np.testing.assert_allclose(np.linalg.solve(m, b), y @ slopes + 0.25, atol=1e-11)


# Two materials: the flux through an interface is continuous, on cells chosen by a mask.


@fem.integrand
def conducted(s: fem.Sample, u: fem.Field, v: fem.Field, k: REAL):
    return k * wp.dot(fem.grad(u, s), fem.grad(v, s))


@pytest.mark.parametrize("name", ["grid2", "tri", "tet", "grid3"])
def test_two_materials(name):
    geometry = programs.geometry(name, 4, REAL)
    centers = fem.make_polynomial_space(geometry, degree=0, dtype=REAL).node_positions().numpy()
    space = fem.make_polynomial_space(geometry, degree=2, dtype=REAL)
    a = 0.0
    for k, chosen in ((1.0, centers[:, 0] < 0.5), (4.0, centers[:, 0] > 0.5)):
        mask = wp.array(chosen.astype(np.int32))
        part = fem.Subdomain(fem.Cells(geometry), element_mask=mask)
        a = a + dense(conducted, programs.fields_of(space, part), part, k=k)
    x = space.node_positions().numpy()[:, 0]
    exact = np.where(x < 0.5, 1.6 * x, 0.8 + 0.4 * (x - 0.5))
    fixed = (x < 1e-9) | (x > 1.0 - 1e-9)
    found = programs.solve(a, np.zeros(len(x)), fixed, exact)
    np.testing.assert_allclose(found, exact, atol=1e-12)
