"""Puts primitives in the order of their groups, and those of a group along a Hilbert curve.

A box that is NaN or inverted, or a face that is not finite, comes last in its group, as it may be
found after a refit. Neighbours in the order say where groups begin.
"""

from __future__ import annotations

from typing import Any

import warp as wp
from warp._src.geometry.device.refit import is_finite, is_proper

# Cells of the curve along an axis: 2^_CELLS.
_CELLS = wp.constant(10)
_CURVE, _GROUP = wp.constant(wp.uint64(30)), 32
_END = wp.constant(wp.uint64((1 << 30) - 1))
# The results: how far from the end the first face with a wrong index is, how many primitives
# nothing finds, and how many groups there are.
WRONG, SKIPPED, GROUPS = (wp.constant(i) for i in range(3))
_FOUND = 3


@wp.func
def _corners(first: wp.array(dtype=wp.vec3), second: wp.array(dtype=int), i: int):
    """Finite bounds of a primitive, whether it may be found, and whether its indices are right."""
    low = wp.vec3()
    high = wp.vec3()
    is_there = bool(False)
    a = second[3 * i]
    b = second[3 * i + 1]
    c = second[3 * i + 2]
    is_right = wp.min(wp.min(a, b), c) >= 0 and wp.max(wp.max(a, b), c) < len(first)
    if is_right:
        p = first[a]
        q = first[b]
        r = first[c]
        low = wp.min(wp.min(p, q), r)
        high = wp.max(wp.max(p, q), r)
        is_there = is_finite(p) and is_finite(q) and is_finite(r)
    return low, high, is_there, is_right


@wp.func
def _corners(first: wp.array(dtype=wp.vec3), second: wp.array(dtype=wp.vec3), i: int):
    low = first[i]
    high = second[i]
    # A place for what is infinite is looked for as in lib/Geometry/HierarchyBuilder.h.
    near = wp.vec3()
    far = wp.vec3()
    for axis in range(3):
        side = wp.where(wp.isfinite(high[axis]), high[axis], 0.0)
        near[axis] = wp.where(wp.isfinite(low[axis]), low[axis], side)
        far[axis] = wp.where(wp.isfinite(high[axis]), high[axis], near[axis])
    return near, far, is_proper(low, high), True


@wp.kernel(enable_backward=False, module="unique")
def _see(
    first: wp.array(dtype=wp.vec3),
    second: wp.array(dtype=Any),
    count: int,
    bounds: wp.array(dtype=float),
    found: wp.array(dtype=int),
):
    """Bounds of all, lower ones with the sign turned."""
    i = wp.tid()
    low, high, is_there, is_right = _corners(first, second, i)
    if is_there:
        for axis in range(3):
            wp.atomic_max(bounds, axis, high[axis])
            wp.atomic_max(bounds, 3 + axis, -low[axis])
    else:
        wp.atomic_add(found, SKIPPED, 1)
    if not is_right:
        wp.atomic_max(found, WRONG, count - i)


@wp.func
def _along_curve(cell: wp.vec3i) -> wp.uint64:
    """Place of a cell along a Hilbert curve (Skilling, "Programming the Hilbert curve", 2004)."""
    x = cell
    for step in range(1, _CELLS):
        bit = 1 << (_CELLS - step)
        for i in range(3):
            if x[i] & bit != 0:
                x[0] = x[0] ^ (bit - 1)
            else:
                turned = (x[0] ^ x[i]) & (bit - 1)
                x[0] = x[0] ^ turned
                x[i] = x[i] ^ turned
    x[1] = x[1] ^ x[0]
    x[2] = x[2] ^ x[1]
    flips = int(0)
    for step in range(1, _CELLS):
        bit = 1 << (_CELLS - step)
        if x[2] & bit != 0:
            flips = flips ^ (bit - 1)
    place = int(0)
    for step in range(1, _CELLS + 1):
        for i in range(3):
            place = (place << 1) | (((x[i] ^ flips) >> (_CELLS - step)) & 1)
    return wp.uint64(place)


