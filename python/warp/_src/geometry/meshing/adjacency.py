"""`tri_tri_adjacency`: which triangles share an edge.

Each side of a triangle has its edge as a number, lower corner first; sorting brings the two sides
of an edge together.
"""

from __future__ import annotations

import warp as wp
from warp._src.argument_kinds import ARRAY, COUNT
from warp._src.arguments import checked
from warp._src.kernels.function import func
from warp._src.types import dtypes


@wp.kernel(enable_backward=False, module="unique")
def _number_sides(
    indices: wp.array2d(dtype=int), edges: wp.array(dtype=wp.int64), sides: wp.array(dtype=int)
):
    i, side = wp.tid()
    a = indices[i, (side + 1) % 3]
    b = indices[i, (side + 2) % 3]
    edges[3 * i + side] = wp.int64(wp.min(a, b)) << wp.int64(32) | wp.int64(wp.max(a, b))
    sides[3 * i + side] = 3 * i + side


@wp.kernel(enable_backward=False, module="unique")
def _join_sides(
    edges: wp.array(dtype=wp.int64),
    sides: wp.array(dtype=int),
    count: int,
    neighbors: wp.array2d(dtype=int),
    neighbor_sides: wp.array2d(dtype=int),
):
    i = wp.tid()
    edge = edges[i]
    # Among more than two sides the first and the second belong together, the third and the fourth.
    before = int(0)
    while before < i and edges[i - before - 1] == edge:
        before += 1
    other = i + 1 - 2 * (before & 1)
    if other < count and edges[other] == edge:
        own = sides[i]
        neighbors[own // 3, own % 3] = sides[other] // 3
        if neighbor_sides:
            neighbor_sides[own // 3, own % 3] = sides[other] % 3


def check_triangles(indices) -> None:
    if not dtypes.is_array(indices) or indices.ndim != 2 or indices.shape[1] != 3:
        shape = getattr(indices, "shape", None)
        raise ValueError(f"expects 'indices' of shape (triangles, 3), but got {shape}")
    if indices.dtype is not dtypes.int32:
        raise TypeError(f"expects 'indices' of int32, but got {dtypes.type_repr(indices.dtype)}")


@checked(indices=ARRAY, vertex_count=COUNT)
def tri_tri_adjacency(indices, vertex_count=None, return_neighbor_edge_indices=True):
    """The triangle at the other side of each edge of each triangle.

    Edge j of a triangle is the one opposite to its corner j. An edge belongs to two triangles at
    most, which may be turned either way. It can be captured in a graph.

    Args:
        indices: corners of triangles, an int32 array of shape (triangles, 3).
        vertex_count: number of vertices; not needed.
        return_neighbor_edge_indices: whether to give the second array.

    Returns:
        Neighbours, an int32 array of shape (triangles, 3), -1 where there is none; and of the same
        shape which edge of the neighbour it is.

    Raises:
        ValueError: indices have another shape.
        TypeError: they are not of int32.
    """
    check_triangles(indices)
    device, count = indices.device, indices.shape[0]
    neighbors = wp.full((count, 3), -1, dtype=int, device=device)
    sides = wp.full((count, 3), -1, dtype=int, device=device)
    if count:
        edges = wp.empty(6 * count, dtype=wp.int64, device=device)
        order = wp.empty(6 * count, dtype=int, device=device)
        wp.launch(_number_sides, (count, 3), inputs=[indices, edges, order], device=device)
        wp.utils.radix_sort_pairs(edges, order, 3 * count)
        wanted = sides if return_neighbor_edge_indices else None
        given = [edges, order, 3 * count, neighbors, wanted]
        wp.launch(_join_sides, 3 * count, inputs=given, device=device)
    return (neighbors, sides) if return_neighbor_edge_indices else neighbors


@func
def find_triangle_neighbor_edge_index(
    triangle_neighbors: wp.array2d(dtype=int), triangle: int, neighbor: int
) -> int:
    """The edge that a triangle shares with a neighbour of `tri_tri_adjacency`; or -1."""
    found = int(-1)
    for side in range(3):
        if found < 0 and triangle_neighbors[triangle, side] == neighbor:
            found = side
    return found
