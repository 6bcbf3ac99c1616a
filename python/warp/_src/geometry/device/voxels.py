"""Grids of NanoVDB that kernels build in the room that was kept for them, so graphs capture it.

The bytes are those of lib/Geometry/Volumes/Build.cpp. Sizes of levels follow from the order of the
points (voxel_order.py); one thread then decides whether there is room, and says where levels are.
"""

from __future__ import annotations

import warp as wp
from warp import _native
from warp._src.geometry.device.refit import words
from warp._src.geometry.device.voxel_nodes import (
    TreeLayout,
    clear,
    count_before,
    decide,
    link,
)
from warp._src.geometry.device.voxel_order import VoxelOrder
from warp._src.geometry.device.voxel_table import TABLE_ROOM, clear_table
from warp._src.geometry.volumes.contents import ON_INDEX

# Elements of the plan of `decide`.
_PLAN = 9


class VoxelTree:
    """A grid on a device with room for others.

    Args:
        recipe: an `allocation.Recipe` with capacities.
        device: where it is.

    Attributes:
        data: its bytes.
        empty: the bytes of a grid without voxels, which it is at first.
    """

    def __init__(self, recipe, device):
        self.recipe, self.device = recipe, device
        self.empty = recipe.native.make_empty()
        layout = _native.grid_layout(recipe.number)
        self.data = wp.empty(recipe.room, dtype=wp.uint8, device=device)
        # At once: a graph that is being captured builds in it, each time it is launched.
        place = self.data.ptr, self.data.device_index
        _native.clear_new_memory(*place, self.data.size)
        _native.write_new_memory(*place, self.empty)
        self._grid = words(self.data.ptr, self.data.size // 4, device)
        self._layout = made = TreeLayout()
        made.root_at, made.root, made.tile = layout.root_at, layout.root, layout.tile
        made.upper, made.upper_table = layout.upper, layout.upper_table
        made.lower, made.lower_table = layout.lower, layout.lower_table
        made.entry, made.leaf, made.leaf_table = layout.entry, layout.leaf, layout.leaf_table
        made.value, made.number = layout.value, recipe.number
        value = recipe.background or bytes(8)
        self._value = wp.empty(len(value) // 4, dtype=wp.uint32, device=device)
        _native.write_new_memory(self._value.ptr, self._value.device_index, value)
        self._plan = wp.zeros(_PLAN, dtype=int, device=device)
        matrix, shift = recipe.transform
        self._matrix, self._shift = wp.mat33d(*matrix.ravel()), wp.vec3d(*shift)
        self._order = None
        room = min(TABLE_ROOM * recipe.capacities[0], 2**31 - 1)
        self._table = wp.empty(room, dtype=wp.uint32, device=device)

    def run(self, slot, points, mask, status) -> None:
        """Builds the grid of points, unless there is no room: then it stays as it is.

        Args:
            slot: words of what the handle leads to.
            points: an array of vec3i in index space, or of vec3 in the world, on this device.
            mask: an int32 array, or None; points with 0 are left out.
            status: a uint32 array for the bits that say why it stays, or None.
        """
        if not len(points):
            # One point that is left out.
            points = wp.zeros(1, dtype=wp.vec3i, device=self.device)
            mask = wp.zeros(1, dtype=int, device=self.device)
        order = self._order
        if order is None or order.count != len(points):
            order = self._order = VoxelOrder(len(points), self.device)
        order.run(points, mask, self.recipe)
        self.write(slot, order, status)

    def write(self, slot, order, status=None) -> None:
        """The part of `run` that comes after the order of the points."""
        plan, layout, grid = self._plan, self._layout, self._grid
        given = [order.ends, order.found, order.bounds, wp.vec4i(*self._room()), layout]
        place = [self._matrix, self._shift, wp.uint64(self.data.ptr), wp.uint64(self._table.ptr)]
        self._launch(decide, 1, [*given, *place, plan, status, grid, slot])
        rest = grid.size - (layout.root_at + layout.root) // 4
        self._launch(clear, rest, [plan, layout, self._value, grid])
        self._launch(clear_table, self._table.size, [plan, self._table])
        given = [plan, layout, order.order, order.voxels, order.ends, order.bounds]
        given += [self._table, grid]
        self._launch(link, order.count, given)
        if layout.number == ON_INDEX:
            self._launch(count_before, self.recipe.capacities[0], [plan, layout, grid])

    def _room(self):
        return [min(count, 2**31 - 1) for count in self.recipe.capacities]

    def _launch(self, kernel, dim, inputs):
        wp.launch(kernel, dim, inputs=inputs, device=self.device)
