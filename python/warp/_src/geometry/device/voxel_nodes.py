"""Kernels that write the nodes of grids of NanoVDB; voxels.py launches them.

`plan` has what `decide` found: whether to go on; where upper nodes, lower nodes and leaves are;
bytes; how many of them there are; how long the table of leaves is, 0 without one.
Places are bytes, and memory is in words of four.
"""

from __future__ import annotations

import warp as wp
from warp._src.geometry.device.voxel_order import cell
from warp._src.geometry.device.voxel_table import WORDS, box_of_leaves, show_table, write_long

_AT_SIZE = wp.constant(WORDS["size"])
_AT_WORLD = wp.constant(WORDS["world_box"])
_AT_TREE = wp.constant(WORDS["tree"])
_HEADER = wp.constant(4 * WORDS["tree"])
_LEAVES_IN_SLOT = wp.constant(WORDS["slot_leaves"])
_END_IN_SLOT = wp.constant(WORDS["slot_leaves_end"])
_TILES_IN_SLOT = wp.constant(WORDS["slot_tiles"])
_VOXELS_IN_SLOT = wp.constant(WORDS["slot_voxels"])


@wp.struct
class TreeLayout:
    """Offsets and sizes in bytes; `number` is that of the grid's type."""

    root_at: int
    root: int
    tile: int
    upper: int
    upper_table: int
    lower: int
    lower_table: int
    entry: int
    leaf: int
    leaf_table: int
    value: int
    number: int


@wp.func
def _write_box(words: wp.array(dtype=wp.uint32), at: int, low: wp.vec3i, high: wp.vec3i):
    for axis in range(3):
        words[at + axis] = wp.cast(low[axis], wp.uint32)
        words[at + 3 + axis] = wp.cast(high[axis], wp.uint32)


@wp.func
def _write_world_box(
    words: wp.array(dtype=wp.uint32),
    low: wp.vec3i,
    high: wp.vec3i,
    matrix: wp.mat33d,
    shift: wp.vec3d,
):
    least = wp.vec3d(wp.float64(wp.inf), wp.float64(wp.inf), wp.float64(wp.inf))
    greatest = -least
    for corner in range(8):
        at = wp.vec3d()
        for axis in range(3):
            x = wp.float64(low[axis])
            if (corner >> axis) & 1 != 0:
                x = wp.float64(high[axis]) + wp.float64(1.0)
            at[axis] = x
        world = matrix * at + shift
        least = wp.min(least, world)
        greatest = wp.max(greatest, world)
    for axis in range(3):
        write_long(words, _AT_WORLD + 2 * axis, wp.cast(least[axis], wp.uint64))
        write_long(words, _AT_WORLD + 6 + 2 * axis, wp.cast(greatest[axis], wp.uint64))


