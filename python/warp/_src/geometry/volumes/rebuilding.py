"""The part of `Volume` that makes its grid again, of other points."""

from __future__ import annotations

from typing import NamedTuple

from warp._src import errors
from warp._src.argument_kinds import ARRAY
from warp._src.arguments import checked
from warp._src.geometry.volumes import allocation
from warp._src.geometry.volumes.points import arrays_on, given


class Rebuildable:
    """A grid that can be made again, in the room that was kept when it was allocated."""

    REBUILD_SUCCESS = 0
    REBUILD_LEAF_CAPACITY_EXCEEDED = allocation.LEAF_CAPACITY
    REBUILD_LOWER_CAPACITY_EXCEEDED = allocation.LOWER_CAPACITY
    REBUILD_UPPER_CAPACITY_EXCEEDED = allocation.UPPER_CAPACITY
    REBUILD_VOXEL_CAPACITY_EXCEEDED = allocation.VOXEL_CAPACITY
    REBUILD_INVALID_INPUT = 16

    class RebuildInfo(NamedTuple):
        """Room for `rebuild`; `kind` is "tiles", "voxels", or None where there is none."""

        kind: str | None
        max_voxel_count: int
        max_leaf_node_count: int
        max_lower_node_count: int
        max_upper_node_count: int

    _recipe = None

    @property
    def is_rebuildable(self) -> bool:
        """True if there is room for `rebuild`."""
        return self._recipe is not None

    def get_rebuild_info(self) -> RebuildInfo:
        """The room that is kept for `rebuild`."""
        if self._recipe is None:
            return self.RebuildInfo(None, 0, 0, 0, 0)
        leaves, lowers, uppers, voxels = self._recipe.capacities
        return self.RebuildInfo(self._recipe.kind, voxels, leaves, lowers, uppers)

    @checked(points=ARRAY, status=ARRAY, point_mask=ARRAY)
    def rebuild(self, points, status=None, point_mask=None):
        """Makes the grid again of other points; `id`, type, background and transform stay.

        Points need what the volume was allocated with: tiles or voxels. If there is no room for
        them the grid stays as it is, and `status` gets the bits that say why. On a GPU kernels do
        it, unless the room is more than a gigabyte; a graph captures a rebuild with as many points
        as one before it. There, points beyond index space are such a status, not an error.

        Raises:
            RuntimeError: the volume is not rebuildable, or an array is of another type or device.
        """
        if self._recipe is None:
            raise errors.WarpError(
                "the volume is not rebuildable: allocate it with rebuildable=True"
            )
        if status is not None:
            allocation.check_status(status, self.device)
        if self._built is not None:
            from warp._src.geometry.device.refit import slot_of

            points, point_mask = arrays_on(self.device, points, point_mask, "points")
            self._forget_leaf_values()
            self._built.run(slot_of(self.id, self.device), points, point_mask, status)
            return status
        recipe = self._recipe
        problem = self._native.rebuild(recipe.native, *given(points, point_mask), recipe.capacities)
        if not problem:
            self._published()
        if status is not None:
            status.fill_(problem)
        return status
