"""Kernels of bases: positions of the nodes."""

import warp as wp
from warp._src.fem.geometry.base import geometry_functions
from warp._src.fem.types import make_free_sample


def positions_kernel(record):
    """A kernel over cells that writes the positions of their nodes; all cells of a node agree."""
    geometry = geometry_functions(record.topology.geometry)
    CellArg, position_of = geometry.CellArg, geometry.cell_position
    topology, basis = record.topology.functions, record.functions
    TopologyArg, count_of = topology.TopologyArg, topology.element_node_count
    index_of, coords_of = topology.element_node_index, basis.node_coords
    vector = wp.types.vector(
        length=record.topology.geometry.dimension, dtype=record.topology.geometry.scalar
    )

    @wp.kernel(enable_backward=False)
    def fill_positions(cell_arg: CellArg, topo_arg: TopologyArg, out: wp.array(dtype=vector)):
        cell = wp.tid()
        for k in range(count_of(cell_arg, topo_arg, cell)):
            sample = make_free_sample(cell, coords_of(cell_arg, topo_arg, cell, k))
            out[index_of(cell_arg, topo_arg, cell, k)] = position_of(cell_arg, sample)

    return fill_positions
