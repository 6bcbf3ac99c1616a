"""Degrees of freedom of nodes in kernels - from a vector at the node in space."""

import numpy as np

import warp as wp
from warp._src.fem.cells.tables import table
from warp._src.fem.geometry.base import geometry_functions
from warp._src.fem.types import make_free_sample


def _duals(element, real):
    """A function of kernels of (node, orientation): the direction of a node's component."""
    cell = element.cell
    data = element.definition.data
    duals = data[4] if element.definition.kind == "vectors" else element.node_duals[None]
    rows, place = np.unique(
        np.round(duals.reshape(-1, cell.dimension), 12), axis=0, return_inverse=True
    )
    directions, numbers = table(rows, real), table(place.reshape(-1), wp.int32)
    Vector = wp.types.vector(length=cell.dimension, dtype=real)
    dimension, nodes = cell.dimension, element.node_count

    @wp.func
    def dual(node: int, orientation: int):
        row = numbers[orientation * nodes + node]
        made = Vector(real(0.0))
        for axis in range(dimension):
            made[axis] = directions[row, axis]
        return made

    return dual


def node_dof_function(record):
    """A function of kernels of (element argument, topology argument, element, node, value): the
    component of a vector at a node that is the node's degree of freedom."""
    geometry = geometry_functions(record.topology.geometry)
    real, dimension = record.topology.geometry.scalar, record.topology.geometry.dimension
    CellArg, topology = geometry.CellArg, record.topology
    if topology.kind == "trace":
        return _on_side(record, geometry, real, dimension)
    functions = topology.functions
    TopologyArg, sign_of = functions.TopologyArg, functions.element_node_sign
    orientation_of = functions.element_orientation
    coords_of = record.basis.functions.node_coords
    gradient_of = geometry.cell_deformation_gradient
    inverse_of, measure_of = geometry.cell_inverse_deformation_gradient, geometry.cell_measure
    dual = _duals(record.element, real)
    Value = wp.types.vector(length=dimension, dtype=real)
    is_covariant, is_signed = record.kind == "covariant", sign_of is not None
    measure = real(record.element.cell.measure)

    @wp.func
    def node_dof(cell_arg: CellArg, topo_arg: TopologyArg, cell: int, node: int, value: Value):
        s = make_free_sample(cell, coords_of(cell_arg, topo_arg, cell, node))
        direction = dual(node, orientation_of(cell_arg, topo_arg, cell))
        if wp.static(is_covariant):
            made = wp.dot(wp.transpose(gradient_of(cell_arg, s)) * value, direction)
        else:
            inside = inverse_of(cell_arg, s) * value
            made = wp.dot(inside, direction) * measure_of(cell_arg, s) / measure
        if wp.static(is_signed):
            made *= sign_of(cell_arg, topo_arg, cell, node)
        return made

    return node_dof


def _on_side(record, geometry, real, dimension):
    SideArg, to_cell = geometry.SideArg, geometry.side_to_cell_arg
    find, TopologyArg = (
        record.topology.functions.neighbor_cell_index,
        record.topology.functions.TopologyArg,
    )
    of_cell = record.cell_space.functions.node_dof
    Value = wp.types.vector(length=dimension, dtype=real)

    @wp.func
    def node_dof(side_arg: SideArg, topo_arg: TopologyArg, side: int, node: int, value: Value):
        cell, place = find(side_arg, topo_arg, side, node)
        return of_cell(to_cell(side_arg), topo_arg, cell, place, value)

    return node_dof
