"""Entities of meshes - edges and faces as runs of sorted vertex tuples, for every cell shape."""

from dataclasses import dataclass

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.types import Ints, IntTable, Longs, Pairs

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
