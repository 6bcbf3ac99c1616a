"""Marching cubes over a set of cells: given ones, or those near the surface of a function."""

from __future__ import annotations

import numpy as np

import warp as wp
from warp._src.argument_kinds import ARRAY, INTEGER, NUMBER, POINT
from warp._src.arguments import checked
from warp._src.geometry.surfaces.nodes import NumberedCells
from warp._src.geometry.surfaces.octree import (
    cells_within,
    check_bound,
    evaluator_of,
    near_cells,
)
from warp._src.types import dtypes


@wp.kernel(enable_backward=False, module="unique")
def _find_extent(
    cells: wp.array(dtype=wp.vec3i), low: wp.array(dtype=int), high: wp.array(dtype=int)
):
    i, axis = wp.tid()
    wp.atomic_min(low, axis, cells[i][axis])
    wp.atomic_max(high, axis, cells[i][axis])


def _nothing(device):
    return wp.empty(0, dtype=wp.vec3, device=device), wp.empty(0, dtype=int, device=device)


def _as_cells(cells, device):
    if dtypes.is_array(cells) and cells.dtype is wp.vec3i:
        return cells.to(device).contiguous().flatten()
    if dtypes.is_array(cells):
        cells = cells.numpy()
    indices = np.asarray(cells)
    if indices.size and indices.dtype.kind not in "iu":
        raise TypeError(f"expects 'cells' of integers, but got {indices.dtype}")
    if indices.size % 3 or (indices.ndim > 1 and indices.shape[-1] != 3):
        raise ValueError(f"expects 'cells' of shape (n, 3), but got {indices.shape}")
    return wp.array(indices.reshape(-1, 3).astype(np.int32), dtype=wp.vec3i, device=device)


def _as_values(values, count, device):
    if not dtypes.is_array(values):
        values = wp.array(np.ascontiguousarray(values, dtype=np.float32), device=device)
    if values.dtype is not dtypes.float32:
        raise ValueError(
            f"expects 'corner_values' of float32, but got {dtypes.type_repr(values.dtype)}"
        )
    if values.size != 8 * count:
        raise ValueError(
            f"expects 8 'corner_values' for each of {count} cells, but got {values.size}"
        )
    values = values.to(device)
    if not values.is_contiguous:
        values = wp.clone(values)
    return values.flatten() if values.ndim > 1 else values


@checked(cells=ARRAY, corner_values=ARRAY, origin=POINT, cell_width=NUMBER)
def sparse_marching_cubes_from_cells(
    cells, corner_values, origin=(0.0, 0.0, 0.0), cell_width=1.0, threshold=0.0, device=None
):
    """Vertices and triangles of the surface where the corners of cells have one value.

    Cell (i, j, k) is the cube from `origin + cell_width * (i, j, k)` on, and its corners have
    values; a corner is inside if its value is less than the threshold. Cells that share corners
    share vertices. Positions have derivatives by `corner_values`, of which one of each node counts.

    Args:
        cells: indices, an array of vec3i or whatever has the shape (n, 3); each cell once.
        corner_values: float32 of shape (n, 8), in the order of
            `IsoSurfaceMarchingCubes.CUBE_CORNER_OFFSETS`; cells that share a corner agree.
        origin: where the corner (0, 0, 0) is.
        cell_width: the edge of a cell.
        threshold: the value.
        device: where to work; by default the current device.

    Returns:
        Vertices, an array of vec3, and an array of int32 with three of them per triangle. Seen from
        larger values they go counter-clockwise.

    Raises:
        ValueError: the edge is not positive, or shapes or types do not fit.
        TypeError: cells are no integers.
    """
    if not cell_width > 0.0:
        raise ValueError(f"expects cell_width > 0, but got {cell_width}")
    device = wp.get_device(device)
    cells = _as_cells(cells, device)
    values = _as_values(corner_values, len(cells), device)
    if not len(cells):
        return _nothing(device)
    low = wp.full(3, 2**31 - 1, dtype=int, device=device)
    high = wp.full(3, -(2**31), dtype=int, device=device)
    wp.launch(_find_extent, (len(cells), 3), inputs=[cells, low, high], device=device)
    numbered = NumberedCells(cells, low.numpy(), high.numpy())
    # Indices far from zero are taken from the lowest on, where float32 still tells them apart.
    width = float(cell_width)
    lower = wp.vec3(*(float(o) + width * int(i) for o, i in zip(origin, numbered.low, strict=True)))
    values = numbered.first_values(values)
    return numbered.surface(values, float(threshold), lower, wp.vec3(width, width, width))


