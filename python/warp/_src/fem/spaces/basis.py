"""Basis spaces - basis functions of the nodes of a topology."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from types import SimpleNamespace

import warp as wp
from warp import extend
from warp._src.fem.cells.cell import Cell
from warp._src.fem.cells.element import Element
from warp._src.fem.geometry.shapes import cell_of
from warp._src.fem.kept import Record
from warp._src.fem.spaces.topologies import SpaceTopology, TopologyRecord


@dataclass(frozen=True)
class BasisRecord(Record):
    """Facts of a basis that its functions of kernels depend on.

    Attributes:
        topology: record of the topology.
        element: the finite element; None if nodes are points.
        base: of traces: the record of the basis of cells.
    """

    topology: TopologyRecord
    element: Element | None = None
    base: BasisRecord | None = None

    @property
    def cell(self) -> Cell:
        """Reference cell of the geometry."""
        return cell_of(self.topology.geometry.cell)

    def make_functions(self) -> SimpleNamespace:
        """Makes functions of kernels, all of (element argument, topology argument, element, ...).

        `weight(..., coords, node)` and `weight_gradient(..., coords, node)` are a basis function
        and its gradient by parameters, `outer_weight` and `outer_weight_gradient` the ones on the
        other side of a side; `node_coords(..., node)` and `node_weight(..., node)`.
        """
        from warp._src.fem.spaces.basis_functions import basis_functions

        return basis_functions(self)


class SpaceOfTopology:
    """Base of spaces and of their bases.

    Attributes:
        topology: numbers of the nodes.
        record: facts that functions of kernels depend on.
        ORDER: polynomial degree.
    """

    topology: SpaceTopology
    record: Record
    ORDER = 0

    @property
    def functions(self) -> SimpleNamespace:
        """Functions of kernels."""
        return self.record.functions

    @property
    def geometry(self):
        """The geometry."""
        return self.topology.geometry

    @property
    def element(self) -> Element | None:
        """The finite element; None if nodes are points."""
        return self.record.element

    @property
    def degree(self) -> int:
        """Polynomial degree."""
        return self.ORDER

    def __str__(self) -> str:
        return self.name

    def node_count(self) -> int:
        """Number of nodes."""
        return self.topology.node_count()

    def __hash__(self) -> int:
        return hash(self.record)


class BasisSpace(SpaceOfTopology):
    """Basis functions on a geometry, before values have a type.

    Attributes:
        topology, record, ORDER: as of `SpaceOfTopology`.
    """

    def __init__(self, topology: SpaceTopology, record: BasisRecord):
        self.topology, self.record = topology, record

    @property
    def value(self):
        """Kind of values, a `ShapeFunction.Value`."""
        from warp._src.fem.spaces.shapes import value_kind

        return value_kind(self.element)

    @property
    def weight_type(self) -> type:
        """Type of basis functions."""
        from warp._src.fem.spaces.basis_functions import value_types

        return value_types(self.record)[0]

    @property
    def weight_gradient_type(self) -> type:
        """Type of gradients of basis functions by parameters."""
        from warp._src.fem.spaces.basis_functions import value_types

        return value_types(self.record)[1]

    @property
    def name(self) -> str:
        """Name of the topology."""
        return self.topology.name

    def node_positions(self, out=None):
        """Positions of the nodes.

        Args:
            out: array (nodes,) of vectors to fill.

        Raises:
            ValueError: `out` has another shape or type.
        """
        geometry = self.geometry
        vector = wp.types.vector(length=geometry.dimension, dtype=geometry.scalar_type)
        shape = (self.node_count(),)
        if out is None:
            out = wp.empty(shape, dtype=vector)
        elif out.shape != shape or not extend.types_equal(out.dtype, vector):
            raise ValueError(
                f"'out' expects shape {shape} and type {extend.type_repr(vector)}, but got "
                f"{out.shape} and {extend.type_repr(out.dtype)}"
            )
        from warp._src.fem.spaces.basis_functions import positions_kernel

        kernel, device = positions_kernel(self.record), out.device
        inputs = [geometry.cell_arg_value(device), self.topology.topo_arg_value(device), out]
        with extend.unrecorded():
            wp.launch(kernel, geometry.cell_count(), inputs, device=device)
        return out

    def trace(self) -> BasisSpace:
        """The basis on the sides."""
        return TraceBasisSpace(self)

    def __eq__(self, other) -> bool:
        if not isinstance(other, BasisSpace):
            return NotImplemented
        return self.topology == other.topology and self.record == other.record

    __hash__ = SpaceOfTopology.__hash__


class ShapeBasisSpace(BasisSpace):
    """Basis functions of a finite element."""

    def __init__(self, topology: SpaceTopology, shape):
        element = shape.element if hasattr(shape, "element") else shape
        super().__init__(topology, BasisRecord(topology.record, element))
        self.ORDER = element.degree

    @property
    def shape(self):
        """The element as a `ShapeFunction`."""
        from warp._src.fem.spaces.shapes import ShapeFunction

        return ShapeFunction(self.element, self.geometry.scalar_type)

    def __getattr__(self, name):
        if "topology" not in self.__dict__:
            # Copies and pickles ask before there is anything.
            raise AttributeError(f"{type(self).__name__!r} has no {name!r} yet")
        if name == "node_grid":
            return self.topology.node_grid
        if name in ("node_triangulation", "node_tets", "node_hexes", "vtk_cells"):
            from warp._src.fem.spaces import plotting

            if plotting.has_pieces(self.element, name):
                return functools.partial(plotting.pieces_of, self, name)
        raise AttributeError(f"{type(self).__name__!r} of {self.element!r} has no {name!r}")


class TraceBasisSpace(BasisSpace):
    """Basis functions on sides: those of the cell on either side."""

    def __init__(self, base: BasisSpace):
        topology = base.topology.trace()
        record = BasisRecord(topology.record, base.element, base=base.record)
        super().__init__(topology, record)
        self._base, self.ORDER = base, base.ORDER

    def trace(self) -> BasisSpace:
        """This basis."""
        return self
