"""`HashGrid`: the neighbours of points."""

from __future__ import annotations

import operator

from warp import _native
from warp._src import errors
from warp._src.argument_kinds import ARRAY, COUNT, INTEGER, POSITIVE
from warp._src.arguments import checked
from warp._src.devices import devices
from warp._src.geometry.bvh import check_groups
from warp._src.types import dtypes
from warp._src.types.scalars import float16, float32, float64

_POINTS = {float16: dtypes.vec3h, float32: dtypes.vec3f, float64: dtypes.vec3d}


class HashGrid:
    """Points sorted into the cells of a periodic grid, whose neighbours kernels find by its `id`.

    Args:
        dim_x, dim_y, dim_z: cells along the axes, fewer than 2^31 together. Points outside are
            found as if the grid repeated itself.
        device: where the points and the kernels are.
        dtype: numbers of the points: float16, float32 (the default) or float64.

    Attributes:
        id: what kernels get, as `wp.uint64`.
        skipped: points of the last build that are NaN and in no cell.

    Raises:
        TypeError: a number of cells is no integer, or `dtype` none of the three.
        RuntimeError: a number of cells is not positive, or there are too many.

    Example:
        >>> import warp as wp
        >>> grid = wp.HashGrid(64, 64, 64, device="cpu")
        >>> grid.build(wp.zeros(100, dtype=wp.vec3, device="cpu"), radius=0.1)
    """

    @checked(dim_x=INTEGER, dim_y=INTEGER, dim_z=INTEGER)
    def __init__(self, dim_x, dim_y, dim_z, device=None, dtype=None):
        dtype = float32 if dtype is None else dtypes.canonical(dtype)
        if dtype not in _POINTS:
            raise TypeError(f"a HashGrid is of float16, float32 or float64, but got {dtype}")
        try:
            cells = [operator.index(count) for count in (dim_x, dim_y, dim_z)]
        except TypeError:
            raise TypeError("a HashGrid has integer numbers of cells") from None
        if min(cells) <= 0:
            raise errors.WarpError(
                f"a HashGrid has at least one cell along each axis, but got {cells}"
            )
        if cells[0] * cells[1] * cells[2] >= 2**31:
            raise errors.WarpError(
                "the cell count exceeds supported limit: a HashGrid has fewer than 2^31 cells, "
                f"but got {' * '.join(map(str, cells))}"
            )
        self._device = devices.get_device(device)
        self._cells, self.dtype = cells, dtype
        if self.device.is_cpu:
            self._native = _native.HashGrid(*cells)
        else:
            from warp._src.geometry.device.grid import DeviceGrid

            self._native = DeviceGrid(cells, self.device)
        self.id = self._native.id
        self.reserved = False

    def __reduce__(self):
        # A grid has no points until the program gives it some.
        return _made_anew, (self._cells, str(self.device), self.dtype)

    @property
    def device(self):
        """The device of the points and the kernels."""
        return self._device

    @property
    def skipped(self) -> int:
        """Points of the last build that are NaN, and in no cell."""
        return self._native.skipped

    @checked(points=ARRAY, radius=POSITIVE, groups=ARRAY)
    def build(self, points, radius, groups=None):
        """Sorts points into cells, in place of those of the last build.

        Args:
            points: an array of vec3h, vec3f or vec3d, as the grid's `dtype` says, of any rank.
            radius: edge length of a cell, best that of the queries.
            groups: array of int32, a number for each point, which `hash_grid_query` may ask for;
                it is kept and may be changed.

        On a GPU the grid is built by kernels. A graph may capture a build of as many points, with
        the same radius, as one before it.

        Raises:
            TypeError: elements are of another type.
            ValueError: the radius is not positive.
            RuntimeError: the points are on another device.
        """
        wanted = _POINTS[self.dtype]
        if not dtypes.is_array(points) or not dtypes.types_equal(points.dtype, wanted):
            given = points.dtype if dtypes.is_array(points) else type(points)
            raise TypeError(
                f"a HashGrid of {self.dtype.__name__} has points of {wanted.__name__}, "
                f"but got {dtypes.type_repr(given)}"
            )
        if not (radius > 0 and radius < float("inf")):
            raise ValueError(f"a HashGrid has cells of a positive radius, but got {radius}")
        if points.device != self.device:
            raise errors.WarpError(
                f"the points are on '{points.device}', but the HashGrid is on '{self.device}'"
            )
        if dtypes.is_array(groups) and groups.ndim > 1:
            groups = groups.contiguous().flatten()
        check_groups(groups, points)
        if groups is not None and groups.size != points.size:
            raise errors.WarpError(f"there are {points.size} points, but {groups.size} groups")
        if points.ndim > 1:
            points = points.contiguous().flatten()
        size = {float16: 2, float32: 4, float64: 8}[self.dtype]
        self._native.build(points, size, float(radius), groups)
        self._groups = groups
        self.reserved = True

    @checked(num_points=COUNT)
    def reserve(self, num_points, with_groups=False):
        """Makes room for a number of points before they are built.

        Raises:
            ValueError: the number is negative.
        """
        if num_points < 0:
            raise ValueError(f"expects a number of points, but got {num_points}")
        self._native.reserve(int(num_points))
        self.reserved = True


def _made_anew(cells, device, dtype):
    """An empty grid on a device, or on the current one if that is not here."""
    return HashGrid(*cells, device=devices.present(device), dtype=dtype)