@wp.kernel(enable_backward=False, module="unique")
def _number(
    first: wp.array(dtype=wp.vec3),
    second: wp.array(dtype=Any),
    groups: wp.array(dtype=int),
    bounds: wp.array(dtype=float),
    keys: wp.array(dtype=wp.uint64),
    order: wp.array(dtype=int),
):
    i = wp.tid()
    low, high, is_there, _ = _corners(first, second, i)
    place = _END
    if is_there:
        extent = float(1.0e-37)
        for axis in range(3):
            extent = wp.max(extent, 0.5 * bounds[axis] + 0.5 * bounds[3 + axis])
        cells = float(1 << _CELLS)
        cell = wp.vec3i()
        for axis in range(3):
            middle = 0.25 * low[axis] + 0.25 * high[axis] + 0.5 * bounds[3 + axis]
            cell[axis] = int(wp.clamp(middle * (cells / extent), 0.0, cells - 1.0))
        place = _along_curve(cell)
    # Negative numbers come first.
    group = wp.uint64(wp.int64(groups[i]) + wp.int64(2147483648))
    keys[i] = (group << _CURVE) | place
    order[i] = i


@wp.func
def _is_first(keys: wp.array(dtype=wp.uint64), i: int):
    if i == 0:
        return True
    return keys[i - 1] >> _CURVE != keys[i] >> _CURVE


@wp.kernel(enable_backward=False, module="unique")
def _mark_first(keys: wp.array(dtype=wp.uint64), firsts: wp.array(dtype=int)):
    i = wp.tid()
    firsts[i] = int(_is_first(keys, i))


@wp.kernel(enable_backward=False, module="unique")
def _count(ranks: wp.array(dtype=int), found: wp.array(dtype=int)):
    if wp.tid() == len(ranks) - 1:
        found[GROUPS] = ranks[len(ranks) - 1]


@wp.kernel(enable_backward=False, module="unique")
def _begin_groups(
    keys: wp.array(dtype=wp.uint64),
    ranks: wp.array(dtype=int),
    starts: wp.array(dtype=int),
    numbers: wp.array(dtype=int),
):
    i = wp.tid()
    if _is_first(keys, i):
        group = ranks[i] - 1
        # There may be more than are expected.
        if group < len(starts):
            starts[group] = i
            numbers[group] = int(wp.int64(keys[i] >> _CURVE) - wp.int64(2147483648))


class GroupOrder:
    """The order of primitives, found when this is made.

    Args:
        first, second: points and indices of faces, or lower and upper corners of boxes.
        groups: a number for each.
        found: an array for what is found, or None.

    Attributes:
        found: what is found.
        order: numbers of primitives.
        bounds: upper bounds of all, and lower ones with the sign turned.
    """

    def __init__(self, first, second, groups, found):
        self.device = first.device
        count = self.count = len(groups)
        self.order = wp.empty(2 * count, dtype=int, device=self.device)
        self._keys = wp.empty(2 * count, dtype=wp.uint64, device=self.device)
        self._ranks = wp.empty(count, dtype=int, device=self.device)
        self.bounds = wp.full(6, -float("inf"), dtype=float, device=self.device)
        if found is None:
            found = wp.empty(_FOUND, dtype=int, device=self.device)
        self.found = found
        found.zero_()
        self._launch(_see, first, second, count, self.bounds, found)
        self._launch(_number, first, second, groups, self.bounds, self._keys, self.order)
        wp.utils.radix_sort_pairs(self._keys, self.order, count, 0, int(_CURVE) + _GROUP + 1)
        self._launch(_mark_first, self._keys, self._ranks)
        wp.utils.array_scan(self._ranks, self._ranks)
        self._launch(_count, self._ranks, found)

    def count_groups(self) -> int:
        """How many groups there are; waits."""
        return int(self.found.numpy()[GROUPS])

    def begin_groups(self, starts, numbers) -> None:
        """Writes where each group begins and its number."""
        self._launch(_begin_groups, self._keys, self._ranks, starts, numbers)

    def _launch(self, kernel, *inputs):
        wp.launch(kernel, self.count, inputs=inputs, device=self.device)
