"""Stokes flow: exact for Poiseuille, stable pairs by their inf-sup constants."""

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
    expected = {("grid2", 2): [0.475, 0.463], ("tri", 2): [0.368, 0.366]}
    for (name, degree), constants in expected.items():
        for n, constant in zip((4, 8), constants, strict=True):
            values = inf_sup(name, degree, 1, n)
            assert values[0] < 1e-6
            assert values[1] == pytest.approx(constant, abs=0.005)
    falling = [inf_sup("grid2", 1, 1, n) for n in (4, 8)]
    least = [values[values > 1e-6][0] for values in falling]
    assert 0.35 < least[1] / least[0] < 0.65
