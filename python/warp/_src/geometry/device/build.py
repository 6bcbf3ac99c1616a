"""Hierarchies that kernels build where primitives are, without the host, so graphs capture it.

Primitives are put in an order: eight that follow each other share a block, eight blocks a node,
eight nodes the next (Kamel and Faloutsos, "Hilbert R-tree: an improved R-tree using fractals", VLDB
1994). Where nodes are and which children they have depends on the number of primitives alone, so
building is sorting, and bounds are found as by a refit.

The order is by halves (halves.py), or along a Hilbert curve (curve.py): one sort instead of one for
each halving, but queries take up to twice as long.
"""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np

import warp as wp
from warp._src import errors
from warp._src.geometry.device.curve import sort_along_curve
from warp._src.geometry.device.extent import PARTS, find_extent, scale_of
from warp._src.geometry.device.halves import halve
from warp._src.geometry.device.refit import (
    BOX_IDS,
    BOXES,
    CHILD_BLOCKS,
    CHILD_NODES,
    MASKS,
    NODE,
    PARENT,
    SCALE,
    TRIANGLE_IDS,
    TRIANGLES,
    Refit,
    is_finite,
)
from warp._src.types import dtypes


@wp.kernel(enable_backward=False, module="unique")
def _start(
    whole: wp.array(dtype=wp.vec3),
    slot: wp.array(dtype=wp.uint32),
    cells: wp.array2d(dtype=wp.vec3),
    found: wp.array(dtype=int),
    count: int,
):
    slot[SCALE] = wp.cast(scale_of(whole[0], whole[1]), wp.uint32)
    cells[0, 0] = whole[0]
    cells[0, 1] = whole[1]
    found[0] = count
    found[1] = 0


@wp.kernel(enable_backward=False, module="unique")
def _see_triangles(
    points: wp.array(dtype=wp.vec3),
    indices: wp.array(dtype=int),
    centers: wp.array(dtype=wp.vec3),
    order: wp.array(dtype=int),
    found: wp.array(dtype=int),
):
    """Centers of bounds, NaN for faces that are not finite or have no such points."""
    face = wp.tid()
    i = indices[3 * face]
    j = indices[3 * face + 1]
    k = indices[3 * face + 2]
    center = wp.vec3(wp.nan, wp.nan, wp.nan)
    if wp.min(wp.min(i, j), k) >= 0 and wp.max(wp.max(i, j), k) < len(points):
        a = points[i]
        b = points[j]
        c = points[k]
        if is_finite(a) and is_finite(b) and is_finite(c):
            center = 0.5 * wp.min(wp.min(a, b), c) + 0.5 * wp.max(wp.max(a, b), c)
    else:
        wp.atomic_min(found, 0, face)
    if center[0] != center[0]:
        wp.atomic_add(found, 1, 1)
    centers[face] = center
    order[face] = face


@wp.kernel(enable_backward=False, module="unique")
def _see_boxes(
    lowers: wp.array(dtype=wp.vec3),
    uppers: wp.array(dtype=wp.vec3),
    centers: wp.array(dtype=wp.vec3),
    order: wp.array(dtype=int),
    found: wp.array(dtype=int),
):
    """Centers, NaN for boxes that are not finite or inverted."""
    box = wp.tid()
    a = lowers[box]
    b = uppers[box]
    center = wp.vec3(wp.nan, wp.nan, wp.nan)
    if is_finite(a) and is_finite(b) and a[0] <= b[0] and a[1] <= b[1] and a[2] <= b[2]:
        center = 0.5 * a + 0.5 * b
    else:
        wp.atomic_add(found, 1, 1)
    centers[box] = center
    order[box] = box


@wp.kernel(enable_backward=False, module="unique")
def _place(
    order: wp.array(dtype=int), count: int, words: wp.array(dtype=wp.uint32), size: int, ids: int
):
    """Writes which primitives a block has."""
    block, lane = wp.tid()
    at = 8 * block + lane
    id = int(-1)
    if at < count:
        id = order[at]
    words[block * size + ids + lane] = wp.cast(id, wp.uint32)


@wp.kernel(enable_backward=False, module="unique")
def _link(
    nodes: wp.array(dtype=wp.uint32),
    above: int,
    start: int,
    children: int,
    count: int,
    blocks: bool,
):
    """Writes what children a node of a level has: nodes from `children` on, or blocks."""
    i = wp.tid()
    node = (start + i) * NODE
    mask = (1 << wp.min(8, count - 8 * i)) - 1
    parent = int(-1)
    if start > 0:
        parent = above + i // 8
    nodes[node + CHILD_NODES] = wp.uint32(wp.where(blocks, 0, children + 8 * i))
    nodes[node + CHILD_BLOCKS] = wp.uint32(wp.where(blocks, 8 * i, 0))
    nodes[node + PARENT] = wp.cast(parent, wp.uint32)
    nodes[node + MASKS] = wp.uint32(wp.where(blocks, mask << 8, mask))


