"""Pieces of cells for pictures fill each cell once."""

import numpy as np
import pytest

import warp as wp
from warp._src.fem.cells.layout import ElementBasis as Basis
from warp._src.fem.geometry.grid import Grid2D, Grid3D
from warp._src.fem.geometry.meshes import Tetmesh, Trimesh2D
from warp._src.fem.spaces.make import make_polynomial_space


def simplex_measure(corners):
    edges = corners[:, 1:] - corners[:, :1]
    return np.abs(np.linalg.det(edges)) / {2: 2.0, 3: 6.0}[corners.shape[2]]


def triangle():
    points = wp.array([[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]], dtype=wp.vec2)
    return Trimesh2D(wp.array([[0, 1, 2]], dtype=wp.int32), points)


def tet():
    points = np.vstack((np.zeros(3), np.diag([1.0, 2.0, 3.0])))
    return Tetmesh(wp.array([[0, 1, 2, 3]], dtype=wp.int32), wp.array(points, dtype=wp.vec3))


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
@pytest.mark.parametrize("make", [lambda: Grid2D((3, 2)), triangle], ids=["grid", "triangle"])
def test_triangles(make, degree):
    space = make_polynomial_space(make(), degree=degree)
    corners = space.node_positions().numpy()[space.node_triangulation()]
    areas = simplex_measure(corners)
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(1.0, rel=1e-5)


@pytest.mark.parametrize("degree", [2, 3])
def test_triangles_of_serendipity(degree):
    space = make_polynomial_space(Grid2D((2, 2)), degree=degree, element_basis=Basis.SERENDIPITY)
    areas = simplex_measure(space.node_positions().numpy()[space.node_triangulation()])
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(1.0, rel=1e-5)


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
@pytest.mark.parametrize("make", [lambda: Grid3D((1, 2, 1)), tet], ids=["grid", "tet"])
def test_tets(make, degree):
    space = make_polynomial_space(make(), degree=degree)
    volumes = simplex_measure(space.node_positions().numpy()[space.node_tets()])
    assert volumes.min() > 0.0
    assert volumes.sum() == pytest.approx(1.0, rel=1e-5)


@pytest.mark.parametrize("degree", [1, 2, 3])
@pytest.mark.parametrize("grid", [Grid2D((2, 1)), Grid3D((1, 2, 1))], ids=lambda g: g.name)
def test_cells_of_vtk(grid, degree):
    """Every node of a cell once; vertices around, then edges from vertex to vertex."""
    space = make_polynomial_space(grid, degree=degree)
    cells, types = space.vtk_cells()
    count = (degree + 1) ** grid.dimension
    cells = cells.reshape(grid.cell_count(), count + 1)
    assert (cells[:, 0] == count).all()
    assert set(types) == {{2: (9, 70), 3: (12, 72)}[grid.dimension][degree > 1]}
    nodes = np.sort(space.topology.element_node_indices().numpy(), axis=1)
    np.testing.assert_array_equal(np.sort(cells[:, 1:], axis=1), nodes)
    places = space.node_positions().numpy()[cells[:, 1:]]
    if degree > 1:
        first = 2**grid.dimension
        middle = places[:, first : first + degree - 1].mean(axis=1)
        np.testing.assert_allclose(middle, places[:, :2].mean(axis=1), atol=1e-6)


def test_hexes_and_missing_pieces():
    space = make_polynomial_space(Grid3D((2, 1, 1)), degree=2)
    assert space.node_hexes().shape == (16, 8)
    assert not hasattr(space, "node_triangulation")
    assert not hasattr(make_polynomial_space(triangle()), "node_grid")
