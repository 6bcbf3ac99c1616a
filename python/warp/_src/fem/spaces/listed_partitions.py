"""Partitions with lists of nodes - by kind of node, or by environment."""

from __future__ import annotations

import warp as wp
from warp import extend
from warp._src.fem.assembly.incidence import find_incidence
from warp._src.fem.geometry.base import forget
from warp._src.fem.geometry.partition import WholeGeometryPartition
from warp._src.fem.spaces.node_numbers import SpacePartition
from warp._src.fem.spaces.partition_kernels import environment_kernel, kind_kernels
from warp._src.fem.types import NULL_NODE_INDEX, Ints

# Kinds of nodes, in their order in a partition.
INTERIOR, FRONTIER, HALO_NEAR, HALO_FAR, EXTERIOR = range(5)


@wp.kernel(enable_backward=False)
def _number(begins: Ints, group: int, capacity: int, nodes: Ints, kept: Ints, numbers: Ints):
    i = wp.tid()
    node = nodes[i]
    count = begins[group]
    number = int(NULL_NODE_INDEX)
    if i < count and i < capacity:
        number = i
        kept[i] = node
    numbers[node] = number


class ListedPartition(SpacePartition):
    """Nodes sorted by a group; the groups below a limit are in the partition.

    Args:
        limit: the first group that is not.
        max_node_count: capacity, -1 to count.
    """

    def __init__(self, space_topology, geo_partition, max_node_count, device):
        super().__init__(space_topology, geo_partition)
        self._capacity, self._device = max_node_count, wp.get_device(device)
        if max_node_count >= 0:
            self._capacity = min(max_node_count, space_topology.node_count())
        self.rebuild(device)

    def _groups(self, device):
        """(group of each node, number of groups, limit)."""
        raise NotImplementedError

    def rebuild(self, device=None, temporary_store=None) -> None:
        """Takes over a geometry that was rebuilt."""
        forget(self)
        device = self._device if device is None else wp.get_device(device)
        with extend.unrecorded():
            groups, count, limit = self._groups(device)
            incidence = find_incidence(groups.reshape((groups.shape[0], 1)), count)
            self._take(incidence, limit, device)

    def _take(self, incidence, limit, device):
        total = self.space_topology.node_count()
        begins, capacity = incidence.begins, self._capacity
        if capacity < 0:
            self._offsets = begins.numpy()
            capacity = int(self._offsets[limit])
        self._count, self._begins = capacity, begins
        self._kept = wp.full(capacity, -1, dtype=wp.int32, device=device)
        self._numbers = wp.empty(total, dtype=wp.int32, device=device)
        inputs = [begins, limit, capacity, incidence.positions, self._kept, self._numbers]
        wp.launch(_number, total, inputs, device=device)

    def fill_partition_arg(self, arg, device) -> None:
        """Fills an argument of `partition_node_index`."""
        arg.space_to_partition = self._numbers.to(device)

    def node_count(self) -> int:
        """Number of nodes, or the capacity."""
        return self._count

    def space_node_indices(self):
        """Numbers in the space of the nodes, int32 (nodes,)."""
        return self._kept


class NodePartition(ListedPartition):
    """Nodes of the cells of a partition: the interior ones, the ones that neighbours have, too, and
    a halo of nodes that only cells of neighbours have."""

    def __init__(
        self, space_topology, geo_partition, with_halo=True, max_node_count=-1, device=None
    ):
        self._with_halo = with_halo
        super().__init__(space_topology, geo_partition, max_node_count, device)

    def _of_kind(self, kind: int) -> int:
        return self._count if self._capacity >= 0 else int(self._offsets[kind + 1])

    def owned_node_count(self) -> int:
        """Number of nodes of the partition's own cells."""
        return self._of_kind(FRONTIER)

    def interior_node_count(self) -> int:
        """Number of nodes that no other partition has."""
        return self._of_kind(INTERIOR)

    def _groups(self, device):
        topology, part = self.space_topology, self.geo_partition
        kinds = wp.full(topology.node_count(), EXTERIOR, dtype=wp.int32, device=device)
        geometry, arg = topology.geometry, topology.topo_arg_value(device)
        of_cells, of_sides, of_frontier = kind_kernels(topology.record, part.record)
        inputs = [geometry.cell_arg_value(device), part.cell_arg_value(device), arg, kinds]
        wp.launch(of_cells, part.cell_count(), inputs, device=device)
        if self._with_halo:
            inputs = [geometry.side_arg_value(device), part.side_arg_value(device), arg, kinds]
            wp.launch(of_sides, part.side_count(), inputs, device=device)
            wp.launch(of_frontier, part.frontier_side_count(), inputs, device=device)
        return kinds, 5, EXTERIOR


@wp.kernel(enable_backward=False)
def _clip(begins: Ints, limit: int, offsets: Ints):
    i = wp.tid()
    offsets[i] = wp.min(begins[i], limit)


class EnvironmentSpacePartition(ListedPartition):
    """Nodes of the cells of a partition, environment by environment; of the whole geometry also the
    nodes that no cell has, which come last.

    Attributes:
        env_offsets: first node of each environment, int32 (environments + 1,), or None if nodes
            belong to none.
    """

    def __init__(self, space_topology, geo_partition, max_node_count=-1, device=None):
        super().__init__(space_topology, geo_partition, max_node_count, device)

    def _groups(self, device):
        topology, part = self.space_topology, self.geo_partition
        geometry = topology.geometry
        count = geometry.environment_count()
        groups = wp.full(topology.node_count(), count, dtype=wp.int32, device=device)
        kernel = environment_kernel(topology.record, part.record)
        inputs = [
            geometry.cell_arg_value(device),
            part.cell_arg_value(device),
            topology.topo_arg_value(device),
            groups,
        ]
        wp.launch(kernel, part.cell_count(), inputs, device=device)
        is_whole = isinstance(part, WholeGeometryPartition)
        return groups, count + 1, count + 1 if is_whole else count

    def _take(self, incidence, limit, device):
        super()._take(incidence, limit, device)
        count = self.space_topology.geometry.environment_count()
        self._offset_array = wp.empty(count + 1, dtype=wp.int32, device=device)
        inputs = [incidence.begins, self._count, self._offset_array]
        wp.launch(_clip, count + 1, inputs, device=device)
        has_others = self._capacity < 0 and limit > count
        self._is_split = not has_others or int(self._offsets[count]) == self._count

    @property
    def env_offsets(self):
        """First node of each environment, int32 (environments + 1,); None if nodes have none."""
        return self._offset_array if self._is_split else None
