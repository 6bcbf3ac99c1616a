"""Stokes flow: exact for Poiseuille, stable pairs by their inf-sup constants."""

import itertools

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem


@fem.integrand
def viscosity(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.ddot(fem.grad(u, s), fem.grad(v, s))


@fem.integrand
def divergence(s: fem.Sample, u: fem.Field, q: fem.Field):
    return q(s) * fem.div(u, s)


def systems(geo, degree, pressure_degree, **options):
    """Spaces, and the dense matrices of velocity, constraint and pressure."""
    domain = fem.Cells(geo)
    dtype = wp.types.vector(length=geo.dimension, dtype=wp.float64)
    velocity = fem.make_polynomial_space(geo, degree=degree, dtype=dtype)
    pressure = fem.make_polynomial_space(geo, degree=pressure_degree, dtype=wp.float64, **options)
    u, q = fem.make_trial(velocity, domain=domain), fem.make_test(pressure, domain=domain)
    a = programs.dense(fem.integrate(viscosity, fields=programs.fields_of(velocity)))
    b = programs.dense(fem.integrate(divergence, fields={"u": u, "q": q}))
    m = programs.dense(fem.integrate(programs.mass, fields=programs.fields_of(pressure)))
    return velocity, pressure, a, b, m


# Tetrahedra of grids have corners whose pressure no velocity sees.
PAIRS = [("grid2", 2, 1, {}), ("tri", 2, 1, {}), ("grid3", 2, 1, {}), ("hex", 2, 1, {})]


@pytest.mark.parametrize(("name", "degree", "pressure_degree", "options"), PAIRS)
def test_poiseuille_flow_is_exact(name, degree, pressure_degree, options):
    geo = programs.geometry(name, 2, wp.float64)
    velocity, pressure, a, b, m = systems(geo, degree, pressure_degree, **options)
    points = velocity.node_positions().numpy()
    exact = np.zeros_like(points)
    exact[:, 0] = points[:, 1] * (1.0 - points[:, 1])
    # -lap u + grad p = 0 with p = 1 - 2 x, whose mean is zero.
    p = 1.0 - 2.0 * pressure.node_positions().numpy()[:, 0]
    n, k = exact.size, p.size
    system = np.block(
        [
            [a, -b.T, np.zeros((n, 1))],
            [-b, np.zeros((k, k)), (m @ np.ones(k))[:, None]],
            [np.zeros((1, n)), (m @ np.ones(k))[None], np.zeros((1, 1))],
        ]
    )
    fixed = np.append(np.repeat(programs.on_boundary(points), geo.dimension), np.zeros(k + 1, bool))
    values = np.concatenate([exact.ravel(), np.zeros(k + 1)])
    x = programs.solve(system, np.zeros(n + k + 1), fixed, values)
    assert np.abs(x[:n] - exact.ravel()).max() < 1e-11
    assert np.abs(x[n : n + k] - p).max() < 1e-9


def inf_sup(name, degree, pressure_degree, n, **options):
    """The least singular value of the constraint, in the norms of grad u and p."""
    geo = programs.geometry(name, n, wp.float64)
    velocity, _, a, b, m = systems(geo, degree, pressure_degree, **options)
    free = ~np.repeat(programs.on_boundary(velocity.node_positions().numpy()), geo.dimension)
    schur = b[:, free] @ np.linalg.solve(a[np.ix_(free, free)], b[:, free].T)
    root = np.linalg.inv(np.linalg.cholesky(m))
    values = np.linalg.eigvalsh(root @ schur @ root.T)
    return np.sqrt(np.maximum(values, 0.0))


def test_inf_sup_constants():
    # The first value belongs to the constant pressure; Q1-Q1 has seven more that vanish.
    expected = {("grid2", 2): [0.475, 0.463, 0.455], ("tri", 2): [0.368, 0.366, 0.366]}
    for (name, degree), constants in expected.items():
        for n, constant in zip((4, 8, 16), constants, strict=True):
            values = inf_sup(name, degree, 1, n)
            assert values[0] < 1e-6
            assert values[1] == pytest.approx(constant, abs=0.005)
    falling = [inf_sup("grid2", 1, 1, n) for n in (4, 8)]
    least = [values[values > 1e-6][0] for values in falling]
    assert 0.35 < least[1] / least[0] < 0.65


@wp.func
def flow_2d(x: wp.vec2d):
    a = wp.float64(1.7) * x
    return wp.vec2d(wp.sin(a[0]) * wp.cos(a[1]), -wp.cos(a[0]) * wp.sin(a[1]))


@wp.func
def flow_3d(x: wp.vec3d):
    a = wp.float64(1.7) * x
    return wp.vec3d(
        wp.sin(a[2]) + wp.cos(a[1]), wp.sin(a[0]) + wp.cos(a[2]), wp.sin(a[1]) + wp.cos(a[0])
    )


@wp.func
def pressure_2d(x: wp.vec2d):
    return wp.sin(wp.float64(2.0) * x[0]) * wp.cos(x[1])


@wp.func
def pressure_3d(x: wp.vec3d):
    return wp.sin(wp.float64(2.0) * x[0]) * wp.cos(x[1]) + x[2]


@fem.integrand
def stokes_load(s: fem.Sample, v: fem.Field, exact: fem.Field, p: fem.Field):
    return wp.ddot(fem.grad(exact, s), fem.grad(v, s)) - p(s) * fem.div(v, s)


@fem.integrand
def squared_difference(s: fem.Sample, u: fem.Field, exact: fem.Field):
    return wp.length_sq(u(s) - exact(s))


@fem.integrand
def difference(s: fem.Sample, p: fem.Field, exact: fem.Field):
    return p(s) - exact(s)


@fem.integrand
def squared_pressure(s: fem.Sample, p: fem.Field, exact: fem.Field, mean: wp.float64):
    return (p(s) - exact(s) - mean) * (p(s) - exact(s) - mean)


@fem.integrand
def field_value(s: fem.Sample, u: fem.Field):
    return u(s)


def tetrahedra(n):
    """Six tetrahedra a cube, around a diagonal: each has a velocity inside."""
    points = programs.points_of_grid(n, 3)
    corner = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), -1).reshape(-1, 3)
    cells = []
    for order in itertools.permutations(range(3)):
        path = [corner]
        for axis in order:
            path.append(path[-1] + np.eye(3, dtype=int)[axis])
        cells.append(np.stack([(p * [(n + 1) ** 2, n + 1, 1]).sum(axis=1) for p in path], -1))
    return fem.Tetmesh(wp.array(np.concatenate(cells), dtype=int), wp.array(points, dtype=wp.vec3d))


