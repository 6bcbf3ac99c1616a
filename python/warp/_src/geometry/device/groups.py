"""Hierarchies with groups, by kernels: nothing is read on the host, so graphs capture it.

Primitives are in the order of their groups (group_order.py). Within a group eight that follow each
other share a block, eight blocks a node, eight nodes the next, up to one that holds the group: its
root. Roots are neighbours in memory; above them are nodes with eight each, and so on.

Nodes of one height are neighbours, too, in the order of groups. How many there may be at most
follows from the number of primitives; those that there are not have no children. So bounds are
found as in a refit, a level after the other.
"""

from __future__ import annotations

import functools

import warp as wp
from warp._src import errors
from warp._src.geometry.device.built import Built
from warp._src.geometry.device.group_links import (
    link_above,
    link_nodes,
    link_roots,
    place,
    publish,
    size_groups,
)
from warp._src.geometry.device.group_order import SKIPPED, WRONG, GroupOrder
from warp._src.geometry.device.refit import BOX_IDS, TRIANGLE_IDS, Refit, slot_of

# No branch of a hierarchy has more nodes.
_DEPTH = 16


def _heights(count) -> list:
    """How many nodes of each height there may be below roots.

    A group with a node of height h has more than 8^h blocks, two of them at least.
    """
    rooms = []
    while count > 8 ** (len(rooms) + 2):
        places = 8 ** (len(rooms) + 2)
        rooms.append(count // places + count // (places + 1))
    return rooms


class GroupedBuild(Built):
    """A hierarchy with groups.

    Args:
        room: how many groups there may be, one at least.
    """

    def __init__(self, count, device, of_triangles, room):
        heights, tops, above = _heights(count), [], room
        while above > 1:
            above = -(-above // 8)
            tops.insert(0, above)
        levels = [*tops, room, *reversed(heights)]
        if len(levels) > _DEPTH:
            raise errors.WarpError(f"a hierarchy of {room} groups of {count} would be too deep")
        super().__init__(count, device, of_triangles, levels, (count + 7 * room) // 8)
        self.room, self._heights = room, heights
        self._table = wp.empty(2 * room, dtype=int, device=device)
        starts = self.view.levels
        self._tops, self._root = starts[: len(tops)], starts[len(tops)]
        # Blocks, and nodes of each height.
        self._firsts = [0, *reversed(starts[len(tops) + 1 : -1])]
        self._starts = wp.empty(room, dtype=int, device=device)
        # The results; they stay where they are for graphs.
        self.found = self._sorted = self._refit = None

    @property
    def groups(self) -> int:
        return self._table.ptr

    def take(self, order) -> None:
        """Takes the order that `run` is to build of."""
        self._sorted, self.found = order, order.found

    def run(self, id, first, second) -> None:
        """As that of `Build`."""
        slot = slot_of(id, self.device)
        if self._refit is None:
            self._refit = Refit(self.view, self.device, self.of_triangles, slot)
        order, room, root = self._sorted, self.room, self._root
        self._sorted = None
        found = order.found
        order.begin_groups(self._starts, self._table)
        sizes = wp.empty(room * len(self._firsts), dtype=int, device=self.device)
        places = wp.empty_like(sizes)
        given = found, self._starts, room, len(self._heights), self.count
        self._launch(size_groups, room, *given, sizes)
        wp.utils.array_scan(sizes, places, inclusive=False)
        nodes, blocks = self._refit.nodes, self._refit.blocks
        for height, number in enumerate(self._heights, 1):
            above = self._firsts[height + 1] if height < len(self._heights) else 0
            first_of = wp.vec3i(self._firsts[height], self._firsts[height - 1], above)
            self._launch(link_nodes, number, sizes, places, room, height, first_of, root, nodes)
        above = self._tops[-1] if self._tops else -1
        self._launch(link_roots, room, sizes, places, room, self._first_array, root, above, nodes)
        for level, start in enumerate(self._tops):
            below = [*self._tops, root][level + 1]
            first_of = wp.vec3i(start, below, self._tops[level - 1] if level else -1)
            reach = 8 ** (len(self._tops) - level)
            self._launch(link_above, self._levels[level], found, room, reach, first_of, nodes)
        ids = TRIANGLE_IDS if self.of_triangles else BOX_IDS
        given = found, self._starts, sizes, places, order.order, room
        self._launch(place, (self._blocks, 8), *given, self._refit.block_words, ids, blocks)
        self._launch(publish, room, found, order.bounds, room, root, self._table, slot)
        self.refit(first, second)

    def refit(self, first, second) -> None:
        """Takes over primitives that moved."""
        self._refit.refit(first, second)

    @functools.cached_property
    def _first_array(self):
        return wp.array(self._firsts, dtype=int, device=self.device)

    def _read(self):
        found = self.found.numpy()
        return self.count - int(found[WRONG]), int(found[SKIPPED])

    def _launch(self, kernel, dim, *inputs):
        wp.launch(kernel, dim, inputs=inputs, device=self.device)


def grouped_build_of(last, first, second, groups, of_triangles) -> GroupedBuild:
    """As `build_of`; primitives are in their order already."""
    count, device = len(groups), first.device
    fits = isinstance(last, GroupedBuild) and last.count == count
    capturing = device.is_capturing
    if capturing and not fits:
        raise errors.WarpError(
            "a graph captures a hierarchy with groups that was built before with as many "
            "primitives; build it once outside"
        )
    order = GroupOrder(first, second, groups, last.found if fits else None)
    needed = last.room if capturing else max(order.count_groups(), 1)
    built = (
        last if fits and last.room >= needed else GroupedBuild(count, device, of_triangles, needed)
    )
    built.take(order)
    return built
