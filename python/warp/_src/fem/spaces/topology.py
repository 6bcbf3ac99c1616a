"""Space topology - which nodes of a space the cells and sides of a geometry have."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

import warp as wp
from warp._src.fem.cells.element import Element, ElementBasis
from warp._src.fem.cells.polynomial import is_closed
from warp._src.fem.geometry.base import per_device


@dataclass(frozen=True)
class TopologyRecord:
    """Facts of a topology that its functions of kernels depend on.

    Attributes:
        kind: "discontinuous", "grid" (numbers by arithmetic), "table", "trace" or "points".
        geometry: record of the geometry.
        nodes: the most nodes that an element has.
        step, width: of grids: nodes between cells and nodes of a cell, per axis.
        is_signed: some nodes change their sign with the orientation of their entity.
        is_oriented: basis functions depend on the order of a cell's vertices.
        base: of traces: the record of the topology of cells.
        quadrature: of points: their record.
    """

    kind: str
    geometry: object
    nodes: int
    step: int = 0
    width: int = 0
    is_signed: bool = False
    is_oriented: bool = False
    base: TopologyRecord | None = None
    quadrature: object = None

    @property
    def functions(self) -> SimpleNamespace:
        """Structs and functions of kernels."""
        return topology_functions(self)


@functools.cache
def topology_functions(record: TopologyRecord) -> SimpleNamespace:
    """The struct `TopologyArg` and the functions of kernels of a topology, made once per record.

    All take (element argument, topology argument, element, ...): `element_node_count`,
    `element_node_index(..., node)`, `element_node_sign(..., node)`, which is None if no node has a
    sign, and `element_orientation`. Traces also have `inner_cell_index`, `outer_cell_index` and
    `neighbor_cell_index` (..., node): the cell that has the node, and its number there.
    """
    if record.kind == "trace":
        from warp._src.fem.spaces.trace_functions import trace_functions as make
    elif record.kind == "points":
        from warp._src.fem.spaces.point_functions import point_functions as make
    else:
        from warp._src.fem.spaces.topology_functions import topology_functions as make
    return make(record)


class SpaceTopology:
    """Numbers of the nodes of each element of a geometry.

    Attributes:
        geometry: the geometry.
        record: facts that functions of kernels depend on.
        element: the finite element; None if nodes are points.
        revision: counts the rebuilds.
    """

    element: Element | None = None
    record: TopologyRecord
    revision = 0

    def __init__(self, geometry, record: TopologyRecord, element: Element | None = None):
        self.geometry, self.record, self.element = geometry, record, element

    def __getattr__(self, name):
        if name.startswith("_") or name in ("record", "geometry"):
            raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")
        try:
            return getattr(self.record.functions, name)
        except AttributeError:
            text = f"{type(self).__name__!r} has no attribute {name!r}"
            raise AttributeError(text) from None

    @property
    def functions(self) -> SimpleNamespace:
        """Structs and functions of kernels."""
        return self.record.functions

    @property
    def nodes_per_element(self) -> int:
        """The most nodes that an element has."""
        return self.record.nodes

    @property
    def MAX_NODES_PER_ELEMENT(self) -> int:
        """The most nodes that an element has."""
        return self.record.nodes

    @property
    def ElementArg(self) -> type:
        """Struct of the argument of elements."""
        geometry = self.geometry.functions
        return geometry.SideArg if self.is_trace else geometry.CellArg

    @property
    def dimension(self) -> int:
        """Dimension of the elements in space."""
        return self.geometry.dimension - (1 if self.is_trace else 0)

    @property
    def is_trace(self) -> bool:
        """Elements are sides."""
        return self.record.kind == "trace"

    @property
    def name(self) -> str:
        """Geometry, kind and element in one word."""
        kind = "D" if self.record.kind == "discontinuous" else ""
        element = self.element
        word = f"{element.basis.value}{element.degree}" if element else self.record.kind
        return f"{self.geometry.name}_{kind}{word}"

    def __str__(self) -> str:
        return self.name

    def node_count(self) -> int:
        """Number of nodes."""
        raise NotImplementedError

    def rebuild(self) -> None:
        """Takes over a geometry that was rebuilt."""
        self.__dict__.pop("_per_device", None)
        self.revision += 1

    @per_device
    def topo_arg_value(self, device):
        """Argument of the functions of kernels."""
        arg = self.TopologyArg()
        self.fill_topo_arg(arg, device)
        return arg

    def fill_topo_arg(self, arg, device) -> None:
        """Fills an argument of the functions of kernels."""

    def element_table(self, device=None):
        """Node numbers of each cell, int32 (cells, n), if there is such a table."""
        return None

    def element_node_indices(self, out=None):
        """Node numbers of each element, int32 (elements, n).

        Args:
            out: an array of this shape to fill.

        Raises:
            ValueError: `out` has another shape or type.
        """
        from warp._src.fem.spaces.topology_functions import element_node_indices

        return element_node_indices(self, out)

    def trace(self) -> SpaceTopology:
        """The topology of the sides: the nodes of the inner cell, then of the outer one."""
        return TraceTopology(self)

    def full_space_topology(self) -> SpaceTopology:
        """The topology of the cells."""
        return self

    def __eq__(self, other) -> bool:
        if not isinstance(other, SpaceTopology):
            return NotImplemented
        same = self.geometry is other.geometry and self.record == other.record
        return same and self.element == other.element

    def __hash__(self) -> int:
        return hash((id(self.geometry), self.record))

    def is_derived_from(self, other: SpaceTopology) -> bool:
        """True if this is the other one or its trace."""
        return self == other or (self.is_trace and self.full_space_topology() == other)


class TraceTopology(SpaceTopology):
    """Nodes of the cells on both sides of a side; on the boundary the inner cell counts twice."""

    def __init__(self, base: SpaceTopology):
        inner = base.record
        record = TopologyRecord(
            "trace",
            inner.geometry,
            2 * inner.nodes,
            is_signed=inner.is_signed,
            is_oriented=inner.is_oriented,
            base=inner,
        )
        super().__init__(base.geometry, record, base.element)
        self._base = base
        self.topo_arg_value, self.fill_topo_arg = base.topo_arg_value, base.fill_topo_arg

    @property
    def name(self) -> str:
        """Name of the topology of cells."""
        return f"{self._base.name}_Trace"

    def node_count(self) -> int:
        """Number of nodes of the topology of cells."""
        return self._base.node_count()

    def full_space_topology(self) -> SpaceTopology:
        """The topology of the cells."""
        return self._base

    def trace(self) -> SpaceTopology:
        """This topology."""
        return self


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


class TableTopology(SpaceTopology):
    """Nodes by entity, in a table."""

    def __init__(self, geometry, element: Element):
        layout = element.layout
        signs = {s for _, of in (*layout.edge_turns, *layout.face_turns) for s in of}
        is_signed = -1 in signs or len(layout.side_signs) > 0
        record = TopologyRecord(
            "table",
            geometry.record,
            element.node_count,
            is_signed=is_signed and not _is_aligned(geometry.base),
            is_oriented=element.orientation_count > 1,
        )
        super().__init__(geometry, record, element)
        self._count = None

    def node_count(self) -> int:
        """Number of nodes."""
        if self._count is None:
            self._tables(None)
        return self._count

    def rebuild(self) -> None:
        """Numbers the nodes anew for a geometry that was rebuilt."""
        super().rebuild()
        self._count = None

    @per_device
    def _tables(self, device):
        """Node numbers and signs of each cell."""
        from warp._src.fem.spaces import numbering

        base = self.geometry.base
        cells = base.cell_count()
        entities = base.entities(device)
        environments = 1
        if entities is None:
            environments = base.environment_count()
            cells //= environments
            entities = numbering.grid_entities([int(n) for n in base.res], device)
        else:
            entities = numbering.mesh_entities(entities, self.element.layout)
        nodes, signs, count = numbering.number_nodes(self.element, entities, cells, device)
        if environments > 1:
            local = nodes.numpy()
            moved = np.concatenate([local + env * count for env in range(environments)])
            nodes = wp.array(moved, dtype=wp.int32, device=device)
            signs = wp.array(np.tile(signs.numpy(), (environments, 1)), device=device)
        self._count = count * environments
        return nodes, signs

    def element_table(self, device=None):
        """Node numbers of each cell, int32 (cells, n)."""
        return self._tables(device)[0]

    def fill_topo_arg(self, arg, device) -> None:
        """Fills an argument of the functions of kernels."""
        arg.nodes, signs = self._tables(device)
        if self.record.is_signed:
            arg.signs = signs
        if self.record.is_oriented:
            from warp._src.fem.spaces.orientations import cell_orientations

            arg.orientations = cell_orientations(self.geometry.base, device)


def _is_aligned(base) -> bool:
    """True if entities have the same direction in all their cells."""
    return hasattr(base, "res") or getattr(base, "is_aligned", False)


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
        if not is_grid:
            raise ValueError(f"B-splines need a grid, but got {geo.name!r}")
        if not discontinuous:
            return GridTopology(geo, element)
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
