"""Orders primitives by halving them: by the medians of their centers along the widest axis.

A segment of the order is a node with all below it, so segments are halved three times from a node
to its children. Segments of one size are halved together: their primitives are sorted by the number
of the segment, then by the center along the axis on which the segment's cell is widest. Cells are
halved where the order is.
"""

from __future__ import annotations

import warp as wp


@wp.func
def _widest(low: wp.vec3, high: wp.vec3):
    extent = high - low
    axis = int(0)
    if extent[1] > extent[0]:
        axis = 1
    if extent[2] > extent[axis]:
        axis = 2
    return axis


@wp.kernel(enable_backward=False, module="unique")
def _number(
    centers: wp.array(dtype=wp.vec3),
    order: wp.array(dtype=int),
    cells: wp.array2d(dtype=wp.vec3),
    size: int,
    fine: wp.uint32,
    keys: wp.array(dtype=wp.uint32),
):
    """The key of the primitive at a place; what has no center is behind all others."""
    i = wp.tid()
    segment = i // size
    low = cells[segment, 0]
    high = cells[segment, 1]
    axis = _widest(low, high)
    x = centers[order[i]][axis]
    # Of two steps, as the extent of floats may be none.
    place = (0.5 * x - 0.5 * low[axis]) / wp.max(0.5 * high[axis] - 0.5 * low[axis], 1.0e-37)
    number = fine
    if x == x:
        number = wp.min(wp.uint32(wp.clamp(place, 0.0, 1.0) * float(fine)), fine - wp.uint32(1))
    keys[i] = wp.uint32(segment) * (fine + wp.uint32(1)) + number


@wp.kernel(enable_backward=False, module="unique")
def _halve_cells(
    centers: wp.array(dtype=wp.vec3),
    order: wp.array(dtype=int),
    cells: wp.array2d(dtype=wp.vec3),
    size: int,
    count: int,
    halves: wp.array2d(dtype=wp.vec3),
):
    segment = wp.tid()
    low = cells[segment, 0]
    high = cells[segment, 1]
    below = high
    above = low
    middle = segment * size + size // 2
    if middle < count:
        axis = _widest(low, high)
        x = centers[order[middle]][axis]
        if x == x:
            below[axis] = x
            above[axis] = x
    halves[2 * segment, 0] = low
    halves[2 * segment, 1] = below
    halves[2 * segment + 1, 0] = above
    halves[2 * segment + 1, 1] = high


def halve(centers, cells, keys, order, levels) -> None:
    """Orders primitives for a tree of full nodes.

    Args:
        centers: vec3 of each primitive, NaN for those that are to be last.
        cells: two arrays of pairs of corners, for as many segments as there are blocks; the first
            pair of the first is the bounds of all centers.
        keys, order: memory for `wp.utils.radix_sort_pairs`; the order is read and written.
        levels: of nodes.
    """
    count, device = len(centers), centers.device
    size = 8 ** (levels + 1)
    segments = 1
    while size > 8:
        if count > size // 2:
            bits = min(16, 32 - segments.bit_length())
            # Not a power of two, as one number is for those that are last.
            fine = (1 << bits) - 1
            inputs = [centers, order, cells[0], size, fine, keys]
            wp.launch(_number, count, inputs, device=device)
            bits += (segments - 1).bit_length()
            wp.utils.radix_sort_pairs(keys, order, count, 0, bits)
        inputs = [centers, order, cells[0], size, count, cells[1]]
        wp.launch(_halve_cells, segments, inputs, device=device)
        cells = (cells[1], cells[0])
        size //= 2
        segments = -(-count // size)
