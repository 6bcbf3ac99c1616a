"""Operators of nodes of discrete fields, and the way from a trace to cells."""

import functools
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import warp as wp
from warp import extend
from warp._src.fem.fields.nodes import locations, signed_weights
from warp._src.fem.kept import Functions
from warp._src.fem.types import make_free_sample


@functools.cache
def discrete_node_functions(nodes, domain) -> SimpleNamespace:
    """Functions of (slots, argument, geometry, sample[, node])."""
    inner, outer = locations(domain, 0), locations(domain, 1)
    cell_arg, cell, out_arg, out_cell = inner.cell_arg, inner.cell, outer.cell_arg, outer.cell
    topology = nodes.topology.functions
    count_of, index_of = topology.element_node_count, topology.element_node_index
    place_of, partition_index = nodes.functions.node_coords, nodes.partition_node_index
    weight, weight_gradient = signed_weights(nodes)
    is_cells = domain.is_cells
    from_cell = None if is_cells else domain.functions.cell_to_element_coords

    @wp.func
    def first_count(arg: Any, geo: Any, s: Any):
        return count_of(cell_arg(geo), arg.topology, cell(geo, s))

    made = Functions()

    @made.add
    def node_count(part: Any, arg: Any, geo: Any, s: Any):
        found = first_count(arg, geo, s)
        if wp.static(not is_cells):
            found += count_of(out_arg(geo), arg.topology, out_cell(geo, s))
        return found

    @wp.func
    def split(arg: Any, geo: Any, s: Any, node: int):
        """Cell of a node, and its number in it."""
        if wp.static(is_cells):
            return s.element_index, node
        else:
            first = first_count(arg, geo, s)
            owner = cell(geo, s)
            local = node
            if node >= first:
                owner = out_cell(geo, s)
                local = node - first
            return owner, local

    @made.add
    def node_index(part: Any, arg: Any, geo: Any, s: Any, node: int):
        owner, local = split(arg, geo, s, node)
        return index_of(cell_arg(geo), arg.topology, owner, local)

    @made.add
    def at_node(part: Any, arg: Any, geo: Any, s: Any, node: int):
        owner, local = split(arg, geo, s, node)
        place = place_of(cell_arg(geo), arg.topology, owner, local)
        if wp.static(is_cells):
            return make_free_sample(s.element_index, place)
        else:
            return make_free_sample(s.element_index, from_cell(geo, s.element_index, owner, place))

    @made.add
    def node_partition_index(part: Any, arg: Any, geo: Any, node: int):
        return partition_index(arg.partition, node)

    def weight_of(half, basis_function, to_space=None):
        """A basis function of the inner or outer cell, 0 for nodes of the other one."""
        at = (inner, outer)[half]
        cell_arg, cell, coords, is_outer = at.cell_arg, at.cell, at.coords, half == 1

        @wp.func
        def node_weight(part: Any, arg: Any, geo: Any, s: Any, node: int):
            local = split(arg, geo, s, node)[1]
            basis = basis_function(cell_arg(geo), arg.topology, cell(geo, s), coords(geo, s), local)
            if wp.static(not is_cells):
                if (node >= first_count(arg, geo, s)) != is_outer:
                    basis = type(basis)()
            if wp.static(to_space is not None):
                return to_space(geo, s, basis)
            else:
                return basis

        return node_weight

    made.node_inner_weight = weight_of(0, weight)
    made.node_outer_weight = weight_of(1, weight)
    made.node_inner_weight_gradient = weight_of(0, weight_gradient, _to_space(domain, 0))
    made.node_outer_weight_gradient = weight_of(1, weight_gradient, _to_space(domain, 1))
    return made


def _to_space(domain, half):
    """A function of (geometry, sample, gradient by reference coordinates): gradient in space."""
    from warp._src.fem.fields.base import inverse_map

    inverse = inverse_map(domain, half)

    @wp.func
    def to_space(geo: Any, s: Any, gradient: Any):
        return wp.transpose(inverse(geo, s)) * gradient

    return to_space


def cells_of(description):
    """The record of a trace's field in cells."""
    found = replace(description, domain=description.domain.cells)
    if description.domain.is_cells:
        return extend.Recast(found)
    return extend.Recast(found, _parts_function(locations(description.domain, 0).cell_arg))


def _parts_function(cell_arg):
    @wp.func
    def parts(part: Any, arg: Any, geo: Any):
        return part, arg, cell_arg(geo)

    return parts
