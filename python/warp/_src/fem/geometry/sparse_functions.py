"""Functions of kernels of sparse grids: cells and sides by integer places, of any level."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp
from warp import extend
from warp._src.fem.geometry.derived import add_listed_environments, add_listed_sides
from warp._src.fem.geometry.lookup_forms import add_lookup_forms, box_search
from warp._src.fem.kept import Functions
from warp._src.fem.types import (
    OUTSIDE,
    Ints,
    Levels,
    Pairs,
    Voxels,
    coords_type,
    make_free_sample,
    sample_type,
)

# Bits of the flags of a side: its axis, a missing lower cell (so that the side is turned), a
# missing upper one, its level.
AXIS, NO_LOWER, NO_UPPER, LEVEL = 3, 2, 3, 4


@wp.func
def find_cell(grid: wp.uint64, at: wp.vec3i, levels: Levels, level_count: int):
    """Number of the cell of any level that has a fine voxel, -1 if there is none."""
    for level in range(level_count):
        p = wp.vec3i(
            (at[0] >> level) << level, (at[1] >> level) << level, (at[2] >> level) << level
        )
        cell = wp.volume_lookup_index(grid, p[0], p[1], p[2])
        if cell >= 0:
            if int(levels[cell]) >= level:
                return cell
    return -1


def sparse_functions(record) -> SimpleNamespace:
    """The functions of kernels of a sparse grid."""
    f = _structs(record)
    _add_places(f, record)
    _add_cells(f, record)
    _add_sides(f, record)
    _add_side_coordinates(f, record)
    _add_lookup(f, record)
    return f


def _structs(record) -> SimpleNamespace:
    real = record.scalar
    vector, matrix = wp.types.vector(3, real), wp.types.matrix((3, 3), real)
    word = "Sparse" if real is wp.float32 else "SparseF64"
    cell = {"grid": wp.uint64, "places": Voxels, "cell_env": Ints, "env_offsets": Voxels}
    cell |= {"levels": Levels, "level_count": wp.int32, "box": Voxels}
    cell |= {"transform": matrix, "inverse": matrix, "origin": vector, "volume": real}
    CellArg = extend.struct_from_fields(f"{word}CellArg", cell, module=__name__)
    side = {"cell_arg": CellArg, "places": Voxels, "flags": Ints, "areas": vector}
    side |= {"side_cells": Pairs, "boundary": Ints}
    SideArg = extend.struct_from_fields(f"{word}SideArg", side, module=__name__)
    return Functions(CellArg=CellArg, SideArg=SideArg, SideIndexArg=SideArg)


def _add_places(f: SimpleNamespace, record) -> None:
    """Adds sizes of cells in fine voxels, and the cell at a place."""
    CellArg, is_adaptive = f.CellArg, record.kind == "adaptive"
    SideArg = f.SideArg

    @f.add
    def cell_width(arg: CellArg, cell: int):
        """Fine voxels along an edge of a cell."""
        if wp.static(is_adaptive):
            return 1 << int(arg.levels[cell])
        else:
            return 1

    @f.add
    def side_width(arg: SideArg, side: int):
        """Fine voxels along an edge of a side."""
        if wp.static(is_adaptive):
            return 1 << (arg.flags[side] >> LEVEL)
        else:
            return 1

    @f.add
    def cell_at(arg: CellArg, p: wp.vec3i):
        """Cell that has a voxel, of the grid that holds all environments."""
        if wp.static(is_adaptive):
            return find_cell(arg.grid, p, arg.levels, arg.level_count)
        else:
            return wp.volume_lookup_index(arg.grid, p[0], p[1], p[2])

    add_listed_environments(f)
    add_listed_sides(f)


def _add_cells(f: SimpleNamespace, record) -> None:
    real = record.scalar
    CellArg, Sample, vector, width = (
        f.CellArg,
        sample_type(real),
        wp.types.vector(3, real),
        f.cell_width,
    )
    half = vector(0.5, 0.5, 0.5)
    zero, one = vector(), vector(1.0, 1.0, 1.0)

    @f.add
    def cell_position(arg: CellArg, s: Sample):
        at = s.element_coords * real(width(arg, s.element_index)) - half
        return arg.transform * (vector(arg.places[s.element_index]) + at) + arg.origin

    @f.add
    def cell_deformation_gradient(arg: CellArg, s: Sample):
        return arg.transform * real(width(arg, s.element_index))

    @f.add
    def cell_inverse_deformation_gradient(arg: CellArg, s: Sample):
        return arg.inverse / real(width(arg, s.element_index))

    @f.add
    def cell_measure(arg: CellArg, s: Sample):
        w = real(width(arg, s.element_index))
        return arg.volume * (w * w * w)

    @f.add
    def voxel_position(arg: CellArg, x: vector):
        """Position in fine voxels, from the lower corner of voxel 0."""
        return arg.inverse * (x - arg.origin) + half

    @f.add
    def cell_coordinates(arg: CellArg, cell: int, x: vector):
        local = voxel_position(arg, x) - vector(arg.places[cell])
        return local / real(width(arg, cell))

    @f.add
    def cell_closest_point(arg: CellArg, cell: int, x: vector):
        coords = cell_coordinates(arg, cell, x)
        inside = wp.min(wp.max(coords, zero), one)
        gap = arg.transform * ((coords - inside) * real(width(arg, cell)))
        return inside, wp.dot(gap, gap)


def _add_sides(f: SimpleNamespace, record) -> None:
    real = record.scalar
    SideArg, Sample = f.SideArg, sample_type(real)
    vector, Coords, width = wp.types.vector(3, real), coords_type(real), f.side_width
    half = vector(0.5, 0.5, 0.5)

    @f.add
    def along(flags: int, altitude: real, s: Coords):
        """Coordinates along the axes of a point of a side."""
        axis = flags & AXIS
        flip = (flags >> NO_LOWER) & 1
        at = Coords()
        at[axis] = altitude
        at[(axis + 1 + flip) % 3] = s[0]
        at[(axis + 2 - flip) % 3] = s[1]
        return at

    @f.add
    def across(flags: int, at: Coords):
        """Coordinates on a side by those along the axes."""
        axis = flags & AXIS
        flip = (flags >> NO_LOWER) & 1
        return Coords(at[(axis + 1 + flip) % 3], at[(axis + 2 - flip) % 3], real(0.0))

    @f.add
    def side_position(arg: SideArg, s: Sample):
        side = s.element_index
        at = along(arg.flags[side], real(0.0), s.element_coords) * real(width(arg, side)) - half
        return arg.cell_arg.transform * (vector(arg.places[side]) + at) + arg.cell_arg.origin

    @wp.func
    def tangent(arg: SideArg, side: int, s: Coords):
        return arg.cell_arg.transform * along(arg.flags[side], real(0.0), s)

    @f.add
    def side_deformation_gradient(arg: SideArg, s: Sample):
        side = s.element_index
        u = tangent(arg, side, Coords(real(1.0), real(0.0), real(0.0)))
        v = tangent(arg, side, Coords(real(0.0), real(1.0), real(0.0)))
        return wp.matrix_from_cols(u, v) * real(width(arg, side))

    @f.add
    def side_measure(arg: SideArg, s: Sample):
        w = real(width(arg, s.element_index))
        return arg.areas[arg.flags[s.element_index] & AXIS] * (w * w)

    @f.add
    def side_measure_ratio(arg: SideArg, s: Sample):
        w = real(width(arg, s.element_index))
        return arg.areas[arg.flags[s.element_index] & AXIS] / (arg.cell_arg.volume * w)


def _add_side_coordinates(f: SimpleNamespace, record) -> None:
    """Adds the way between coordinates of sides and of cells, by differences of places."""
    real = record.scalar
    SideArg, Coords, vector = f.SideArg, coords_type(real), wp.types.vector(3, real)
    along, across, cell_width, side_width = f.along, f.across, f.cell_width, f.side_width
    side_environment, cell_environment = f.side_environment_index, f.cell_environment_index
    voxel_position, outside = f.voxel_position, real(OUTSIDE)

    @wp.func
    def in_cell(arg: SideArg, side: int, cell: int, s: Coords):
        at = along(arg.flags[side], real(0.0), s) * real(side_width(arg, side))
        at += vector(arg.places[side] - arg.cell_arg.places[cell])
        return at / real(cell_width(arg.cell_arg, cell))

    @f.add
    def side_inner_cell_coords(arg: SideArg, side: int, s: Coords):
        return in_cell(arg, side, arg.side_cells[side][0], s)

    @f.add
    def side_outer_cell_coords(arg: SideArg, side: int, s: Coords):
        return in_cell(arg, side, arg.side_cells[side][1], s)

    @f.add
    def side_from_cell_coords(arg: SideArg, side: int, cell: int, c: Coords):
        """Coordinates on a side of a point of a cell, OUTSIDE if it is not on the side."""
        if side < 0 or cell < 0:
            return Coords(outside)
        if side_environment(arg, side) != cell_environment(arg.cell_arg, cell):
            return Coords(outside)
        at = c * real(cell_width(arg.cell_arg, cell))
        at += vector(arg.cell_arg.places[cell] - arg.places[side])
        at /= real(side_width(arg, side))
        on_plane = at[arg.flags[side] & AXIS] == real(0.0)
        if not on_plane or wp.min(at) < real(0.0) or wp.max(at) > real(1.0):
            return Coords(outside)
        return across(arg.flags[side], at)

    @f.add
    def side_coordinates(arg: SideArg, side: int, x: vector):
        at = voxel_position(arg.cell_arg, x) - vector(arg.places[side])
        return across(arg.flags[side], at / real(side_width(arg, side)))

    @f.add
    def side_closest_point(arg: SideArg, side: int, x: vector):
        width = real(side_width(arg, side))
        at = (voxel_position(arg.cell_arg, x) - vector(arg.places[side])) / width
        inside = wp.min(wp.max(at, vector()), vector(real(1.0)))
        inside[arg.flags[side] & AXIS] = real(0.0)
        gap = arg.cell_arg.transform * ((at - inside) * width)
        return across(arg.flags[side], inside), wp.dot(gap, gap)


def _add_lookup(f: SimpleNamespace, record) -> None:
    """Adds `cell_lookup`: the cell of the voxel, else the nearest one in growing boxes."""
    real, CellArg = record.scalar, f.CellArg
    vector, Coords = wp.types.vector(3, real), coords_type(real)
    voxel_position, cell_at, closest = f.voxel_position, f.cell_at, f.cell_closest_point
    far = real(1.0e9)

    @wp.func
    def voxel_of(u: vector):
        p = wp.vec3i()
        for k in range(3):
            p[k] = int(wp.floor(wp.clamp(u[k], -far, far)))
        return p

    @wp.func
    def place_of(arg: CellArg, x: vector, shift: vector, environment: int):
        """Voxel in the grid that holds all environments, in its box."""
        p = voxel_of(voxel_position(arg, x) + shift) + arg.env_offsets[environment]
        return wp.min(wp.max(p, arg.box[0]), arg.box[1])

    @wp.func
    def size_of(arg: CellArg):
        T = wp.transpose(arg.transform)
        return vector(wp.length(T[0]), wp.length(T[1]), wp.length(T[2]))

    @functools.cache
    def make_search(filter_func=None):
        is_filtered = filter_func is not None

        @wp.func
        def chosen(arg: CellArg, at: wp.vec3i, data: Any, target: Any, environment: int):
            cell = cell_at(arg, at)
            if cell >= 0:
                if arg.cell_env[cell] != environment:
                    cell = int(-1)
                elif wp.static(is_filtered):
                    if filter_func(data, cell) != target:
                        cell = int(-1)
            return cell

        search_around = box_search(f, 3, real, size_of, place_of, chosen)

        @wp.func
        def search(
            arg: CellArg, x: vector, max_dist: real, data: Any, target: Any, environment: int
        ):
            u = voxel_position(arg, x)
            is_inside = environment >= 0 and environment < arg.env_offsets.shape[0]
            if not is_inside or not wp.dot(u, u) >= real(0.0):
                return make_free_sample(-1, Coords(real(OUTSIDE)))
            place = voxel_of(u) + arg.env_offsets[environment]
            cell = chosen(arg, place, data, target, environment)
            if cell >= 0:
                coords, _distance_sq = closest(arg, cell, x)
                return make_free_sample(cell, coords)
            return search_around(arg, x, max_dist, data, target, environment)

        return search

    add_lookup_forms(f, record, make_search)
