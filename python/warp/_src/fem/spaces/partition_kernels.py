"""Kernels of partitions and restrictions: kinds, environments and numbers of the nodes of cells."""

import functools

import warp as wp
from warp._src.fem.spaces.topologies import TopologyRecord
from warp._src.fem.types import NULL_ELEMENT_INDEX, NULL_NODE_INDEX, Ints, IntTable

_INTERIOR, _FRONTIER, _HALO_NEAR, _HALO_FAR, _EXTERIOR = (wp.constant(k) for k in range(5))


@functools.cache
def kind_kernels(topology, part):
    """Kernels over the cells, the sides and the frontier of a partition that mark their nodes."""
    geometry, of_part = topology.geometry.functions, part.functions
    CellArg, SideArg = geometry.CellArg, geometry.SideArg
    CellsArg, SidesArg = of_part.CellArg, of_part.SideArg
    functions, TopologyArg = topology.functions, topology.functions.TopologyArg
    count_of, index_of = functions.element_node_count, functions.element_node_index
    trace = TopologyRecord("trace", topology.geometry, 2 * topology.nodes, base=topology)
    trace = trace.functions
    side_count_of, side_index_of = trace.element_node_count, trace.element_node_index
    cell_of = of_part.cell_index

    @wp.kernel(enable_backward=False)
    def of_cells(cell_arg: CellArg, part_arg: CellsArg, topo_arg: TopologyArg, kinds: Ints):
        cell = cell_of(part_arg, wp.tid())
        if cell != NULL_ELEMENT_INDEX:
            for k in range(count_of(cell_arg, topo_arg, cell)):
                kinds[index_of(cell_arg, topo_arg, cell, k)] = _INTERIOR

    def of_sides(side_of, halo, own):
        @wp.kernel(enable_backward=False)
        def mark_sides(side_arg: SideArg, part_arg: SidesArg, topo_arg: TopologyArg, kinds: Ints):
            side = side_of(part_arg, wp.tid())
            if side != NULL_ELEMENT_INDEX:
                for k in range(side_count_of(side_arg, topo_arg, side)):
                    node = side_index_of(side_arg, topo_arg, side, k)
                    if kinds[node] == _EXTERIOR:
                        kinds[node] = halo
                    elif kinds[node] == _INTERIOR:
                        kinds[node] = own

        return mark_sides

    frontier = of_sides(of_part.frontier_side_index, _HALO_FAR, _FRONTIER)
    return of_cells, of_sides(of_part.side_index, _HALO_NEAR, _INTERIOR), frontier


@functools.cache
def environment_kernel(topology, part):
    """A kernel over cells that gives nodes the least environment of their cells."""
    geometry, of_part = topology.geometry.functions, part.functions
    CellArg, CellsArg = geometry.CellArg, of_part.CellArg
    functions, TopologyArg = topology.functions, topology.functions.TopologyArg
    count_of, index_of = functions.element_node_count, functions.element_node_index
    cell_of, environment_of = of_part.cell_index, geometry.cell_environment_index

    @wp.kernel(enable_backward=False)
    def of_environments(cell_arg: CellArg, part_arg: CellsArg, topo_arg: TopologyArg, groups: Ints):
        cell = cell_of(part_arg, wp.tid())
        if cell != NULL_ELEMENT_INDEX:
            environment = environment_of(cell_arg, cell)
            for k in range(count_of(cell_arg, topo_arg, cell)):
                wp.atomic_min(groups, index_of(cell_arg, topo_arg, cell, k), environment)

    return of_environments


@functools.cache
def table_kernel(domain, topology, partition):
    """A kernel over elements and nodes that writes partition numbers, or -1."""
    of_domain, of_topology = domain.functions, topology.functions
    ElementArg, IndexArg = of_domain.ElementArg, of_domain.ElementIndexArg
    TopologyArg, PartitionArg = of_topology.TopologyArg, partition.functions.PartitionArg
    element_of, count_of = of_domain.element_index, of_topology.element_node_count
    index_of, number_of = of_topology.element_node_index, partition.functions.partition_node_index

    @wp.kernel(enable_backward=False)
    def fill_table(
        element_arg: ElementArg,
        index_arg: IndexArg,
        topo_arg: TopologyArg,
        partition_arg: PartitionArg,
        table: IntTable,
    ):
        i, k = wp.tid()
        element = element_of(index_arg, i)
        number = int(-1)
        if element >= 0:
            if k < count_of(element_arg, topo_arg, element):
                node = index_of(element_arg, topo_arg, element, k)
                number = number_of(partition_arg, node)
                if number == NULL_NODE_INDEX:
                    number = -1
        table[i, k] = number

    return fill_table
