"""Functions of kernels of traces - nodes of the cells on both sides of a side."""

from types import SimpleNamespace

import warp as wp
from warp._src.fem.kept import Functions
from warp._src.fem.spaces.topology_functions import add_constants
from warp._src.fem.types import NULL_ELEMENT_INDEX, NULL_NODE_INDEX


def trace_functions(record) -> SimpleNamespace:
    """The struct and the functions of a topology of sides."""
    geometry = record.geometry.functions
    SideArg, to_cell = geometry.SideArg, geometry.side_to_cell_arg
    inner_of, outer_of = geometry.side_inner_cell_index, geometry.side_outer_cell_index
    base = record.base.functions
    TopologyArg, count_of = base.TopologyArg, base.element_node_count
    index_of, sign_of = base.element_node_index, base.element_node_sign

    made = Functions(TopologyArg=TopologyArg, element_node_sign=None, cell=base)

    @wp.func
    def inner_count(side_arg: SideArg, topo_arg: TopologyArg, side: int):
        return count_of(to_cell(side_arg), topo_arg, inner_of(side_arg, side))

    @made.add
    def side_neighbor_node_counts(side_arg: SideArg, topo_arg: TopologyArg, side: int):
        outer = count_of(to_cell(side_arg), topo_arg, outer_of(side_arg, side))
        return inner_count(side_arg, topo_arg, side), outer

    @made.add
    def element_node_count(side_arg: SideArg, topo_arg: TopologyArg, side: int):
        inner, outer = side_neighbor_node_counts(side_arg, topo_arg, side)
        return inner + outer

    @made.add
    def inner_cell_index(side_arg: SideArg, topo_arg: TopologyArg, side: int, node: int):
        cell = inner_of(side_arg, side)
        place = node
        if node >= inner_count(side_arg, topo_arg, side):
            cell = NULL_ELEMENT_INDEX
            place = NULL_NODE_INDEX
        return cell, place

    @made.add
    def outer_cell_index(side_arg: SideArg, topo_arg: TopologyArg, side: int, node: int):
        count = inner_count(side_arg, topo_arg, side)
        cell = outer_of(side_arg, side)
        place = node - count
        if node < count:
            cell = NULL_ELEMENT_INDEX
            place = NULL_NODE_INDEX
        return cell, place

    @made.add
    def neighbor_cell_index(side_arg: SideArg, topo_arg: TopologyArg, side: int, node: int):
        count = inner_count(side_arg, topo_arg, side)
        cell = inner_of(side_arg, side)
        place = node
        if node >= count:
            cell = outer_of(side_arg, side)
            place = node - count
        return cell, place

    @made.add
    def element_node_index(side_arg: SideArg, topo_arg: TopologyArg, side: int, node: int):
        cell, place = neighbor_cell_index(side_arg, topo_arg, side, node)
        return index_of(to_cell(side_arg), topo_arg, cell, place)

    if sign_of is not None:

        @made.add
        def element_node_sign(side_arg: SideArg, topo_arg: TopologyArg, side: int, node: int):
            cell, place = neighbor_cell_index(side_arg, topo_arg, side, node)
            return sign_of(to_cell(side_arg), topo_arg, cell, place)

    add_constants(made, record, SideArg)
    return made
