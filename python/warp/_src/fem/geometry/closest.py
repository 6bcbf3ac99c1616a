"""Closest points and inverse maps of cells: closed forms, Newton's method where cells are warped.

Functions take the corners of a cell as the rows of a matrix, all relative to the first, and a
point relative to it, so that no size and no offset is lost to rounding.
"""

import functools

import warp as wp
from warp._src.fem.geometry.shape_functions import shape_functions, side_coords_function
from warp._src.fem.geometry.shapes import DIMENSIONS, SIDES, VERTICES
from warp._src.fem.types import coords_type

_EPSILON = {wp.float32: 2.0**-23, wp.float64: 2.0**-52}
# Newton's method doubles the digits in each step; halved steps take more.
_STEPS = 24
# Columns of the corners of each side; those of squares go around.
_SIDES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "square": ((0, 1), (1, 2), (3, 2), (0, 3)),
    "tet": ((0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 2, 3)),
    "cube": (
        *((0, 3, 7, 4), (1, 2, 6, 5), (0, 1, 5, 4)),
        *((3, 2, 6, 7), (0, 1, 2, 3), (4, 5, 6, 7)),
    ),
}


@functools.cache
def nearest_functions(cell: str, d: int, real, affine: bool):
    """Functions of (corners, point): coordinates by the inverse map, and (coordinates, squared
    distance) of the closest point of the cell."""
    if cell == "line":
        return _line(d, real)
    Corners, vector = wp.types.matrix((VERTICES[cell], d), real), wp.types.vector(d, real)
    coordinates, boundary = _coordinates(cell, d, real, affine), _boundary(cell, d, real)
    is_solid, is_triangle = DIMENSIONS[cell] == d, cell == "triangle"
    if is_solid:
        inside = inside_function(cell, d, real, affine)

        @wp.func
        def closest(p: Corners, q: vector):
            c, is_inside = inside(p, q)
            if is_inside:
                return c, real(0.0)
            return boundary(p, q)

    elif is_triangle:
        slack = real(4.0 * _EPSILON[real])

        @wp.func
        def closest(p: Corners, q: vector):
            c = coordinates(p, q)
            if wp.min(c) >= -slack:
                r = q - c[1] * p[1] - c[2] * p[2]
                return c, wp.dot(r, r)
            return boundary(p, q)

    else:
        solve = _newton(cell, d, real, affine)

        @wp.func
        def closest(p: Corners, q: vector):
            c, gap_sq = solve(p, q)
            edge_coords, edge_sq = boundary(p, q)
            is_between = wp.min(c) >= real(0.0) and wp.max(c) <= real(1.0)
            if is_between and gap_sq >= real(0.0) and gap_sq <= edge_sq:
                return c, gap_sq
            return edge_coords, edge_sq

    return coordinates, closest


@functools.cache
def inside_function(cell: str, d: int, real, affine: bool):
    """Function of (corners, point): coordinates, and True if the point is in the cell; None for
    cells of fewer dimensions than space."""
    k = DIMENSIONS[cell]
    if k < d:
        return None
    Corners, vector = wp.types.matrix((VERTICES[cell], d), real), wp.types.vector(d, real)
    slack, one = real(4.0 * _EPSILON[real]), real(1.0)
    if cell in ("triangle", "tet"):
        coordinates, is_tet = _coordinates(cell, d, real, affine), cell == "tet"

        @wp.func
        def inside(p: Corners, q: vector):
            c = coordinates(p, q)
            lowest = wp.min(c)
            if wp.static(is_tet):
                lowest = wp.min(lowest, one - c[0] - c[1] - c[2])
            return c, lowest >= -slack

    else:
        solve = _newton(cell, d, real, affine)

        @wp.func
        def inside(p: Corners, q: vector):
            c, gap_sq = solve(p, q)
            is_inside = gap_sq >= real(0.0)
            for i in range(k):
                is_inside = is_inside and c[i] >= -slack and c[i] <= one + slack
            return c, is_inside

    return inside


