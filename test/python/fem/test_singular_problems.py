"""Problems with steep solutions: an L-shape on graded grids, the eikonal equation."""

import math

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem
from warp.optim import linear

REAL = wp.float64
Vec3 = wp.vec3d


# An edge that points inwards: r^(2/3) sin(2 t / 3) in a slab, by interior penalties.


def slab(n, is_graded):
    """An L of thickness 1 / n. Cells of a graded grid have sizes below sqrt(r) / n."""
    cells = {}

    def add(i, j, k, size):
        r = math.hypot((i + 0.5) * size, (j + 0.5) * size)
        if is_graded and size > math.sqrt(r) / n:
            for a, b, c in np.ndindex(2, 2, 2):
                add(2 * i + a, 2 * j + b, 2 * k + c, 0.5 * size)
        else:
            cells.setdefault(size, []).append((i, j, k))

    for i, j in np.ndindex(2 * n, 2 * n):
        if i < n or j >= n:
            add(i - n, j - n, 0, 1.0 / n)
    grids = [
        wp.Volume.allocate_by_voxels(
            wp.array(np.array(cells[size]), dtype=wp.vec3i), size, translation=(0.5 * size,) * 3
        )
        for size in sorted(cells)
    ]
    made = fem.adaptive_nanogrid_from_hierarchy(grids)
    return fem.AdaptiveNanogrid(
        made.cell_grid, made.cell_level, made.level_count, scalar_type=wp.float64
    )


@wp.func
def polar(x: Vec3):
    t = wp.atan2(x[1], x[0])
    if t < REAL(-1e-12):
        t += REAL(2.0 * math.pi)
    return wp.sqrt(x[0] * x[0] + x[1] * x[1]), t


@wp.func
def singular(x: Vec3):
    r, t = polar(x)
    return wp.pow(r, REAL(2.0 / 3.0)) * wp.sin(REAL(2.0 / 3.0) * t)


@wp.func
def slope(x: Vec3):
    r, t = polar(x)
    size, t = REAL(2.0 / 3.0) * wp.pow(r, REAL(-1.0 / 3.0)), t / REAL(3.0)
    return size * Vec3(-wp.sin(t), wp.cos(t), REAL(0.0))


@fem.integrand
def penalties(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    n, size = fem.normal(domain, s), wp.sqrt(fem.measure(domain, s))
    flux_u = wp.dot(fem.grad_average(u, s), n)
    flux_v = wp.dot(fem.grad_average(v, s), n)
    ju, jv = fem.jump(u, s), fem.jump(v, s)
    return REAL(8.0) / size * ju * jv - ju * flux_v - jv * flux_u


@fem.integrand
def nitsche(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    n, size = fem.normal(domain, s), wp.sqrt(fem.measure(domain, s))
    flux_u, flux_v = wp.dot(fem.grad(u, s), n), wp.dot(fem.grad(v, s), n)
    upright = REAL(1.0) - n[2] * n[2]
    return upright * (REAL(8.0) / size * u(s) * v(s) - u(s) * flux_v - v(s) * flux_u)


@fem.integrand
def nitsche_load(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    n, size = fem.normal(domain, s), wp.sqrt(fem.measure(domain, s))
    weight = REAL(8.0) / size * v(s) - wp.dot(fem.grad(v, s), n)
    return (REAL(1.0) - n[2] * n[2]) * singular(fem.position(domain, s)) * weight


@fem.integrand
def slope_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    e = fem.grad(u, s) - slope(fem.position(domain, s))
    return wp.dot(e, e)


def energy_error(n, is_graded):
    geometry = slab(n, is_graded)
    cells, sides, border = fem.Cells(geometry), fem.Sides(geometry), fem.BoundarySides(geometry)
    space = fem.make_polynomial_space(geometry, degree=1, discontinuous=True, dtype=REAL)
    a = fem.integrate(programs.diffusion, fields=programs.fields_of(space, cells))
    fem.integrate(penalties, fields=programs.fields_of(space, sides), output=a, add=True)
    fields = programs.fields_of(space, border)
    fem.integrate(nitsche, fields=fields, output=a, add=True)
    rule = fem.RegularQuadrature(border, order=6)
    b = fem.integrate(nitsche_load, quadrature=rule, fields={"v": fields["v"]})
    u = space.make_field()
    linear.cg(a, b, u.dof_values, tol=1e-10, maxiter=2000, M=linear.preconditioner(a, "diag"))
    error = programs.norm(slope_error, {"u": u}, 8, cells)
    return math.sqrt(n) * error, geometry.cell_count()


def test_graded_grids_restore_the_order_on_an_l_shape():
    """Energies converge with h^(2/3) on uniform grids, with h on graded ones: no slower than
    cells^(-1/2), the order of smooth solutions in a plane."""
    errors = [energy_error(n, False)[0] for n in (4, 8)]
    assert programs.order_of(errors) == pytest.approx(2.0 / 3.0, abs=0.06)
    errors, counts = zip(*(energy_error(n, True) for n in (4, 8)))
    assert programs.order_of(errors) == pytest.approx(1.0, abs=0.06)
    assert 2.0 * programs.order_of(errors, counts[1] / counts[0]) > 0.94


# Arrival times: |grad u|^2 - e Laplace u = 1, which exp(-u / e) makes linear.

WIDTH = 0.3


@fem.integrand
def arrival(s: fem.Sample, domain: fem.Domain):
    x, e = fem.position(domain, s), REAL(WIDTH)
    return -e * wp.log(wp.cosh(REAL(0.6) * x[0] / e) * wp.cosh(REAL(0.8) * x[1] / e))


@fem.integrand
def eikonal(s: fem.Sample, u: fem.Field, v: fem.Field):
    g = fem.grad(u, s)
    return (wp.dot(g, g) - REAL(1.0)) * v(s) + REAL(WIDTH) * wp.dot(g, fem.grad(v, s))


@fem.integrand
def arrival_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    e = u(s) - arrival(s, domain)
    return e * e


@pytest.mark.parametrize(("degree", "sizes"), [(1, (8, 16)), (2, (6, 12)), (3, (4, 8))])
@pytest.mark.parametrize("name", ["tri", "grid2", "quad"])
def test_order_of_arrival_times(name, degree, sizes):
    def error(n):
        geometry = programs.warped_geometry(name, n)
        cells, order = fem.Cells(geometry), 3 * degree + 1
        space = fem.make_polynomial_space(geometry, degree=degree, dtype=REAL)
        u, v, du = space.make_field(), fem.make_test(space), fem.make_trial(space)
        fem.interpolate(arrival, dest=u)
        # Newton's method converges from near, with exact values on the boundary.
        fixed = programs.on_boundary(space.node_positions().numpy())
        x = u.dof_values.numpy()
        x = np.where(fixed, x, x + 0.01)
        tangent, rule = fem.derivative(eikonal, "u"), fem.RegularQuadrature(cells, order=order)
        for _ in range(20):
            u = programs.field_of(space, x)
            a = programs.matrix_of(tangent, {"u": u, "v": v, "du": du}, cells, order)
            r = fem.integrate(eikonal, quadrature=rule, fields={"u": u, "v": v}).numpy()
            step = programs.solve(a, -r, fixed, 0.0)
            x = x + step
            if np.abs(step).max() < 1e-12:
                return programs.norm(arrival_error, {"u": u}, 2 * degree + 6, cells)
        pytest.fail("Newton's method does not converge")

    assert programs.order_of([error(n) for n in sizes]) == pytest.approx(degree + 1, abs=0.4)
