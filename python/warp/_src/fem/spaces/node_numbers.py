"""Numbers of nodes in a part of a space - the base of partitions, and the whole."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.geometry.base import per_device
from warp._src.fem.geometry.partition import WholeGeometryPartition
from warp._src.fem.kept import Record
from warp._src.fem.types import Ints

_WholeArg = extend.struct_from_fields("WholeNodesArg", {}, module=__name__)
_TableArg = extend.struct_from_fields(
    "NodeNumbersArg", {"space_to_partition": Ints}, module=__name__
)


@wp.func
def _same_node(arg: Any, node: int):
    return node


@wp.func
def _listed_node(arg: _TableArg, node: int):
    return arg.space_to_partition[node]


@dataclass(frozen=True)
class SpacePartitionRecord(Record):
    """Facts of a partition that its functions of kernels depend on: `is_whole`."""

    is_whole: bool

    def make_functions(self) -> SimpleNamespace:
        """Makes the struct `PartitionArg` and `partition_node_index(arg, node)`: a node's number in
        the partition, or `NULL_NODE_INDEX`."""
        if self.is_whole:
            return SimpleNamespace(PartitionArg=_WholeArg, partition_node_index=_same_node)
        return SimpleNamespace(PartitionArg=_TableArg, partition_node_index=_listed_node)


class SpacePartition:
    """Some nodes of a space, with numbers of their own."""

    _keeps_arguments = True

    def __init__(self, space_topology, geo_partition, is_whole=False):
        self.space_topology, self.geo_partition = space_topology, geo_partition
        self.record = SpacePartitionRecord(is_whole)

    @property
    def PartitionArg(self):
        """Struct of the argument of `partition_node_index`."""
        return self.record.functions.PartitionArg

    @property
    def partition_node_index(self):
        """Function of kernels: the number of a node in the partition."""
        return self.record.functions.partition_node_index

    @property
    def name(self) -> str:
        """Name of the class."""
        return type(self).__name__

    def __str__(self) -> str:
        return self.name

    @per_device
    def partition_arg_value(self, device):
        """Argument of `partition_node_index`."""
        arg = self.PartitionArg()
        self.fill_partition_arg(arg, device)
        return arg

    def fill_partition_arg(self, arg, device) -> None:
        """Fills an argument of `partition_node_index`."""

    def node_count(self) -> int:
        """Number of nodes, with the ones of neighbours."""
        raise NotImplementedError

    def owned_node_count(self) -> int:
        """Number of nodes of the partition's own cells."""
        return self.node_count()

    def interior_node_count(self) -> int:
        """Number of nodes that no other partition has."""
        return self.node_count()

    def space_node_indices(self):
        """Numbers in the space of the nodes, int32 (nodes,)."""
        raise NotImplementedError

    def rebuild(self, device=None, temporary_store=None) -> None:
        """Takes over a geometry that was rebuilt."""


class WholeSpacePartition(SpacePartition):
    """All nodes."""

    def __init__(self, space_topology):
        whole = WholeGeometryPartition(space_topology.geometry)
        super().__init__(space_topology, whole, is_whole=True)

    @property
    def name(self) -> str:
        """The word Whole."""
        return "Whole"

    def node_count(self) -> int:
        """Number of nodes of the space."""
        return self.space_topology.node_count()

    def space_node_indices(self):
        """Numbers in the space of the nodes, int32 (nodes,)."""
        return wp.array(np.arange(self.node_count(), dtype=np.int32))

    def __eq__(self, other) -> bool:
        same = isinstance(other, WholeSpacePartition)
        return same and self.space_topology == other.space_topology

    def __hash__(self) -> int:
        return hash(self.space_topology)
