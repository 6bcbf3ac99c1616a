"""Tables of nodes - numbers in a partition of the nodes of each element of a domain."""

import functools

import warp as wp
from warp import extend
from warp._src.fem.fields.nodes import locations
from warp._src.fem.fields.spaces import node_arg_type
from warp._src.fem.types import NULL_NODE_INDEX, IntTable, sample_type


@functools.cache
def _node_table_kernel(nodes, domain):
    """Kernel of (domain argument, node argument, number of nodes, table)."""
    functions = domain.functions
    Arg, DomainArg, Sample = (
        node_arg_type(nodes),
        functions.DomainArg,
        sample_type(domain.geometry.scalar),
    )
    element_index = functions.element_index
    node_index = nodes.topology.functions.element_node_index
    partition_index, count = nodes.partition_node_index, nodes.node_count
    inner, outer = locations(domain, 0), locations(domain, 1)
    inner_arg, inner_cell, outer_arg, outer_cell = (
        *(inner.cell_arg, inner.cell, outer.cell_arg, outer.cell),
    )
    halves = 1 if domain.is_cells else 2

    @wp.func
    def number(arg: Arg, node: int, limit: int):
        """Number in the partition, -1 for a node that the element or the partition lacks."""
        found = int(-1)
        if node >= 0 and node < NULL_NODE_INDEX:
            found = partition_index(arg.partition, node)
        return wp.where(found >= 0 and found < limit, found, -1)

    def node_table(domain_arg: DomainArg, arg: Arg, limit: int, table: IntTable):
        e = wp.tid()
        s = Sample()
        s.element_index = element_index(domain_arg.index, e)
        if s.element_index < 0:
            for k in range(halves * count):
                table[e, k] = -1
            return
        cells, cell = inner_arg(domain_arg.geo), inner_cell(domain_arg.geo, s)
        for k in range(count):
            table[e, k] = number(arg, node_index(cells, arg.topology, cell, k), limit)
        if wp.static(halves == 2):
            others, other = outer_arg(domain_arg.geo), outer_cell(domain_arg.geo, s)
            for k in range(count):
                node = node_index(others, arg.topology, other, k)
                table[e, count + k] = number(arg, node, limit)

    return wp.kernel(node_table, enable_backward=False)


def node_table(field, domain, device):
    """Numbers in its partition of the nodes of a test or trial function, int32 (elements, n); -1
    where there is none."""
    topology, partition = field.space.topology, field.space_partition
    has_table = topology.record.kind == "table" and partition.record.is_whole
    if has_table and domain.is_cells and domain.is_whole:
        return topology.element_table(device)
    kernel = _node_table_kernel(field.nodes, domain.record)
    shape = domain.element_count(), field.nodes.node_count * (1 if domain.is_cells else 2)
    table = wp.empty(shape, dtype=wp.int32, device=device)
    inputs = [domain.domain_arg_value(device), field.arg_value(device)]
    inputs += [partition.node_count(), table]
    with extend.unrecorded():
        wp.launch(kernel, shape[0], inputs, device=device)
    return table
