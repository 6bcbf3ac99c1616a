"""Evaluation of elements in kernels - for points that are not known before a kernel runs."""

import functools
from types import SimpleNamespace

import warp as wp
from warp._src.fem.cells import lagrange_functions
from warp._src.fem.cells.element import Element
from warp._src.fem.cells.tables import table


@functools.cache
def element_functions(element: Element, real=wp.float32) -> SimpleNamespace:
    """Functions of kernels that evaluate an element.

    Args:
        real: scalar type of coordinates and values.

    Returns:
        `value(coords, node)` and `gradient(coords, node)`, by parameters, of a basis function;
        `node_coords(node)`, `node_weight(node)` and `trace_weight(node)`. Elements with
        orientations have `oriented_value(coords, node, orientation)` and `oriented_gradient`, too.
    """
    kind = element.definition.kind
    makers = lagrange_functions
    if not hasattr(makers, kind):
        from warp._src.fem.cells import family_functions as makers

    functions = getattr(makers, kind)(element, real)
    functions.node_coords = _node_coords(element, real)
    functions.node_weight = _numbers(tuple(element.node_weights.tolist()), real)
    functions.trace_weight = _numbers(tuple(element.trace_weights.tolist()), real)
    return functions


@functools.cache
def _numbers(values, real):
    if len(set(values)) == 1:
        first = real(values[0])

        @wp.func
        def node_number(node: int):
            return first

        return node_number
    numbers = table(values, real)

    @wp.func
    def node_number(node: int):
        return numbers[node]

    return node_number


def _node_coords(element, real):
    places = table(element.node_coords, real)
    Coords = wp.types.vector(length=3, dtype=real)

    @wp.func
    def node_coords(node: int):
        return Coords(places[node, 0], places[node, 1], places[node, 2])

    return node_coords