@checked(nx=INTEGER, ny=INTEGER, nz=INTEGER, lower=POINT, upper=POINT, lipschitz_bound=NUMBER)
def sparse_marching_cubes(
    field,
    nx,
    ny,
    nz,
    *,
    lower=None,
    upper=None,
    threshold=0.0,
    lipschitz_bound=1.0,
    device=None,
    return_stats=False,
):
    """Vertices and triangles of the surface where a function of points has one value.

    The function is asked only near the surface (`lipschitz_octree`), and the result is that of
    `IsoSurfaceMarchingCubes.extract` for its values on the whole grid, vertices and triangles in
    another order. Positions have derivatives by what the function gives, if that has gradients.

    Args:
        field: called with an array of points (vec3), gives an array of their values (float32) on
            the same device; of a distance the slope is 1.
        nx, ny, nz: nodes of the grid.
        lower, upper: where its first and its last node are; by default at their indices.
        threshold: the value; a node is inside if its value is less.
        lipschitz_bound: the largest slope of the function.
        device: where to work; by default the current device.
        return_stats: also give a dictionary of counts: `leaf_cells`, `unique_corners`,
            `field_evaluations`, `culled_cells`, and the grid's `requested_ncells` and `resolution`.

    Returns:
        Vertices, an array of vec3, and an array of int32 with three of them per triangle. Seen from
        larger values they go counter-clockwise.

    Raises:
        ValueError: fewer than 2 nodes along an axis, or a negative bound.
        TypeError: the function cannot be called with an array of points, or gives another type.
    """
    nodes = (int(nx), int(ny), int(nz))
    if min(nodes) < 2:
        raise ValueError(f"expects at least 2 nodes on each axis, but got {nodes}")
    check_bound(lipschitz_bound)
    evaluate, device = evaluator_of(field), wp.get_device(device)
    cells_per_axis = tuple(n - 1 for n in nodes)
    depth = (max(cells_per_axis) - 1).bit_length()
    low = np.zeros(3) if lower is None else np.array(list(lower), dtype=np.float64)
    high = np.array(cells_per_axis) if upper is None else np.array(list(upper), dtype=np.float64)
    spacing = (high - low) / np.array(cells_per_axis)
    stats = {
        **dict.fromkeys(("leaf_cells", "unique_corners", "field_evaluations", "culled_cells"), 0),
        "resolution": 2**depth,
        "requested_ncells": cells_per_axis,
    }

    def counted(points):
        stats["field_evaluations"] += len(points)
        return evaluate(points)

    def result(surface):
        return (*surface, stats) if return_stats else surface

    width, threshold = spacing * 2.0**depth, float(threshold)
    found = near_cells(counted, low, width, depth, threshold, float(lipschitz_bound), device)
    # The octree is a power of two of cells wide.
    cells = found if set(cells_per_axis) == {2**depth} else cells_within(found, cells_per_axis)
    stats["culled_cells"], stats["leaf_cells"] = len(found) - len(cells), len(cells)
    if not len(cells):
        return result(_nothing(device))
    numbered = NumberedCells(cells, (0, 0, 0), [n - 1 for n in cells_per_axis])
    stats["unique_corners"] = len(numbered.nodes)
    place = wp.vec3(*low), wp.vec3(*spacing)
    values = counted(numbered.places(*place))
    return result(numbered.surface(values, threshold, *place))
