"""Evaluation of the other families in kernels - polynomials by coefficients, and products."""

import math
from types import SimpleNamespace

import numpy as np

import warp as wp
from warp._src.fem.cells.cell import TRIANGLE
from warp._src.fem.cells.lagrange_functions import (
    line_functions,
    tensor_functions,
)
from warp._src.fem.cells.tables import table


def _types(cell, real):
    """Coordinates, parameters, and matrices of their size."""
    Coords = wp.types.vector(length=3, dtype=real)
    Vector = wp.types.vector(length=cell.dimension, dtype=real)
    return Coords, Vector, wp.types.matrix(shape=(cell.dimension,) * 2, dtype=real)


def _parameters(cell, center, scale, real):
    """A function of kernels from coordinates to scaled parameters around a centre."""
    Coords, Vector, _ = _types(cell, real)
    middle, size, first = table(center, real), real(scale), 1 if cell == TRIANGLE else 0
    dimension = cell.dimension

    @wp.func
    def parameters(coords: Coords):
        x = Vector(real(0.0))
        for axis in range(dimension):
            x[axis] = size * (coords[first + axis] - middle[axis])
        return x

    return parameters


def _monomials(cell, exponents, real):
    """Functions of kernels: a monomial, and its derivative by an axis."""
    _, Vector, _ = _types(cell, real)
    powers, dimension = table(exponents, wp.int32), cell.dimension

    @wp.func
    def power(x: real, exponent: int):
        made = real(1.0)
        for _ in range(exponent):
            made *= x
        return made

    @wp.func
    def monomial(x: Vector, m: int):
        made = real(1.0)
        for axis in range(dimension):
            made *= power(x[axis], powers[m, axis])
        return made

    @wp.func
    def derivative(x: Vector, m: int, along: int):
        made = real(1.0)
        for axis in range(dimension):
            exponent = powers[m, axis]
            if axis == along:
                made *= real(exponent) * power(x[axis], wp.max(exponent - 1, 0))
            else:
                made *= power(x[axis], exponent)
        return made

    return monomial, derivative


def polynomial(element, real):
    """Sums of monomials of 2 x - 1."""
    cell = element.cell
    exponents, coefficients = element.definition.data
    Coords, Vector, _ = _types(cell, real)
    parameters = _parameters(cell, np.full(cell.dimension, 0.5), 2.0, real)
    monomial, derivative = _monomials(cell, exponents, real)
    factors, count, dimension = table(coefficients, real), len(exponents), cell.dimension

    @wp.func
    def value(coords: Coords, node: int):
        x = parameters(coords)
        made = real(0.0)
        for m in range(count):
            made += factors[node, m] * monomial(x, m)
        return made

    @wp.func
    def gradient(coords: Coords, node: int):
        x = parameters(coords)
        made = Vector(real(0.0))
        for m in range(count):
            factor = real(2.0) * factors[node, m]
            for axis in range(dimension):
                made[axis] += factor * derivative(x, m, axis)
        return made

    return SimpleNamespace(value=value, gradient=gradient)


def splines(element, real):
    """Products of cardinal B-splines."""
    degree, dimension = element.degree, element.cell.dimension
    count = len(element.definition.data)
    first = real(element.definition.data[0])
    terms, half = degree + 2, real(0.5 * (degree + 1))
    scales = [(-1) ** k * math.comb(degree + 1, k) / math.factorial(degree) for k in range(terms)]
    factors, order = table(np.array(scales), real), real(degree)

    @wp.func
    def factor(x: real, i: int):
        distance = wp.abs(x - first - real(i))
        made = real(0.0)
        for k in range(terms):
            left = wp.max(half - real(k) - distance, real(0.0))
            power = factors[k]
            for _ in range(degree):
                power *= left
            made += power
        return made

    @wp.func
    def smooth_slope(x: real, i: int):
        delta = x - first - real(i)
        made = real(0.0)
        for k in range(terms):
            left = half - real(k) - wp.abs(delta)
            if left > real(0.0):
                power = factors[k] * order
                for _ in range(1, degree):
                    power *= left
                made -= power
        return made * wp.sign(delta)

    @wp.func
    def inner_slope(x: real, i: int):
        # The slope of degree 1 at an end of the cell is the one inside.
        return real(2 * i - 1)

    factor_slope = inner_slope if degree == 1 else smooth_slope
    return SimpleNamespace(**tensor_functions(dimension, count, factor, factor_slope, real))


def box_vectors(element, real):
    """Products of Lagrange polynomials along one axis, of squares and cubes."""
    cell = element.cell
    gauss, lobatto, nodes, is_curl = element.definition.data
    Coords, Vector, Matrix = _types(cell, real)
    nodes, dimension = table(nodes, wp.int32), cell.dimension
    own, own_slope = line_functions(tuple(gauss.tolist()), real)
    other, other_slope = line_functions(tuple(lobatto.tolist()), real)

    @wp.func
    def factor(x: real, axis: int, along: int, i: int):
        if (axis == along) == is_curl:
            return own(x, i)
        return other(x, i)

    @wp.func
    def factor_slope(x: real, axis: int, along: int, i: int):
        if (axis == along) == is_curl:
            return own_slope(x, i)
        return other_slope(x, i)

    @wp.func
    def value(coords: Coords, node: int):
        along = nodes[node, 0]
        made = real(1.0)
        for axis in range(dimension):
            made *= factor(coords[axis], axis, along, nodes[node, axis + 1])
        vector = Vector(real(0.0))
        vector[along] = made
        return vector

    @wp.func
    def gradient(coords: Coords, node: int):
        along = nodes[node, 0]
        matrix = Matrix(real(0.0))
        for by in range(dimension):
            made = real(1.0)
            for axis in range(dimension):
                i = nodes[node, axis + 1]
                if axis == by:
                    made *= factor_slope(coords[axis], axis, along, i)
                else:
                    made *= factor(coords[axis], axis, along, i)
            matrix[along, by] = made
        return matrix

    return SimpleNamespace(value=value, gradient=gradient)


def vectors(element, real):
    """Vectors of polynomials by coefficients, for each order of the vertices."""
    cell = element.cell
    exponents, tables, center, scale = element.definition.data
    Coords, Vector, Matrix = _types(cell, real)
    parameters = _parameters(cell, center, scale, real)
    monomial, derivative = _monomials(cell, exponents, real)
    count, dimension, nodes = len(exponents), cell.dimension, tables.shape[1]
    factors, size = table(tables.reshape(-1, count), real), real(scale)

    @wp.func
    def oriented_value(coords: Coords, node: int, orientation: int):
        x = parameters(coords)
        row = (orientation * nodes + node) * dimension
        made = Vector(real(0.0))
        for m in range(count):
            one = monomial(x, m)
            for axis in range(dimension):
                made[axis] += factors[row + axis, m] * one
        return made

    @wp.func
    def oriented_gradient(coords: Coords, node: int, orientation: int):
        x = parameters(coords)
        row = (orientation * nodes + node) * dimension
        made = Matrix(real(0.0))
        for m in range(count):
            for by in range(dimension):
                one = size * derivative(x, m, by)
                for axis in range(dimension):
                    made[axis, by] += factors[row + axis, m] * one
        return made

    @wp.func
    def value(coords: Coords, node: int):
        return oriented_value(coords, node, 0)

    @wp.func
    def gradient(coords: Coords, node: int):
        return oriented_gradient(coords, node, 0)

    return SimpleNamespace(
        value=value,
        gradient=gradient,
        oriented_value=oriented_value,
        oriented_gradient=oriented_gradient,
    )
