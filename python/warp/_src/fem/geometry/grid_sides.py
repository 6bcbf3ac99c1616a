"""Sides of regular grids: numbers, positions, cells on both."""

from types import SimpleNamespace
from typing import Any

import warp as wp
from warp._src.fem.types import OUTSIDE, coords_type, sample_type


def add_sides(f: SimpleNamespace, record) -> None:
    """Adds the functions of sides."""
    _add_numbers_of_sides(f, record)
    _add_positions(f, record)
    _add_cells(f, record)
    _add_coordinates(f, record)


def _add_numbers_of_sides(f: SimpleNamespace, record) -> None:
    """Adds the numbers of sides: those at the lower face of each cell, axis by axis, then those
    of the upper boundary."""
    d = record.dimension
    counts, several = wp.types.vector(d, wp.int32), record.environments
    SideArg, Side, sides_of = f.SideArg, f.Side, f.sides_of
    cell_at, cell_number = f.cell_at, f.cell_number

    @f.add
    def across(axis: int, at: Any):
        """Turns components along the axes of space so that `axis` comes first."""
        turned = type(at)()
        for k in range(d):
            turned[k] = at[(axis + k) % d]
        return turned

    @f.add
    def along(axis: int, at: Any):
        """Inverse of `across`."""
        turned = type(at)()
        for k in range(d):
            turned[k] = at[(k + d - axis) % d]
        return turned

    @wp.func
    def boundary_origin(res: counts, axis: int, altitude: int, layer: int):
        if wp.static(d == 2):
            return counts(altitude, layer)
        else:
            width = res[(axis + 2) % d]
            return counts(altitude, layer // width, layer % width)

    @wp.func
    def axis_of_layer(arg: SideArg, number: int):
        axis = int(0)
        for k in range(1, d):
            axis += wp.where(number >= arg.axis_offsets[k], 1, 0)
        return axis

    @f.add
    def grid_side(arg: SideArg, side: int):
        """Axis and position of a side."""
        res = arg.cell_arg.res
        local = side
        if wp.static(several):
            local = side % sides_of(arg)
        if local < d * arg.cell_count:
            axis = local // arg.cell_count
            return Side(axis, across(axis, cell_at(res, local - axis * arg.cell_count)))
        number = local - d * arg.cell_count
        axis = axis_of_layer(arg, number)
        layer = number - arg.axis_offsets[axis]
        return Side(axis, boundary_origin(res, axis, res[axis], layer))

    @f.add
    def side_number(arg: SideArg, side: Side):
        res = arg.cell_arg.res
        axis = side.axis
        if side.origin[0] == res[axis]:
            layer = side.origin[1]
            if wp.static(d == 3):
                layer = layer * res[(axis + 2) % d] + side.origin[d - 1]
            return d * arg.cell_count + arg.axis_offsets[axis] + layer
        return axis * arg.cell_count + cell_number(res, along(axis, side.origin))

    @f.add
    def boundary_side_index(arg: SideArg, boundary_side: int):
        """Number of a side of the boundary; lower and upper sides alternate."""
        sides = sides_of(arg)
        per_copy = 2 * (sides - d * arg.cell_count)
        copy = boundary_side // per_copy
        local = boundary_side - copy * per_copy
        number = local // 2
        axis = axis_of_layer(arg, number)
        res = arg.cell_arg.res
        altitude = (local - 2 * number) * res[axis]
        origin = boundary_origin(res, axis, altitude, number - arg.axis_offsets[axis])
        return copy * sides + side_number(arg, Side(axis, origin))


def _add_positions(f: SimpleNamespace, record) -> None:
    d, real = record.dimension, record.scalar
    vector, SideArg, Side, Sample = wp.types.vector(d, real), f.SideArg, f.Side, sample_type(real)
    grid_side, along, Coords = f.grid_side, f.along, coords_type(real)

    @f.add
    def is_flipped(side: Side):
        """The first coordinate runs against its axis, for normals from inner to outer cell."""
        if wp.static(d == 2):
            return (side.axis == 0) == (side.origin[0] == 0)
        else:
            return side.origin[0] == 0

    @f.add
    def in_layer(side: Side, coords: Coords):
        """Coordinates of a side along the axes across it; first, place for the axis."""
        first = wp.where(is_flipped(side), real(1.0) - coords[0], coords[0])
        if wp.static(d == 2):
            return vector(real(0.0), first)
        else:
            return vector(real(0.0), first, coords[1])

    @f.add
    def side_position(arg: SideArg, s: Sample):
        side = grid_side(arg, s.element_index)
        at = along(side.axis, vector(side.origin) + in_layer(side, s.element_coords))
        return arg.cell_arg.origin + wp.cw_mul(at, arg.cell_arg.cell_size)

    @f.add
    def side_deformation_gradient(arg: SideArg, s: Sample):
        side = grid_side(arg, s.element_index)
        size = arg.cell_arg.cell_size
        first = vector()
        first[1] = wp.where(is_flipped(side), real(-1.0), real(1.0))
        if wp.static(d == 2):
            return wp.cw_mul(along(side.axis, first), size)
        else:
            second = vector()
            second[d - 1] = real(1.0)
            return wp.matrix_from_cols(
                wp.cw_mul(along(side.axis, first), size), wp.cw_mul(along(side.axis, second), size)
            )

    @f.add
    def side_measure(arg: SideArg, s: Sample):
        axis = grid_side(arg, s.element_index).axis
        size = arg.cell_arg.cell_size[(axis + 1) % d]
        if wp.static(d == 3):
            size *= arg.cell_arg.cell_size[(axis + 2) % d]
        return size

    @f.add
    def side_measure_ratio(arg: SideArg, s: Sample):
        return real(1.0) / arg.cell_arg.cell_size[grid_side(arg, s.element_index).axis]

    @f.add
    def side_normal(arg: SideArg, s: Sample):
        side = grid_side(arg, s.element_index)
        normal = vector()
        normal[side.axis] = wp.where(side.origin[0] == 0, real(-1.0), real(1.0))
        return normal


def _add_cells(f: SimpleNamespace, record) -> None:
    """Adds the cells on both sides; one of the boundary has its cell twice."""
    d, real, several = record.dimension, record.scalar, record.environments
    SideArg, Coords, grid_side = f.SideArg, coords_type(real), f.grid_side
    Side, along, cell_number = f.Side, f.along, f.cell_number
    in_layer, sides_of = f.in_layer, f.sides_of

    @wp.func
    def cell_beside(arg: SideArg, side_index: int, altitude: int):
        side = grid_side(arg, side_index)
        at = side.origin
        at[0] = altitude
        cell = cell_number(arg.cell_arg.res, along(side.axis, at))
        if wp.static(several):
            cell += (side_index // sides_of(arg)) * arg.cell_count
        return cell

    @f.add
    def side_inner_cell_index(arg: SideArg, side_index: int):
        if side_index < 0:
            return -1
        return cell_beside(arg, side_index, wp.max(grid_side(arg, side_index).origin[0] - 1, 0))

    @f.add
    def side_outer_cell_index(arg: SideArg, side_index: int):
        if side_index < 0:
            return -1
        side = grid_side(arg, side_index)
        last = arg.cell_arg.res[side.axis] - 1
        return cell_beside(arg, side_index, wp.min(side.origin[0], last))

    @wp.func
    def coords_beside(side: Side, altitude: real, coords: Coords):
        local = in_layer(side, coords)
        local[0] = altitude
        at = along(side.axis, local)
        inside = Coords()
        for k in range(d):
            inside[k] = at[k]
        return inside

    @f.add
    def side_inner_cell_coords(arg: SideArg, side_index: int, coords: Coords):
        side = grid_side(arg, side_index)
        return coords_beside(side, wp.where(side.origin[0] == 0, real(0.0), real(1.0)), coords)

    @f.add
    def side_outer_cell_coords(arg: SideArg, side_index: int, coords: Coords):
        side = grid_side(arg, side_index)
        is_last = side.origin[0] == arg.cell_arg.res[side.axis]
        return coords_beside(side, wp.where(is_last, real(1.0), real(0.0)), coords)


def _add_coordinates(f: SimpleNamespace, record) -> None:
    """Adds the way from positions and coordinates of cells to coordinates of sides."""
    d, real = record.dimension, record.scalar
    SideArg, Coords, vector = f.SideArg, coords_type(real), wp.types.vector(d, real)
    Side, grid_side, across, is_flipped = f.Side, f.grid_side, f.across, f.is_flipped
    grid_cell, side_environment = f.grid_cell, f.side_environment_index
    cell_environment = f.cell_environment_index

    @wp.func
    def of_layer(side: Side, at: vector):
        """Coordinates of a side by those along the axes across it."""
        coords = Coords()
        coords[0] = wp.where(is_flipped(side), real(1.0) - at[1], at[1])
        if wp.static(d == 3):
            coords[1] = at[d - 1]
        return coords

    @f.add
    def side_from_cell_coords(arg: SideArg, side_index: int, cell: int, coords: Coords):
        """Coordinates on a side of a point of a cell, OUTSIDE if it is not on the side."""
        outside = Coords(real(OUTSIDE))
        if side_index < 0 or cell < 0:
            return outside
        if side_environment(arg, side_index) != cell_environment(arg.cell_arg, cell):
            return outside
        side = grid_side(arg, side_index)
        cell_at = across(side.axis, grid_cell(arg.cell_arg, cell))
        inside = vector()
        for k in range(d):
            inside[k] = coords[k]
        local = across(side.axis, inside)
        is_beside = local[0] == real(side.origin[0] - cell_at[0])
        for k in range(1, d):
            is_beside = is_beside and cell_at[k] == side.origin[k]
        if not is_beside:
            return outside
        return of_layer(side, local)

    @f.add
    def side_coordinates(arg: SideArg, side_index: int, x: vector):
        side = grid_side(arg, side_index)
        cells = arg.cell_arg
        at = across(side.axis, wp.cw_div(x - cells.origin, cells.cell_size))
        return of_layer(side, at - vector(side.origin))

    @f.add
    def side_closest_point(arg: SideArg, side_index: int, x: vector):
        side = grid_side(arg, side_index)
        size = across(side.axis, arg.cell_arg.cell_size)
        at = across(side.axis, wp.cw_div(x - arg.cell_arg.origin, arg.cell_arg.cell_size))
        local = at - vector(side.origin)
        gap = local[0] * size[0]
        distance_sq = gap * gap
        for k in range(1, d):
            inside = wp.clamp(local[k], real(0.0), real(1.0))
            gap = (local[k] - inside) * size[k]
            distance_sq += gap * gap
            local[k] = inside
        return of_layer(side, local), distance_sq
