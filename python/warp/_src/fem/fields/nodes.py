"""Nodes of a sample's element - numbers, basis functions and sums over them, in kernels.

On sides, nodes of the inner cell come first, then those of the outer one, as in traces of spaces.
"""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp
from warp import extend


@functools.cache
def locations(domain, half: int) -> SimpleNamespace:
    """Functions of (argument of elements, sample): cell argument, cell, coordinates in it."""
    if domain.is_cells:

        @wp.func
        def cell_arg(geo: Any):
            return geo

        @wp.func
        def cell(geo: Any, s: Any):
            return s.element_index

        @wp.func
        def coords(geo: Any, s: Any):
            return s.element_coords

    else:
        side = "outer" if half else "inner"
        functions, geometry = domain.functions, domain.geometry.functions
        index, place = (getattr(functions, f"element_{side}_cell_{w}") for w in ("index", "coords"))
        cell_arg = geometry.side_to_cell_arg

        @wp.func
        def cell(geo: Any, s: Any):
            return index(geo, s.element_index)

        @wp.func
        def coords(geo: Any, s: Any):
            return place(geo, s.element_index, s.element_coords)

    return SimpleNamespace(cell_arg=cell_arg, cell=cell, coords=coords)


@wp.func
def scaled(basis: Any, dof: Any):
    """A basis function times a degree of freedom."""
    return basis * dof


@functools.cache
def gradient_product_function(values):
    """A function of (gradient of a basis function, degree of freedom): their product."""
    if values.map == "identity" and extend.type_is_matrix(values.dof):
        Dof, (rows, columns) = values.dof, values.dof._shape_
        Flat = wp.types.vector(extend.type_size(Dof), extend.type_scalar_type(Dof))

        @wp.func
        def product(gradient: Any, dof: Any):
            flat = Flat()
            for i in range(rows):
                for j in range(columns):
                    flat[i * columns + j] = dof[i, j]
            return wp.outer(flat, gradient)

    elif values.map == "identity" and extend.type_is_vector(values.dof):

        @wp.func
        def product(gradient: Any, dof: Any):
            return wp.outer(dof, gradient)

    else:

        @wp.func
        def product(gradient: Any, dof: Any):
            return gradient * dof

    return product


@functools.cache
def memory_reference(space, values, domain, half: int, one_node: bool) -> SimpleNamespace:
    """Functions of (node, field argument, argument of elements, sample): reference values of a
    discrete field, summed over the nodes of a cell or of one node."""
    at = locations(domain, half)
    cell_arg, cell, coords = at.cell_arg, at.cell, at.coords
    weight, weight_gradient = signed_weights(space)
    node_count = space.topology.functions.element_node_count
    dof_at = dof_function(space)
    Value, Gradient = values.reference_types(space.cell_dimension)

    def reference(Type, basis_function, product):
        if one_node:

            @wp.func
            def found(part: Any, arg: Any, geo: Any, s: Any):
                cells, element, place = cell_arg(geo), cell(geo, s), coords(geo, s)
                dof = dof_at(arg, cells, element, part)
                return product(basis_function(cells, arg.topology, element, place, part), dof)

        else:

            @wp.func
            def found(part: Any, arg: Any, geo: Any, s: Any):
                cells, element, place = cell_arg(geo), cell(geo, s), coords(geo, s)
                total = Type()
                for k in range(node_count(cells, arg.topology, element)):
                    dof = dof_at(arg, cells, element, k)
                    total += product(basis_function(cells, arg.topology, element, place, k), dof)
                return total

        return found

    return SimpleNamespace(
        value=reference(Value, weight, scaled),
        gradient=reference(Gradient, weight_gradient, gradient_product_function(values)),
    )


@functools.cache
def signed_weights(space) -> tuple:
    """Functions of (cell argument, topology argument, cell, coordinates, node): a basis function
    and its gradient by reference coordinates, with the sign of the node in the cell."""
    functions, topology = space.functions, space.topology.functions
    weight, weight_gradient = functions.weight, functions.weight_gradient
    sign = topology.element_node_sign
    if sign is None:
        return weight, weight_gradient

    def signed(function):
        @wp.func
        def signed_weight(cells: Any, topology: Any, element: int, coords: Any, node: int):
            basis = function(cells, topology, element, coords, node)
            return sign(cells, topology, element, node) * basis

        return signed_weight

    return signed(weight), signed(weight_gradient)


@functools.cache
def dof_function(space):
    """A function of (field argument, cell argument, cell, node): a degree of freedom."""
    node_index = space.topology.functions.element_node_index
    partition_index, Dof = space.partition_node_index, space.dof_dtype

    @wp.func
    def dof_at(arg: Any, cells: Any, element: int, k: int):
        index = partition_index(arg.partition, node_index(cells, arg.topology, element, k))
        if index < 0 or index >= arg.values.shape[0]:
            return Dof()
        return arg.values[index]

    return dof_at