def _line(d, real):
    Corners, vector = wp.types.matrix((2, d), real), wp.types.vector(d, real)
    Coords, zero = coords_type(real), real(0.0)

    @wp.func
    def coordinates(p: Corners, q: vector):
        return Coords(wp.dot(q, p[1]) / wp.dot(p[1], p[1]), zero, zero)

    @wp.func
    def closest(p: Corners, q: vector):
        length_sq = wp.dot(p[1], p[1])
        t = zero
        if length_sq > zero:
            t = wp.clamp(wp.dot(q, p[1]) / length_sq, zero, real(1.0))
        r = q - t * p[1]
        return Coords(t, zero, zero), wp.dot(r, r)

    return coordinates, closest


@functools.cache
def _coordinates(cell, d, real, affine):
    """Function of (corners, point): coordinates by the inverse map; of the closest point of the
    plane of a triangle in space."""
    Corners, vector = wp.types.matrix((VERTICES[cell], d), real), wp.types.vector(d, real)
    Coords, is_plane, one = coords_type(real), d == 2, real(1.0)
    if cell == "triangle":

        @wp.func
        def coordinates(p: Corners, q: vector):
            u, v = p[1], p[2]
            if wp.static(is_plane):
                area = u[0] * v[1] - u[1] * v[0]
                s = (q[0] * v[1] - q[1] * v[0]) / area
                t = (u[0] * q[1] - u[1] * q[0]) / area
            else:
                n = wp.cross(u, v)
                area_sq = wp.dot(n, n)
                s = wp.dot(wp.cross(q, v), n) / area_sq
                t = wp.dot(wp.cross(u, q), n) / area_sq
            return Coords(one - s - t, s, t)

    elif cell == "tet":

        @wp.func
        def coordinates(p: Corners, q: vector):
            vw, wu, uv = wp.cross(p[2], p[3]), wp.cross(p[3], p[1]), wp.cross(p[1], p[2])
            volume = wp.dot(p[1], vw)
            return Coords(wp.dot(q, vw) / volume, wp.dot(q, wu) / volume, wp.dot(q, uv) / volume)

    else:
        solve = _newton(cell, d, real, affine)

        @wp.func
        def coordinates(p: Corners, q: vector):
            c, _gap_sq = solve(p, q)
            return c

    return coordinates


def _boundary(cell, d, real):
    """Function of (corners, point): coordinates and squared distance of the closest point of the
    sides of a cell, the first of several."""
    side, vector, Coords = SIDES[cell], wp.types.vector(d, real), coords_type(real)
    sides, width = _SIDES[cell], VERTICES[side]
    count = len(sides)
    Corners, Side = (wp.types.matrix((VERTICES[one], d), real) for one in (cell, side))
    _, on_side = nearest_functions(side, d, real, False)
    in_cell = side_coords_function(cell, real)

    def nearer_of(columns, before):
        """The point of a side, if it is nearer than the best one of those before."""
        first, second, last = columns[0], columns[1], columns[-1]

        @wp.func
        def nearer(p: Corners, q: vector):
            a = p[first]
            corners = Side()
            corners[1] = p[second] - a
            if wp.static(width > 2):
                corners[2] = p[last] - a
            coords, distance_sq = on_side(corners, q - a)
            coords = in_cell(first, second, last, coords)
            if wp.static(before is not None):
                others, best = before(p, q)
                if best <= distance_sq:
                    return others, best
            return coords, distance_sq

        return nearer

    if width < 4:
        return functools.reduce(lambda before, of: nearer_of(of, before), sides, None)

    # Sides of cubes: one copy of the code for all.
    @wp.func
    def columns_of(k: int):
        v = wp.vec4i()
        for j in range(count):
            if j == k:
                v = wp.static(wp.vec4i(*sides[j]))
        return v

    @wp.func
    def boundary(p: Corners, q: vector):
        best = real(-1.0)
        coords = Coords()
        for k in range(count):
            v = columns_of(k)
            a = p[v[0]]
            corners = Side()
            for i in range(1, width):
                corners[i] = p[v[i]] - a
            c, distance_sq = on_side(corners, q - a)
            if best < real(0.0) or distance_sq < best:
                best = distance_sq
                coords = in_cell(v[0], v[1], v[3], c)
        return coords, best

    return boundary


