"""Gradients on the tape of solutions of systems: by shapes, by materials through two coupled
systems, and by particles through a grid, against differences in float64."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem
from warp.optim import linear

REAL = wp.float64
Vec2, Vec3 = wp.vec2d, wp.vec3d


@wp.kernel
def inner(x: wp.array(dtype=REAL), y: wp.array(dtype=REAL), out: wp.array(dtype=REAL)):
    i = wp.tid()
    wp.atomic_add(out, 0, x[i] * y[i])


def difference(value_of, x, direction, h):
    high, low = value_of(x + h * direction)[0], value_of(x - h * direction)[0]
    return (high - low) / (2.0 * h)


# Shapes: a reaction and diffusion problem whose vertices move.


@fem.integrand
def screened(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    k = REAL(1.0) + fem.position(domain, s)[0]
    return k * wp.dot(fem.grad(u, s), fem.grad(v, s)) + u(s) * v(s)


@fem.integrand
def load(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    x = fem.position(domain, s)
    return wp.sin(REAL(3.0) * x[0]) * x[1] * v(s)


@fem.integrand
def through(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    return fem.normal(domain, s)[0] * v(s)


@pytest.mark.parametrize(
    ("name", "degree"), [("tri", 1), ("tri", 2), ("quad", 2), ("tet", 2), ("hex", 1)]
)
def test_gradient_of_a_solution_by_the_shape(name, degree):
    base = programs.warped_geometry(name, 2)
    table, start = base.cell_vertices, base.positions.numpy()
    kind, dtype = type(base), base.positions.dtype

    def work(x):
        positions = wp.array(x, dtype=dtype, requires_grad=True)
        geometry = kind(table, positions)
        space = fem.make_polynomial_space(geometry, degree=degree, dtype=REAL)
        n, fields = space.node_count(), programs.fields_of(space)
        border = fem.BoundarySides(geometry)
        u = wp.zeros(n, dtype=REAL, requires_grad=True)
        out = wp.zeros(1, dtype=REAL, requires_grad=True)
        rule = fem.RegularQuadrature(fem.Cells(geometry), order=2 * degree + 2)
        on_border = fem.RegularQuadrature(border, order=2 * degree + 2)
        test = fem.make_test(space, domain=border)
        with wp.Tape() as tape:
            a = fem.integrate(screened, quadrature=rule, fields=fields)
            b = fem.integrate(load, quadrature=rule, fields={"v": fields["v"]})
            c = fem.integrate(through, quadrature=on_border, fields={"v": test})
            linear.cg(a, b, u, tol=1e-14, maxiter=500)
            wp.launch(inner, n, [c, u], [out])
        tape.backward(out)
        return float(out.numpy()[0]), positions.grad.numpy()

    _, gradient = work(start)
    for seed in range(2):
        direction = np.random.default_rng(seed).standard_normal(start.shape)
        found = (gradient * direction).sum()
        assert found == pytest.approx(difference(work, start, direction, 1e-5), rel=1e-6)


@fem.integrand
def conduction(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    return wp.dot(fem.grad(u, s), fem.grad(v, s))


@fem.integrand
def unit_load(s: fem.Sample, v: fem.Field):
    return v(s)


@fem.integrand
def wavy(s: fem.Sample, domain: fem.Domain, height: wp.array(dtype=REAL)):
    x = fem.position(domain, s)
    return height[0] * wp.sin(REAL(3.0) * x[0]) + x[1] * x[1]


@pytest.mark.parametrize("value", [None, wavy], ids=["zero", "by_place"])
@pytest.mark.parametrize("name", ["tri", "quad"])
def test_gradient_of_a_solution_with_fixed_values(name, value):
    """Rigidity of a twisted bar by its cross-section: values are fixed on the boundary."""
    base = programs.warped_geometry(name, 3)
    table, start, dtype = base.cell_vertices, base.positions.numpy(), base.positions.dtype

    def work(x):
        positions = wp.array(x[:-1], dtype=dtype, requires_grad=True)
        height = wp.array(x[-1, :1], dtype=REAL, requires_grad=True)
        geometry = type(base)(table, positions)
        space = fem.make_polynomial_space(geometry, degree=2, dtype=REAL)
        n, fields = space.node_count(), programs.fields_of(space)
        u = wp.zeros(n, dtype=REAL, requires_grad=True)
        out = wp.zeros(1, dtype=REAL, requires_grad=True)
        rule = fem.RegularQuadrature(fem.Cells(geometry), order=6)
        with wp.Tape() as tape:
            a = fem.integrate(conduction, quadrature=rule, fields=fields)
            b = fem.integrate(unit_load, quadrature=rule, fields={"v": fields["v"]})
            c = wp.clone(b)
            given = {} if value is None else {"value": value, "values": {"height": height}}
            fem.dirichlet(space, **given).project(a, b)
            linear.cg(a, b, u, tol=1e-14, maxiter=500)
            wp.launch(inner, n, [c, u], [out])
        tape.backward(out)
        of_height = np.array([[height.grad.numpy()[0], 0.0]])
        return float(out.numpy()[0]), np.concatenate([positions.grad.numpy(), of_height])

    start = np.concatenate([start, [[0.3, 0.0]]])
    rigidity, gradient = work(start)
    if value is None:
        # Torsion constant of a unit square by Saint-Venant's series: 0.1406.
        assert 4.0 * rigidity == pytest.approx(0.1406, rel=0.02)
    direction = np.random.default_rng(0).standard_normal(start.shape)
    found = (gradient * direction).sum()
    assert found == pytest.approx(difference(work, start, direction, 1e-5), rel=1e-6)


# Two systems: heat, and the displacements that it causes.


@fem.integrand
def heat(s: fem.Sample, u: fem.Field, v: fem.Field, k: wp.array(dtype=REAL)):
    return k[s.element_index] * wp.dot(fem.grad(u, s), fem.grad(v, s)) + u(s) * v(s)


@fem.integrand
def heated(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    return fem.position(domain, s)[0] * v(s)


@fem.integrand
def elastic(s: fem.Sample, u: fem.Field, v: fem.Field):
    e, w = fem.D(u, s), fem.D(v, s)
    return REAL(2.0) * wp.ddot(e, w) + wp.trace(e) * wp.trace(w) + wp.dot(u(s), v(s))


@fem.integrand
def thermal_load(s: fem.Sample, t: fem.Field, v: fem.Field):
    # Expansion grows with temperature, so that the load is not linear in it.
    return t(s) * (REAL(1.0) + t(s)) * fem.div(v, s)


@wp.kernel
def squares(x: wp.array(dtype=Vec2), out: wp.array(dtype=REAL)):
    i = wp.tid()
    wp.atomic_add(out, 0, x[i][0] * x[i][0] + x[i][0] * x[i][1])


@pytest.mark.parametrize("name", ["grid2", "tri"])
def test_gradient_through_two_systems(name):
    geometry = programs.warped_geometry(name, 3)
    temperatures = fem.make_polynomial_space(geometry, degree=2, dtype=REAL)
    moves = fem.make_polynomial_space(geometry, degree=1, dtype=Vec2)
    of_t, of_u = programs.fields_of(temperatures), programs.fields_of(moves)
    rule = fem.RegularQuadrature(fem.Cells(geometry), order=6)
    start = np.random.default_rng(2).uniform(0.5, 2.0, geometry.cell_count())

    def work(values):
        k = wp.array(values, dtype=REAL, requires_grad=True)
        t = temperatures.make_field()
        t.dof_values = wp.zeros(temperatures.node_count(), dtype=REAL, requires_grad=True)
        u = wp.zeros(moves.node_count(), dtype=Vec2, requires_grad=True)
        out = wp.zeros(1, dtype=REAL, requires_grad=True)
        with wp.Tape() as tape:
            a = fem.integrate(heat, quadrature=rule, fields=of_t, values={"k": k})
            b = fem.integrate(heated, quadrature=rule, fields={"v": of_t["v"]})
            linear.cg(a, b, t.dof_values, tol=1e-14, maxiter=500)
            stiffness = fem.integrate(elastic, quadrature=rule, fields=of_u)
            f = fem.integrate(thermal_load, quadrature=rule, fields={"t": t, "v": of_u["v"]})
            linear.cg(stiffness, f, u, tol=1e-14, maxiter=500)
            wp.launch(squares, u.shape[0], [u], [out])
        tape.backward(out)
        return float(out.numpy()[0]), k.grad.numpy()

    _, gradient = work(start)
    direction = np.random.default_rng(0).standard_normal(start.shape)
    found = gradient @ direction
    assert found == pytest.approx(difference(work, start, direction, 1e-5), rel=1e-6)


# Particles: momentum to a grid and velocities back.


@fem.integrand
def momentum(
    s: fem.Sample,
    domain: fem.Domain,
    v: fem.Field,
    velocity: wp.array(dtype=Vec3),
    slope: wp.array(dtype=wp.mat33d),
):
    """Momentum of an affine velocity at a particle, at the nodes."""
    d = domain(fem.at_node(v, s)) - domain(s)
    return wp.dot(v(s), velocity[s.qp_index] + slope[s.qp_index] * d)


@fem.integrand
def mass(s: fem.Sample, v: fem.Field):
    return v(s)


@fem.integrand
def gathered(s: fem.Sample, u: fem.Field):
    return u(s)


@wp.kernel
def divide(p: wp.array(dtype=Vec3), m: wp.array(dtype=REAL), v: wp.array(dtype=Vec3)):
    i = wp.tid()
    v[i] = Vec3()
    if m[i] > REAL(1e-12):
        v[i] = p[i] / m[i]


@wp.kernel
def weigh(v: wp.array(dtype=Vec3), w: wp.array(dtype=Vec3), out: wp.array(dtype=REAL)):
    i = wp.tid()
    wp.atomic_add(out, 0, wp.dot(v[i], w[i]) + wp.dot(v[i], v[i]))


class Transfer:
    """Affine velocities of particles to a grid and back, with all that the tape has."""

    def __init__(self, geometry, x, velocity, slope):
        n, cells = len(x), fem.Cells(geometry)
        space = fem.make_polynomial_space(geometry, degree=1, dtype=Vec3)
        numbers = fem.make_polynomial_space(geometry, degree=1, dtype=REAL)
        options = {"requires_grad": True}
        self.x, self.velocity = (wp.array(a, dtype=Vec3, **options) for a in (x, velocity))
        self.slope = wp.array(slope, dtype=wp.mat33d, **options)
        masses = wp.array(np.linspace(1.0, 2.0, n), dtype=REAL)
        self.masses, self.nodes = masses.numpy(), space.node_positions().numpy()
        self.result = wp.zeros(n, dtype=Vec3, **options)
        field = space.make_field()
        self.grid = field.dof_values = wp.zeros(space.node_count(), dtype=Vec3, **options)
        given = {"velocity": self.velocity, "slope": self.slope}
        with wp.Tape() as self.tape:
            rule = fem.PicQuadrature(cells, self.x, masses)
            tests = fem.make_test(space, domain=cells), fem.make_test(numbers, domain=cells)
            self.p = fem.integrate(
                momentum, quadrature=rule, fields={"v": tests[0]}, values=given, assembly="generic",
                output_dtype=Vec3,
            )  # fmt: skip
            self.m = fem.integrate(mass, quadrature=rule, fields={"v": tests[1]})
            wp.launch(divide, space.node_count(), [self.p, self.m, self.grid])
            fem.interpolate(gathered, dest=self.result, at=rule, fields={"u": field})


def sample_particles(n=40):
    rng = np.random.default_rng(4)
    return rng.uniform(0.05, 0.95, (n, 3)), rng.standard_normal((n, 3)), rng


TRANSFERS = ["grid3", "nano"]


def transfer_geometry(name):
    if name == "grid3":
        return fem.Grid3D(res=wp.vec3i(3, 3, 3), scalar_type=REAL)
    voxels = wp.array(np.argwhere(np.ones((3, 3, 3))), dtype=wp.vec3i)
    volume = wp.Volume.allocate_by_voxels(voxels, 1.0 / 3.0, translation=(1.0 / 6.0,) * 3)
    return fem.Nanogrid(volume, scalar_type=REAL)


@pytest.mark.parametrize("name", TRANSFERS)
def test_transfers_keep_momentum_and_affine_velocities(name):
    x, velocity, rng = sample_particles()
    slope = rng.standard_normal((len(x), 3, 3))
    geometry = transfer_geometry(name)
    made = Transfer(geometry, x, velocity, slope)
    p, m = made.p.numpy(), made.masses
    np.testing.assert_allclose(p.sum(0), (m[:, None] * velocity).sum(0), atol=1e-11)
    # Nodes get the values of an affine velocity that all particles share, and give them back.
    matrix, shift = rng.standard_normal((3, 3)), rng.standard_normal(3)
    made = Transfer(geometry, x, x @ matrix.T + shift, np.tile(matrix, (len(x), 1, 1)))
    used = made.m.numpy() > 1e-12
    exact = made.nodes @ matrix.T + shift
    np.testing.assert_allclose(made.grid.numpy()[used], exact[used], atol=1e-10)
    np.testing.assert_allclose(made.result.numpy(), x @ matrix.T + shift, atol=1e-10)


@pytest.mark.parametrize("name", TRANSFERS)
def test_gradient_through_a_transfer(name):
    x, velocity, rng = sample_particles()
    slope, weights = rng.standard_normal((len(x), 3, 3)), rng.standard_normal(x.shape)
    geometry = transfer_geometry(name)
    w = wp.array(weights, dtype=Vec3)

    def work(at):
        at = at.reshape(len(x), 15)
        made = Transfer(geometry, at[:, :3], at[:, 3:6], at[:, 6:].reshape(-1, 3, 3))
        out = wp.zeros(1, dtype=REAL, requires_grad=True)
        with made.tape:
            wp.launch(weigh, len(x), [made.result, w], [out])
        made.tape.backward(out)
        parts = (made.x.grad, made.velocity.grad, made.slope.grad)
        rows = [one.numpy().reshape(len(x), -1) for one in parts]
        return float(out.numpy()[0]), np.concatenate(rows, axis=1).reshape(-1)

    start = np.concatenate([x, velocity, slope.reshape(len(x), 9)], axis=1).reshape(-1)
    _, gradient = work(start)
    for first, last in ((0, 3), (3, 6), (6, 15)):
        direction = np.zeros((len(x), 15))
        direction[:, first:last] = rng.standard_normal((len(x), last - first))
        direction = direction.reshape(-1)
        found = gradient @ direction
        assert found == pytest.approx(difference(work, start, direction, 1e-6), rel=1e-6)
