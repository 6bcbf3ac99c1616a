"""The part of `Volume` that gives the values of voxels as an array, which may have gradients."""

from __future__ import annotations

from warp._src import errors
from warp._src.arrays.array import array
from warp._src.derivatives.handles import Behind
from warp._src.geometry.volumes.cells import GRADIENTS
from warp._src.geometry.volumes.contents import DTYPES
from warp._src.geometry.volumes.layout import HEADER, TYPES


class LeafValues(Behind):
    """Values of voxels in leaves."""

    def _published(self, nodes):
        """Called when the slot has been written, for the levels of a grid."""
        self._leaf_values = None
        self._layout = nodes.layout
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
        `leaf_values.grad`. What `rebuild` makes has values of its own.

        Raises:
            RuntimeError: voxels have numbers instead of values, or values of a type without arrays.
        """
        if self._leaf_values is None:
            self._leaf_values = self._over_leaves()
        return self._leaf_values

    def _over_leaves(self):
        name, *_ = TYPES[self._layout.number]
        dtype = DTYPES.get(name)
        if self._layout.is_index or dtype is None:
            raise errors.WarpError(f"voxels of type {name} have no values that arrays may have")
        tree = self._tree
        leaves_at = HEADER.itemsize + int(tree["offsets"][0])
        made = array(
            ptr=self._data.ptr + leaves_at + self._layout.leaf_table,
            dtype=dtype,
            shape=(int(tree["counts"][0]), 512),
            strides=(self._layout.leaf, self._layout.value),
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
