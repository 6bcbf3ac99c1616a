"""Tables of sparse grids - vertices of cells, sides between cells of any levels, boxes."""

from dataclasses import dataclass

import warp as wp
from warp import extend
from warp._src.fem.geometry.indices import masked_indices
from warp._src.fem.geometry.sparse_functions import LEVEL, NO_LOWER, NO_UPPER, find_cell
from warp._src.fem.types import Ints, IntTable, Levels, Pairs, Voxels


@wp.kernel(enable_backward=False)
def _write_places(
    grid: wp.uint64,
    cells: Voxels,
    levels: Levels,
    width: int,
    pad: int,
    places: Voxels,
    is_cell: Ints,
):
    i, k = wp.tid()
    size = 1 << int(levels[i])
    offset = wp.vec3i(k // (width * width), (k // width) % width, k % width) - wp.vec3i(pad)
    at = i * width * width * width + k
    places[at] = cells[i] + size * offset
    is_cell[at] = wp.where(i < wp.volume_voxel_count(grid), 1, 0)


@wp.kernel(enable_backward=False)
def _find_numbers(grid: wp.uint64, places: Voxels, numbers: Ints):
    i = wp.tid()
    p = places[i]
    numbers[i] = wp.max(wp.volume_lookup_index(grid, p[0], p[1], p[2]), 0)


@wp.kernel(enable_backward=False)
def _fit_box(grid: wp.uint64, places: Voxels, levels: Levels, box: Voxels):
    i = wp.tid()
    if i < wp.volume_voxel_count(grid):
        wp.atomic_min(box, 0, places[i])
        wp.atomic_max(box, 1, places[i] + wp.vec3i((1 << int(levels[i])) - 1))


@wp.kernel(enable_backward=False)
def _shift_places(packed: Voxels, environments: Ints, offsets: Voxels, places: Voxels):
    i = wp.tid()
    last = offsets.shape[0] - 1
    places[i] = packed[i] - offsets[wp.clamp(environments[i], 0, last)]


@wp.func
def _across(place: wp.vec3i, width: int, axis: int, is_upper: int):
    """Voxel at the lower corner of what is beyond a side of a cell."""
    p = place
    p[axis] += wp.where(is_upper == 1, width, -1)
    return p


@wp.kernel(enable_backward=False)
def _cover_sides(
    grid: wp.uint64, packed: Voxels, levels: Levels, level_count: int, covered: IntTable
):
    """Adds up the fine squares of each side of a cell that finer cells touch."""
    i, k = wp.tid()
    if i >= wp.volume_voxel_count(grid):
        return
    level = int(levels[i])
    beside = find_cell(grid, _across(packed[i], 1 << level, k >> 1, k & 1), levels, level_count)
    if beside >= 0:
        if int(levels[beside]) > level:
            wp.atomic_add(covered, beside, k ^ 1, 1 << (2 * level))


@wp.kernel(enable_backward=False)
def _count_sides(
    grid: wp.uint64,
    packed: Voxels,
    levels: Levels,
    level_count: int,
    covered: IntTable,
    counts: Ints,
):
    """Number of sides that a side of a cell makes: those to finer cells are made by these, one of
    two equal cells' by the lower; free parts of a partly covered side are squares of level 0."""
    i, k = wp.tid()
    count = int(0)
    if i < wp.volume_voxel_count(grid):
        level = int(levels[i])
        p = _across(packed[i], 1 << level, k >> 1, k & 1)
        beside = find_cell(grid, p, levels, level_count)
        area = 1 << (2 * level)
        if covered[i, k] > 0:
            count = area - covered[i, k]
        elif beside < 0 or int(levels[beside]) > level:
            count = 1
        else:
            count = k & 1
    counts[6 * i + k] = count


@wp.kernel(enable_backward=False)
def _write_sides(
    grid: wp.uint64,
    packed: Voxels,
    local: Voxels,
    levels: Levels,
    level_count: int,
    covered: IntTable,
    counts: Ints,
    ends: Ints,
    places: Voxels,
    flags: Ints,
    cells: Pairs,
    is_boundary: Ints,
):
    i, k = wp.tid()
    number = ends[6 * i + k] - counts[6 * i + k]
    if counts[6 * i + k] == 0:
        return
    level = int(levels[i])
    axis = k >> 1
    is_upper = k & 1
    width = 1 << level
    beyond = _across(packed[i], width, axis, is_upper)
    place = local[i]
    place[axis] += is_upper * width
    free = wp.where(is_upper == 1, 1 << NO_UPPER, 1 << NO_LOWER)
    if covered[i, k] > 0:
        u = (axis + 1) % 3
        v = (axis + 2) % 3
        for a in range(width):
            for b in range(width):
                p = beyond
                p[u] += a
                p[v] += b
                if find_cell(grid, p, levels, level_count) < 0:
                    q = place
                    q[u] += a
                    q[v] += b
                    places[number] = q
                    flags[number] = axis | free
                    cells[number] = wp.vec2i(i, i)
                    is_boundary[number] = 1
                    number += 1
        return
    beside = find_cell(grid, beyond, levels, level_count)
    places[number] = place
    is_boundary[number] = wp.where(beside < 0, 1, 0)
    flags[number] = axis | wp.where(beside < 0, free, 0) | (level << LEVEL)
    if beside < 0:
        cells[number] = wp.vec2i(i, i)
    elif is_upper == 1:
        cells[number] = wp.vec2i(i, beside)
    else:
        cells[number] = wp.vec2i(beside, i)


@dataclass(frozen=True, eq=False)
class SparseSides:
    """Sides of a sparse grid.

    Attributes:
        places: (sides,) of vec3i, lower corners in fine voxels of the environment.
        flags: (sides,) of int32, see `sparse_functions`.
        cells: (sides,) of vec2i, inner (lower) and outer cell, the same on the boundary.
        boundary: numbers of the sides with one cell.
    """

    places: wp.array
    flags: wp.array
    cells: wp.array
    boundary: wp.array


def node_places(grid, cells, levels, width: int = 2, pad: int = 0) -> tuple:
    """Places of the nodes of all cells in fine voxels, `width` along each axis of which `pad` come
    before the cell, in the order of a cube's vertices; and a mask of those of cells that exist."""
    device, shape = cells.device, (cells.shape[0], width**3)
    with extend.unrecorded():
        places = wp.empty(shape[0] * shape[1], dtype=wp.vec3i, device=device)
        mask = wp.empty(shape[0] * shape[1], dtype=wp.int32, device=device)
        inputs = [grid.id, cells, levels, width, pad]
        wp.launch(_write_places, shape, inputs, [places, mask], device=device)
    return places, mask


def node_numbers(node_grid, places, count: int = 8, out=None):
    """(cells, count) of int32: numbers in `node_grid` of the nodes of cells."""
    device = places.device
    with extend.unrecorded():
        if out is None:
            out = wp.empty((places.shape[0] // count, count), dtype=wp.int32, device=device)
        inputs = [node_grid.id, places]
        wp.launch(_find_numbers, places.shape, inputs, [out.flatten()], device=device)
    return out


def fit_box(grid, places, levels, box) -> None:
    """Sets `box` to the lowest and the highest voxel."""
    with extend.unrecorded():
        box[0:1].fill_(wp.vec3i(2**30))
        box[1:2].fill_(wp.vec3i(-(2**30)))
        inputs = [grid.id, places, levels]
        wp.launch(_fit_box, places.shape, inputs, [box], device=places.device)


def shift_places(packed, environments, offsets, places) -> None:
    """Sets `places` to those in the environment of each cell."""
    with extend.unrecorded():
        inputs = [packed, environments, offsets]
        wp.launch(_shift_places, packed.shape, inputs, [places], device=packed.device)


def make_sides(grid, packed, local, levels, level_count: int) -> SparseSides:
    """Makes the tables of sides, in the order of cells.

    Args:
        grid: volume of the cells' lowest voxels.
        packed, local: (cells,) of vec3i: voxels in the grid, and in their environment.
        levels: (cells,) of uint8.
        level_count: number of levels.
    """
    device, n = packed.device, packed.shape[0]
    ints = {"dtype": wp.int32, "device": device}
    with extend.unrecorded():
        covered = wp.zeros((n, 6), **ints)
        inputs = [grid.id, packed, levels, level_count]
        if level_count > 1:
            wp.launch(_cover_sides, (n, 6), inputs, [covered], device=device)
        counts, ends = wp.empty(6 * n, **ints), wp.empty(6 * n, **ints)
        wp.launch(_count_sides, (n, 6), [*inputs, covered], [counts], device=device)
        wp.utils.array_scan(counts, ends, inclusive=True)
        count = int(ends[6 * n - 1 :].numpy()[0])
        places = wp.empty(count, dtype=wp.vec3i, device=device)
        cells = wp.empty(count, dtype=wp.vec2i, device=device)
        flags, is_boundary = wp.empty(count, **ints), wp.empty(count, **ints)
        inputs = [grid.id, packed, local, levels, level_count, covered, counts, ends]
        outputs = [places, flags, cells, is_boundary]
        wp.launch(_write_sides, (n, 6), inputs, outputs, device=device)
    return SparseSides(places, flags, cells, masked_indices(is_boundary)[0])
