"""Functions of kernels of topologies - nodes of cells by arithmetic or from tables."""

import warp as wp
from warp import extend
from warp._src.fem.kept import Functions
from warp._src.fem.types import NULL_NODE_INDEX, Ints, IntTable


def topology_functions(record) -> Functions:
    """The struct and the functions of a topology of cells."""
    made = {"discontinuous": _discontinuous, "grid": _grid, "table": _table}[record.kind](record)
    add_constants(made, record, record.geometry.functions.CellArg)
    return made


def add_constants(made, record, ElementArg) -> None:
    """Adds the functions that are the same for all elements, where there are no others.
    `element_node_sign` is None if no node has a sign."""
    count, TopologyArg = record.nodes, made.TopologyArg

    @wp.func
    def element_node_count(element_arg: ElementArg, topo_arg: TopologyArg, element: int):
        return count

    @wp.func
    def element_orientation(element_arg: ElementArg, topo_arg: TopologyArg, element: int):
        return 0

    constants = {"element_node_count": element_node_count, "element_node_sign": None}
    constants["element_orientation"] = element_orientation
    for name, function in constants.items():
        if not hasattr(made, name):
            setattr(made, name, function)


def _discontinuous(record):
    CellArg = record.geometry.functions.CellArg
    TopologyArg = extend.struct_from_fields("CellNodesArg", {}, module=__name__)
    count = record.nodes

    made = Functions(TopologyArg=TopologyArg)

    @made.add
    def element_node_index(cell_arg: CellArg, topo_arg: TopologyArg, element: int, node: int):
        return element * count + node

    return made


def _grid(record):
    CellArg = record.geometry.functions.CellArg
    dimension = 2 if record.geometry.cell == "square" else 3
    counts = wp.types.vector(length=dimension, dtype=wp.int32)
    fields = {"res": counts, "strides": counts, "cells": wp.int32, "nodes": wp.int32}
    TopologyArg = extend.struct_from_fields(f"Grid{dimension}DNodesArg", fields, module=__name__)
    step, width, several = record.step, record.width, record.geometry.environments

    made = Functions(TopologyArg=TopologyArg)

    @made.add
    def element_node_index(cell_arg: CellArg, topo_arg: TopologyArg, element: int, node: int):
        cell = element
        number = int(0)
        if wp.static(several):
            environment = element // topo_arg.cells
            cell = element - environment * topo_arg.cells
            number = environment * topo_arg.nodes
        rest = node
        for k in range(dimension):
            axis = wp.static(dimension - 1) - k
            # The first axis has what is left.
            along = cell
            inside = rest
            if k < wp.static(dimension - 1):
                along = cell % topo_arg.res[axis]
                inside = rest % width
                cell = cell // topo_arg.res[axis]
                rest = rest // width
            number += (along * step + inside) * topo_arg.strides[axis]
        return number

    return made


def _table(record):
    CellArg = record.geometry.functions.CellArg
    real = record.geometry.scalar
    fields = {"nodes": IntTable}
    if record.is_signed:
        fields["signs"] = wp.array2d(dtype=wp.int8)
    if record.is_oriented:
        fields["orientations"] = Ints
    TopologyArg = extend.struct_from_fields("NodeTableArg", fields, module=__name__)

    made = Functions(TopologyArg=TopologyArg)

    @made.add
    def element_node_index(cell_arg: CellArg, topo_arg: TopologyArg, element: int, node: int):
        return topo_arg.nodes[element, node]

    if record.is_signed:

        @made.add
        def element_node_sign(cell_arg: CellArg, topo_arg: TopologyArg, element: int, node: int):
            return real(topo_arg.signs[element, node])

    if record.is_oriented:

        @made.add
        def element_orientation(cell_arg: CellArg, topo_arg: TopologyArg, element: int):
            return topo_arg.orientations[element]

    return made


def _fill_kernel(record):
    ElementArg = record.geometry.functions
    ElementArg = ElementArg.SideArg if record.kind == "trace" else ElementArg.CellArg
    functions = record.functions
    TopologyArg = functions.TopologyArg
    count_of, index_of = functions.element_node_count, functions.element_node_index

    @wp.kernel(enable_backward=False)
    def fill_nodes(element_arg: ElementArg, topo_arg: TopologyArg, nodes: IntTable):
        element, k = wp.tid()
        number = int(NULL_NODE_INDEX)
        if k < count_of(element_arg, topo_arg, element):
            number = index_of(element_arg, topo_arg, element, k)
        nodes[element, k] = number

    return fill_nodes


_kernels: dict = {}


def element_node_indices(topology, out=None):
    """Node numbers of each element of a topology, int32 (elements, n)."""
    geometry, record = topology.geometry, topology.record
    elements = geometry.side_count() if topology.is_trace else geometry.cell_count()
    shape = (elements, record.nodes)
    if out is None:
        out = wp.empty(shape, dtype=wp.int32)
    elif out.shape != shape or out.dtype is not wp.int32:
        raise ValueError(
            f"'out' expects shape {shape} and type int32, but got {out.shape} and "
            f"{extend.type_repr(out.dtype)}"
        )
    if record not in _kernels:
        _kernels[record] = _fill_kernel(record)
    device = out.device
    of_sides = topology.is_trace
    arg = (geometry.side_arg_value if of_sides else geometry.cell_arg_value)(device)
    inputs = [arg, topology.topo_arg_value(device), out]
    with extend.unrecorded():
        wp.launch(_kernels[record], shape, inputs, device=device)
    return out
