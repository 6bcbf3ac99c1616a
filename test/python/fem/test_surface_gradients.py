"""Gradients of covariant and contravariant fields on curved surfaces, against differences of their
values along the surface."""

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem

Basis = fem.ElementBasis
REAL = wp.float64
KINDS = {"Trimesh3D": fem.utils.grid_to_tris, "Quadmesh3D": fem.utils.grid_to_quads}


def saddle(x):
    a, b = x[:, 0], x[:, 1]
    height = 0.3 * a * a - 0.2 * a * b + 0.1 * b
    return np.stack([a + 0.1 * b * b, b - 0.05 * a * b, height], axis=1)


def surface(kind, degree):
    flat = np.pad(programs.points_of_grid(2, 2), ((0, 0), (0, 1)))
    cells = wp.array(KINDS[kind](2, 2), dtype=int)
    return programs.curved(getattr(fem, kind)(cells, wp.array(flat, wp.vec3d)), saddle, degree)


@fem.integrand
def value(s: fem.Sample, u: fem.Field):
    return u(s)


@fem.integrand
def gradient(s: fem.Sample, u: fem.Field):
    return fem.grad(u, s)


@fem.integrand
def place(s: fem.Sample, domain: fem.Domain):
    return domain(s)


@fem.integrand
def energy(s: fem.Sample, u: fem.Field):
    g = fem.grad(u, s)
    return wp.ddot(g, g)


@fem.integrand
def energy_form(s: fem.Sample, u: fem.Field, v: fem.Field):
    return wp.ddot(fem.grad(u, s), fem.grad(v, s))


def at_points(form, geometry, points, dtype, **fields):
    """Values of a form at points of each cell, (cells, points, ...)."""
    shape = (geometry.cell_count(), len(points))
    coords = wp.array(np.broadcast_to(points, (*shape, 3)).copy(), dtype=wp.vec3d)
    weights = wp.array(np.ones(shape), dtype=REAL)
    rule = fem.ExplicitQuadrature(fem.Cells(geometry), coords, weights)
    out = wp.zeros(shape[0] * shape[1], dtype=dtype)
    fem.interpolate(form, dest=out, at=rule, fields=fields)
    return out.numpy().reshape(*shape, *out.numpy().shape[1:])


@pytest.mark.parametrize(("degree", "map_degree"), [(1, 1), (1, 3), (2, 2), (3, 2)])
@pytest.mark.parametrize("basis", [Basis.NEDELEC_FIRST_KIND, Basis.RAVIART_THOMAS])
@pytest.mark.parametrize("kind", KINDS)
def test_gradients_along_a_curved_surface(kind, basis, degree, map_degree):
    geometry = surface(kind, map_degree)
    space = fem.make_polynomial_space(geometry, degree=degree, element_basis=basis, dtype=REAL)
    u = programs.field_of(space, np.random.default_rng(1).standard_normal(space.node_count()))
    is_triangle, h = kind == "Trimesh3D", 1e-5
    center = np.array([0.3, 0.25, 0.45] if is_triangle else [0.3, 0.6, 0.0])
    axes = np.array([(-1, 1, 0), (-1, 0, 1)] if is_triangle else [(1, 0, 0), (0, 1, 0)])
    points = np.concatenate([center + h * axes, center - h * axes, [center]])

    def slopes(values):
        """Differences by the two parameters, as columns."""
        return ((values[:, :2] - values[:, 2:4]) / (2.0 * h)).swapaxes(1, 2)

    values = at_points(value, geometry, points, wp.vec3d, u=u)
    tangents = slopes(at_points(place, geometry, points, wp.vec3d))
    expected = slopes(values) @ np.linalg.pinv(tangents)
    found = at_points(gradient, geometry, points, wp.mat33d, u=u)[:, -1]
    np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())
    if degree > 1 or map_degree > 1:
        return
    # Functions of tables, which matrices are made of, agree with fields.
    rule = fem.RegularQuadrature(fem.Cells(geometry), order=4)
    k = fem.integrate(energy_form, quadrature=rule, fields=programs.fields_of(space))
    x = u.dof_values.numpy()
    total = float(fem.integrate(energy, quadrature=rule, fields={"u": u}))
    assert x @ programs.dense(k) @ x == pytest.approx(total, rel=1e-12)
