"""Entities of meshes - edges and faces as runs of sorted vertex tuples, and sides between cells."""

from dataclasses import dataclass
from typing import Any

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.geometry.indices import masked_indices
from warp._src.fem.types import AnyArray, Ints, IntTable, Longs, Pairs

_MOST = 4
_vec4l = wp.types.vector(_MOST, wp.int64)


@wp.func
def _sorted_vertices(cells: IntTable, corners: IntTable, cell: int, k: int):
    """Vertices of the k-th entity of a cell, ascending; missing ones are 0."""
    v = _vec4l()
    n = corners.shape[1]
    for i in range(n):
        v[i] = wp.int64(cells[cell, corners[k, i]])
    for i in range(1, n):
        for j in range(i):
            # Insertion: v[:i] is sorted.
            a = v[j]
            b = v[i]
            v[j] = wp.min(a, b)
            v[i] = wp.max(a, b)
    return v


@wp.kernel(enable_backward=False)
def _make_keys(
    cells: IntTable, corners: IntTable, vertex_count: wp.int64, high: Longs, low: Longs, items: Ints
):
    cell, k = wp.tid()
    v = _sorted_vertices(cells, corners, cell, k)
    i = cell * corners.shape[0] + k
    high[i] = v[0] * vertex_count + v[1]
    low[i] = v[2] * vertex_count + v[3]
    items[i] = i


@wp.kernel(enable_backward=False)
def _reorder(source: Longs, items: Ints, out: Longs):
    i = wp.tid()
    out[i] = source[items[i]]


@wp.kernel(enable_backward=False)
def _mark_heads(high: Longs, low: Longs, items: Ints, heads: Ints):
    i = wp.tid()
    is_head = i == 0
    if i > 0:
        is_head = high[i] != high[i - 1] or low[items[i]] != low[items[i - 1]]
    heads[i] = wp.where(is_head, 1, 0)


@wp.kernel(enable_backward=False)
def _number(heads: Ints, numbers: Ints, items: Ints, of_items: Ints, ends: Pairs):
    i = wp.tid()
    number = numbers[i] - 1
    item = items[i]
    of_items[item] = number
    last = heads.shape[0] - 1
    if heads[i] != 0:
        ends[number][0] = item
    if i == last or heads[wp.min(i + 1, last)] != 0:
        ends[number][1] = item


@wp.kernel(enable_backward=False)
def _write_vertices(cells: IntTable, corners: IntTable, ends: Pairs, vertices: IntTable):
    """Vertices in a canonical order: ascending; of squares the smallest first, then its smaller
    neighbour, its other neighbour, the opposite vertex."""
    i = wp.tid()
    cell = ends[i][0] // corners.shape[0]
    k = ends[i][0] % corners.shape[0]
    n = corners.shape[1]
    v = _sorted_vertices(cells, corners, cell, k)
    if n < 4:
        for j in range(n):
            vertices[i, j] = wp.int32(v[j])
        return
    first = int(0)
    for j in range(4):
        if wp.int64(cells[cell, corners[k, j]]) == v[0]:
            first = j
    # Neighbours differ from a vertex (0, 0), (0, 1), (1, 0), (1, 1) in one bit.
    a = cells[cell, corners[k, first ^ 1]]
    b = cells[cell, corners[k, first ^ 2]]
    vertices[i, 0] = wp.int32(v[0])
    vertices[i, 1] = wp.min(a, b)
    vertices[i, 2] = wp.max(a, b)
    vertices[i, 3] = cells[cell, corners[k, first ^ 3]]


@dataclass(frozen=True, eq=False)
class EntityTable:
    """Entities of one dimension: the faces of a mesh, for example.

    Attributes:
        count: number of entities.
        of_cells: (cells, k) of int32, the entities of each cell in the reference cell's order.
        vertices: (count, n) of int32, ascending; of squares the smallest first, then its smaller
            neighbour, its other neighbour, the opposite vertex.
        ends: (count,) of vec2i, first and last `cell * k + place` that have the entity.
    """

    count: int
    of_cells: wp.array
    vertices: wp.array
    ends: wp.array


