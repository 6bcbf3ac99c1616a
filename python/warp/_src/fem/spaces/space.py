"""Function spaces - basis functions with a type of values, and maps to the cells of a geometry.

The value of a function at a point is the sum over the nodes of the node's components times the
basis function. Covariant and contravariant spaces map basis functions of the reference cell by the
inverse transposed deformation gradient, or by the gradient over its determinant (Piola).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import warp as wp
from warp import extend
from warp._src.fem.cells.element import Element
from warp._src.fem.kept import Record
from warp._src.fem.spaces.basis import BasisRecord, BasisSpace, SpaceOfTopology
from warp._src.fem.spaces.mappers import DofMapper, IdentityMapper, MapperRecord
from warp._src.fem.spaces.topologies import SpaceTopology, TopologyRecord
from warp._src.fem.types import ElementKind


@dataclass(frozen=True)
class SpaceRecord(Record):
    """Facts of a space that its functions of kernels depend on.

    Attributes:
        basis: record of the basis.
        kind: "identity", "covariant" or "contravariant": how values go to a cell in space.
        dtype: type of values.
        dof_dtype: type of the components of a node.
        degree: polynomial degree.
        mapper: record of the mapper from components to values; None if they are the same.
        cell_space: of traces: the record of the space on cells.
    """

    basis: BasisRecord
    kind: str
    dtype: type
    dof_dtype: type
    degree: int
    mapper: MapperRecord | None = None
    cell_space: SpaceRecord | None = None

    @property
    def topology(self) -> TopologyRecord:
        """Record of the topology."""
        return self.basis.topology

    @property
    def element(self) -> Element | None:
        """The finite element; None if nodes are points."""
        return self.basis.element

    def make_functions(self) -> SimpleNamespace:
        """Makes the functions of kernels of the basis, with `to_value(dof)` and `to_dof(value)`,
        which are None if both are the same."""
        made = SimpleNamespace(**vars(self.basis.functions))
        made.to_value, made.to_dof = self.mapper.functions if self.mapper else (None, None)
        return made


class FunctionSpace(SpaceOfTopology):
    """Functions on a geometry.

    Attributes:
        basis: basis functions.
        dtype: type of values.
        dof_dtype: type of the components of a node.
        topology, record, ORDER: as of `SpaceOfTopology`.
    """

    dof_mapper: DofMapper | None = None

    def __init__(self, basis: BasisSpace, record: SpaceRecord):
        self.basis, self.record = basis, record
        self.dtype, self.dof_dtype = record.dtype, record.dof_dtype
        self.ORDER = basis.ORDER

    def __getattr__(self, name):
        plots = ("node_grid", "node_triangulation", "node_tets", "node_hexes", "vtk_cells")
        if name in plots and "basis" in self.__dict__:
            return getattr(self.basis, name)
        raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")

    @property
    def topology(self) -> SpaceTopology:
        """Numbers of the nodes."""
        return self.basis.topology

    @property
    def mapper(self) -> MapperRecord | None:
        """Record of the mapper from components to values; None if they are the same."""
        return self.record.mapper

    @property
    def dimension(self) -> int:
        """Dimension of the elements."""
        return self.topology.dimension

    @property
    def element_kind(self) -> ElementKind:
        """Cells or sides."""
        return ElementKind.SIDE if self.topology.is_trace else ElementKind.CELL

    @property
    def weight_dtype(self) -> type:
        """Type of basis functions."""
        return self.basis.weight_type

    @property
    def NODE_DOF_COUNT(self) -> int:
        """Number of components of a node."""
        return extend.type_size(self.dof_dtype)

    @property
    def VALUE_DOF_COUNT(self) -> int:
        """Number of independent components of a value."""
        is_identity = self.record.kind == "identity"
        return extend.type_size(self.dof_dtype if is_identity else self.dtype)

    @property
    def name(self) -> str:
        """Names of the basis and of the type of values in one word."""
        return f"{self.basis.name}_{extend.type_repr(self.dtype)}"

    def node_positions(self, out=None):
        """Positions of the nodes, see `BasisSpace.node_positions`."""
        return self.basis.node_positions(out=out)

    def make_field(self, space_partition=None):
        """A field of zeros.

        Args:
            space_partition: the nodes that it has; all if not given.
        """
        from warp._src.fem.fields.discrete import DiscreteField
        from warp._src.fem.spaces.partition import make_space_partition

        if space_partition is None:
            space_partition = make_space_partition(space_topology=self.topology)
        return DiscreteField(space=self, space_partition=space_partition)

    def trace(self) -> FunctionSpace:
        """The space on the sides."""
        if self.topology.is_trace:
            return self
        basis = self.basis.trace()
        record = replace(self.record, basis=basis.record, cell_space=self.record)
        made = object.__new__(type(self))
        FunctionSpace.__init__(made, basis, record)
        made.dof_mapper, made._cell_space = self.dof_mapper, self
        return made

    @property
    def cell_space(self) -> FunctionSpace:
        """The space on the cells."""
        return self.__dict__.get("_cell_space", self)

    def gradient_valid(self) -> bool:
        """Gradients have a type: values are scalars or vectors."""
        return not extend.type_is_matrix(self.dtype)

    def divergence_valid(self) -> bool:
        """Divergences have a type: the first size of values is the dimension of space."""
        shape = getattr(self.dtype, "_shape_", ())
        return len(shape) > 0 and shape[0] == self.geometry.dimension

    def __eq__(self, other) -> bool:
        if not isinstance(other, FunctionSpace):
            return NotImplemented
        return self.basis == other.basis and self.record == other.record

    __hash__ = SpaceOfTopology.__hash__


class CollocatedFunctionSpace(FunctionSpace):
    """Functions whose nodes have all the components of a value.

    Args:
        basis: scalar basis functions.
        dtype: type of values; the scalar type of the geometry if not given.
        dof_mapper: from components of a node to values, which have its type.
    """

    def __init__(self, basis: BasisSpace, dtype=None, dof_mapper: DofMapper | None = None):
        if dof_mapper is None:
            dof_mapper = IdentityMapper(basis.geometry.scalar_type if dtype is None else dtype)
        self.dof_mapper = dof_mapper
        mapper = None if dof_mapper.record.kind == "identity" else dof_mapper.record
        types = (dof_mapper.value_dtype, extend.canonical(dof_mapper.dof_dtype))
        super().__init__(basis, SpaceRecord(basis.record, "identity", *types, basis.ORDER, mapper))


class VectorValuedFunctionSpace(FunctionSpace):
    """Functions with vector-valued basis functions and one component per node."""

    _map = ""

    def __init__(self, basis: BasisSpace):
        geometry = basis.geometry
        real = geometry.scalar_type
        vector = wp.types.vector(length=geometry.dimension, dtype=real)
        super().__init__(basis, SpaceRecord(basis.record, self._map, vector, real, basis.ORDER))


class CovariantFunctionSpace(VectorValuedFunctionSpace):
    """Vectors whose tangential components are continuous: H(curl)."""

    _map = "covariant"


class ContravariantFunctionSpace(VectorValuedFunctionSpace):
    """Vectors whose normal components are continuous: H(div)."""

    _map = "contravariant"
