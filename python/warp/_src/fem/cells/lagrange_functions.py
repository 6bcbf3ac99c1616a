"""Evaluation of Lagrange elements in kernels - products of factors by parameter."""

import functools
from types import SimpleNamespace

import numpy as np

import warp as wp
from warp._src.fem.cells import simplices
from warp._src.fem.cells.cell import TRIANGLE
from warp._src.fem.cells.polynomial import lagrange_scales
from warp._src.fem.cells.tables import table


def constant(element, real):
    """The basis function of elements of degree 0."""
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


def lattice(element, real):
    """Lagrange elements of triangles and tetrahedra."""
    return lattice_functions(element.cell, element.degree, real)


@functools.cache
def lattice_functions(cell, degree, real):
    """Lagrange polynomials of the lattice of a triangle or tetrahedron."""
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


def tensor(element, real):
    """Lagrange elements of lines, squares and cubes."""
    points = tuple(element.definition.data[0].tolist())
    count = len(points)
    factor, factor_slope = line_functions(points, real)
    return SimpleNamespace(
        **tensor_functions(element.cell.dimension, count, factor, factor_slope, real)
    )


@functools.cache
def line_functions(points, real):
    """Functions of kernels: the Lagrange polynomial of a point, and its derivative."""
    count = len(points)
    places, scales = table(np.array(points), real), table(lagrange_scales(points), real)

    @wp.func
    def factor(x: real, i: int):
        made = scales[i]
        for k in range(count):
            made *= wp.where(k == i, real(1.0), x - places[k])
        return made

    @wp.func
    def factor_slope(x: real, i: int):
        made = scales[i]
        slope = real(0.0)
        for k in range(count):
            if k != i:
                delta = x - places[k]
                slope = slope * delta + made
                made *= delta
        return slope

    return factor, factor_slope


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
