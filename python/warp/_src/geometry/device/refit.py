"""Hierarchies that kernels refit: blocks first, then nodes, one level after the other.

The bits are those of lib/Geometry/Hierarchy.h as long as the scale of coordinates, which is chosen
when a hierarchy is built, is the same. Nothing is read on the host, so graphs may capture it.
"""

from __future__ import annotations

import warp as wp
from warp._src.device_table import WORDS
from warp._src.types import dtypes

# Words of nodes and blocks (lib/DeviceLib/geometry/Tree.h).
NODE, CHILD_NODES, CHILD_BLOCKS, PARENT, MASKS = 64, 48, 49, 50, 51
TRIANGLES, TRIANGLE_IDS, BOXES, BOX_IDS = 80, 72, 56, 48
# The word of 32 bits of a slot with the scale of coordinates.
SCALE = wp.constant(2 * WORDS["Mesh"]["scale"])
_NONE = wp.constant(wp.uint32(0x7FC00000))


def words(address, count, device):
    """Memory of a device as numbers of 32 bits."""
    return wp.array(ptr=address, dtype=dtypes.uint32, shape=count, device=device)


def slot_of(id, device):
    """The memory behind a handle (lib/Geometry/Slots.h)."""
    return words(id & ((1 << 49) - 1), 64, device)


@wp.func
def is_finite(v: wp.vec3):
    return wp.isfinite(v[0]) and wp.isfinite(v[1]) and wp.isfinite(v[2])


@wp.func
def is_proper(low: wp.vec3, high: wp.vec3):
    """True if a box is neither inverted nor NaN; it may be infinite."""
    return low[0] <= high[0] and low[1] <= high[1] and low[2] <= high[2]


@wp.func
def _write(words: wp.array(dtype=wp.uint32), at: int, v: wp.vec3, is_there: bool):
    """Three components, eight words apart; NaN without them."""
    for axis in range(3):
        word = wp.cast(v[axis], wp.uint32)
        words[at + 8 * axis] = wp.where(is_there, word, _NONE)


@wp.kernel(enable_backward=False, module="unique")
def _fill_triangles(
    words: wp.array(dtype=wp.uint32),
    slot: wp.array(dtype=wp.uint32),
    points: wp.array(dtype=wp.vec3),
    indices: wp.array(dtype=int),
):
    block, lane = wp.tid()
    scale = wp.cast(slot[SCALE], float)
    first = block * TRIANGLES
    face = wp.cast(words[first + TRIANGLE_IDS + lane], int)
    a = wp.vec3()
    b = wp.vec3()
    c = wp.vec3()
    is_there = bool(False)
    if face >= 0:
        i = indices[3 * face]
        j = indices[3 * face + 1]
        k = indices[3 * face + 2]
        # The host has checked them, but they may have changed.
        if wp.min(wp.min(i, j), k) >= 0 and wp.max(wp.max(i, j), k) < len(points):
            a = points[i]
            b = points[j]
            c = points[k]
            is_there = is_finite(a) and is_finite(b) and is_finite(c)
    _write(words, first + lane, a * scale, is_there)
    _write(words, first + 24 + lane, b * scale, is_there)
    _write(words, first + 48 + lane, c * scale, is_there)


@wp.kernel(enable_backward=False, module="unique")
def _fill_boxes(
    words: wp.array(dtype=wp.uint32),
    slot: wp.array(dtype=wp.uint32),
    lowers: wp.array(dtype=wp.vec3),
    uppers: wp.array(dtype=wp.vec3),
):
    block, lane = wp.tid()
    scale = wp.cast(slot[SCALE], float)
    first = block * BOXES
    box = wp.cast(words[first + BOX_IDS + lane], int)
    low = wp.vec3()
    high = wp.vec3()
    is_there = bool(False)
    if box >= 0:
        low = lowers[box]
        high = uppers[box]
        is_there = is_proper(low, high)
    _write(words, first + lane, low * scale, is_there)
    _write(words, first + 24 + lane, high * scale, is_there)


