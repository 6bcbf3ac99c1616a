"""Whether a buffer is a grid that kernels can walk: every count and offset is checked before."""

from __future__ import annotations

import numpy as np

from warp._src import errors
from warp._src.geometry.volumes.layout import HEADER, MAGICS, MAJOR, TREE, TYPES, layout_of


def header_of(buffer):
    """The header of the grid at the start of a buffer.

    Raises:
        WarpError: there is none, or one of another version.
    """
    if buffer.size < HEADER.itemsize + TREE.itemsize:
        raise _broken(f"it has {buffer.size} bytes, fewer than a grid's header")
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

    def __init__(self, buffer):
        """Finds the levels.

        Raises:
            WarpError: they are not within the buffer, or of a type that is not supported.
        """
        header = header_of(buffer)
        number, size = int(header["type"]), int(header["size"])
        if number not in TYPES:
            raise errors.WarpError(f"a NanoVDB grid of type {number} is not supported")
        if not HEADER.itemsize + TREE.itemsize <= size <= buffer.size:
            raise _broken(f"it says it has {size} bytes, but there are {buffer.size}")
        self.buffer, self.layout = buffer[:size], layout_of(number)
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
        self.leaves = self._level(self.leaf_at, leaves, self.layout.leaf_node)
        self.starts = upper_at, lower_at, self.leaf_at

    def _check(self, start, size, what):
        if start < 0 or start % 4 or start + size > self.buffer.size:
            raise _broken(f"its {what} is not within its {self.buffer.size} bytes")

    def _level(self, start, count, record):
        if count == 0:
            return np.zeros(0, dtype=record)
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
        raise _broken(f"a child of its {what} is not one of its nodes")


def _broken(why):
    return errors.WarpError(f"the NanoVDB grid is damaged: {why}")
