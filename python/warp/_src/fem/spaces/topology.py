"""Space topology - which nodes of a space the cells and sides of a geometry have."""

from __future__ import annotations

import numpy as np

from warp._src.fem.cells.element import Element, ElementBasis
from warp._src.fem.cells.polynomial import is_closed
from warp._src.fem.spaces.tables import SparseSplineTopology, TableTopology
from warp._src.fem.spaces.topologies import SpaceTopology, TopologyRecord


class DiscontinuousTopology(SpaceTopology):
    """Each cell has nodes of its own."""

    def __init__(self, geometry, element: Element):
        record = TopologyRecord("discontinuous", geometry.record, element.node_count)
        super().__init__(geometry, record, element)

    def node_count(self) -> int:
        """Number of nodes."""
        return self.geometry.cell_count() * self.record.nodes


class GridTopology(SpaceTopology):
    """Nodes of a regular grid, the last axis fastest, environment by environment."""

    def __init__(self, geometry, element: Element):
        is_spline = element.basis is ElementBasis.BSPLINE
        width = 2 * (element.degree // 2) + 2 if is_spline else element.degree + 1
        step = 1 if is_spline else element.degree
        record = TopologyRecord("grid", geometry.record, element.node_count, step, width)
        super().__init__(geometry, record, element)
        self._res = [int(n) for n in geometry.base.res]
        self._shape = [n * step + width - step for n in self._res]
        if self.node_count() >= 2**31:
            raise ValueError(f"expects fewer than 2^31 nodes, but {self.name} has more")

    def node_count(self) -> int:
        """Number of nodes."""
        return self.geometry.environment_count() * int(np.prod(self._shape, dtype=np.int64))

    def fill_topo_arg(self, arg, device) -> None:
        """Fills an argument of the functions of kernels."""
        strides = np.cumprod([1, *self._shape[:0:-1]])[::-1]
        arg.res = self._res
        arg.strides = [int(n) for n in strides]
        arg.cells = int(np.prod(self._res))
        arg.nodes = int(np.prod(self._shape))

    def node_grid(self):
        """Coordinates of the nodes of one environment, as `numpy.meshgrid` gives them."""
        element, base = self.element, self.geometry.base
        record, axes = self.record, []
        if element.basis is ElementBasis.BSPLINE:
            steps = [np.arange(n) - float(record.width // 2 - 1) for n in self._shape]
        else:
            inside = element.node_coords[: record.width, element.cell.dimension - 1][:-1]
            steps = [
                np.append((np.arange(n)[:, None] + inside).ravel(), float(n)) for n in self._res
            ]
        for axis, step in enumerate(steps):
            axes.append(step * base.cell_size[axis] + base.origin[axis])
        return np.meshgrid(*axes, indexing="ij")


def make_element_based_space_topology(geo, shape, discontinuous: bool = False) -> SpaceTopology:
    """The topology of an element on a geometry.

    Args:
        geo: the geometry.
        shape: the element, see `make_element_shape_function`.
        discontinuous: cells share no nodes.

    Returns:
        The topology; equal arguments give the same object.

    Raises:
        ValueError: the element is one of another cell, or cannot be continuous.
    """
    element = shape.element if hasattr(shape, "element") else shape
    known = geo.__dict__.setdefault("_topologies", {})
    key = (element, bool(discontinuous))
    if key not in known:
        known[key] = _make_topology(geo, element, discontinuous)
    return known[key]


def _make_topology(geo, element, discontinuous) -> SpaceTopology:
    if element.cell != geo.cell:
        raise ValueError(f"element {element!r} is none of the cells of {geo.name!r}: {geo.cell}")
    is_grid = hasattr(geo.base, "res")
    if element.basis is ElementBasis.BSPLINE and element.degree > 0:
        if not is_grid and not hasattr(geo.base, "cell_grid"):
            raise ValueError(f"B-splines need a grid, but got {geo.name!r}")
        if not discontinuous:
            return GridTopology(geo, element) if is_grid else SparseSplineTopology(geo, element)
    if discontinuous or element.degree == 0:
        return DiscontinuousTopology(geo, element)
    if not element.is_continuous:
        raise ValueError(
            f"nodes of {element.variant.name} do not lie on sides; choose a closed family, or "
            "'discontinuous=True'"
        )
    if is_grid and element.basis is ElementBasis.LAGRANGE and is_closed(element.variant):
        return GridTopology(geo, element)
    return TableTopology(geo, element)