@wp.func
def bits_below(mask: int, place: int):
    count = int(0)
    for bit in range(8):
        count += int(bit < place) * ((mask >> bit) & 1)
    return count


@wp.kernel(enable_backward=False, module="unique")
def _bound(
    nodes: wp.array(dtype=wp.uint32),
    blocks: wp.array(dtype=wp.uint32),
    block_words: int,
    corners: int,
    order: wp.array(dtype=int),
    start: int,
):
    """The bounds of one child of a node of a level; of triangles each corner counts."""
    which, child = wp.tid()
    node = order[start + which] * NODE
    masks = int(nodes[node + MASKS])
    of_nodes = masks & 255
    of_blocks = (masks >> 8) & 255
    for axis in range(3):
        low = float(wp.inf)
        high = -float(wp.inf)
        if (of_nodes >> child) & 1 != 0:
            below = (int(nodes[node + CHILD_NODES]) + bits_below(of_nodes, child)) * NODE
            there = int(nodes[below + MASKS])
            for lane in range(8):
                if ((there | (there >> 8)) >> lane) & 1 != 0:
                    low = wp.min(low, wp.cast(nodes[below + 8 * axis + lane], float))
                    high = wp.max(high, wp.cast(nodes[below + 24 + 8 * axis + lane], float))
        elif (of_blocks >> child) & 1 != 0:
            block = int(nodes[node + CHILD_BLOCKS]) + bits_below(of_blocks, child)
            for lane in range(8):
                for corner in range(corners):
                    at = block * block_words + 24 * corner + 8 * axis + lane
                    x = wp.cast(blocks[at], float)
                    if x == x:
                        # The first corner of a box is the lower one.
                        low = wp.min(low, x)
                        high = wp.max(high, x)
        nodes[node + 8 * axis + child] = wp.cast(low, wp.uint32)
        nodes[node + 24 + 8 * axis + child] = wp.cast(high, wp.uint32)


class Refit:
    """Refits one hierarchy in place.

    Args:
        view: where the hierarchy is; as long as it is not built again.
        device: the device.
        of_triangles: whether blocks are of triangles, else of boxes.
        slot: words of what its handle leads to.
    """

    def __init__(self, view, device, of_triangles, slot):
        self.view, self.device, self.of_triangles, self._slot = view, device, of_triangles, slot
        self.block_words = TRIANGLES if of_triangles else BOXES
        self.order = wp.array(view.order, dtype=int, device=device)
        self.nodes = words(view.nodes, NODE * len(view.order), device)
        self.blocks = words(view.blocks, self.block_words * view.block_count, device)
        self._launches, self._of = [], None

    def refit(self, first, second) -> None:
        """Takes over points and indices of faces, or lower and upper corners of boxes."""
        if not len(self.view.order):
            return
        if self._of != (first.ptr, second.ptr):
            self._launches, self._of = self._record(first, second), (first.ptr, second.ptr)
        for launch in self._launches:
            launch.launch()

    def _record(self, first, second) -> list:
        def record(kernel, dim, inputs):
            return wp.launch(kernel, dim, inputs, device=self.device, record_cmd=True)

        fill = _fill_triangles if self.of_triangles else _fill_boxes
        inputs = [self.blocks, self._slot, first, second]
        launches = [record(fill, (self.view.block_count, 8), inputs)]
        corners = 3 if self.of_triangles else 2
        levels = self.view.levels
        for level in reversed(range(len(levels) - 1)):
            count = levels[level + 1] - levels[level]
            inputs = [self.nodes, self.blocks, self.block_words, corners, self.order, levels[level]]
            launches.append(record(_bound, (count, 8), inputs))
        return launches


def refit_of(handle, of_triangles) -> Refit:
    """Refits of a `Mesh` or `Bvh` of a GPU that the host has built.

    Made with the hierarchy: a graph that records a refit could not copy the order of its nodes.
    """
    slot = slot_of(handle.id, handle.device)
    return Refit(handle._native.view, handle.device, of_triangles, slot)
