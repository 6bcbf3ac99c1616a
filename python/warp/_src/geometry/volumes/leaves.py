"""The part of `Volume` that gives the values of voxels as an array, which may have gradients."""

from __future__ import annotations

from warp._src import errors
from warp._src.arrays.array import array
from warp._src.derivatives.handles import Behind
from warp._src.geometry.volumes.cells import GRADIENTS
from warp._src.geometry.volumes.contents import DTYPES


class LeafValues(Behind):
    """Values of voxels in leaves."""

    def _published(self):
        """Called when the slot has been written."""
        self._leaf_values = None
        self._enroll()

    def _forget_leaf_values(self):
        """Called before kernels build another grid in the same memory."""
        if self._leaf_values is not None:
            self._point(GRADIENTS, 0)
        self._leaf_values = None

    @property
    def leaf_values(self):
        """The values of voxels in leaves, in the volume's memory.

        An array of shape (n, 512): a row for each tile of `get_tiles`, in it the voxels, z fastest.
        With `leaf_values.requires_grad = True` derivatives of samples and lookups are added to
        `leaf_values.grad`. The result of `rebuild` has values of its own.

        Raises:
            RuntimeError: voxels have numbers instead of values, or values of a type without arrays.
        """
        if self._leaf_values is None:
            self._leaf_values = self._over_leaves()
        return self._leaf_values

    def _over_leaves(self):
        info = self._info
        dtype = DTYPES.get(info.type_name)
        if info.is_index or dtype is None:
            raise errors.WarpError(
                f"voxels of type {info.type_name} have no values that arrays may have"
            )
        made = array(
            ptr=self._data.ptr + info.leaves_at + info.leaf_table,
            dtype=dtype,
            shape=(info.counts[0], 512),
            strides=(info.leaf_size, info.value_size),
            device=self.device,
        )
        made._kept = self._data
        return made

    def _behind(self):
        values = self._leaf_values
        return [(GRADIENTS, values, 0 if values is None else values.ptr)]

    def _tangents(self, tangents, one):
        if tangents.width > 1:
            raise errors.WarpGradientError(
                "voxels of a volume have tangents along one direction at a time",
                hint="pass the tangents one by one",
            )
        return tangents.twin(one)
