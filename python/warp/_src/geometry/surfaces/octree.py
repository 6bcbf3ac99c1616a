"""`lipschitz_octree`: cells of an octree that a surface of a function may cross.

A function whose slope is bounded differs by no more than slope times distance, so its value at the
centre of a cell tells whether the surface can be inside. Cells that it cannot be in are left out,
the others are divided, level by level.
"""

from __future__ import annotations

import math

import numpy as np

import warp as wp
from warp._src.argument_kinds import COUNT, NUMBER, POINT, POSITIVE
from warp._src.arguments import checked
from warp._src.geometry.surfaces.fields import plain, scan
from warp._src.kernels.function import Function
from warp._src.types import dtypes

# Rounding of distances must not lose a cell.
_SLACK = 1.0 + 1e-6
_MOST_CELLS = (2**31 - 1) // 8


@wp.kernel(enable_backward=False, module="unique")
def _find_centers(
    cells: wp.array(dtype=wp.vec3i),
    lower: wp.vec3,
    width: wp.vec3,
    centers: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    cell = cells[i]
    half = wp.vec3(float(cell[0]) + 0.5, float(cell[1]) + 0.5, float(cell[2]) + 0.5)
    centers[i] = lower + wp.cw_mul(width, half)


@wp.kernel(enable_backward=False, module="unique")
def _mark_near(
    values: wp.array(dtype=float), threshold: float, reach: float, counts: wp.array(dtype=int)
):
    i = wp.tid()
    counts[i] = int(wp.abs(values[i] - threshold) <= reach)


@wp.kernel(enable_backward=False, module="unique")
def _mark_within(cells: wp.array(dtype=wp.vec3i), extents: wp.vec3i, counts: wp.array(dtype=int)):
    i = wp.tid()
    cell = cells[i]
    counts[i] = int(cell[0] < extents[0] and cell[1] < extents[1] and cell[2] < extents[2])


@wp.kernel(enable_backward=False, module="unique")
def _list_marked(
    cells: wp.array(dtype=wp.vec3i), ends: wp.array(dtype=int), kept: wp.array(dtype=wp.vec3i)
):
    i = wp.tid()
    before = int(0)
    if i > 0:
        before = ends[i - 1]
    if ends[i] > before:
        kept[before] = cells[i]


@wp.kernel(enable_backward=False, module="unique")
def _divide(cells: wp.array(dtype=wp.vec3i), children: wp.array(dtype=wp.vec3i)):
    i, child = wp.tid()
    children[8 * i + child] = 2 * cells[i] + wp.vec3i(child & 1, child >> 1 & 1, child >> 2)


def evaluator_of(field):
    """Calls a function of points, and checks what it gives.

    Raises:
        TypeError: it cannot be called with an array of points.
    """
    if isinstance(field, Function):
        raise TypeError(
            f"'field' is called with an array of points, but '{field.key}' is a @wp.func of one; "
            "launch a kernel that calls it for each point"
        )
    if not callable(field):
        raise TypeError(f"'field' is called with an array of points, but is {type(field).__name__}")

    def evaluate(points):
        values = field(points)
        if not dtypes.is_array(values) or values.dtype is not dtypes.float32:
            shown = getattr(getattr(values, "dtype", type(values)), "__name__", "another type")
            raise TypeError(f"'field' gives an array of float32, but gave {shown}")
        if values.shape != points.shape:
            raise ValueError(
                f"'field' gives a value for each of {points.shape[0]} points, but gave an array "
                f"of shape {tuple(values.shape)}"
            )
        if values.device != points.device:
            raise ValueError(
                f"'field' gives values on '{points.device}', where the points are, but gave them "
                f"on '{values.device}'"
            )
        return values

    return evaluate


def _marked(kernel, cells, *inputs):
    """The cells that a kernel marks with 1."""
    if not len(cells):
        return cells
    device = cells.device
    counts = wp.empty(len(cells), dtype=int, device=device)
    wp.launch(kernel, len(cells), inputs=[*inputs, counts], device=device)
    kept = wp.empty(scan(counts), dtype=wp.vec3i, device=device)
    wp.launch(_list_marked, len(cells), inputs=[cells, counts, kept], device=device)
    return kept


def cells_within(cells, extents):
    """The cells whose indices are less than the extents of a grid."""
    return _marked(_mark_within, cells, cells, wp.vec3i(*extents))


def near_cells(evaluate, lower, width, depth, threshold, bound, device):
    """The cells of the last level that the surface may cross.

    Args:
        evaluate: values of the function at points, both arrays.
        lower, width: the corner and the three extents of the octree.
        depth: how often cells are divided.
        threshold, bound: the value of the surface, and the largest slope.
    """
    lower, width = wp.vec3(*map(float, lower)), np.array(list(width), dtype=np.float64)
    cells = wp.zeros(1, dtype=wp.vec3i, device=device)
    for level in range(depth + 1):
        extent = width / 2.0**level
        reach = bound * 0.5 * math.sqrt((extent * extent).sum()) * _SLACK
        centers = wp.empty(len(cells), dtype=wp.vec3, device=device)
        given = [cells, lower, wp.vec3(*extent), centers]
        wp.launch(_find_centers, len(cells), inputs=given, device=device)
        values = evaluate(centers)
        cells = _marked(_mark_near, cells, plain(values), threshold, reach)
        if level == depth or not len(cells):
            return cells
        if len(cells) > _MOST_CELLS:
            raise ValueError(
                f"the octree has {len(cells)} cells at level {level}, but at most {_MOST_CELLS} "
                "can be divided; is 'lipschitz_bound' too large?"
            )
        children = wp.empty(8 * len(cells), dtype=wp.vec3i, device=device)
        wp.launch(_divide, (len(cells), 8), inputs=[cells, children], device=device)
        cells = children
    return cells


@checked(origin=POINT, root_width=POSITIVE, max_depth=COUNT, lipschitz_bound=NUMBER)
def lipschitz_octree(
    field, origin, root_width, max_depth, threshold=0.0, lipschitz_bound=1.0, device=None
):
    """Cells of an octree that the surface where a function has one value may cross.

    No cell that is crossed is missing, if the slope of the function is nowhere larger than
    `lipschitz_bound`. Which cells there are has no derivative.

    Args:
        field: called with an array of points (vec3), gives an array of their values (float32) on
            the same device; of a distance the slope is 1. Where it is NaN there is no surface.
        origin: the lower corner of the octree, a cube.
        root_width: its edge; what is outside of it is not looked at.
        max_depth: how often it is divided; cells have the edge `root_width / 2**max_depth`.
        threshold: the value of the surface.
        lipschitz_bound: the largest slope of the function.
        device: where to look; by default the current device.

    Returns:
        Indices of cells, an array of vec3i as `sparse_marching_cubes_from_cells` takes them, and
        the edge of a cell.

    Raises:
        ValueError: depth or bound is negative, the edge is not positive, or the function gives an
            array of another shape or on another device.
        TypeError: the function cannot be called so, or gives another type.
    """
    if max_depth < 0:
        raise ValueError(f"expects max_depth >= 0, but got {max_depth}")
    if not root_width > 0.0:
        raise ValueError(f"expects root_width > 0, but got {root_width}")
    check_bound(lipschitz_bound)
    evaluate, width = evaluator_of(field), float(root_width)
    cells = near_cells(
        *(evaluate, list(origin), [width] * 3, max_depth),
        *(float(threshold), float(lipschitz_bound), wp.get_device(device)),
    )
    return cells, width / 2.0**max_depth


def check_bound(lipschitz_bound) -> None:
    if not lipschitz_bound >= 0.0:
        raise ValueError(f"expects lipschitz_bound >= 0, but got {lipschitz_bound}")
