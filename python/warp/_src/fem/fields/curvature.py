"""Gradients of vector families on curved cells - the part by the second derivatives of the map.

A covariant value is G' v, a contravariant one is J v / det(J), with the map's gradient J and its
(pseudo-)inverse G. Where J varies in a cell, its derivatives are a part of those of the value. The
curl of covariant and the divergence of contravariant values do not depend on them.
"""

import math
from typing import Any

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.cells.layout import ElementBasis
from warp._src.fem.cells.tables import table
from warp._src.fem.fields.nodes import locations
from warp._src.fem.geometry.shapes import DIMENSIONS
from warp._src.fem.types import coords_type, make_free_sample

# Operators whose value depends on derivatives of the map, by map.
_CURVED = {
    "covariant": frozenset(("grad", "grad_outer", "div", "div_outer")),
    "contravariant": frozenset(("grad", "grad_outer", "curl_grad")),
}


def needs_curvature(domain, map: str, name: str) -> bool:
    """True if an operator of fields of a map depends on second derivatives of the map of cells."""
    return not domain.geometry.affine and name in _CURVED.get(map, ())


def _map_degree(record) -> int | None:
    """Polynomial degree of the map of cells along each coordinate, None if it is no polynomial."""
    if record.kind != "deformed":
        return 1
    base, description, _, is_relative = record.base
    element = getattr(getattr(description, "nodes", None), "element", None)
    if element is None or element.basis is ElementBasis.BSPLINE:
        return None
    degrees = [description.degree, _map_degree(base) if is_relative else 1]
    return None if None in degrees else max(degrees)


def _stencil(degree: int):
    """Distances and weights of differences that are exact for polynomials of a degree."""
    pairs = (degree + 1) // 2
    distances = 0.5 * np.arange(1, pairs + 1) / pairs
    weights = [
        (-1) ** (j + 1) * math.comb(2 * pairs, pairs - j) / math.comb(2 * pairs, pairs) / j
        for j in range(1, pairs + 1)
    ]
    return distances, np.array(weights) * 2.0 * pairs


def _bend_function(domain, half: int) -> wp.Function:
    """A function of (elements, sample): derivatives of J by reference coordinates, a row for each
    element of J.

    Derivatives of polynomials are differences, which are exact but for rounding and have
    derivatives themselves; automatic differentiation gives others.
    """
    geometry, at = domain.geometry, locations(domain, half)
    d, k, real = geometry.dimension, DIMENSIONS[geometry.cell], geometry.scalar
    Coords, Rows = coords_type(real), wp.types.matrix((d * k, k), real)
    gradient, CellArg = geometry.functions.cell_deformation_gradient, geometry.functions.CellArg
    cell_arg, cell, coords = at.cell_arg, at.cell, at.coords
    gradient_by, is_barycentric = extend.gradient_by, geometry.cell == "triangle"
    first, degree = int(is_barycentric), _map_degree(geometry)
    if degree is not None:
        distances, weights = (table(values, real) for values in _stencil(degree))
        pairs = (degree + 1) // 2

        @wp.func
        def bend(geo: Any, s: Any):
            out = Rows()
            arg, index, place = cell_arg(geo), cell(geo, s), coords(geo, s)
            for i in range(k):
                axis = Coords()
                axis[i + first] = real(1.0)
                if wp.static(is_barycentric):
                    axis[0] = real(-1.0)
                for j in range(pairs):
                    step = distances[j] * axis
                    slope = gradient(arg, make_free_sample(index, place + step))
                    slope -= gradient(arg, make_free_sample(index, place - step))
                    for row in range(d * k):
                        out[row, i] += weights[j] * slope[row // k, row % k]
            return out

        return bend

    @wp.func
    def element(c: Coords, row: int, arg: CellArg, index: int):
        F = gradient(arg, make_free_sample(index, c))
        return F[row // k, row % k]

    @wp.func
    def bend(geo: Any, s: Any):
        out = Rows()
        for row in range(d * k):
            found = gradient_by(element, 1)(coords(geo, s), row, cell_arg(geo), cell(geo, s))[0]
            for i in range(k):
                out[row, i] = found[i + first]
                if wp.static(is_barycentric):
                    out[row, i] -= found[0]
        return out

    return bend


def curved_gradient(description, reference, half: int, forward, inverse, stretch) -> wp.Function:
    """The function of a field's gradient in space, for cells that are not affine."""
    domain, geometry = description.domain, description.domain.geometry
    d, k, real = geometry.dimension, DIMENSIONS[geometry.cell], geometry.scalar
    value, gradient = reference[half].value, reference[half].gradient
    Columns, Square = wp.types.matrix((d, k), real), wp.types.matrix((k, k), real)
    Slope = wp.types.vector(k, real)
    bend_of, is_surface, one = _bend_function(domain, half), k < d, real(1.0)

    @wp.func
    def along(bend: Any, w: Any):
        """Derivatives of J w by reference coordinates, for a constant w."""
        out = Columns()
        for m in range(d):
            for j in range(k):
                out[m] += w[j] * bend[m * k + j]
        return out

    if description.values.map == "covariant":

        @wp.func
        def field_gradient(part: Any, arg: Any, geo: Any, s: Any):
            G, bend = inverse(geo, s), bend_of(geo, s)
            v = wp.transpose(G) * value(part, arg, geo, s)
            turn = Square()
            for m in range(d):
                for j in range(k):
                    turn[j] += v[m] * bend[m * k + j]
            found = wp.transpose(G) * (gradient(part, arg, geo, s) - turn)
            if wp.static(is_surface):
                aside = along(bend, G * v)
                found += aside - forward(geo, s) * (G * aside)
            return found * G

    else:

        @wp.func
        def field_gradient(part: Any, arg: Any, geo: Any, s: Any):
            F, G, bend = forward(geo, s), inverse(geo, s), bend_of(geo, s)
            scale = one / stretch(F)
            w = value(part, arg, geo, s) * scale
            growth = Slope()
            for m in range(d):
                for j in range(k):
                    growth += G[j, m] * bend[m * k + j]
            found = F * (gradient(part, arg, geo, s) * scale) + along(bend, w)
            return (found - wp.outer(F * w, growth)) * G

    return field_gradient