def _newton(cell, d, real, affine):
    """Function of (corners, point): coordinates, squared distance there, -1 if there are none."""
    Corners = wp.types.matrix((VERTICES[cell], d), real)
    vector, Coords = wp.types.vector(d, real), coords_type(real)
    position, gradient = shape_functions(cell, d, real, affine)
    step = _newton_step(cell, d, real)
    k, is_solid = DIMENSIONS[cell], DIMENSIONS[cell] == d
    start = Coords(*([0.5] * k + [0.0] * (3 - k)))
    steps = 1 if affine and is_solid else _STEPS
    tolerance = real(4.0 * _EPSILON[real])
    is_affine = affine

    @wp.func
    def iterate(p: Corners, q: vector):
        c = start
        r = q - position(p, c)
        for _i in range(steps):
            dc = step(p, gradient(p, c), r)
            size = wp.max(wp.abs(dc))
            # A step that leads away is halved: the map may fold outside of the cell.
            scale = real(1.0)
            trial = q - position(p, c + dc)
            if wp.static(is_solid and not is_affine):
                while scale > real(0.06) and not wp.dot(trial, trial) < wp.dot(r, r):
                    scale *= real(0.5)
                    trial = q - position(p, c + scale * dc)
            c += scale * dc
            r = trial
            if not size > tolerance:
                break
        return c

    @wp.func
    def solve(p: Corners, q: vector):
        c = wp.stop_gradient(iterate(p, q))
        r = q - position(p, c)
        # The last step carries the derivative of the inverse map.
        c += step(p, gradient(p, c), r)
        r = q - position(p, c)
        gap_sq = wp.dot(r, r)
        if not gap_sq < real(1.0e30):
            return start, real(-1.0)
        if wp.static(is_solid):
            # Far from a solution, the point is outside of what the map reaches.
            scale = wp.ddot(p, p)
            if gap_sq > tolerance * scale:
                return c, real(-1.0)
        return c, gap_sq

    return solve


def _newton_step(cell, d, real):
    """Function of (corners, gradient, residual): Newton's step for a point or a nearest point."""
    Corners = wp.types.matrix((VERTICES[cell], d), real)
    Gradient = wp.types.matrix((d, DIMENSIONS[cell]), real)
    vector, Coords = wp.types.vector(d, real), coords_type(real)
    if cell == "square" and d == 2:

        @wp.func
        def step(p: Corners, F: Gradient, r: vector):
            area = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
            s = (r[0] * F[1, 1] - r[1] * F[0, 1]) / area
            t = (F[0, 0] * r[1] - F[1, 0] * r[0]) / area
            return Coords(s, t, real(0.0))

    elif cell == "square":

        @wp.func
        def step(p: Corners, F: Gradient, r: vector):
            """Newton's step of the squared distance; Gauss-Newton's where that is not convex."""
            u, v = wp.transpose(F)[0], wp.transpose(F)[1]
            a, c = wp.dot(u, u), wp.dot(v, v)
            gauss = wp.dot(u, v)
            b = gauss - wp.dot(r, p[2] - p[1] - p[3])
            area_sq = a * c - b * b
            if not area_sq > real(0.0):
                b = gauss
                area_sq = a * c - b * b
            ru, rv = wp.dot(r, u), wp.dot(r, v)
            return Coords((c * ru - b * rv) / area_sq, (a * rv - b * ru) / area_sq, real(0.0))

    else:

        @wp.func
        def step(p: Corners, F: Gradient, r: vector):
            G = wp.transpose(F)
            vw, wu, uv = wp.cross(G[1], G[2]), wp.cross(G[2], G[0]), wp.cross(G[0], G[1])
            return Coords(wp.dot(r, vw), wp.dot(r, wu), wp.dot(r, uv)) / wp.dot(G[0], vw)

    return step
