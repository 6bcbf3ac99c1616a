"""Spaces on meshes: continuity across sides of every orientation."""

import itertools

import numpy as np
import pytest

import warp as wp
from warp._src.fem.cells.cell import CUBE, SQUARE, TET, TRIANGLE
from warp._src.fem.geometry.meshes import Hexmesh, Quadmesh2D, Tetmesh, Trimesh2D
from warp._src.fem.spaces.make import make_polynomial_space

MESHES = {TRIANGLE: Trimesh2D, SQUARE: Quadmesh2D, TET: Tetmesh, CUBE: Hexmesh}


def symmetries(cell):
    """Orders of a cell's vertices that are motions or reflections of the cell."""
    edges = {frozenset(edge) for edge in cell.edges}
    for order in itertools.permutations(range(len(cell.corners))):
        if {frozenset((order[a], order[b])) for a, b in cell.edges} == edges:
            yield order


def doubled(cell):
    """A cell and its mirror image across a side: positions, cells in the reference cell's order."""
    side = cell.sides[-1]
    corners = cell.vertices
    if cell.is_simplex:
        normal = np.ones(cell.dimension)
        normal = np.cross(*(corners[list(side[1:])] - corners[side[0]])) if len(side) == 3 else None
        if normal is None:
            along = corners[side[1]] - corners[side[0]]
            normal = np.array([along[1], -along[0]])
    else:
        normal = np.eye(cell.dimension)[0 if cell.dimension == 2 else 2]
    normal = normal / np.linalg.norm(normal)
    mirrored = corners - 2.0 * np.outer((corners - corners[side[0]]) @ normal, normal)
    numbers, positions = [], list(corners)
    for v, place in enumerate(mirrored):
        if v in side:
            numbers.append(v)
        else:
            numbers.append(len(positions))
            positions.append(place)
    return np.array(positions), np.array([range(len(corners)), numbers]), side


def turned_meshes(cell, most=100):
    """The doubled cell with each order of the second cell's vertices and shuffled numbers."""
    positions, cells, side = doubled(cell)
    rng = np.random.default_rng(3)
    orders = list(symmetries(cell))
    for order in orders[:most]:
        numbers = rng.permutation(len(positions))
        moved = np.empty_like(positions)
        moved[numbers] = positions
        table = numbers[np.array([cells[0], cells[1][list(order)]])]
        yield moved, table, [numbers[v] for v in side]


def make_mesh(cell, positions, table):
    columns = np.empty_like(table)
    for v, column in enumerate(cell.mesh_vertices):
        columns[:, column] = table[:, v]
    vector = wp.vec2d if cell.dimension == 2 else wp.vec3d
    return MESHES[cell](
        wp.array(columns, dtype=wp.int32, ndim=2), wp.array(positions, dtype=vector)
    )


def parameters_of(cell, corners, point):
    """Parameters of a point in a cell with these corners, which is affine."""
    base = corners[0]
    rows = [1, 2, 3][: cell.dimension] if cell.is_simplex else [4, 2, 1][-cell.dimension :]
    gradient = (corners[rows] - base).T
    return np.linalg.solve(gradient, point - base), gradient


def values_at(space, positions, table, point, dofs):
    """Value of a function at a point of a side, seen from each of the two cells."""
    element, cell = space.element, space.geometry.cell
    nodes = space.topology.element_node_indices().numpy()
    signs = np.ones_like(nodes)
    if space.topology.record.is_signed:
        signs = space.topology.tables().signs.numpy()
    turns = np.zeros(len(table), int)
    if space.topology.record.is_oriented:
        turns = space.topology.tables().orientations.numpy()
    found = []
    for k in range(len(table)):
        x, gradient = parameters_of(cell, positions[table[k]], point)
        basis, _ = element.tabulate(cell.coords(x[None]), turns[k])
        weights = signs[k] * dofs[nodes[k]]
        value = np.tensordot(weights, basis[0], axes=1)
        if element.map == "covariant":
            value = np.linalg.solve(gradient.T, value)
        elif element.map == "contravariant":
            value = gradient @ value / abs(np.linalg.det(gradient))
        found.append(value)
    return found


def check_continuity(cell, project=lambda value, normal: value, **arguments):
    rng = np.random.default_rng(5)
    turns = 0
    for positions, table, side in turned_meshes(cell):
        space = make_polynomial_space(make_mesh(cell, positions, table), **arguments)
        dofs = rng.standard_normal(space.node_count())
        corners = positions[side]
        axes = (corners[1:] - corners[0])[:2]
        normal = np.cross(*axes) if cell.dimension == 3 else np.array([axes[0][1], -axes[0][0]])
        normal = normal / np.linalg.norm(normal)
        for _ in range(3):
            mix = rng.dirichlet(np.ones(len(side)))
            inner, outer = values_at(space, positions, table, mix @ corners, dofs)
            np.testing.assert_allclose(
                project(inner, normal), project(outer, normal), atol=1e-10, err_msg=str(table)
            )
        turns += 1
    assert turns == {TRIANGLE: 6, SQUARE: 8, TET: 24, CUBE: 48}[cell]


@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("cell", [TRIANGLE, SQUARE, TET, CUBE], ids=str)
def test_lagrange_spaces_are_continuous(cell, degree):
    check_continuity(cell, degree=degree)


@pytest.mark.parametrize("cell", [TRIANGLE, SQUARE, TET, CUBE], ids=str)
@pytest.mark.parametrize("degree", [1, 2, 4])
def test_nodes_of_meshes(cell, degree):
    """Vertices come first, with their numbers; nodes at one place are one node."""
    positions, table, _ = next(turned_meshes(cell))
    space = make_polynomial_space(make_mesh(cell, positions, table), degree=degree)
    found = space.node_positions().numpy()
    np.testing.assert_allclose(found[: len(positions)], positions, atol=1e-12)
    assert len(np.unique(np.round(found, 9), axis=0)) == space.node_count()
