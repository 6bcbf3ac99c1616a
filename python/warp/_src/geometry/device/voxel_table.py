"""Kernels that make the table of leaves by which volumes are sampled.

The host's is in lib/Geometry/Volumes/Contents.cpp.
"""

from __future__ import annotations

import warp as wp
from warp import _native

# Words of a grid and of what a handle leads to.
WORDS = _native.grid_words
TABLE_ROOM = _native.leaf_table_room
_TABLE_IN_SLOT = wp.constant(WORDS["slot_numbers"])
_LOWEST_IN_SLOT = wp.constant(WORDS["slot_lowest"])
_EXTENT_IN_SLOT = wp.constant(WORDS["slot_extent"])
_TABLE_ROOM = wp.constant(TABLE_ROOM)
_NO_LEAF = wp.constant(wp.uint32(0xFFFFFFFF))


@wp.func
def write_long(words: wp.array(dtype=wp.uint32), at: int, value: wp.uint64):
    words[at] = wp.uint32(value & wp.uint64(0xFFFFFFFF))
    words[at + 1] = wp.uint32(value >> wp.uint64(32))


@wp.func
def box_of_leaves(bounds: wp.array(dtype=int)):
    """The lowest leaf, and how many there are along the axes of the box around all."""
    low = wp.vec3i(bounds[0] >> 3, bounds[1] >> 3, bounds[2] >> 3)
    high = wp.vec3i(bounds[3] >> 3, bounds[4] >> 3, bounds[5] >> 3)
    return low, high - low + wp.vec3i(1, 1, 1)


@wp.func
def show_table(
    bounds: wp.array(dtype=int), leaves: int, address: wp.uint64, slot: wp.array(dtype=wp.uint32)
):
    """Lets kernels find a table of leaves, if they are dense; gives how long it is."""
    size = int(0)
    low, extent = box_of_leaves(bounds)
    at = wp.uint64(0)
    if leaves > 0:
        entries = wp.float64(extent[0]) * wp.float64(extent[1]) * wp.float64(extent[2])
        if entries <= wp.float64(_TABLE_ROOM) * wp.float64(leaves):
            size = extent[0] * extent[1] * extent[2]
            at = address
    for axis in range(3):
        slot[_LOWEST_IN_SLOT + axis] = wp.cast(low[axis], wp.uint32)
        slot[_EXTENT_IN_SLOT + axis] = wp.uint32(wp.where(size > 0, extent[axis], 0))
    write_long(slot, _TABLE_IN_SLOT, at)
    return size


@wp.kernel(enable_backward=False, module="unique")
def clear_table(plan: wp.array(dtype=int), table: wp.array(dtype=wp.uint32)):
    i = wp.tid()
    if plan[0] != 0 and i < plan[8]:
        table[i] = _NO_LEAF
