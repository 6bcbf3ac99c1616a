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
    """A function of (elements, sample): the derivatives of J along each reference coordinate."""
    geometry, at = domain.geometry, locations(domain, half)
    cell_arg, cell, coords = at.cell_arg, at.cell, at.coords
    if geometry.kind == "mesh":
        cell_bend = geometry.functions.cell_bend

        @wp.func
        def bend(geo: Any, s: Any):
            return cell_bend(cell_arg(geo), make_free_sample(cell(geo, s), coords(geo, s)))

        return bend

    d, k, real = geometry.dimension, DIMENSIONS[geometry.cell], geometry.scalar
    rows_of = _rows_function(geometry, d, k)
    Rows, Columns = wp.types.matrix((d * k, k), real), wp.types.matrix((d, k), real)

    @wp.func
    def column(rows: Rows, i: int):
        out = Columns()
        for row in range(d * k):
            out[row // k, row % k] = rows[row, i]
        return out

    @wp.func
    def bend(geo: Any, s: Any):
        rows = rows_of(cell_arg(geo), cell(geo, s), coords(geo, s))
        if wp.static(k == 2):
            return column(rows, 0), column(rows, 1)
        else:
            return column(rows, 0), column(rows, 1), column(rows, 2)

    return bend


def _rows_function(geometry, d: int, k: int) -> wp.Function:
    """A function of (cells, cell, coordinates): derivatives of J by reference coordinates, a row
    for each element of J.

    Derivatives of polynomials are differences, which are exact but for rounding and have
    derivatives themselves; automatic differentiation gives others.
    """
    real = geometry.scalar
    Coords, Rows = coords_type(real), wp.types.matrix((d * k, k), real)
    gradient, CellArg = geometry.functions.cell_deformation_gradient, geometry.functions.CellArg
    gradient_by, is_barycentric = extend.gradient_by, geometry.cell == "triangle"
    first, degree = int(is_barycentric), _map_degree(geometry)
    if degree is not None:
        distances, weights = (table(values, real) for values in _stencil(degree))
        pairs = (degree + 1) // 2

        @wp.func
        def rows_of(arg: CellArg, index: int, place: Coords):
            out = Rows()
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

        return rows_of

    @wp.func
    def element(c: Coords, row: int, arg: CellArg, index: int):
        F = gradient(arg, make_free_sample(index, c))
        return F[row // k, row % k]

    @wp.func
    def rows_of(arg: CellArg, index: int, place: Coords):
        out = Rows()
        for row in range(d * k):
            found = gradient_by(element, 1)(place, row, arg, index)[0]
            for i in range(k):
                out[row, i] = found[i + first]
                if wp.static(is_barycentric):
                    out[row, i] -= found[0]
        return out

    return rows_of


def _sums_functions(k: int) -> tuple:
    """Functions of the derivatives of J, without loops, so that their copies are found to be equal:
    by (derivatives, w) those of J w, by (derivatives, v) those of v J, and by (derivatives, G) the
    traces of G with each of them."""
    if k == 2:

        @wp.func
        def along(bend: Any, w: Any):
            return wp.matrix_from_cols(bend[0] * w, bend[1] * w)

        @wp.func
        def across(bend: Any, v: Any):
            return wp.matrix_from_cols(v * bend[0], v * bend[1])

        @wp.func
        def traces(bend: Any, G: Any):
            return wp.vector(wp.trace(G * bend[0]), wp.trace(G * bend[1]))

    else:

        @wp.func
        def along(bend: Any, w: Any):
            return wp.matrix_from_cols(bend[0] * w, bend[1] * w, bend[2] * w)

        @wp.func
        def across(bend: Any, v: Any):
            return wp.matrix_from_cols(v * bend[0], v * bend[1], v * bend[2])

        @wp.func
        def traces(bend: Any, G: Any):
            return wp.vector(wp.trace(G * bend[0]), wp.trace(G * bend[1]), wp.trace(G * bend[2]))

    return along, across, traces


def curved_gradient(description, reference, half: int, forward, inverse, stretch) -> wp.Function:
    """The function of a field's gradient in space, for cells that are not affine."""
    domain, geometry = description.domain, description.domain.geometry
    k, one = DIMENSIONS[geometry.cell], geometry.scalar(1.0)
    value, gradient = reference[half].value, reference[half].gradient
    bend_of, is_surface = _bend_function(domain, half), k < geometry.dimension
    along, across, traces = _sums_functions(k)

    if description.values.map == "covariant":

        @wp.func
        def field_gradient(part: Any, arg: Any, geo: Any, s: Any):
            G, bend = inverse(geo, s), bend_of(geo, s)
            v = wp.transpose(G) * value(part, arg, geo, s)
            found = wp.transpose(G) * (gradient(part, arg, geo, s) - across(bend, v))
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
            found = F * (gradient(part, arg, geo, s) * scale) + along(bend, w)
            return (found - wp.outer(F * w, traces(bend, G))) * G

    return field_gradient
