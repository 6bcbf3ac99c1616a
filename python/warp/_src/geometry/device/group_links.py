"""Kernels that say where the nodes of a hierarchy with groups lead to (groups.py).

How many blocks a group has, and how many nodes of each height, are rows of an array; the sums of
all before each say where they are among those of their height.
"""

from __future__ import annotations

import warp as wp
from warp._src.device_table import WORDS
from warp._src.geometry.device.group_order import GROUPS, SKIPPED
from warp._src.geometry.device.refit import CHILD_BLOCKS, CHILD_NODES, MASKS, NODE, PARENT, SCALE

# The word of 32 bits of a slot with the number of groups.
_GROUP_COUNT = wp.constant(2 * WORDS["Mesh"]["tree_counts"])
# The resolution of coordinates, at their distance from the origin.
_FAR = wp.constant(wp.float64(2.0**-20))


@wp.func
def _groups_here(found: wp.array(dtype=int), room: int):
    """How many groups there are; none without room for all."""
    return wp.where(found[GROUPS] <= room, found[GROUPS], 0)


@wp.kernel(enable_backward=False, module="unique")
def size_groups(
    found: wp.array(dtype=int),
    starts: wp.array(dtype=int),
    room: int,
    heights: int,
    primitives: int,
    sizes: wp.array(dtype=int),
):
    """Blocks of a group, and its nodes of each height below its root."""
    group = wp.tid()
    count = _groups_here(found, room)
    blocks = int(0)
    if group < count:
        end = primitives
        if group + 1 < count:
            end = starts[group + 1]
        blocks = (end - starts[group] + 7) // 8
    sizes[group] = blocks
    nodes = blocks
    for height in range(1, heights + 1):
        nodes = (nodes + 7) // 8
        sizes[height * room + group] = wp.where(nodes > 1, nodes, 0)
    if group == 0 and found[GROUPS] > room:
        found[SKIPPED] = primitives


@wp.func
def _group_of(places: wp.array(dtype=int), row: int, room: int, place: int):
    """The last group of a row that begins at a place or before it."""
    low = int(0)
    high = int(room)
    while high - low > 1:
        middle = (low + high) // 2
        if places[row * room + middle] - places[row * room] <= place:
            low = middle
        else:
            high = middle
    return low


@wp.func
def _link(
    nodes: wp.array(dtype=wp.uint32),
    node: int,
    child: int,
    count: int,
    of_blocks: bool,
    parent: int,
):
    """Says which children a node has."""
    at = node * NODE
    mask = (1 << count) - 1
    nodes[at + CHILD_NODES] = wp.uint32(wp.where(of_blocks, 0, child))
    nodes[at + CHILD_BLOCKS] = wp.uint32(wp.where(of_blocks, child, 0))
    nodes[at + PARENT] = wp.uint32(parent)
    nodes[at + MASKS] = wp.uint32(wp.where(of_blocks, mask << 8, mask))


@wp.kernel(enable_backward=False, module="unique")
def link_nodes(
    sizes: wp.array(dtype=int),
    places: wp.array(dtype=int),
    room: int,
    height: int,
    first: wp.vec3i,
    root: int,
    nodes: wp.array(dtype=wp.uint32),
):
    """Nodes of a height below roots. `first`: where those of it, below and above it begin."""
    i = wp.tid()
    group = _group_of(places, height, room, i)
    row = height * room + group
    own = i - (places[row] - places[height * room])
    count = int(0)
    child = int(0)
    parent = int(0)
    if own < sizes[row]:
        below = row - room
        child = first[1] + places[below] - places[below - group] + 8 * own
        count = wp.min(sizes[below] - 8 * own, 8)
        parent = root + group
        above = row + room
        is_root_above = above >= len(sizes)
        if not is_root_above:
            is_root_above = sizes[above] == 0
        if not is_root_above:
            parent = first[2] + places[above] - places[above - group] + own // 8
    _link(nodes, first[0] + i, child, count, height == 1, parent)


@wp.kernel(enable_backward=False, module="unique")
def link_roots(
    sizes: wp.array(dtype=int),
    places: wp.array(dtype=int),
    room: int,
    firsts: wp.array(dtype=int),
    root: int,
    above: int,
    nodes: wp.array(dtype=wp.uint32),
):
    """Roots, and where nodes of each height begin; those of height 0 are blocks."""
    group = wp.tid()
    height = int(0)
    for higher in range(1, len(firsts)):
        if sizes[higher * room + group] > 0:
            height = higher
    row = height * room + group
    child = firsts[height] + places[row] - places[row - group]
    parent = wp.where(above < 0, -1, above + group // 8)
    _link(nodes, root + group, child, sizes[row], height == 0, parent)


@wp.kernel(enable_backward=False, module="unique")
def link_above(
    found: wp.array(dtype=int),
    room: int,
    reach: int,
    first: wp.vec3i,
    nodes: wp.array(dtype=wp.uint32),
):
    """Nodes above roots, each over `reach` of them at most. `first` as for `_link_nodes`."""
    i = wp.tid()
    below = reach // 8
    rest = (_groups_here(found, room) + below - 1) // below - 8 * i
    parent = wp.where(first[2] < 0, -1, first[2] + i // 8)
    _link(nodes, first[0] + i, first[1] + 8 * i, wp.clamp(rest, 0, 8), False, parent)


@wp.kernel(enable_backward=False, module="unique")
def place(
    found: wp.array(dtype=int),
    starts: wp.array(dtype=int),
    sizes: wp.array(dtype=int),
    places: wp.array(dtype=int),
    order: wp.array(dtype=int),
    room: int,
    block_words: int,
    ids: int,
    blocks: wp.array(dtype=wp.uint32),
):
    """Says which primitives a block has."""
    block, lane = wp.tid()
    group = _group_of(places, 0, room, block)
    own = block - places[group]
    primitive = int(-1)
    if own < sizes[group]:
        end = len(order) // 2
        if group + 1 < _groups_here(found, room):
            end = starts[group + 1]
        at = starts[group] + 8 * own + lane
        if at < end:
            primitive = order[at]
    blocks[block * block_words + ids + lane] = wp.uint32(primitive)


@wp.kernel(enable_backward=False, module="unique")
def publish(
    found: wp.array(dtype=int),
    bounds: wp.array(dtype=float),
    room: int,
    root: int,
    table: wp.array(dtype=int),
    slot: wp.array(dtype=wp.uint32),
):
    """Says how many groups there are, where their roots are, and the scale (Scale.cpp)."""
    group = wp.tid()
    count = _groups_here(found, room)
    if group < count:
        table[count + group] = root + group
    if group == 0:
        size = wp.float64(0.0)
        if bounds[0] >= -bounds[3]:
            for axis in range(3):
                low = -wp.float64(bounds[3 + axis])
                high = wp.float64(bounds[axis])
                far = wp.max(wp.abs(low), wp.abs(high))
                size = wp.max(size, wp.max(high - low, far * _FAR))
        exponent = int(0)
        if size > wp.float64(0.0):
            exponent = int(wp.cast(size, wp.uint64) >> wp.uint64(52)) - 1023
        slot[SCALE] = wp.uint32(127 - wp.clamp(exponent, -126, 126)) << wp.uint32(23)
        slot[_GROUP_COUNT] = wp.uint32(count)