def make_entities(cells, corners: tuple, vertex_count: int) -> EntityTable:
    """Finds the entities of a dimension, numbered by their sorted vertices.

    Args:
        cells: (cells, n) of int32, vertices of each cell in the reference cell's order.
        corners: places in a cell of the vertices of each of its entities.
        vertex_count: number of vertices of the mesh.
    """
    device = cells.device
    table = wp.array(np.array(corners, np.int32), dtype=wp.int32, ndim=2, device=device)
    per_cell, width = table.shape
    n = cells.shape[0] * per_cell
    with extend.unrecorded():
        high, low = (wp.empty(2 * n, dtype=wp.int64, device=device) for _ in range(2))
        items = wp.empty(2 * n, dtype=wp.int32, device=device)
        inputs = [cells, table, wp.int64(max(vertex_count, 1))]
        shape = (cells.shape[0], per_cell)
        wp.launch(_make_keys, shape, inputs, [high, low, items], device=device)
        bits = 2 * max(vertex_count, 1).bit_length()
        unsorted_low = low
        if width > 2:
            # Sorts are stable: the less significant half first.
            unsorted_low, sorted_high = wp.clone(low), wp.empty_like(high)
            wp.utils.radix_sort_pairs(low, items, n, 0, bits)
            wp.launch(_reorder, n, [high, items], [sorted_high], device=device)
            high = sorted_high
        wp.utils.radix_sort_pairs(high, items, n, 0, bits)
        heads, numbers = (wp.empty(n, dtype=wp.int32, device=device) for _ in range(2))
        wp.launch(_mark_heads, n, [high, unsorted_low, items], [heads], device=device)
        if n:
            wp.utils.array_scan(heads, numbers, inclusive=True)
        count = int(numbers[n - 1 :].numpy()[0]) if n else 0
        of_items = wp.empty(n, dtype=wp.int32, device=device)
        ends = wp.empty(count, dtype=wp.vec2i, device=device)
        wp.launch(_number, n, [heads, numbers, items], [of_items, ends], device=device)
        vertices = wp.empty((count, width), dtype=wp.int32, device=device)
        wp.launch(_write_vertices, count, [cells, table, ends], [vertices], device=device)
    return EntityTable(count, of_items.reshape(shape), vertices, ends)


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


@wp.func
def _aside(along: wp.types.vector(2, wp.Scalar), u: Any, v: Any):
    """Normal of an edge in the plane of a cell, whose sides u and v begin at its first vertex."""
    return type(along)(along[1], -along[0])


@wp.func
def _aside(along: wp.types.vector(3, wp.Scalar), u: Any, v: Any):
    """Normal of an edge in the plane of a cell, whose sides u and v begin at its first vertex."""
    return wp.cross(along, wp.cross(u, v))


@wp.kernel(enable_backward=False)
def _orient_edges(positions: AnyArray, cells: IntTable, side_cells: Pairs, vertices: IntTable):
    i = wp.tid()
    cell, last = side_cells[i][0], cells.shape[1] - 1
    a = positions[vertices[i, 0]]
    along = positions[vertices[i, 1]] - a
    inward = _inward(positions, cells, cell, a + along * a.dtype(0.5), cells.shape[1])
    p = positions[cells[cell, 0]]
    u, v = positions[cells[cell, 1]] - p, positions[cells[cell, last]] - p
    if wp.dot(_aside(along, u, v), inward) > a.dtype(0.0):
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
        kernel = _orient_faces if width > 2 else _orient_edges
        wp.launch(kernel, count, [positions, cells, side_cells, vertices], device=device)
        inputs = [cells, side_cells, vertices]
        wp.launch(_place_corners, (count, width), inputs, [corners], device=device)
    boundary, _ = masked_indices(is_boundary)
    return SideTables(vertices, side_cells, corners, boundary)
