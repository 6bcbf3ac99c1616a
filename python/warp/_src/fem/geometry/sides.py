"""Sides of meshes - cells on both, orientation of normals, places of vertices in the cells."""

from dataclasses import dataclass
from typing import Any

import warp as wp
from warp import extend
from warp._src.fem.types import AnyArray, Ints, IntTable, Pairs


@wp.func
def _place(cells: IntTable, cell: int, vertex: int):
    """Column of a vertex in the table of a mesh."""
    place = int(0)
    for j in range(cells.shape[1]):
        if cells[cell, j] == vertex:
            place = j
    return place


@wp.kernel(enable_backward=False)
def _make_sides(
    cells: IntTable,
    entity_vertices: IntTable,
    ends: Pairs,
    per_cell: int,
    vertices: IntTable,
    side_cells: Pairs,
    is_boundary: Ints,
):
    i = wp.tid()
    inner = ends[i][0] // per_cell
    outer = ends[i][1] // per_cell
    side_cells[i] = wp.vec2i(inner, outer)
    is_boundary[i] = wp.where(inner == outer, 1, 0)
    n = vertices.shape[1]
    for k in range(n):
        # Squares of entities are in the order of their coordinates, sides go around.
        vertices[i, k] = entity_vertices[i, wp.where(n == 4 and k >= 2, 5 - k, k)]


@wp.func
def _swap(vertices: IntTable, i: int, a: int, b: int):
    v = vertices[i, a]
    vertices[i, a] = vertices[i, b]
    vertices[i, b] = v


@wp.func
def _inward(positions: AnyArray, cells: IntTable, cell: int, center: Any, n: int):
    """Direction from a point to the mean of a cell's vertices."""
    d = center - center
    for k in range(cells.shape[1]):
        d += positions[cells[cell, k]] - center
    return d / center.dtype(n)


@wp.kernel(enable_backward=False)
def _orient_edges(positions: AnyArray, cells: IntTable, side_cells: Pairs, vertices: IntTable):
    i = wp.tid()
    a = positions[vertices[i, 0]]
    b = positions[vertices[i, 1]]
    half = a.dtype(0.5)
    inward = _inward(positions, cells, side_cells[i][0], a + (b - a) * half, cells.shape[1])
    along = b - a
    # The normal (t_y, -t_x) points inward.
    if along[1] * inward[0] - along[0] * inward[1] > a.dtype(0.0):
        _swap(vertices, i, 0, 1)


@wp.kernel(enable_backward=False)
def _orient_edges_of_surface(
    positions: AnyArray, cells: IntTable, side_cells: Pairs, vertices: IntTable
):
    i = wp.tid()
    cell = side_cells[i][0]
    a = positions[vertices[i, 0]]
    b = positions[vertices[i, 1]]
    half = a.dtype(0.5)
    inward = _inward(positions, cells, cell, a + (b - a) * half, cells.shape[1])
    p = positions[cells[cell, 0]]
    last = cells.shape[1] - 1
    normal = wp.cross(positions[cells[cell, 1]] - p, positions[cells[cell, last]] - p)
    if wp.dot(wp.cross(b - a, normal), inward) > a.dtype(0.0):
        _swap(vertices, i, 0, 1)


@wp.kernel(enable_backward=False)
def _orient_faces(positions: AnyArray, cells: IntTable, side_cells: Pairs, vertices: IntTable):
    i = wp.tid()
    n = vertices.shape[1]
    last = n - 1
    a = positions[vertices[i, 0]]
    center = a
    for k in range(1, n):
        center += (positions[vertices[i, k]] - a) / a.dtype(n)
    # Half the diagonals' product is the mean normal of a square, edges are those of a triangle.
    u = positions[vertices[i, wp.where(n == 4, 2, 1)]] - a
    v = positions[vertices[i, last]] - positions[vertices[i, wp.where(n == 4, 1, 0)]]
    inward = _inward(positions, cells, side_cells[i][0], center, cells.shape[1])
    if wp.dot(wp.cross(u, v), inward) > a.dtype(0.0):
        _swap(vertices, i, 1, last)


@wp.kernel(enable_backward=False)
def _place_corners(cells: IntTable, side_cells: Pairs, vertices: IntTable, corners: IntTable):
    i, k = wp.tid()
    n = vertices.shape[1]
    corners[i, k] = _place(cells, side_cells[i][0], vertices[i, k])
    corners[i, n + k] = _place(cells, side_cells[i][1], vertices[i, k])


@dataclass(frozen=True, eq=False)
class SideTables:
    """Sides of a mesh.

    Attributes:
        vertices: (sides, n) of int32, around squares, so that normals leave the inner cell.
        cells: (sides,) of vec2i, inner and outer cell, the same on the boundary.
        corners: (sides, 2 n) of int32, columns of the vertices in the rows of both cells.
        boundary: numbers of the sides with one cell.
    """

    vertices: wp.array
    cells: wp.array
    corners: wp.array
    boundary: wp.array


def make_sides(entities, cells, positions) -> SideTables:
    """Makes the tables of sides.

    Args:
        entities: the `EntityTable` of the sides.
        cells: (cells, n) of int32, the mesh's table.
        positions: of the vertices, for the orientation of normals.
    """
    from warp._src.fem.geometry.indices import masked_indices

    device, (count, width) = cells.device, entities.vertices.shape
    with extend.unrecorded():
        vertices = wp.empty((count, width), dtype=wp.int32, device=device)
        side_cells = wp.empty(count, dtype=wp.vec2i, device=device)
        is_boundary = wp.empty(count, dtype=wp.int32, device=device)
        corners = wp.empty((count, 2 * width), dtype=wp.int32, device=device)
        per_cell = entities.of_cells.shape[1]
        inputs = [cells, entities.vertices, entities.ends, per_cell]
        outputs = [vertices, side_cells, is_boundary]
        wp.launch(_make_sides, count, inputs, outputs, device=device)
        on_surface = positions.dtype._length_ == 3
        kernel = _orient_edges_of_surface if on_surface else _orient_edges
        kernel = _orient_faces if width > 2 else kernel
        wp.launch(kernel, count, [positions, cells, side_cells, vertices], device=device)
        inputs = [cells, side_cells, vertices]
        wp.launch(_place_corners, (count, width), inputs, [corners], device=device)
    boundary, _ = masked_indices(is_boundary)
    return SideTables(vertices, side_cells, corners, boundary)
