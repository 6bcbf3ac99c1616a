"""Whether a buffer is a grid that kernels can walk: every count and offset is checked before."""

from __future__ import annotations

import numpy as np

from warp._src import errors
from warp._src.geometry.volumes.layout import (
    HEADER,
    MAGICS,
    MAJOR,
    ON_INDEX,
    ON_INDEX_MASK,
    TREE,
    TYPES,
    layout_of,
)


def header_of(buffer):
    """The header of the grid at the start of a buffer.

    Raises:
        WarpError: there is none, or one of another version.
    """
    if buffer.size < HEADER.itemsize + TREE.itemsize:
        raise broken(f"it has {buffer.size} bytes, fewer than a grid's header")
    header = buffer[: HEADER.itemsize].view(HEADER)[0]
    if int(header["magic"]) not in MAGICS:
        raise errors.WarpError("this is no NanoVDB grid: its signature is missing")
    if int(header["version"]) >> 21 != MAJOR:
        raise errors.WarpError(
            f"a NanoVDB grid of version {int(header['version']) >> 21}, but {MAJOR} is supported"
        )
    return header


def tree_of(buffer):
    """The tree behind a grid's header."""
    return buffer[HEADER.itemsize : HEADER.itemsize + TREE.itemsize].view(TREE)[0]


class Nodes:
    """The levels of a grid's nodes as arrays of records.

    Attributes:
        layout, tiles, uppers, lowers, leaves: where what is, and the records.
        root_at, leaf_at: offsets of the root and of the first leaf.
    """

    def __init__(self, buffer, layout=None):
        """Finds the levels; all but the leaves as a layout has them, if one is given.

        Raises:
            WarpError: they are not within the buffer, or of a type that is not supported.
        """
        header = header_of(buffer)
        number, size = int(header["type"]), int(header["size"])
        if number not in TYPES and layout is None:
            raise errors.WarpError(f"a NanoVDB grid of type {number} is not supported")
        if not HEADER.itemsize + TREE.itemsize <= size <= buffer.size:
            raise broken(f"it says it has {size} bytes, but there are {buffer.size}")
        self.buffer, self.layout = buffer[:size], layout or layout_of(number)
        tree = tree_of(buffer)
        offsets = [HEADER.itemsize + int(offset) for offset in tree["offsets"]]
        self.leaf_at, lower_at, upper_at, self.root_at = offsets
        self._check(self.root_at, self.layout.root, "root")
        root = self.root_at
        count = int(self.buffer[root + 24 : root + 28].view("<u4")[0])
        self.tiles = self._level(root + self.layout.root, count, self.layout.root_tile)
        leaves, lowers, uppers = (int(count) for count in tree["counts"])
        self.uppers = self._level(upper_at, uppers, self.layout.upper_node)
        self.lowers = self._level(lower_at, lowers, self.layout.lower_node)
        if layout is None:
            self.leaves = self._level(self.leaf_at, leaves, self.layout.leaf_node)
        self.starts = upper_at, lower_at, self.leaf_at

    @property
    def end(self) -> int:
        """Behind the root and the inner nodes."""
        levels = (
            (self.root_at + self.layout.root, self.tiles),
            (self.starts[0], self.uppers),
            (self.starts[1], self.lowers),
        )
        return max(
            start + level.nbytes for start, level in levels if len(level) or level is self.tiles
        )

    def _check(self, start, size, what):
        if start < 0 or start % 4 or start + size > self.buffer.size:
            raise broken(f"its {what} is not within its {self.buffer.size} bytes")

    def _level(self, start, count, record):
        self._check(start, count * record.itemsize, "level of nodes")
        return self.buffer[start : start + count * record.itemsize].view(record)


def check_grid(buffer) -> Nodes:
    """Checks the grid at the start of a buffer.

    Raises:
        WarpError: it is none, or not one that kernels can walk.
    """
    nodes = Nodes(buffer)
    upper_at, lower_at, leaf_at = nodes.starts
    children = nodes.tiles["child"].astype(np.int64)
    linked = children[children != 0] + nodes.root_at
    _check_level(linked, upper_at, nodes.uppers, "root")
    for parents, start, below, level in (
        (nodes.uppers, upper_at, lower_at, nodes.lowers),
        (nodes.lowers, lower_at, leaf_at, nodes.leaves),
    ):
        _check_level(children_of(parents, start)[2], below, level, "inner node")
    if nodes.layout.number in (ON_INDEX, ON_INDEX_MASK):
        numbered = int(np.unpackbits(nodes.leaves["values"]).sum())
        # Tiles that are active have numbers, too.
        if not numbered <= int(tree_of(buffer)["voxels"]) < 2**31:
            raise broken(f"{numbered} voxels of its leaves are active, which is not what it says")
    return nodes


def children_of(parents, start):
    """Parent, place and offset in the buffer of each child of a level that starts somewhere."""
    none = np.zeros(0, dtype=np.int64)
    parent, place = [none], [none]
    # A level at a time would take eight times the memory of its masks.
    for number, mask in enumerate(parents["children"]):
        places = np.flatnonzero(np.unpackbits(mask, bitorder="little"))
        parent.append(np.full(len(places), number))
        place.append(places)
    parent, place = np.concatenate(parent), np.concatenate(place)
    entries = np.ascontiguousarray(parents["table"][parent, place])
    raw = entries.view(np.uint8).reshape(len(parent), entries.dtype.itemsize)[:, :8]
    relative = np.ascontiguousarray(raw).view("<i8").reshape(-1)
    return parent, place, start + parent * parents.dtype.itemsize + relative


def _check_level(offsets, start, level, what):
    places = (offsets - start) // max(level.dtype.itemsize, 1)
    wrong = (offsets - start) % level.dtype.itemsize != 0
    if (wrong | (places < 0) | (places >= len(level))).any():
        raise broken(f"a child of its {what} is not one of its nodes")


def broken(why):
    return errors.WarpError(f"the NanoVDB grid is damaged: {why}")
