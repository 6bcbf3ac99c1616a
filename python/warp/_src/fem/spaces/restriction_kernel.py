"""The kernel of restrictions: nodes of the elements of a domain."""

import warp as wp
from warp._src.fem.types import NULL_NODE_INDEX


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
        table: wp.array2d(dtype=wp.int32),
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
