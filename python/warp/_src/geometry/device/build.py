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
from warp._src.types import dtypes


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
        self._shape = _native.tree_shape(count, of_triangles)
        # Nodes, blocks, and what was found.
        size = sum(self._shape[2:]) // 4 + 2
        self._memory = wp.empty(size, dtype=dtypes.uint32, device=device)
        self._id = None

    @property
    def nodes(self) -> int:
        """Where nodes are; 0 without any."""
        return self._memory.ptr if self.count else 0

    @property
    def blocks(self) -> int:
        """Where blocks are."""
        return self._memory.ptr + self._shape[2] if self.count else 0

    @functools.cached_property
    def view(self):
        """Where the hierarchy is, as `Moments` reads it."""
        levels, blocks, *_ = self._shape
        starts = [0, *itertools.accumulate(levels)]
        return SimpleNamespace(
            nodes=self.nodes, blocks=self.blocks, block_count=blocks,
            order=np.arange(starts[-1]), levels=starts,
        )  # fmt: skip

    @property
    def report(self):
        """What is in the hierarchy; waits for its build."""
        levels, blocks, *sizes = self._shape
        return SimpleNamespace(
            skipped=self._read()[1] if self.count else 0,
            nodes=sum(levels), blocks=blocks, bytes=sum(sizes), depth=len(levels),
        )  # fmt: skip

    def run(self, id, first, second) -> None:
        """Builds from points and indices of faces, or from lower and upper corners of boxes.

        id: the handle, which gets the scale of coordinates.
        """
        self._id = id
        if self.count:
            given = first, second, self.of_triangles, self.along_curve
            _native.build_tree(*given, self._memory, id)

    def refit(self, first, second) -> None:
        """Takes over primitives that moved."""
        if self.count:
            _native.refit_tree(first, second, self.of_triangles, self._memory, self._id)

    def finish(self, points=None, indices=None) -> None:
        """Waits for the build of something new.

        Raises:
            RuntimeError: an index of a face is out of range; the message names the face.
        """
        if not self.of_triangles or not self.count:
            return
        face, _ = self._read()
        if face == self.count:
            return
        corners = indices[3 * face : 3 * face + 3].numpy()
        index = next(i for i in corners if not 0 <= i < len(points))
        raise errors.WarpError(
            f"face {face} has the index {index}, but there are {len(points)} points"
        )

    def _read(self):
        """The first face with a wrong index, or `count`, and how many are never found."""
        if _native.is_capturing(self.device.index):
            raise errors.WarpError(
                f"cannot read what was built on '{self.device}' while a graph is being captured "
                "on it: make the hierarchy outside"
            )
        return _native.read_tree(self._memory)
