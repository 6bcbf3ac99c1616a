"""Closest points and inverse maps of cells: closed forms, Newton's method where cells are warped.

Functions take the corners of a cell as the rows of a matrix, all relative to the first, and a
point relative to it, so that no size and no offset is lost to rounding.
"""

import functools

import warp as wp
from warp._src.fem.geometry.shape_functions import shape_functions
from warp._src.fem.geometry.shapes import DIMENSIONS, VERTICES
from warp._src.fem.types import coords_type

_EPSILON = {wp.float32: 2.0**-23, wp.float64: 2.0**-52}
# Newton's method doubles the digits in each step; halved steps take more.
_STEPS = 24
_AROUND = ((0, 1), (1, 2), (3, 2), (0, 3))


@functools.cache
def nearest_functions(cell: str, d: int, real, affine: bool):
    """Functions of (corners, point): coordinates by the inverse map, and (coordinates, squared
    distance) of the closest point of the cell."""
    if cell == "line":
        return _line(d, real)
    if cell == "triangle":
        return _triangle(d, real)
    if cell == "tet":
        return _tet(real)
    return _box(cell, d, real, affine)


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
        coordinates, _ = nearest_functions(cell, d, real, affine)
        is_tet = cell == "tet"

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


@functools.cache
def _segment(d: int, real):
    vector = wp.types.vector(d, real)

    @wp.func
    def segment(a: vector, b: vector, q: vector):
        """Parameter and squared distance of the closest point between a and b."""
        u = b - a
        length_sq = wp.dot(u, u)
        t = real(0.0)
        if length_sq > real(0.0):
            t = wp.clamp(wp.dot(q - a, u) / length_sq, real(0.0), real(1.0))
        r = q - a - t * u
        return t, wp.dot(r, r)

    return segment


def _line(d, real):
    Corners, vector, Coords = (
        wp.types.matrix((2, d), real),
        wp.types.vector(d, real),
        coords_type(real),
    )
    segment = _segment(d, real)

    @wp.func
    def coordinates(p: Corners, q: vector):
        return Coords(wp.dot(q, p[1]) / wp.dot(p[1], p[1]), real(0.0), real(0.0))

    @wp.func
    def closest(p: Corners, q: vector):
        t, distance_sq = segment(vector(), p[1], q)
        return Coords(t, real(0.0), real(0.0)), distance_sq

    return coordinates, closest


@functools.cache
def _in_plane(d: int, real):
    vector, pair = wp.types.vector(d, real), wp.types.vector(2, real)
    is_plane = d == 2

    @wp.func
    def in_plane(u: vector, v: vector, q: vector):
        """Parameters (s, t) of the projection of q to the plane of u and v."""
        if wp.static(is_plane):
            area = u[0] * v[1] - u[1] * v[0]
            return pair((q[0] * v[1] - q[1] * v[0]) / area, (u[0] * q[1] - u[1] * q[0]) / area)
        else:
            n = wp.cross(u, v)
            area_sq = wp.dot(n, n)
            return pair(wp.dot(wp.cross(q, v), n) / area_sq, wp.dot(wp.cross(u, q), n) / area_sq)

    return in_plane


@functools.cache
def _triangle_closest(d: int, real):
    """Function of (a, b, c, q): barycentric coordinates and squared distance."""
    vector, Coords = wp.types.vector(d, real), coords_type(real)
    segment, in_plane = _segment(d, real), _in_plane(d, real)
    zero, one = real(0.0), real(1.0)
    slack = real(-4.0 * _EPSILON[real])
    is_plane = d == 2

    @wp.func
    def triangle(a: vector, b: vector, c: vector, q: vector):
        u, v = b - a, c - a
        st = in_plane(u, v, q - a)
        if st[0] >= slack and st[1] >= slack and one - st[0] - st[1] >= slack:
            distance_sq = zero
            if wp.static(not is_plane):
                r = q - a - st[0] * u - st[1] * v
                distance_sq = wp.dot(r, r)
            return Coords(one - st[0] - st[1], st[0], st[1]), distance_sq
        t, best = segment(a, b, q)
        coords = Coords(one - t, t, zero)
        t, distance_sq = segment(b, c, q)
        if distance_sq < best:
            best = distance_sq
            coords = Coords(zero, one - t, t)
        t, distance_sq = segment(c, a, q)
        if distance_sq < best:
            best = distance_sq
            coords = Coords(t, zero, one - t)
        return coords, best

    return triangle


def _triangle(d, real):
    Corners, vector, Coords = (
        wp.types.matrix((3, d), real),
        wp.types.vector(d, real),
        coords_type(real),
    )
    in_plane, triangle = _in_plane(d, real), _triangle_closest(d, real)

    @wp.func
    def coordinates(p: Corners, q: vector):
        st = in_plane(p[1], p[2], q)
        return Coords(real(1.0) - st[0] - st[1], st[0], st[1])

    @wp.func
    def closest(p: Corners, q: vector):
        return triangle(vector(), p[1], p[2], q)

    return coordinates, closest