def _shape(count):
    """Numbers of nodes on the levels, the root first, and of blocks, for so many primitives."""
    blocks = -(-count // 8)
    levels = [-(-blocks // 8)] if count else []
    while levels and levels[0] > 1:
        levels.insert(0, -(-levels[0] // 8))
    return levels, blocks


class Build:
    """A hierarchy on a device, for a number of triangles or boxes.

    Args:
        count: how many primitives there are.
        device: where they are.
        of_triangles: whether they are triangles, else boxes.
        along_curve: whether they are ordered along a curve, else by halves.
    """

    def __init__(self, count, device, of_triangles, along_curve=False):
        self.count, self.device, self.of_triangles = count, device, of_triangles
        self.along_curve = along_curve
        levels, blocks = _shape(count)
        starts = [0, *itertools.accumulate(levels)]
        size = TRIANGLES if of_triangles else BOXES
        self.nodes = wp.empty(starts[-1] * NODE, dtype=dtypes.uint32, device=device)
        self.blocks = wp.empty(blocks * size, dtype=dtypes.uint32, device=device)
        # The first face with a wrong index, and how many primitives are never found.
        self._found = wp.zeros(2, dtype=int, device=device)
        self.view = SimpleNamespace(
            nodes=self.nodes.ptr, blocks=self.blocks.ptr, block_count=blocks,
            order=np.arange(starts[-1]), levels=starts,
        )  # fmt: skip
        self._refit = self._room = None
        for i, number in enumerate(levels):
            is_last = i == len(levels) - 1
            below = blocks if is_last else levels[i + 1]
            inputs = [self.nodes, starts[max(i - 1, 0)], starts[i], starts[i + 1], below, is_last]
            self._launch(_link, number, inputs)

    @property
    def report(self):
        """What is in the hierarchy; waits for its build."""
        return SimpleNamespace(
            skipped=int(self._found.numpy()[1]), nodes=self.nodes.size // NODE,
            blocks=self.view.block_count, bytes=4 * (self.nodes.size + self.blocks.size),
            depth=len(self.view.levels) - 1,
        )  # fmt: skip

    def run(self, slot, first, second) -> None:
        """Builds from points and indices of faces, or from lower and upper corners of boxes.

        slot: words of what the handle leads to, of which the scale of coordinates is written.
        """
        if not self.count:
            return
        if self._refit is None:
            self._refit = Refit(self.view, self.device, self.of_triangles, slot)
        if self._room is None:
            self._room = _Room(self.count, self.view.block_count, self.device)
        room = self._room
        find_extent(first, None if self.of_triangles else second, room.parts, room.whole)
        self._launch(_start, 1, [room.whole, slot, room.cells[0], self._found, self.count])
        see = _see_triangles if self.of_triangles else _see_boxes
        self._launch(see, self.count, [first, second, room.centers, room.order, self._found])
        if self.along_curve:
            sort_along_curve(room.centers, room.whole, room.keys, room.order)
        else:
            halve(room.centers, room.cells, room.keys, room.order, len(self.view.levels) - 1)
        ids = TRIANGLE_IDS if self.of_triangles else BOX_IDS
        inputs = [room.order, self.count, self.blocks, self._refit.block_words, ids]
        self._launch(_place, (self.view.block_count, 8), inputs)
        self.refit(first, second)

    def _launch(self, kernel, dim, inputs):
        wp.launch(kernel, dim, inputs, device=self.device)

    def refit(self, first, second) -> None:
        """Takes over primitives that moved."""
        if self.count:
            self._refit.run(first, second)

    def finish(self, points=None, indices=None) -> None:
        """Waits for the build of something new, and gives back memory.

        Raises:
            RuntimeError: an index of a face is out of range; the message names the face.
        """
        self._room = None
        if not self.of_triangles or not self.count:
            return
        face = int(self._found.numpy()[0])
        if face == self.count:
            return
        corners = indices[3 * face : 3 * face + 3].numpy()
        index = next(i for i in corners if not 0 <= i < len(points))
        raise errors.WarpError(
            f"face {face} has the index {index}, but there are {len(points)} points"
        )


class _Room:
    """Memory while a hierarchy is built."""

    def __init__(self, count, blocks, device):
        def empty(shape, dtype):
            return wp.empty(shape, dtype=dtype, device=device)

        self.keys, self.order = empty(2 * count, dtypes.uint32), empty(2 * count, int)
        self.centers = empty(count, wp.vec3)
        self.cells = [empty((blocks + 1, 2), wp.vec3) for _ in range(2)]
        self.parts, self.whole = empty((PARTS, 2), wp.vec3), empty(2, wp.vec3)
