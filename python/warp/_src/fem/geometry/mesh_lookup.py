"""Look-up in meshes - a hierarchy of boxes of cells, closest points, the lowest of equal cells."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp
from warp._src.fem.geometry.closest import inside_function, nearest_functions
from warp._src.fem.geometry.lookup_forms import add_lookup_forms
from warp._src.fem.geometry.shapes import SIDES, VERTICES
from warp._src.fem.types import OUTSIDE, Vectors, coords_type, make_free_sample, sample_type


def add_lookup(f: SimpleNamespace, record) -> None:
    """Adds coordinates and closest points of cells and sides, boxes of cells, and `cell_lookup`."""
    d, real = record.dimension, record.scalar
    add_closest(f, record)
    f.cell_bounds = _bounds(f, d, real, VERTICES[record.cell])
    add_bvh_lookup(f, record)


def add_closest(f: SimpleNamespace, record) -> None:
    """Adds `cell_coordinates`, `cell_closest_point`, `cell_contains`, and those of sides."""
    d, real = record.dimension, record.scalar
    vector = wp.types.vector(d, real)

    def of_element(Arg, corners_of, function):
        """A function of corners and a position relative to the first, as one of an element."""

        @wp.func
        def of_position(arg: Arg, element: int, x: vector):
            corners = corners_of(arg, element)
            q = x - corners[0]
            corners[0] = vector()
            return function(corners, q)

        return of_position

    cell, side = (record.cell, d, real, record.affine), (SIDES[record.cell], d, real, False)
    f.cell_coordinates, f.cell_closest_point = (
        of_element(f.CellArg, f.cell_corners, one) for one in nearest_functions(*cell)
    )
    f.side_coordinates, f.side_closest_point = (
        of_element(f.SideArg, f.side_corners, one) for one in nearest_functions(*side)
    )
    inside = inside_function(*cell)
    f.cell_contains = inside and of_element(f.CellArg, f.cell_corners, inside)


def _bounds(f: SimpleNamespace, d: int, real, n: int) -> wp.Function:
    CellArg = f.CellArg

    @wp.func
    def cell_bounds(arg: CellArg, cell: int):
        lower = arg.positions[arg.cells[cell, 0]]
        upper = lower
        for k in range(1, n):
            lower = wp.min(lower, arg.positions[arg.cells[cell, k]])
            upper = wp.max(upper, arg.positions[arg.cells[cell, k]])
        return lower, upper

    return cell_bounds


@functools.cache
def _to_box(d: int, real) -> wp.Function:
    """Function of kernels: a position as one of the hierarchy, in float32 and three axes."""
    vector = wp.types.vector(d, real)

    @wp.func
    def to_box(x: vector):
        y = wp.vec3()
        for k in range(d):
            y[k] = wp.float32(x[k])
        return y

    return to_box


@functools.cache
def bounds_kernel(record) -> wp.Kernel:
    """Kernel that writes the boxes of cells, and the box of all.

    Positions in float64 are rounded for the hierarchy: boxes grow by the rounding of both.
    """
    d, real, functions = record.dimension, record.scalar, record.functions
    to_box, cell_bounds, CellArg = _to_box(d, real), functions.cell_bounds, functions.CellArg
    pad = 0.0 if real is wp.float32 else 2.0**-22

    @wp.kernel(enable_backward=False)
    def write_bounds(arg: CellArg, lowers: Vectors, uppers: Vectors, box: Vectors):
        i = wp.tid()
        lower, upper = cell_bounds(arg, i)
        a, b = to_box(lower), to_box(upper)
        grow = pad * wp.max(wp.abs(a), wp.abs(b))
        a -= grow
        b += grow
        lowers[i] = a
        uppers[i] = b
        wp.atomic_min(box, 0, a)
        wp.atomic_max(box, 1, b)

    return write_bounds


def add_bvh_lookup(f: SimpleNamespace, record) -> None:
    """Adds `cell_lookup` by the hierarchy of boxes of `arg.bvh` and the box of all, `arg.box`."""

    @functools.cache
    def make_search(filter_func=None):
        nearest = _search_from(f, record, filter_func)
        real, vector = record.scalar, wp.types.vector(record.dimension, record.scalar)
        CellArg, Coords = f.CellArg, coords_type(record.scalar)

        @wp.func
        def search(
            arg: CellArg, x: vector, max_dist: real, data: Any, target: Any, environment: int
        ):
            none = Coords(real(OUTSIDE))
            return nearest(arg, x, data, target, environment, -1, none, real(0.0), real(0.0))

        return search

    f.guided_lookup = _guided(f, record)
    add_lookup_forms(f, record, make_search)


def _guided(f: SimpleNamespace, record) -> wp.Function:
    """Function of (arg, position, guess): the guess's cell bounds the distance of the search."""
    vector, Sample = wp.types.vector(record.dimension, record.scalar), sample_type(record.scalar)
    CellArg, closest, environment_of = f.CellArg, f.cell_closest_point, f.cell_environment_index
    nearest, real = _search_from(f, record, None), record.scalar

    @wp.func
    def guided(arg: CellArg, x: vector, guess: Sample):
        cell = guess.element_index
        coords, distance_sq = closest(arg, cell, x)
        if distance_sq <= real(0.0):
            return make_free_sample(cell, coords)
        environment = environment_of(arg, cell)
        return nearest(arg, x, 0, 0, environment, cell, coords, distance_sq, wp.sqrt(distance_sq))

    return guided


