"""Degrees of freedom of vector families in kernels - from the field at points of an element."""

import functools
from types import SimpleNamespace

import numpy as np

import warp as wp
from warp._src.fem.cells.moments import interpolation_weights
from warp._src.fem.cells.tables import table
from warp._src.fem.kept import Functions
from warp._src.fem.types import coords_type, make_free_sample


@functools.cache
def dof_functions(record) -> SimpleNamespace:
    """Functions of kernels of a covariant or contravariant space, all of (element argument,
    topology argument, element, node, ...).

    `dof_point_count(...)` points of the element determine the degree of freedom of a node;
    `dof_point_coords(..., point)` are their coordinates, and the sum of `dof_part(..., point,
    value)` over them, where `value` is the vector in space there, is the degree of freedom.
    """
    if record.topology.kind == "trace":
        return _on_sides(record)
    topology, element, real = record.topology, record.element, record.topology.geometry.scalar
    geometry = topology.geometry.functions
    functions, CellArg = topology.functions, geometry.CellArg
    TopologyArg, sign_of = functions.TopologyArg, functions.element_node_sign
    orientation_of, dimension = functions.element_orientation, element.cell.dimension
    places, weights = interpolation_weights(element)
    is_used = np.any(weights != 0.0, axis=(0, 3))
    begins = table(np.concatenate(([0], np.cumsum(is_used.sum(axis=1)))), wp.int32)
    nodes, numbers = np.nonzero(is_used)
    count = len(nodes)
    places = table(places[numbers], real)
    weights = table(weights[:, nodes, numbers].reshape(-1, dimension), real)
    gradient_of = geometry.cell_deformation_gradient
    inverse_of, measure_of = geometry.cell_inverse_deformation_gradient, geometry.cell_measure
    Value = wp.types.vector(length=topology.geometry.dimension, dtype=real)
    Direction, Coords = wp.types.vector(length=dimension, dtype=real), coords_type(real)
    is_covariant, is_signed = record.kind == "covariant", sign_of is not None
    measure = real(element.cell.measure)

    @wp.func
    def dof_point_count(cell_arg: CellArg, topo_arg: TopologyArg, cell: int, node: int):
        return begins[node + 1] - begins[node]

    @wp.func
    def dof_point_coords(
        cell_arg: CellArg, topo_arg: TopologyArg, cell: int, node: int, point: int
    ):
        place = begins[node] + point
        return Coords(places[place, 0], places[place, 1], places[place, 2])

    @wp.func
    def dof_part(
        cell_arg: CellArg, topo_arg: TopologyArg, cell: int, node: int, point: int, value: Value
    ):
        s = make_free_sample(cell, dof_point_coords(cell_arg, topo_arg, cell, node, point))
        row = orientation_of(cell_arg, topo_arg, cell) * count + begins[node] + point
        direction = Direction()
        for axis in range(dimension):
            direction[axis] = weights[row, axis]
        if wp.static(is_covariant):
            made = wp.dot(wp.transpose(gradient_of(cell_arg, s)) * value, direction)
        else:
            inside = inverse_of(cell_arg, s) * value
            made = wp.dot(inside, direction) * measure_of(cell_arg, s) / measure
        if wp.static(is_signed):
            made *= sign_of(cell_arg, topo_arg, cell, node)
        return made

    return SimpleNamespace(
        dof_point_count=dof_point_count, dof_point_coords=dof_point_coords, dof_part=dof_part
    )


def _on_sides(record):
    """The functions of the nodes' cells: points of a node on a side are on it."""
    geometry = record.topology.geometry.functions
    SideArg, to_cell = geometry.SideArg, geometry.side_to_cell_arg
    from_cell, functions = geometry.side_from_cell_coords, record.topology.functions
    find, TopologyArg = functions.neighbor_cell_index, functions.TopologyArg
    of_cell, space = dof_functions(record.cell_space), record.topology.geometry
    count_of, coords_of, part_of = (
        of_cell.dof_point_count,
        of_cell.dof_point_coords,
        of_cell.dof_part,
    )
    Value = wp.types.vector(length=space.dimension, dtype=space.scalar)

    made = Functions()

    @made.add
    def dof_point_count(side_arg: SideArg, topo_arg: TopologyArg, side: int, node: int):
        cell, place = find(side_arg, topo_arg, side, node)
        return count_of(to_cell(side_arg), topo_arg, cell, place)

    @made.add
    def dof_point_coords(
        side_arg: SideArg, topo_arg: TopologyArg, side: int, node: int, point: int
    ):
        cell, place = find(side_arg, topo_arg, side, node)
        coords = coords_of(to_cell(side_arg), topo_arg, cell, place, point)
        return from_cell(side_arg, side, cell, coords)

    @made.add
    def dof_part(
        side_arg: SideArg, topo_arg: TopologyArg, side: int, node: int, point: int, value: Value
    ):
        cell, place = find(side_arg, topo_arg, side, node)
        return part_of(to_cell(side_arg), topo_arg, cell, place, point, value)

    return made
