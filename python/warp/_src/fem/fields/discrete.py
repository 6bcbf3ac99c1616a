"""Discrete fields - a value per node of a function space."""

from __future__ import annotations

import warp as wp
from warp import extend
from warp._src.fem.fields.base import GeometryField
from warp._src.fem.fields.spaces import SpaceDescription, node_arg_type, node_arg_value, node_space


class SpaceField(GeometryField):
    """Base of fields of a function space.

    Attributes:
        space: the space. space_partition: of its nodes.
    """

    def __init__(self, space, space_partition):
        if space_partition is None:
            from warp._src.fem.spaces.partition import make_space_partition

            space_partition = make_space_partition(space_topology=space.topology)
        self.space, self.space_partition = space, space_partition
        self.__dict__.pop("_bound", None)
        self.kind = "sides" if space.topology.is_trace else "cells"

    @property
    def geometry(self):
        """Geometry of the space."""
        return self.space.geometry

    @property
    def nodes(self):
        """Record of the space in cells, and of the partition."""
        return node_space(self.space, self.space_partition)

    @property
    def dtype(self):
        """Type of the value."""
        return self.space.dtype

    @property
    def dof_dtype(self):
        """Type of a degree of freedom."""
        return self.space.dof_dtype

    @property
    def degree(self) -> int:
        """Polynomial degree of the space."""
        return self.space.degree

    @property
    def ArgType(self):
        """Struct of topology, partition and values."""
        return node_arg_type(self.nodes)

    @property
    def node_dof_count(self) -> int:
        """Number of components of a degree of freedom."""
        return self.space.NODE_DOF_COUNT

    @property
    def value_dof_count(self) -> int:
        """Number of independent components of a value."""
        return self.space.VALUE_DOF_COUNT


class DiscreteField(SpaceField):
    """A value per node of a function space.

    Attributes:
        dof_values: array (space_partition.node_count(),) of the space's `dof_dtype`.
    """

    def __init__(self, space, space_partition=None, dof_values=None):
        super().__init__(space, space_partition)
        if dof_values is None:
            count = self.space_partition.node_count()
            dof_values = wp.zeros(count, dtype=space.dof_dtype)
        self.dof_values = dof_values

    @property
    def dof_values(self):
        """The array of values."""
        return self._dof_values

    @dof_values.setter
    def dof_values(self, values):
        count = self.space_partition.node_count()
        if not extend.is_array(values):
            values = wp.array(values, dtype=self.space.dof_dtype)
        if values.ndim != 1 or not extend.types_equal(values.dtype, self.space.dof_dtype):
            raise ValueError(
                f"'dof_values' expects an array of {extend.type_repr(self.space.dof_dtype)}, but "
                f"got one of {values.ndim} dimensions of {extend.type_repr(values.dtype)}"
            )
        if values.shape[0] != count:
            raise ValueError(
                f"'dof_values' expects {count} values, one per node, but got {values.shape[0]}"
            )
        self._dof_values = values

    def bind(self, domain):
        """The description for elements of a domain's record."""
        return SpaceDescription(self.nodes, domain)

    def arg_value(self, device):
        """The struct of topology, partition and values."""
        device, values = wp.get_device(device), self.dof_values
        if values.device != device:
            raise ValueError(
                f"the values of the field are on '{values.device}', the form is "
                f"integrated on '{device}'"
            )
        return node_arg_value(self.space, self.space_partition, values, device)

    @property
    def array(self):
        """The array that gradients are of."""
        return self.dof_values

    @property
    def cell_field(self) -> DiscreteField:
        """The field in cells, of a trace."""
        return self

    def trace(self) -> DiscreteField:
        """The field on sides; its values are those that the field has when they are read."""
        return self if self.kind == "sides" else FieldTrace(self)

    def rebind(self, space, space_partition) -> None:
        """Gives the field another space and partition of the same kind.

        Values of as many nodes stay, in the same array or its first part; for more nodes there is
        a new array, of zeros behind them.
        """
        before = self._dof_values
        count = space_partition.node_count()
        values = before[:count] if count < before.shape[0] else before
        if count > before.shape[0]:
            values = wp.zeros(
                count, dtype=before.dtype, device=before.device, requires_grad=before.requires_grad
            )
            with extend.unrecorded():
                wp.copy(values, before, count=before.shape[0])
        self.__init__(space, space_partition, values)


class FieldTrace(DiscreteField):
    """A discrete field on sides.

    Attributes:
        cell_field: the field in cells, whose values it has.
    """

    cell_field = None

    def __init__(self, field: DiscreteField):
        SpaceField.__init__(self, field.space.trace(), field.space_partition)
        self.cell_field = field

    @property
    def dof_values(self):
        """The array of values of the field in cells."""
        return self.cell_field.dof_values

    @dof_values.setter
    def dof_values(self, values):
        self.cell_field.dof_values = values

    def rebind(self, space, space_partition) -> None:
        """Gives it and the field in cells another space and partition of the same kind."""
        self.cell_field.rebind(space.cell_space, space_partition)
        SpaceField.__init__(self, space.trace(), space_partition)


class FieldRestriction:
    """A discrete field on the nodes of some elements.

    Attributes:
        field: the field. space: its space. space_restriction: the nodes. domain: the elements.
    """

    def __init__(self, space_restriction, field):
        self.field, self.space_restriction = field, space_restriction
        self.space, self.domain = field.space, space_restriction.domain


def make_restriction(field, space_restriction=None, domain=None, device=None) -> FieldRestriction:
    """Restricts a discrete field to some elements.

    Args:
        field: the field.
        space_restriction: the nodes; by default those of `domain`.
        domain: the elements.
    """
    if space_restriction is None:
        from warp._src.fem.spaces.restriction import make_space_restriction

        space_restriction = make_space_restriction(
            space_partition=field.space_partition, domain=domain, device=device
        )
    return FieldRestriction(space_restriction, field)


def make_discrete_field(space, space_partition=None) -> DiscreteField:
    """A field of zeros over a function space or a partition of one."""
    return DiscreteField(space, space_partition)