def _search_from(f: SimpleNamespace, record, filter_func) -> wp.Function:
    """Function that finds the nearest cell, from a candidate and a radius on.

    Cells around the point are tried first, by their inverse maps alone. Else boxes of a growing
    radius are searched; the first find's distance is the radius of the last one, and cells whose
    box is farther than a find are left out.
    """
    d, real, several = record.dimension, record.scalar, record.environments
    vector, Coords, CellArg = wp.types.vector(d, real), coords_type(real), f.CellArg
    closest, to_box, contains = f.cell_closest_point, _to_box(d, real), f.cell_contains
    is_filtered, is_solid = filter_func is not None, contains is not None
    # The distance in float32 of a position in float64 is off by its rounding.
    pad = wp.float32(0.0 if real is wp.float32 else 2.0**-22)

    @wp.func
    def find_around(arg: CellArg, x: vector, data: Any, target: Any, reach: wp.vec3, root: int):
        """The lowest cell that contains the point."""
        center = to_box(x)
        best_cell = int(-1)
        best_coords = Coords(real(OUTSIDE))
        query = wp.bvh_query_aabb(arg.bvh, center - reach, center + reach, root)
        cell = int(0)
        while wp.bvh_query_next(query, cell):
            if best_cell < 0 or cell < best_cell:
                coords, is_inside = contains(arg, cell, x)
                if wp.static(is_filtered):
                    if is_inside:
                        is_inside = filter_func(data, cell) == target
                if is_inside:
                    best_cell = cell
                    best_coords = coords
        return best_cell, best_coords

    @wp.func
    def nearest(
        arg: CellArg,
        x: vector,
        data: Any,
        target: Any,
        environment: int,
        first_cell: int,
        first_coords: Coords,
        first_sq: real,
        first_radius: real,
    ):
        best_cell = first_cell
        best_coords = first_coords
        best_sq = first_sq
        root = int(-1)
        if wp.static(several):
            if arg.bvh != wp.uint64(0):
                root = wp.bvh_get_group_root(arg.bvh, environment)
        if arg.bvh == wp.uint64(0) or (wp.static(several) and root < 0):
            return make_free_sample(best_cell, best_coords)
        # Nothing is near NaN.
        if not wp.dot(x, x) >= real(0.0):
            return make_free_sample(-1, Coords(real(OUTSIDE)))
        center = to_box(x)
        error = pad * wp.max(wp.abs(center))
        if wp.static(is_solid):
            found, coords = find_around(arg, x, data, target, wp.vec3(error), root)
            if found >= 0:
                return make_free_sample(found, coords)
        gap = wp.length(wp.max(wp.max(arg.box[0] - center, center - arg.box[1]), wp.vec3()))
        size = wp.length(arg.box[1] - arg.box[0])
        # Beyond this radius are no cells.
        last_radius = 1.0001 * (gap + size) + error
        step = 1.0e-3 * size
        radius = wp.where(best_cell < 0, gap + step, wp.float32(first_radius))
        for _attempt in range(64):
            query = wp.bvh_query_sphere(arg.bvh, center, radius * 1.000001 + error, root)
            cell = int(0)
            while wp.bvh_query_next(query, cell):
                a = arg.lowers[cell] - center
                b = center - arg.uppers[cell]
                box_gap = wp.length(wp.max(wp.max(a, b), wp.vec3())) * 0.999999 - error
                box_gap = wp.max(box_gap, 0.0)
                is_near = best_cell < 0 or real(box_gap) * real(box_gap) <= best_sq
                if wp.static(is_filtered):
                    if is_near:
                        is_near = filter_func(data, cell) == target
                if is_near:
                    coords, distance_sq = closest(arg, cell, x)
                    nearer = distance_sq < best_sq or (distance_sq == best_sq and cell < best_cell)
                    # The distance of a cell with NaN is not at least 0.
                    if (best_cell < 0 or nearer) and distance_sq >= real(0.0):
                        best_sq = distance_sq
                        best_cell = cell
                        best_coords = coords
            if best_cell >= 0:
                distance = wp.float32(wp.sqrt(best_sq))
                if distance <= radius * 1.000001:
                    break
                radius = distance
            else:
                if radius >= last_radius:
                    break
                radius = wp.min(radius + step, last_radius)
                step *= 2.0
        return make_free_sample(best_cell, best_coords)

    return nearest
