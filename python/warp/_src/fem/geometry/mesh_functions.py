"""Functions of kernels of meshes: positions and gradients in differences from the first vertex."""

from types import SimpleNamespace

import warp as wp
from warp import extend
from warp._src.fem.geometry.derived import (
    add_environments,
    add_listed_environments,
    add_listed_sides,
)
from warp._src.fem.geometry.mesh_lookup import add_lookup
from warp._src.fem.geometry.shape_functions import (
    bend_function,
    shape_functions,
    side_coords_function,
    vertex_coords_function,
)
from warp._src.fem.geometry.shapes import DIMENSIONS, SIDES, VERTICES
from warp._src.fem.kept import Functions
from warp._src.fem.types import OUTSIDE, Ints, IntTable, Pairs, Vectors, coords_type, sample_type


def mesh_functions(record) -> SimpleNamespace:
    """The functions of kernels of a mesh."""
    f = _structs(record)
    real, vector = record.scalar, wp.types.vector(record.dimension, record.scalar)
    Sample = sample_type(real)
    position, gradient = shape_functions(record.cell, record.dimension, real, record.affine)
    side_position, side_gradient = shape_functions(
        SIDES[record.cell], record.dimension, real, False
    )
    CellArg, SideArg = f.CellArg, f.SideArg
    n, m = VERTICES[record.cell], VERTICES[SIDES[record.cell]]
    Corners, SideCorners = (wp.types.matrix((k, record.dimension), real) for k in (n, m))

    @f.add
    def cell_corners(arg: CellArg, cell: int):
        """Vertices of a cell, relative to the first, which is the first row."""
        origin = arg.positions[arg.cells[cell, 0]]
        corners = Corners()
        corners[0] = origin
        for k in range(1, n):
            # Unrolled, so that copies of the function are found to be equal.
            corners[k] = arg.positions[arg.cells[cell, wp.static(k)]] - origin
        return corners

    @f.add
    def side_corners(arg: SideArg, side: int):
        """Vertices of a side, relative to the first, which is the first row."""
        origin = arg.cell_arg.positions[arg.side_vertices[side, 0]]
        corners = SideCorners()
        corners[0] = origin
        for k in range(1, m):
            corners[k] = arg.cell_arg.positions[arg.side_vertices[side, wp.static(k)]] - origin
        return corners

    @f.add
    def cell_position(arg: CellArg, s: Sample):
        return position(cell_corners(arg, s.element_index), s.element_coords)

    @f.add
    def cell_deformation_gradient(arg: CellArg, s: Sample):
        return gradient(cell_corners(arg, s.element_index), s.element_coords)

    @wp.func
    def side_position_at(arg: SideArg, s: Sample):
        return side_position(side_corners(arg, s.element_index), s.element_coords)

    @f.add
    def side_deformation_gradient(arg: SideArg, s: Sample):
        return side_gradient(side_corners(arg, s.element_index), s.element_coords)

    if not record.affine:
        bend = bend_function(record.cell, record.dimension, real)

        @f.add
        def cell_bend(arg: CellArg, s: Sample):
            return bend(cell_corners(arg, s.element_index), s.element_coords)

    f.vector = vector
    f.side_position = side_position_at
    add_listed_sides(f)
    if record.environments:
        add_listed_environments(f)
    else:
        add_environments(f)
    _add_coordinates(f, record)
    add_lookup(f, record)
    return f


def _structs(record) -> SimpleNamespace:
    vector = wp.types.vector(record.dimension, record.scalar)
    word = f"{record.cell.capitalize()}Mesh{record.dimension}D" + (
        "" if record.scalar is wp.float32 else "_f64"
    )
    cell = {"cells": IntTable, "positions": wp.array(dtype=vector), "cell_env": Ints}
    cell |= {"bvh": wp.uint64, **dict.fromkeys(("box", "lowers", "uppers"), Vectors)}
    CellArg = extend.struct_from_fields(f"{word}CellArg", cell, module=__name__)
    side = {"cell_arg": CellArg, "side_vertices": IntTable, "side_corners": IntTable}
    side |= {"side_cells": Pairs, "boundary": Ints}
    SideArg = extend.struct_from_fields(f"{word}SideArg", side, module=__name__)
    return Functions(CellArg=CellArg, SideArg=SideArg, SideIndexArg=SideArg)


def _add_coordinates(f: SimpleNamespace, record) -> None:
    """Adds the way between coordinates of sides and of cells.

    A side's reference cell is flat in that of the cell: its corners there and the coordinates on
    the side give the point; a scalar product with its axes gives the coordinates back.
    """
    real, cell = record.scalar, record.cell
    SideArg, Coords = f.SideArg, coords_type(real)
    m = VERTICES[SIDES[cell]]
    place, in_cell = vertex_coords_function(cell, real), side_coords_function(cell, real)
    in_triangle, in_tet, is_square = cell == "triangle", cell == "tet", m == 4
    is_flat = DIMENSIONS[cell] == 2
    tolerance = real(1.0e-5 if real is wp.float32 else 1.0e-12)
    outside = real(OUTSIDE)

    def in_cell_from(first):
        @wp.func
        def side_cell_coords(arg: SideArg, side: int, c: Coords):
            a, b = arg.side_corners[side, first], arg.side_corners[side, first + 1]
            return in_cell(a, b, arg.side_corners[side, wp.static(first + m - 1)], c)

        return side_cell_coords

    @wp.func
    def of_vertex(column: int, c: Coords):
        """Barycentric coordinate of a vertex."""
        if wp.static(in_triangle):
            return c[column]
        else:
            if column == 0:
                return real(1.0) - c[0] - c[1] - c[2]
            return c[column - 1]

    @f.add
    def side_from_cell_coords(arg: SideArg, side: int, cell_index: int, c: Coords):
        """Coordinates on a side of a point of a cell, OUTSIDE if it is not on the side."""
        if side < 0 or cell_index < 0:
            return Coords(outside)
        first = int(0)
        if arg.side_cells[side][0] != cell_index:
            if arg.side_cells[side][1] != cell_index:
                return Coords(outside)
            first = m
        s = Coords()
        gap = real(0.0)
        if wp.static(in_triangle or in_tet):
            total = real(0.0)
            for k in range(m):
                s[k] = of_vertex(arg.side_corners[side, first + k], c)
                total += s[k]
            gap = wp.abs(real(1.0) - total)
            if wp.static(in_triangle):
                s = Coords(s[1], real(0.0), real(0.0))
        else:
            a = place(arg.side_corners[side, first])
            u = place(arg.side_corners[side, first + 1]) - a
            s[0] = wp.dot(c - a, u)
            rest = c - a - s[0] * u
            if wp.static(is_square):
                v = place(arg.side_corners[side, first + 3]) - a
                s[1] = wp.dot(c - a, v)
                rest -= s[1] * v
            if wp.static(is_flat):
                rest[2] = real(0.0)
            gap = wp.length(rest)
        if gap > tolerance:
            return Coords(outside)
        return s

    f.side_inner_cell_coords, f.side_outer_cell_coords = in_cell_from(0), in_cell_from(m)