@wp.kernel(enable_backward=False, module="unique")
def decide(
    ends: wp.array(dtype=wp.vec4i),
    found: wp.array(dtype=wp.uint32),
    bounds: wp.array(dtype=int),
    room: wp.vec4i,
    layout: TreeLayout,
    matrix: wp.mat33d,
    shift: wp.vec3d,
    address: wp.uint64,
    table: wp.uint64,
    plan: wp.array(dtype=int),
    status: wp.array(dtype=wp.uint32),
    grid: wp.array(dtype=wp.uint32),
    slot: wp.array(dtype=wp.uint32),
):
    counts = ends[ends.shape[0] - 1]
    uppers = counts[0]
    lowers = counts[1]
    leaves = counts[2]
    voxels = wp.where(layout.number == 20, counts[3], 512 * leaves)
    problem = found[0]
    problem |= wp.where(leaves > room[0], wp.uint32(1), wp.uint32(0))
    problem |= wp.where(lowers > room[1], wp.uint32(2), wp.uint32(0))
    problem |= wp.where(uppers > room[2], wp.uint32(4), wp.uint32(0))
    problem |= wp.where(voxels > room[3], wp.uint32(8), wp.uint32(0))
    if status:
        for i in range(status.shape[0]):
            status[i] = problem
    plan[0] = int(problem == wp.uint32(0))
    if problem == wp.uint32(0):
        upper_at = layout.root_at + layout.root + uppers * layout.tile
        lower_at = upper_at + uppers * layout.upper
        leaf_at = lower_at + lowers * layout.lower
        size = leaf_at + leaves * layout.leaf
        plan[1] = upper_at
        plan[2] = lower_at
        plan[3] = leaf_at
        plan[4] = size
        plan[5] = uppers
        plan[6] = lowers
        plan[7] = leaves
        write_long(grid, _AT_SIZE, wp.uint64(size))
        write_long(grid, _AT_TREE, wp.uint64(leaf_at - _HEADER))
        write_long(grid, _AT_TREE + 2, wp.uint64(lower_at - _HEADER))
        write_long(grid, _AT_TREE + 4, wp.uint64(upper_at - _HEADER))
        grid[_AT_TREE + 8] = wp.uint32(leaves)
        grid[_AT_TREE + 9] = wp.uint32(lowers)
        grid[_AT_TREE + 10] = wp.uint32(uppers)
        write_long(grid, _AT_TREE + 14, wp.uint64(voxels))
        grid[layout.root_at // 4 + 6] = wp.uint32(uppers)
        low = wp.vec3i(bounds[0], bounds[1], bounds[2])
        high = wp.vec3i(bounds[3], bounds[4], bounds[5])
        _write_box(grid, layout.root_at // 4, low, high)
        if leaves > 0:
            _write_world_box(grid, low, high, matrix, shift)
        else:
            for i in range(12):
                grid[_AT_WORLD + i] = wp.uint32(0)
        plan[8] = show_table(bounds, leaves, table, slot)
        write_long(slot, _LEAVES_IN_SLOT, address + wp.uint64(leaf_at))
        write_long(slot, _END_IN_SLOT, address + wp.uint64(size))
        slot[_TILES_IN_SLOT] = wp.uint32(uppers)
        write_long(slot, _VOXELS_IN_SLOT, wp.uint64(voxels))


@wp.func
def _word_of(value: wp.array(dtype=wp.uint32), at: int, table: int, entry: int):
    """The word of a node at an offset where no child is."""
    word = wp.uint32(0)
    if at >= table:
        k = (at - table) % entry // 4
        if k < value.shape[0]:
            word = value[k]
    return word


@wp.kernel(enable_backward=False, module="unique")
def clear(
    plan: wp.array(dtype=int),
    layout: TreeLayout,
    value: wp.array(dtype=wp.uint32),
    grid: wp.array(dtype=wp.uint32),
):
    """Nodes without children, and the background everywhere; behind the root's own words."""
    at = layout.root_at + layout.root + 4 * wp.tid()
    if plan[0] != 0 and at < plan[4]:
        word = wp.uint32(0)
        if at >= plan[3]:
            if layout.number != 19 and layout.number != 20:
                inside = (at - plan[3]) % layout.leaf
                if inside < layout.leaf_table + 512 * layout.value:
                    word = _word_of(value, inside, layout.leaf_table, layout.value)
        elif at >= plan[2]:
            inside = (at - plan[2]) % layout.lower
            word = _word_of(value, inside, layout.lower_table, layout.entry)
        elif at >= plan[1]:
            inside = (at - plan[1]) % layout.upper
            word = _word_of(value, inside, layout.upper_table, layout.entry)
        grid[at // 4] = word


@wp.func
def _add_child(
    grid: wp.array(dtype=wp.uint32), parent: int, masks: int, table: int, entry: int, n: int,
    child: int,
):  # fmt: skip
    """Sets the mask and the table of an inner node; places are bytes."""
    wp.atomic_or(grid, (parent + 32 + masks) // 4 + (n >> 5), wp.uint32(1) << wp.uint32(n & 31))
    at = (parent + table + n * entry) // 4
    for k in range(entry // 4):
        grid[at + k] = wp.uint32(0)
    write_long(grid, at, wp.uint64(child - parent))


@wp.func
def _down_to(v: wp.vec3i, bits: int):
    return wp.vec3i(v[0] >> bits << bits, v[1] >> bits << bits, v[2] >> bits << bits)


@wp.func
def _key_of(x: int, shift: int):
    return wp.uint64((x >> 12) & 0xFFFFF) << wp.uint64(shift)


@wp.kernel(enable_backward=False, module="unique")
def link(
    plan: wp.array(dtype=int),
    layout: TreeLayout,
    order: wp.array(dtype=int),
    voxels: wp.array(dtype=wp.vec3i),
    ends: wp.array(dtype=wp.vec4i),
    bounds: wp.array(dtype=int),
    table: wp.array(dtype=wp.uint32),
    grid: wp.array(dtype=wp.uint32),
):
    """Writes the nodes that begin at a place of the order."""
    i = wp.tid()
    before = wp.vec4i()
    if i > 0:
        before = ends[i - 1]
    end = ends[i]
    if plan[0] != 0 and end[3] > before[3]:
        v = voxels[order[i]]
        upper = plan[1] + (end[0] - 1) * layout.upper
        lower = plan[2] + (end[1] - 1) * layout.lower
        leaf = plan[3] + (end[2] - 1) * layout.leaf
        if end[0] > before[0]:
            tile = (layout.root_at + layout.root + (end[0] - 1) * layout.tile) // 4
            write_long(grid, tile, _key_of(v[2], 0) | _key_of(v[1], 21) | _key_of(v[0], 42))
            write_long(grid, tile + 2, wp.uint64(upper - layout.root_at))
            low = _down_to(v, 12)
            _write_box(grid, upper // 4, low, low + wp.vec3i(4095, 4095, 4095))
        if end[1] > before[1]:
            n = cell(v, 7, 5)
            _add_child(grid, upper, 4096, layout.upper_table, layout.entry, n, lower)
            low = _down_to(v, 7)
            _write_box(grid, lower // 4, low, low + wp.vec3i(127, 127, 127))
        if end[2] > before[2]:
            n = cell(v, 3, 4)
            _add_child(grid, lower, 512, layout.lower_table, layout.entry, n, leaf)
            if plan[8] > 0:
                lowest, extent = box_of_leaves(bounds)
                x = (v[0] >> 3) - lowest[0]
                y = (v[1] >> 3) - lowest[1]
                z = (v[2] >> 3) - lowest[2]
                table[(x * extent[1] + y) * extent[2] + z] = wp.uint32(end[2] - 1)
            low = _down_to(v, 3)
            for axis in range(3):
                grid[leaf // 4 + axis] = wp.cast(low[axis], wp.uint32)
            grid[leaf // 4 + 3] = wp.uint32(0x02070707)
            if layout.number == 19:
                write_long(grid, leaf // 4 + 20, wp.uint64(1 + 512 * (end[2] - 1)))
            elif layout.number == 20:
                write_long(grid, leaf // 4 + 20, wp.uint64(end[3]))
            if layout.number != 20:
                for k in range(16):
                    grid[leaf // 4 + 4 + k] = wp.uint32(0xFFFFFFFF)
        if layout.number == 20:
            n = cell(v, 0, 3)
            wp.atomic_or(grid, leaf // 4 + 4 + (n >> 5), wp.uint32(1) << wp.uint32(n & 31))


@wp.kernel(enable_backward=False, module="unique")
def count_before(plan: wp.array(dtype=int), layout: TreeLayout, grid: wp.array(dtype=wp.uint32)):
    """Seven numbers of nine bits of a leaf: voxels before its words of 64 bits but the first."""
    i = wp.tid()
    if plan[0] != 0 and i < plan[7]:
        leaf = (plan[3] + i * layout.leaf) // 4
        sums = wp.uint64(0)
        total = int(0)
        for k in range(7):
            total += wp.bit_count(grid[leaf + 4 + 2 * k]) + wp.bit_count(grid[leaf + 5 + 2 * k])
            sums |= wp.uint64(total) << wp.uint64(9 * k)
        write_long(grid, leaf + 22, sums)