def _tet(real):
    Corners, vector, Coords = (
        wp.types.matrix((4, 3), real),
        wp.types.vector(3, real),
        coords_type(real),
    )
    triangle = _triangle_closest(3, real)
    zero, one = real(0.0), real(1.0)
    slack = real(-4.0 * _EPSILON[real])

    @wp.func
    def coordinates(p: Corners, q: vector):
        vw, wu, uv = wp.cross(p[2], p[3]), wp.cross(p[3], p[1]), wp.cross(p[1], p[2])
        volume = wp.dot(p[1], vw)
        return Coords(wp.dot(q, vw) / volume, wp.dot(q, wu) / volume, wp.dot(q, uv) / volume)

    @wp.func
    def closest(p: Corners, q: vector):
        c = coordinates(p, q)
        if wp.min(c) >= slack and one - c[0] - c[1] - c[2] >= slack:
            return c, zero
        o = vector()
        b, best = triangle(o, p[1], p[2], q)
        coords = Coords(b[1], b[2], zero)
        b, distance_sq = triangle(o, p[2], p[3], q)
        if distance_sq < best:
            best = distance_sq
            coords = Coords(zero, b[1], b[2])
        b, distance_sq = triangle(o, p[3], p[1], q)
        if distance_sq < best:
            best = distance_sq
            coords = Coords(b[2], zero, b[1])
        b, distance_sq = triangle(p[1], p[2], p[3], q)
        if distance_sq < best:
            best = distance_sq
            coords = b
        return coords, best

    return coordinates, closest


def _box(cell, d, real, affine):
    """Inverse map and closest point of squares and cubes."""
    Corners = wp.types.matrix((VERTICES[cell], d), real)
    vector = wp.types.vector(d, real)
    is_solid = DIMENSIONS[cell] == d
    solve = _newton(cell, d, real, affine)
    boundary = _edges(Corners, d, real) if cell == "square" else _faces(Corners, real)

    @wp.func
    def coordinates(p: Corners, q: vector):
        c, _gap_sq = solve(p, q)
        return c

    if is_solid:
        inside = inside_function(cell, d, real, affine)

        @wp.func
        def closest(p: Corners, q: vector):
            c, is_inside = inside(p, q)
            if is_inside:
                return c, real(0.0)
            return boundary(p, q)

    else:

        @wp.func
        def closest(p: Corners, q: vector):
            c, gap_sq = solve(p, q)
            edge_coords, edge_sq = boundary(p, q)
            is_between = wp.min(c) >= real(0.0) and wp.max(c) <= real(1.0)
            if is_between and gap_sq >= real(0.0) and gap_sq <= edge_sq:
                return c, gap_sq
            return edge_coords, edge_sq

    return coordinates, closest


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


def _edges(Corners, d, real):
    """Function of (corners, point): closest point of the four edges of a square."""
    vector, Coords, segment = wp.types.vector(d, real), coords_type(real), _segment(d, real)
    zero, one = real(0.0), real(1.0)

    @wp.func
    def edges(p: Corners, q: vector):
        o = vector()
        t, best = segment(o, p[1], q)
        coords = Coords(t, zero, zero)
        t, distance_sq = segment(p[1], p[2], q)
        if distance_sq < best:
            best = distance_sq
            coords = Coords(one, t, zero)
        t, distance_sq = segment(p[3], p[2], q)
        if distance_sq < best:
            best = distance_sq
            coords = Coords(t, one, zero)
        t, distance_sq = segment(o, p[3], q)
        if distance_sq < best:
            best = distance_sq
            coords = Coords(zero, t, zero)
        return coords, best

    return edges


def _faces(Corners, real):
    """Function of (corners, point): closest point of the six faces of a cube."""
    vector, Coords = wp.types.vector(3, real), coords_type(real)
    Square = wp.types.matrix((4, 3), real)
    _, on_square = nearest_functions("square", 3, real, False)
    ints = wp.types.vector(4, wp.int32)

    @wp.func
    def corners_of(face: int):
        """Columns around the face, so that coordinates run along the other axes in order."""
        if face == 0:
            return ints(0, 3, 7, 4)
        if face == 1:
            return ints(1, 2, 6, 5)
        if face == 2:
            return ints(0, 1, 5, 4)
        if face == 3:
            return ints(3, 2, 6, 7)
        if face == 4:
            return ints(0, 1, 2, 3)
        return ints(4, 5, 6, 7)

    @wp.func
    def faces(p: Corners, q: vector):
        best = real(-1.0)
        coords = Coords()
        for face in range(6):
            k = corners_of(face)
            a = p[k[0]]
            square = Square()
            for i in range(1, 4):
                square[i] = p[k[i]] - a
            c, distance_sq = on_square(square, q - a)
            if best < real(0.0) or distance_sq < best:
                best = distance_sq
                side = real(face & 1)
                axis = face >> 1
                if axis == 0:
                    coords = Coords(side, c[0], c[1])
                elif axis == 1:
                    coords = Coords(c[0], side, c[1])
                else:
                    coords = Coords(c[0], c[1], side)
        return coords, best

    return faces
