"""Numbers of nodes - the base of topologies of spaces, and the nodes of sides."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

from warp._src.fem.cells.element import Element
from warp._src.fem.geometry.base import RecordFunctions, per_device
from warp._src.fem.kept import Record


@dataclass(frozen=True)
class TopologyRecord(Record):
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

    def make_functions(self) -> SimpleNamespace:
        """Makes the struct `TopologyArg` and the functions of kernels of a topology.

        All take (element argument, topology argument, element, ...): `element_node_count`,
        `element_node_index(..., node)`, `element_node_sign(..., node)`, which is None if no node
        has a sign, and `element_orientation`. Traces also have `inner_cell_index`,
        `outer_cell_index` and `neighbor_cell_index` (..., node): the cell that has the node, and
        its number there.
        """
        if self.kind == "trace":
            from warp._src.fem.spaces.trace_functions import trace_functions as make
        elif self.kind == "points":
            from warp._src.fem.spaces.point_functions import point_functions as make
        else:
            from warp._src.fem.spaces.topology_functions import topology_functions as make
        return make(self)


class SpaceTopology(RecordFunctions):
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
