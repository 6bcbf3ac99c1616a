"""Quadratures of nodes, arrays and particles: integrals of polynomials, gradients by positions."""

import numpy as np
import pytest

import warp as wp
import warp.fem as fem
from box_meshes import box_mesh

BOTH = pytest.mark.parametrize("real", [wp.float32, wp.float64])


@fem.integrand
def square(s: fem.Sample, domain: fem.Domain):
    x = domain(s)
    return x[0] * x[0] + x[1]


@fem.integrand
def first_moment(s: fem.Sample, domain: fem.Domain):
    return domain(s)[0]


def hexmesh(real, n=3):
    cells, positions = box_mesh("cube", n, 0.2, seed=2)
    positions = wp.array(positions, dtype=wp.types.vector(3, real))
    return fem.Hexmesh(wp.array(cells), positions, build_bvh=True)


def geometries(real):
    return [fem.Grid2D(wp.vec2i(3, 4), scalar_type=real), hexmesh(real)]


def test_nodes_as_points_integrate_what_their_space_does():
    grid = fem.Grid2D(wp.vec2i(3, 4))
    space = fem.make_polynomial_space(grid, degree=2)
    quadrature = fem.NodalQuadrature(fem.Cells(grid), space)
    assert quadrature.total_point_count() == space.node_count()
    assert fem.integrate(square, quadrature=quadrature) == pytest.approx(1 / 3 + 1 / 2, rel=1e-6)


@BOTH
def test_points_of_arrays(real):
    grid = fem.Grid2D(wp.vec2i(3, 4), scalar_type=real)
    rule = fem.RegularQuadrature(fem.Cells(grid), 2).rule
    n = grid.cell_count()
    points = wp.array(np.tile(rule.points, (n, 1, 1)), dtype=grid.coords_type)
    weights = wp.array(np.tile(rule.weights, (n, 1)), dtype=real)
    quadrature = fem.ExplicitQuadrature(fem.Cells(grid), points, weights)
    assert fem.integrate(square, quadrature=quadrature) == pytest.approx(1 / 3 + 1 / 2, rel=1e-6)
    with pytest.raises(ValueError, match=r"'points' expects 12 rows"):
        fem.ExplicitQuadrature(fem.Cells(grid), points[:5], weights[:5])


@BOTH
@pytest.mark.parametrize("which", [0, 1])
def test_particles_keep_mass_and_first_moment(real, which):
    geometry = geometries(real)[which]
    d, rng = geometry.dimension, np.random.default_rng(4)
    x, mass = 0.1 + 0.8 * rng.random((500, d)), rng.random(500)
    # On faces of the grid: each counts once.
    x[:50, 0] = 1 / 3
    positions = wp.array(x, dtype=wp.types.vector(d, real))
    measures = wp.array(mass, dtype=real)
    quadrature = fem.PicQuadrature(fem.Cells(geometry), positions, measures)
    assert quadrature.outside_count() == 0
    expected = mass @ x[:, 0]
    tolerance = 1e-6 if real is wp.float32 else 1e-13
    got = fem.integrate(first_moment, quadrature=quadrature)
    assert got == pytest.approx(expected, rel=tolerance)
    cells = quadrature.cell_indices.numpy()
    offsets = quadrature.cell_particle_offsets.numpy()
    np.testing.assert_array_equal(np.diff(offsets), np.bincount(cells, minlength=len(offsets) - 1))
    assert quadrature.max_points_per_element() == np.bincount(cells).max()
    assert quadrature.active_cell_count() == len(np.unique(cells))
    order = quadrature.cell_particle_indices.numpy()
    np.testing.assert_array_equal(order, np.argsort(cells, kind="stable"))
    mask = wp.zeros(geometry.cell_count(), dtype=int)
    quadrature.fill_element_mask(mask)
    np.testing.assert_array_equal(mask.numpy(), np.diff(offsets) > 0)


@pytest.mark.parametrize("which", [0, 1])
def test_gradient_by_positions_of_particles(which):
    geometry = geometries(wp.float64)[which]
    d, rng = geometry.dimension, np.random.default_rng(5)
    x, mass = 0.1 + 0.8 * rng.random((40, d)), rng.random(40)
    vector = wp.types.vector(d, wp.float64)
    positions = wp.array(x, dtype=vector, requires_grad=True)
    measures = wp.array(mass, dtype=wp.float64, requires_grad=True)
    total = wp.zeros(1, dtype=wp.float64, requires_grad=True)
    with wp.Tape() as tape:
        quadrature = fem.PicQuadrature(fem.Cells(geometry), positions, measures)
        fem.integrate(square, quadrature=quadrature, output=total)
    tape.backward(total)
    # The mass of a particle is measured in space, its position enters by the integrand alone.
    expected = np.zeros_like(x)
    expected[:, 0] = 2.0 * mass * x[:, 0]
    expected[:, 1] = mass
    np.testing.assert_allclose(positions.grad.numpy(), expected, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(measures.grad.numpy(), x[:, 0] ** 2 + x[:, 1], rtol=1e-9)


def test_particles_in_several_cells():
    grid = fem.Grid2D(wp.vec2i(2, 1))
    cells = wp.array([[0, 1], [1, -1]], dtype=int)
    coords = wp.array(np.full((2, 2, 3), 0.5), dtype=wp.vec3)
    fractions = wp.array([[0.25, 0.75], [1.0, 0.0]], dtype=float)
    measures = wp.array([1.0, 2.0], dtype=float)
    quadrature = fem.PicQuadrature(fem.Cells(grid), (cells, coords, fractions), measures)
    assert quadrature.outside_count() == 1
    got = fem.integrate(first_moment, quadrature=quadrature)
    assert got == pytest.approx(0.25 * 0.25 + 0.75 * 0.75 + 2.0 * 0.75, rel=1e-6)


def test_a_mesh_without_hierarchy_is_named():
    cells, positions = box_mesh("tet", 2)
    mesh = fem.Tetmesh(wp.array(cells), wp.array(positions, dtype=wp.vec3))
    with pytest.raises(RuntimeError, match="'build_bvh' first"):
        fem.PicQuadrature(fem.Cells(mesh), wp.zeros(3, dtype=wp.vec3))
