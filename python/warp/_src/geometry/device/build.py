"""Hierarchies that kernels of the runtime build on a GPU, without the host, so graphs capture it.

Primitives are put in an order: eight that follow each other share a block, eight blocks a node,
eight nodes the next. Where nodes are and which children they have depends on the number of
primitives alone, so building is ordering (lib/DeviceLib/cuda/TreeOrder.cpp): by halves, or along a
Hilbert curve, which is quicker to build, but queries take up to twice as long. Trees with groups
are built by kernels of the package (groups.py).
"""

from __future__ import annotations

from warp import _native
from warp._src.geometry.device.built import Built


class Build(Built):
    """A hierarchy without groups.

    Args:
        along_curve: whether primitives are ordered along a curve, else by halves.
    """

    def __init__(self, count, device, of_triangles, along_curve=False):
        levels, blocks = _native.tree_shape(count)
        # Behind nodes and blocks is what was found.
        super().__init__(count, device, of_triangles, levels, blocks, others=2)
        self.along_curve = along_curve
        self._id = None

    def run(self, id, first, second) -> None:
        """Builds from points and indices of faces, or from lower and upper corners of boxes.

        id: the handle, which gets the scale of coordinates.
        """
        reads = self._id is None and self.of_triangles
        self._id = id
        if self.count:
            given = first, second, self.of_triangles, self.along_curve
            self._first_found = _native.build_tree(*given, self._memory, id, reads)

    def refit(self, first, second) -> None:
        """Takes over primitives that moved."""
        if self.count:
            _native.refit_tree(first, second, self.of_triangles, self._memory, self._id)

    def _read(self):
        return _native.read_tree(self._memory)


def build_of(last, constructor, first, second, groups, of_triangles) -> Built:
    """The hierarchy to build in: the last one if it fits, or a new one.

    Args:
        last: a `Built` or None.
        constructor: as of `Bvh`.
        first, second: points and indices of faces, or lower and upper corners of boxes.
        groups: a number for each, or None.
        of_triangles: which of both they are.

    Raises:
        RuntimeError: a graph is being captured, and there was no hierarchy with groups before.
    """
    count = len(second) // 3 if of_triangles else len(second)
    if groups is not None and count:
        from warp._src.geometry.device.groups import grouped_build_of

        return grouped_build_of(last, first, second, groups, of_triangles)
    along_curve = constructor == "lbvh"
    if isinstance(last, Build) and (last.count, last.along_curve) == (count, along_curve):
        return last
    return Build(count, first.device, of_triangles, along_curve)
