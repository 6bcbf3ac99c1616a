"""Hierarchies that kernels of the runtime build on a GPU, without the host, so graphs capture it.

Primitives are put in an order: eight that follow each other share a block, eight blocks a node,
eight nodes the next. Where nodes are and which children they have depends on the number of
primitives alone, so building is ordering (lib/DeviceLib/cuda/TreeOrder.cpp): by halves, or along a
Hilbert curve, which is quicker to build, but queries take up to twice as long.
"""

from __future__ import annotations

import functools
import itertools
from types import SimpleNamespace

import numpy as np

import warp as wp
from warp import _native
from warp._src import errors
from warp._src.geometry.device.refit import BOXES, NODE, TRIANGLES
from warp._src.types import dtypes


def _shape(count):
    """Numbers of nodes on the levels, the root first, and of blocks, for so many primitives."""
    blocks = -(-count // 8)
    levels = [-(-blocks // 8)] if count else []
    while levels and levels[0] > 1:
        levels.insert(0, -(-levels[0] // 8))
    return levels, blocks


class Build:
    """A hierarchy on a GPU, for a number of triangles or boxes.

    Args:
        count: how many primitives there are.
        device: where they are.
        of_triangles: whether they are triangles, else boxes.
        along_curve: whether they are ordered along a curve, else by halves.
    """

    def __init__(self, count, device, of_triangles, along_curve=False):
        self.count, self.device, self.of_triangles = count, device, of_triangles
        self.along_curve = along_curve
        levels, self._block_count = _shape(count)
        self._levels = [0, *itertools.accumulate(levels)]
        size = TRIANGLES if of_triangles else BOXES
        self.nodes = wp.empty(self._levels[-1] * NODE, dtype=dtypes.uint32, device=device)
        self.blocks = wp.empty(self._block_count * size, dtype=dtypes.uint32, device=device)
        # The first face with a wrong index, and how many primitives are never found.
        self._found = wp.empty(2, dtype=int, device=device)
        self._slot = None

    @functools.cached_property
    def view(self):
        """Where the hierarchy is, as `Moments` reads it."""
        return SimpleNamespace(
            nodes=self.nodes.ptr, blocks=self.blocks.ptr, block_count=self._block_count,
            order=np.arange(self._levels[-1]), levels=self._levels,
        )  # fmt: skip

    @property
    def report(self):
        """What is in the hierarchy; waits for its build."""
        return SimpleNamespace(
            skipped=int(self._found.numpy()[1]) if self.count else 0,
            nodes=self._levels[-1], blocks=self._block_count,
            bytes=4 * (self.nodes.size + self.blocks.size), depth=len(self._levels) - 1,
        )  # fmt: skip

    def run(self, slot, first, second) -> None:
        """Builds from points and indices of faces, or from lower and upper corners of boxes.

        slot: words of what the handle leads to, of which the scale of coordinates is written.
        """
        self._slot = slot
        if self.count:
            given = first, second, self.of_triangles, self.along_curve
            _native.build_tree(*given, self.nodes, self.blocks, slot, self._found)

    def refit(self, first, second) -> None:
        """Takes over primitives that moved."""
        if self.count:
            given = first, second, self.of_triangles
            _native.refit_tree(*given, self.nodes, self.blocks, self._slot, self._found)

    def finish(self, points=None, indices=None) -> None:
        """Waits for the build of something new.

        Raises:
            RuntimeError: an index of a face is out of range; the message names the face.
        """
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
