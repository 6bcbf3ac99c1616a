"""Evaluation of elements in kernels - for points that are not known before a kernel runs."""

import functools
from types import SimpleNamespace

import numpy as np

import warp as wp
from warp._src.fem.cells.cell import TRIANGLE
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
    made = {"constant": _constant, "lattice": _lattice, "tensor": _tensor}
    kind = element.definition.kind
    if kind in made:
        functions = made[kind](element, real)
    else:
        from warp._src.fem.cells import family_functions

        functions = getattr(family_functions, kind)(element, real)
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


def _constant(element, real):
    Coords = wp.types.vector(length=3, dtype=real)
    Gradient = wp.types.vector(length=max(1, element.cell.dimension), dtype=real)

    @wp.func
    def value(coords: Coords, node: int):
        return real(1.0)

    @wp.func
    def gradient(coords: Coords, node: int):
        return Gradient(real(0.0))

    return SimpleNamespace(value=value, gradient=gradient)


@functools.cache
def barycentric_function(cell, real):
    """A function of kernels from coordinates to the barycentric ones of a triangle or tet."""
    Coords = wp.types.vector(length=3, dtype=real)
    Four = wp.types.vector(length=4, dtype=real)
    if cell == TRIANGLE:

        @wp.func
        def barycentric(coords: Coords):
            return coords

        return barycentric

    @wp.func
    def barycentric(coords: Coords):
        first = real(1.0) - coords[0] - coords[1] - coords[2]
        return Four(first, coords[0], coords[1], coords[2])

    return barycentric


def _lattice(element, real):
    return lattice_functions(element.cell, element.degree, real)


@functools.cache
def lattice_functions(cell, degree, real):
    """Lagrange polynomials of the lattice of a triangle or tetrahedron."""
    from warp._src.fem.cells import simplices

    size = cell.dimension + 1
    steps = table(np.array([place for place, _ in simplices.lattice(cell, degree)]), wp.int32)
    Coords = wp.types.vector(length=3, dtype=real)
    Gradient = wp.types.vector(length=cell.dimension, dtype=real)
    barycentric = barycentric_function(cell, real)
    n = real(degree)

    @wp.func
    def linear_value(coords: Coords, node: int):
        return barycentric(coords)[node]

    @wp.func
    def linear_gradient(coords: Coords, node: int):
        gradient = Gradient(real(0.0))
        for i in range(1, size):
            gradient[i - 1] = wp.where(node == i, real(1.0), real(0.0))
            gradient[i - 1] -= wp.where(node == 0, real(1.0), real(0.0))
        return gradient

    if degree == 1:
        return SimpleNamespace(value=linear_value, gradient=linear_gradient)

    @wp.func
    def factor(x: real, count: int):
        made = real(1.0)
        for j in range(count):
            made *= (n * x - real(j)) / real(j + 1)
        return made

    @wp.func
    def factor_slope(x: real, count: int):
        made = real(1.0)
        slope = real(0.0)
        for j in range(count):
            scale = real(1.0) / real(j + 1)
            term = (n * x - real(j)) * scale
            slope = slope * term + made * n * scale
            made *= term
        return slope

    @wp.func
    def value(coords: Coords, node: int):
        places = barycentric(coords)
        made = real(1.0)
        for i in range(size):
            made *= factor(places[i], steps[node, i])
        return made

    @wp.func
    def gradient(coords: Coords, node: int):
        places = barycentric(coords)
        gradient = Gradient(real(0.0))
        first = real(0.0)
        for i in range(size):
            slope = factor_slope(places[i], steps[node, i])
            for k in range(size):
                if k != i:
                    slope *= factor(places[k], steps[node, k])
            if i == 0:
                first = slope
            else:
                gradient[i - 1] = slope - first
        return gradient

    return SimpleNamespace(value=value, gradient=gradient)


def _tensor(element, real):
    dimension, count = element.cell.dimension, element.degree + 1
    points, scales = (table(row, real) for row in element.definition.data)

    @wp.func
    def factor(x: real, i: int):
        made = scales[i]
        for k in range(count):
            made *= wp.where(k == i, real(1.0), x - points[k])
        return made

    @wp.func
    def factor_slope(x: real, i: int):
        made = scales[i]
        slope = real(0.0)
        for k in range(count):
            if k != i:
                delta = x - points[k]
                slope = slope * delta + made
                made *= delta
        return slope

    return SimpleNamespace(**tensor_functions(dimension, count, factor, factor_slope, real))


def tensor_functions(dimension, count, factor, factor_slope, real):
    """Products of functions per axis, `factor(x, i)`; nodes are numbered last axis first."""
    Coords = wp.types.vector(length=3, dtype=real)
    Gradient = wp.types.vector(length=dimension, dtype=real)

    @wp.func
    def value(coords: Coords, node: int):
        made = real(1.0)
        rest = node
        for k in range(dimension):
            axis = wp.static(dimension - 1) - k
            i = rest % count
            rest = rest // count
            made *= factor(coords[axis], i)
        return made

    @wp.func
    def gradient(coords: Coords, node: int):
        gradient = Gradient(real(1.0))
        rest = node
        for k in range(dimension):
            axis = wp.static(dimension - 1) - k
            i = rest % count
            rest = rest // count
            one = factor(coords[axis], i)
            slope = factor_slope(coords[axis], i)
            for other in range(dimension):
                gradient[other] *= wp.where(other == axis, slope, one)
        return gradient

    return {"value": value, "gradient": gradient}
