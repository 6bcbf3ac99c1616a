"""Moments of far triangles for winding numbers, by kernels: a level after the other, upward.

The layout is that of lib/DeviceLib/geometry/Winding.h, the sums are those of
lib/Geometry/Moments.cpp, in 64 bits. Nothing is read on the host, so graphs may capture it.
"""

from __future__ import annotations

import warp as wp
from warp._src.device_table import WORDS
from warp._src.geometry.device.refit import (
    CHILD_BLOCKS,
    CHILD_NODES,
    MASKS,
    NODE,
    TRIANGLES,
    bits_below,
    words,
)

# Words of 32 bits per node.
_MOMENTS = wp.constant(128)
MOMENTS_IN_SLOT = WORDS["Mesh"]["moments"]

# For a set of triangles: area, area times center, area times normal, and that times the center.
_Sums = wp.types.vector(16, wp.float64)


@wp.func
def _corner(blocks: wp.array(dtype=wp.uint32), at: int):
    """Three components, eight words apart."""
    corner = wp.vec3d()
    for axis in range(3):
        corner[axis] = wp.float64(wp.cast(blocks[at + 8 * axis], float))
    return corner


@wp.kernel(enable_backward=False, module="unique")
def _sum_blocks(blocks: wp.array(dtype=wp.uint32), sums: wp.array(dtype=_Sums)):
    block = wp.tid()
    total = _Sums()
    for lane in range(8):
        at = block * TRIANGLES + lane
        a = _corner(blocks, at)
        b = _corner(blocks, at + 24)
        c = _corner(blocks, at + 48)
        normal = wp.float64(0.5) * wp.cross(b - a, c - a)
        area = wp.length(normal)
        # Absent triangles are NaN.
        if area > wp.float64(0.0):
            center = (a + b + c) / wp.float64(3.0)
            total[0] += area
            for i in range(3):
                total[1 + i] += area * center[i]
                total[4 + i] += normal[i]
                for j in range(3):
                    total[7 + 3 * i + j] += center[i] * normal[j]
    sums[block] = total


@wp.func
def _write(
    moments: wp.array(dtype=float), at: int, part: _Sums, nodes: wp.array(dtype=wp.uint32), box: int
):
    """Writes down a child about its center, with the radius that its bounds have."""
    squared = wp.float64(0.0)
    center = wp.vec3d()
    for i in range(3):
        low = wp.float64(wp.cast(nodes[box + 8 * i], float))
        high = wp.float64(wp.cast(nodes[box + 24 + 8 * i], float))
        center[i] = low
        if part[0] > wp.float64(0.0):
            center[i] = part[1 + i] / part[0]
        reach = wp.max(center[i] - low, high - center[i])
        squared += reach * reach
        moments[at + 8 * i] = float(center[i])
        moments[at + 32 + 8 * i] = float(part[4 + i])
    moments[at + 24] = float(squared) * 1.00001
    for i in range(3):
        for j in range(3):
            moment = part[7 + 3 * i + j] - center[i] * part[4 + j]
            moments[at + 56 + 24 * i + 8 * j] = float(moment)


@wp.kernel(enable_backward=False, module="unique")
def _sum_children(
    nodes: wp.array(dtype=wp.uint32),
    order: wp.array(dtype=int),
    start: int,
    of_blocks: wp.array(dtype=_Sums),
    of_nodes: wp.array(dtype=_Sums),
    moments: wp.array(dtype=float),
):
    index = order[start + wp.tid()]
    node = index * NODE
    masks = int(nodes[node + MASKS])
    inner = masks & 255
    leaves = (masks >> 8) & 255
    total = _Sums()
    for child in range(8):
        if ((inner | leaves) >> child) & 1 != 0:
            part = _Sums()
            if (inner >> child) & 1 != 0:
                part = of_nodes[int(nodes[node + CHILD_NODES]) + bits_below(inner, child)]
            else:
                part = of_blocks[int(nodes[node + CHILD_BLOCKS]) + bits_below(leaves, child)]
            _write(moments, index * _MOMENTS + child, part, nodes, node + child)
            total += part
    of_nodes[index] = total


class Moments:
    """Moments of the triangles below all nodes of a hierarchy.

    Args:
        view: where the hierarchy is; as long as it is not built again.
        device: the device.
    """

    def __init__(self, view, device):
        count = len(view.order)
        self._levels, self._device, self._blocks = view.levels, device, view.block_count
        self._order = wp.array(view.order, dtype=int, device=device)
        self._nodes = words(view.nodes, NODE * count, device)
        self._leaves = words(view.blocks, TRIANGLES * view.block_count, device)
        self._of_blocks = wp.empty(view.block_count, dtype=_Sums, device=device)
        self._of_nodes = wp.empty(count, dtype=_Sums, device=device)
        self.moments = wp.zeros(_MOMENTS * count, dtype=float, device=device)

    def run(self) -> None:
        """Finds them for triangles and bounds as they are now."""
        device = self._device
        given = [self._leaves, self._of_blocks]
        wp.launch(_sum_blocks, self._blocks, inputs=given, device=device)
        for first, end in reversed(list(zip(self._levels, self._levels[1:], strict=False))):
            given = [self._nodes, self._order, first, self._of_blocks, self._of_nodes]
            wp.launch(_sum_children, end - first, inputs=[*given, self.moments], device=device)
