"""Spaces of fields - what kernels need of a function space and of a partition of its nodes."""

import functools
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import warp as wp
from warp import extend
from warp._src.fem.fields.base import MARK, NodesDescription, References, Values
from warp._src.fem.fields.nodes import memory_reference
from warp._src.fem.forms.facts import note_operation
from warp._src.fem.kept import hashed


@hashed
@dataclass(frozen=True)
class NodeSpace:
    """A space with the numbers of its nodes in a partition.

    space: record of the space in cells. partition: record of the partition.
    """

    space: object
    partition: object

    def __str__(self):
        element = self.element
        kind = "points" if element is None else f"{element.basis.value}{element.degree} elements"
        return f"{extend.type_repr(self.space.dtype)} on {kind}"

    @property
    def functions(self) -> SimpleNamespace:
        """Basis functions in reference coordinates, and places of nodes."""
        return self.space.functions

    @property
    def topology(self):
        """Record of the topology."""
        return self.space.topology

    @property
    def element(self):
        """The reference element, None if basis functions are no polynomials of a cell."""
        return self.space.element

    @property
    def dof_dtype(self):
        """Type of a degree of freedom."""
        return self.space.dof_dtype

    @property
    def cell_dimension(self) -> int:
        """Dimension of reference coordinates."""
        return self.space.basis.cell.dimension

    @property
    def partition_node_index(self):
        """Function of kernels: number in the partition of a node."""
        return self.partition.functions.partition_node_index

    @property
    def values(self) -> Values:
        """Kinds of values."""
        space = self.space
        return Values(space.dof_dtype, space.dtype, space.kind, space.mapper)

    @property
    def node_count(self):
        """Nodes of a cell, at most."""
        return self.topology.nodes


def node_space(space, partition) -> NodeSpace:
    """The record of a space, in cells, and of a partition."""
    cells = space.cell_space
    kept = cells.__dict__.setdefault("_node_spaces", {})
    key = partition.record
    if key not in kept:
        kept[key] = NodeSpace(cells.record, key)
    return kept[key]


@functools.cache
def node_arg_type(nodes: NodeSpace):
    """Struct with the arguments of topology and partition, and with an array of values."""
    fields = {
        "topology": nodes.topology.functions.TopologyArg,
        "partition": nodes.partition.functions.PartitionArg,
        "values": wp.array(dtype=nodes.dof_dtype),
    }
    made = extend.struct_from_fields("NodeArg", fields, module=__name__)
    # Pickles name what makes the class: others of the same fields are not it.
    made._maker_ = node_arg_type, (nodes,)
    return made


def node_arg_value(space, partition, values, device):
    """The argument of `node_arg_type`."""
    arg = node_arg_type(node_space(space, partition))()
    arg.topology = space.cell_space.topology.topo_arg_value(device)
    arg.partition = partition.partition_arg_value(device)
    if values is not None:
        arg.values = values
    return arg


@hashed
@dataclass(frozen=True)
class SpaceDescription(NodesDescription):
    """A discrete field whose values are in memory; its parts are (slots, argument, geometry)."""

    nodes: NodeSpace
    domain: object

    def reference(self, one_node=False):
        """Functions of reference values."""
        return References(
            *(
                memory_reference(self.nodes, self.values, self.domain, half, one_node)
                for half in (0, 1)
            ),
            one_node=one_node,
        )

    def node_functions(self):
        """Operators of nodes."""
        from warp._src.fem.fields.node_operators import discrete_node_functions

        return discrete_node_functions(self.nodes, self.domain)

    def in_cells(self):
        """The field in cells."""
        from warp._src.fem.fields.node_operators import cells_of

        return cells_of(self)

    def __str__(self):
        return f"discrete field of {self.nodes} ({self.domain.kind})"


@hashed
@dataclass(frozen=True)
class PointDescription(NodesDescription):
    """A field whose reference values at the point of the plan are known: slots.

    base: the field at other samples; None for a test or trial function, which is 0 there.
    moves: samples of other places may occur.
    """

    nodes: object
    domain: object
    role: str
    moves: bool = False
    base: object = None

    def operation(self, name, count):
        """As for other fields; recordings are told."""
        note_operation(self.role, name)
        return super().operation(name, count)

    def reference(self, one_node=False):
        """Functions of reference values."""
        if one_node:
            return self.base.reference(True)
        other = None if self.base is None else self.base.reference()
        return References(*(slot_reference(self, half, other) for half in (0, 1)))

    def node_functions(self):
        """Operators of nodes, of discrete fields alone."""
        if self.base is None:
            raise TypeError(f"operators of nodes of a {self.role} function need assembly='generic'")
        return self.base.node_functions()

    def in_cells(self):
        """The field in cells."""
        if self.base is None:
            raise TypeError(f"'cells' is not defined for a {self.role} function")
        return self.base.in_cells()

    def __str__(self):
        role = f"{self.role} function" if self.base is None else "discrete field"
        return f"{role} of {self.nodes} ({self.domain.kind})"


def slot_reference(description, half, other) -> SimpleNamespace:
    """Functions of (slots, argument, geometry, sample): a slot.

    Slots are value and gradient, on sides those of the outer cell, too.

    Args:
        description: of the field, with `moves`.
        other: functions at other samples; None for zero.
    """
    first = 0 if description.domain.is_cells else 2 * half
    second = first + 1
    moves = description.moves
    elsewhere = None if other is None else other[half]
    return SimpleNamespace(
        value=_slot(first, moves, elsewhere and elsewhere.value),
        gradient=_slot(second, moves, elsewhere and elsewhere.gradient),
    )


def _slot(position, moves, elsewhere):
    if not moves:

        @wp.func
        def slot(part: Any, arg: Any, geo: Any, s: Any):
            return part[position]

    elif elsewhere is None:

        @wp.func
        def slot(part: Any, arg: Any, geo: Any, s: Any):
            value = part[position]
            if s.test_dof[1] != MARK:
                value = type(value)()
            return value

    else:

        @wp.func
        def slot(part: Any, arg: Any, geo: Any, s: Any):
            value = part[position]
            if s.test_dof[1] != MARK:
                value = elsewhere(0, arg, geo, s)
            return value

    return slot
