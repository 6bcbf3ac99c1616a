"""Trees that kernels have built on a GPU: nodes and blocks in memory of the package."""

from __future__ import annotations

import functools
import itertools
from types import SimpleNamespace

import numpy as np

import warp as wp
from warp._src import errors
from warp._src.geometry.device.refit import BOXES, NODE, TRIANGLES
from warp._src.types import dtypes


class Built:
    """A tree that kernels have built: a subclass has `run`, `refit` and `_read`.

    Args:
        count: how many primitives there are.
        device: where they are.
        of_triangles: whether they are triangles, else boxes.
        levels: how many nodes each level has room for, the root's first.
        blocks: how many blocks there is room for.
        others: words of memory for anything else.

    Attributes:
        view: where the hierarchy is, as `Moments` and `Refit` read it.
        groups: where numbers of groups and their nodes are; 0 without.
    """

    groups = 0
    # The result of `_read`, if a first build has it already.
    _first_found = None

    def __init__(self, count, device, of_triangles, levels, blocks, others=0):
        self.count, self.device, self.of_triangles = count, device, of_triangles
        self._levels, self._blocks = levels, blocks
        self._node_words = NODE * sum(levels)
        self._block_words = (TRIANGLES if of_triangles else BOXES) * blocks
        size = self._node_words + self._block_words + others
        self._memory = wp.empty(size, dtype=dtypes.uint32, device=device)

    @property
    def memory(self) -> tuple:
        """Addresses of nodes and blocks, each with its bytes, and of groups; 0 without any."""
        nodes = self._memory.ptr if self.count else 0
        blocks = nodes + 4 * self._node_words
        return nodes, 4 * self._node_words, blocks, 4 * self._block_words, self.groups

    @functools.cached_property
    def view(self):
        starts = [0, *itertools.accumulate(self._levels)]
        nodes, _, blocks, *_ = self.memory
        return SimpleNamespace(
            nodes=nodes, blocks=blocks, block_count=self._blocks,
            order=np.arange(starts[-1]), levels=starts,
        )  # fmt: skip

    @property
    def report(self):
        """The primitives of the hierarchy; waits for its build."""
        return SimpleNamespace(
            skipped=self._found()[1] if self.count else 0,
            nodes=sum(self._levels), blocks=self._blocks,
            bytes=4 * (self._node_words + self._block_words), depth=len(self._levels),
        )  # fmt: skip

    def finish(self, points=None, indices=None) -> None:
        """Waits until the primitives of something new have been seen.

        Raises:
            RuntimeError: an index of a face is out of range; the message names the face.
        """
        if not self.of_triangles or not self.count:
            return
        face, _ = self._first_found or self._found()
        if face == self.count:
            return
        corners = indices[3 * face : 3 * face + 3].numpy()
        index = next(i for i in corners if not 0 <= i < len(points))
        raise errors.WarpError(
            f"face {face} has the index {index}, but there are {len(points)} points"
        )

    def _found(self):
        """The first face with a wrong index, or `count`, and how many are never found."""
        if self.device.is_capturing:
            raise errors.WarpError(
                f"cannot read what was built on '{self.device}' while a graph is being captured "
                "on it: make the hierarchy outside"
            )
        return self._read()
