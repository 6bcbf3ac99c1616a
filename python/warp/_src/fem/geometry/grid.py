"""Regular grids - cells and sides by arithmetic, without tables."""

from __future__ import annotations

import math

import numpy as np

import warp as wp
from warp._src.fem.geometry.base import MAKERS, Geometry, GeometryRecord, checked_scalar
from warp._src.fem.geometry.grid_functions import grid_functions

MAKERS.update(Grid2D=grid_functions, Grid3D=grid_functions)


def _extents(name: str, values, default, dimension: int) -> np.ndarray:
    if values is None:
        return np.full(dimension, default)
    values = np.array([float(v) for v in values])
    if values.shape != (dimension,) or not np.isfinite(values).all():
        raise ValueError(f"'{name}' expects {dimension} finite numbers, but got {values.tolist()}")
    return values


@wp.func
def cell_of_square_grid(res: wp.vec2i, cell_index: int):
    """Numbers of a cell along each axis."""
    return wp.vec2i(cell_index // res[1], cell_index % res[1])


@wp.func
def cell_of_cube_grid(res: wp.vec3i, cell_index: int):
    """Numbers of a cell along each axis."""
    layer = res[1] * res[2]
    rest = cell_index % layer
    return wp.vec3i(cell_index // layer, rest // res[2], rest % res[2])


class _Grid(Geometry):
    """Grid of equal boxes, numbered with the last axis fastest."""

    _axes = 0

    def __init__(
        self, res, bounds_lo=None, bounds_hi=None, scalar_type: type = wp.float32, env_count=1
    ):
        d = self._axes
        self.res = wp.types.vector(d, wp.int32)(*(int(n) for n in res))
        if min(self.res) < 1:
            raise ValueError(f"'res' expects at least 1 cell per axis, but got {tuple(self.res)}")
        if env_count < 1:
            raise ValueError(f"'env_count' expects at least 1, but got {env_count}")
        vector = wp.types.vector(d, checked_scalar(scalar_type))
        # Bounds count as rounded, so that the size of a cell is that between them.
        self.bounds_lo = vector(*_extents("bounds_lo", bounds_lo, 0.0, d))
        self.bounds_hi = vector(*_extents("bounds_hi", bounds_hi, 1.0, d))
        extents = np.array(self.bounds_hi, float) - np.array(self.bounds_lo, float)
        if not (extents > 0.0).all():
            raise ValueError(
                f"'bounds_hi' expects numbers above those of 'bounds_lo' {tuple(self.bounds_lo)}, "
                f"but got {tuple(self.bounds_hi)}"
            )
        self.extents = vector(*extents)
        self.cell_size = vector(*(extents / np.array(self.res)))
        self._environments = int(env_count)
        if self.side_count() >= 2**31:
            raise ValueError(f"'res' expects below 2^31 sides, but {tuple(self.res)} has more")
        cell = "square" if d == 2 else "cube"
        self.record = GeometryRecord(
            type(self).__name__, cell, d, scalar_type, environments=env_count > 1
        )

    @property
    def origin(self):
        """Lower corner."""
        return self.bounds_lo

    @property
    def strides(self):
        """Distance in cell numbers of neighbours along each axis."""
        n = [math.prod(self.res[k + 1 :]) for k in range(self._axes)]
        return wp.types.vector(self._axes, wp.int32)(*n)

    def _across(self) -> list[int]:
        """Number of cells of a layer across each axis."""
        n = list(self.res)
        return [math.prod(n[:k] + n[k + 1 :]) for k in range(self._axes)]

    def cell_count(self) -> int:
        """Number of cells."""
        return self._environments * math.prod(self.res)

    def vertex_count(self) -> int:
        """Number of vertices."""
        return self._environments * math.prod(n + 1 for n in self.res)

    def side_count(self) -> int:
        """Number of sides."""
        cells = self._axes * math.prod(self.res)
        return self._environments * (cells + sum(self._across()))

    def edge_count(self) -> int:
        """Number of edges."""
        n = list(self.res)
        along = [n[k] * math.prod(m + 1 for m in n[:k] + n[k + 1 :]) for k in range(self._axes)]
        return self._environments * sum(along)

    def boundary_side_count(self) -> int:
        """Number of sides with one cell."""
        return self._environments * 2 * sum(self._across())

    def fill_cell_arg(self, arg, device) -> None:
        """Fills an argument of the functions of cells."""
        arg.res = self.res
        arg.cell_size = self.cell_size
        arg.origin = self.bounds_lo

    def fill_side_arg(self, arg, device) -> None:
        """Fills an argument of the functions of sides."""
        self.fill_cell_arg(arg.cell_arg, device)
        across = self._across()
        arg.axis_offsets = [sum(across[:k]) for k in range(self._axes)]
        arg.cell_count = math.prod(self.res)


class Grid2D(_Grid):
    """Grid of equal rectangles.

    Args:
        res: number of cells per axis.
        bounds_lo: lower corner; zeros if None.
        bounds_hi: upper corner; ones if None.
        scalar_type: `wp.float32` or `wp.float64`.
        env_count: number of copies at one place that share no side and no node.

    Raises:
        ValueError: a resolution below 1, bounds that are not finite or in the wrong order.

    Example:
        >>> import warp as wp
        >>> from warp._src.fem.geometry.grid import Grid2D
        >>> Grid2D(wp.vec2i(4, 3)).side_count()
        31
    """

    _axes = 2
    get_cell = cell_of_square_grid


class Grid3D(_Grid):
    """Grid of equal boxes.

    Args:
        res: number of cells per axis.
        bounds_lo: lower corner; zeros if None.
        bounds_hi: upper corner; ones if None.
        scalar_type: `wp.float32` or `wp.float64`.
        env_count: number of copies at one place that share no side and no node.

    Raises:
        ValueError: a resolution below 1, bounds that are not finite or in the wrong order.
    """

    _axes = 3
    get_cell = cell_of_cube_grid