def manufactured_errors(geo, options):
    """L2 errors of velocity and pressure, boundary values being those of the exact flow."""
    cells, d = fem.Cells(geo), geo.dimension
    flow, exact_pressure = (flow_2d, pressure_2d) if d == 2 else (flow_3d, pressure_3d)
    velocity, pressure, a, b, _ = systems(geo, 2, 1, **options)
    exact = fem.ImplicitField(cells, flow, grad_func=True, degree=6)
    p_exact = fem.ImplicitField(cells, exact_pressure, degree=6)
    rule = fem.RegularQuadrature(cells, order=8)
    v = fem.make_test(velocity, domain=cells)
    fields = {"v": v, "exact": exact, "p": p_exact}
    f = fem.integrate(stokes_load, quadrature=rule, fields=fields).numpy().ravel()
    nodal = velocity.make_field()
    fem.interpolate(field_value, dest=nodal, fields={"u": exact})
    n, k = len(f), b.shape[0]
    system = np.block([[a, -b.T], [-b, np.zeros((k, k))]])
    fixed = np.zeros(n + k, bool)
    fixed[:n] = np.repeat(programs.on_boundary(velocity.node_positions().numpy()), d)
    fixed[n] = True
    values = np.append(nodal.dof_values.numpy().ravel(), np.zeros(k))
    x = programs.solve(system, np.append(f, np.zeros(k)), fixed, values)
    u, p = programs.field_of(velocity, x[:n]), programs.field_of(pressure, x[n:])
    pair = {"p": p, "exact": p_exact}
    mean = fem.integrate(difference, quadrature=rule, fields=pair)
    values = {"mean": float(mean)}
    return (
        programs.norm(squared_difference, {"u": u, "exact": exact}, 8, cells),
        programs.norm(squared_pressure, pair, 8, cells, values=values),
    )


INSIDE = {"discontinuous": True, "element_basis": fem.ElementBasis.NONCONFORMING_POLYNOMIAL}
MANUFACTURED = [
    ("grid2", (6, 12), {}),
    ("tri", (6, 12), {}),
    ("quad", (6, 12), {}),
    ("grid2", (6, 12), INSIDE),
    ("grid3", (2, 4), {}),
    ("hex", (2, 4), {}),
    ("tet", (2, 4), {}),
    ("grid3", (2, 4), INSIDE),
]


@pytest.mark.parametrize(("name", "sizes", "options"), MANUFACTURED)
def test_orders_of_velocity_and_pressure(name, sizes, options):
    make = programs.geometry
    errors = [
        manufactured_errors(tetrahedra(n) if name == "tet" else make(name, n, wp.float64), options)
        for n in sizes
    ]
    of_velocity, of_pressure = (programs.order_of(e) for e in zip(*errors, strict=True))
    assert of_velocity == pytest.approx(3.0, abs=0.15), errors
    # On coarse grids pressures converge faster than their best approximation.
    assert of_pressure > 2.0 - 0.15, errors
