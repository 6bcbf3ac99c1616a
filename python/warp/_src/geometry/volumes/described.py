"""The header of a volume's grid."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from warp._src import errors
from warp._src.argument_kinds import ARRAY, COUNT
from warp._src.arguments import checked
from warp._src.arrays.array import array
from warp._src.geometry.volumes import contents, points
from warp._src.types import dtypes


class GridContents:
    """Counts, coordinates and arrays of a volume's grid; the part of `Volume` that only reads."""

    # The builder of the grid on the device, in room for larger ones; None if the host builds it.
    _built = None

    @property
    def _info(self):
        """The header of the grid; waits for kernels that build it."""
        if self._built is not None:
            self._native.refresh()
        return self._native.info

    def array(self):
        """The bytes of the grid, and of those behind it, without a copy."""
        return self._data if self._built is None else self._data[: self._info.size]

    GridInfo = contents.GridInfo
    FeatureArrayInfo = contents.FeatureArrayInfo

    class ActiveStats(NamedTuple):
        """The present header of the grid."""

        voxel_count: int
        leaf_node_count: int
        lower_node_count: int
        upper_node_count: int

    def get_tile_count(self) -> int:
        """Number of leaves: of 8^3 voxels; of a volume that can be rebuilt, room for them."""
        return (self._recipe.capacities if self._recipe else self._info.counts)[0]

    def get_voxel_count(self) -> int:
        """How many voxels have a number; of a volume that can be rebuilt, room for them."""
        return (self._recipe.capacities if self._recipe else self._info.counts)[3]

    def get_active_stats(self) -> ActiveStats:
        """Counts of the grid as it is now."""
        leaves, lowers, uppers, voxels = self._info.counts
        return self.ActiveStats(voxels, leaves, lowers, uppers)

    @checked(out=ARRAY)
    def get_tiles(self, out=None):
        """Coordinates of the lowest voxel of each tile, an int32 array of shape (n, 3).

        Where there is room for more tiles than there are, rows of `out` beyond them stay as they
        are; those of a new array are zero.

        Raises:
            RuntimeError: `out` is too small, or not int32 of that shape on this device.
        """
        return self._give(self._native.tiles_into, 0, self.get_tile_count(), out)

    @checked(out=ARRAY)
    def get_voxels(self, out=None):
        """Coordinates of the voxels in the order of their numbers, an int32 array (n, 3).

        Raises:
            RuntimeError: as `get_tiles`.
        """
        count = min(self.get_voxel_count(), 512 * self.get_tile_count())
        return self._give(self._native.voxels_into, 3, count, out)

    def _give(self, write, which, count, out):
        """Rows that a native function writes; `which` of the grid's counts is theirs."""
        if out is not None:
            self._check_rows(out, count)
        has = min(self._info.counts[which], count)
        rows = np.zeros((count if out is None else has, 3), dtype=np.int32)
        has = write(rows)
        if out is None:
            return array(rows, dtype=dtypes.int32, device=self.device)
        if has:
            out[:has].assign(array(rows[:has], dtype=out.dtype, device=self.device))
        return out

    def _check_rows(self, out, count):
        if not dtypes.is_array(out) or not points.is_threes(out, dtypes.int32):
            raise errors.WarpError("'out' is an array of vec3i, or of int32 and of shape (n, 3)")
        if out.device != self.device or out.shape[0] < count or not out.is_contiguous:
            raise errors.WarpError(f"'out' has at least {count} packed rows on '{self.device}'")
        if dtypes.type_scalar_type(out.dtype) is not dtypes.int32:
            raise errors.WarpError("'out' is of int32")

    def get_voxel_size(self) -> tuple[float, float, float]:
        """Edges of a voxel in the world; of a turned grid, where a step along all axes leads."""
        return tuple(float(np.float32(edge)) for edge in self._info.voxel_size)

    def _repr_html_(self):
        from warp._src.notebooks import volume_html

        return volume_html(self)

    def get_grid_info(self) -> GridInfo:
        """The header of the grid."""
        return contents.info_of(self._info)

    @property
    def dtype(self):
        """Type of the values; None if voxels have numbers instead."""
        return contents.DTYPES.get(self._native.info.type_name)

    @property
    def is_index(self) -> bool:
        """True if voxels have numbers, which stand for elements of any array."""
        return self._native.info.is_index

    def get_feature_array_count(self) -> int:
        """Number of arrays that are stored beside the grid."""
        return self._info.features

    @checked(feature_index=COUNT)
    def get_feature_array_info(self, feature_index) -> FeatureArrayInfo:
        """About an array beside the grid.

        Raises:
            RuntimeError: there is none of that number.
        """
        found = self._native.feature(feature_index)
        address = self._data.ptr + found.at
        return self.FeatureArrayInfo(found.name, address, found.value_size, found.count, found.type)

    @checked(feature_index=COUNT)
    def feature_array(self, feature_index, dtype=None):
        """An array beside the grid, without a copy; bytes if its type is not known.

        Raises:
            RuntimeError: there is none of that number, or its values are of another size.
        """
        info = self.get_feature_array_info(feature_index)
        dtype = dtype or contents.DTYPES.get(info.type_str, dtypes.uint8)
        size, total = dtypes.type_size_in_bytes(dtype), info.value_count * info.value_size
        if size != info.value_size and not (
            size == 1 or (info.value_size == 1 and not total % size)
        ):
            raise errors.WarpError(
                f"values of {info.value_size} bytes are no elements of {dtypes.type_repr(dtype)}"
            )
        made = array(ptr=info.ptr, dtype=dtype, shape=total // size, device=self.device)
        made._kept = self
        return made
