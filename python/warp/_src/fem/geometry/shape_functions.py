"""Shape functions of reference cells of degree 1: positions and gradients by corners."""

import warp as wp
from warp._src.fem.geometry.shapes import VERTICES
from warp._src.fem.types import coords_type

# Coordinates and the columns of the corners that they lead to, of cells with a constant gradient.
_AXES = {
    "line": ((0, 1),),
    "triangle": ((1, 1), (2, 2)),
    "tet": ((0, 1), (1, 2), (2, 3)),
    "square": ((0, 1), (1, 3)),
    "cube": ((0, 1), (1, 3), (2, 4)),
}


def shape_functions(cell: str, d: int, real, affine: bool):
    """Position and gradient by (corners, coordinates): the first corner, then differences."""
    vector, Coords = wp.types.vector(d, real), coords_type(real)
    Corners = wp.types.matrix((VERTICES[cell], d), real)
    if affine or cell not in ("square", "cube"):
        return _affine(_AXES[cell], Corners, Coords)
    return (_square if cell == "square" else _cube)(Corners, Coords, real, vector)


def _affine(axes, Corners, Coords):
    """Simplices, parallelograms and parallelepipeds: neighbours of the first vertex say all."""
    count, ((i, a), (j, b), (k, c)) = len(axes), (*axes, *axes[:1] * 2)[:3]

    @wp.func
    def position(p: Corners, x: Coords):
        at = p[0] + x[i] * p[a]
        if wp.static(count > 1):
            at += x[j] * p[b]
        if wp.static(count > 2):
            at += x[k] * p[c]
        return at

    @wp.func
    def gradient(p: Corners, x: Coords):
        if wp.static(count == 1):
            return p[a]
        elif wp.static(count == 2):
            return wp.matrix_from_cols(p[a], p[b])
        else:
            return wp.matrix_from_cols(p[a], p[b], p[c])

    return position, gradient


def _square(Corners, Coords, real, vector):
    @wp.func
    def position(p: Corners, c: Coords):
        warp_ = p[2] - p[1] - p[3]
        return p[0] + c[0] * p[1] + c[1] * p[3] + (c[0] * c[1]) * warp_

    @wp.func
    def gradient(p: Corners, c: Coords):
        warp_ = p[2] - p[1] - p[3]
        return wp.matrix_from_cols(p[1] + c[1] * warp_, p[3] + c[0] * warp_)

    return position, gradient


def _cube(Corners, Coords, real, vector):
    @wp.func
    def layer(p: Corners, k: int, a: vector, x: real, y: real):
        """Bilinear part of the square of corners k..k+3, whose first one is `a`."""
        u = p[k + 1] - a
        v = p[k + 3] - a
        return x * u + y * v + (x * y) * (p[k + 2] - a - u - v)

    @wp.func
    def position(p: Corners, c: Coords):
        low = layer(p, 0, vector(), c[0], c[1])
        high = layer(p, 4, p[4], c[0], c[1])
        return p[0] + low + c[2] * (p[4] + high - low)

    @wp.func
    def gradient(p: Corners, c: Coords):
        x, y, z = c[0], c[1], c[2]
        one = real(1.0)
        # Differences along each axis at the four parallel edges, blended by the other axes.
        dx = (one - z) * ((one - y) * p[1] + y * (p[2] - p[3])) + z * (
            (one - y) * (p[5] - p[4]) + y * (p[6] - p[7])
        )
        dy = (one - z) * ((one - x) * p[3] + x * (p[2] - p[1])) + z * (
            (one - x) * (p[7] - p[4]) + x * (p[6] - p[5])
        )
        dz = (one - y) * ((one - x) * p[4] + x * (p[5] - p[1])) + y * (
            (one - x) * (p[7] - p[3]) + x * (p[6] - p[2])
        )
        return wp.matrix_from_cols(dx, dy, dz)

    return position, gradient


def bend_function(cell: str, d: int, real):
    """Function of (corners, coordinates): derivatives of the gradient along each coordinate, of
    squares and cubes. They have no loops, so that copies of the function are found to be equal."""
    vector, Coords = wp.types.vector(d, real), coords_type(real)
    Corners = wp.types.matrix((VERTICES[cell], d), real)
    if cell == "square":

        @wp.func
        def bend(p: Corners, c: Coords):
            xy, zero = p[2] - p[1] - p[3], vector()
            return wp.matrix_from_cols(zero, xy), wp.matrix_from_cols(xy, zero)

    else:

        @wp.func
        def bend(p: Corners, c: Coords):
            x, y, z = c[0], c[1], c[2]
            one, zero = real(1.0), vector()
            xy = (one - z) * (p[2] - p[3] - p[1]) + z * (p[6] - p[7] - (p[5] - p[4]))
            xz = (one - y) * (p[5] - p[4] - p[1]) + y * (p[6] - p[7] - (p[2] - p[3]))
            yz = (one - x) * (p[7] - p[4] - p[3]) + x * (p[6] - p[5] - (p[2] - p[1]))
            return (
                wp.matrix_from_cols(zero, xy, xz),
                wp.matrix_from_cols(xy, zero, yz),
                wp.matrix_from_cols(xz, yz, zero),
            )

    return bend


def vertex_coords_function(cell: str, real) -> wp.Function:
    """Function of kernels: coordinates of a vertex by its column in a mesh's table."""
    Coords, is_triangle, is_tet = coords_type(real), cell == "triangle", cell == "tet"
    one, zero = real(1.0), real(0.0)

    @wp.func
    def vertex_coords(v: int):
        c = Coords()
        if wp.static(is_triangle):
            c[v] = one
        elif wp.static(is_tet):
            if v > 0:
                c[v - 1] = one
        else:
            around = v & 3
            c[0] = wp.where(around == 1 or around == 2, one, zero)
            c[1] = wp.where(around >= 2, one, zero)
            c[2] = wp.where(v >= 4, one, zero)
        return c

    return vertex_coords


def side_coords_function(cell: str, real) -> wp.Function:
    """Function of kernels of (first, second and last column of the corners of a side, coordinates
    on it): coordinates in the cell."""
    Coords, place = coords_type(real), vertex_coords_function(cell, real)
    in_tet, in_cube = cell == "tet", cell == "cube"

    @wp.func
    def side_coords(first: int, second: int, last: int, c: Coords):
        a, b = place(first), place(second)
        if wp.static(in_tet):
            return c[0] * a + c[1] * b + c[2] * place(last)
        elif wp.static(in_cube):
            return a + c[0] * (b - a) + c[1] * (place(last) - a)
        else:
            return a + c[0] * (b - a)

    return side_coords
