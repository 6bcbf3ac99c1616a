"""Look-up in regular grids: the cell by arithmetic, the nearest selected one by growing boxes."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp
from warp._src.fem.geometry.lookup_forms import add_lookup_forms
from warp._src.fem.types import OUTSIDE, coords_type, make_free_sample


def add_lookup(f: SimpleNamespace, record) -> None:
    """Adds `cell_lookup` and `make_filtered_cell_lookup`."""
    d, real, several = record.dimension, record.scalar, record.environments
    vector, counts, Coords = (
        wp.types.vector(d, real),
        wp.types.vector(d, wp.int32),
        coords_type(real),
    )
    CellArg, cell_number, cells_of = f.CellArg, f.cell_number, f.cells_of
    closest_point = f.cell_closest_point

    @wp.func
    def first_cell(arg: CellArg, environment: int):
        if wp.static(several):
            return environment * cells_of(arg.res)
        else:
            return 0

    @wp.func
    def cell_around(arg: CellArg, x: vector):
        """Numbers along the axes of the nearest cell."""
        at = counts()
        for k in range(d):
            u = (x[k] - arg.origin[k]) / arg.cell_size[k]
            # Clamped before the conversion: far positions have no number.
            at[k] = int(wp.floor(wp.clamp(u, real(0.0), real(arg.res[k] - 1))))
        return at

    @functools.cache
    def make_search(filter_func=None):
        @wp.func
        def nearest(
            arg: CellArg,
            x: vector,
            max_dist: real,
            filter_data: Any,
            filter_target: Any,
            environment: int,
        ):
            if not wp.dot(x, x) >= real(0.0):
                return make_free_sample(-1, Coords(real(OUTSIDE)))
            center = cell_around(arg, x)
            cell = first_cell(arg, environment) + cell_number(arg.res, center)
            if wp.static(filter_func is None):
                coords, _distance_sq = closest_point(arg, cell, x)
                return make_free_sample(cell, coords)
            else:
                return search_around(
                    arg, x, max_dist, filter_data, filter_target, center, environment
                )

        if filter_func is not None:
            search_around = _make_ring_search(
                d, real, f, filter_func, first_cell, vector, counts, Coords
            )
        return nearest

    add_lookup_forms(f, record, make_search)


def _make_ring_search(d, real, f, filter_func, first_cell, vector, counts, Coords):
    """Function that finds the nearest selected cell within `max_dist`, or in the cell itself."""
    CellArg, cell_number, closest_point = f.CellArg, f.cell_number, f.cell_closest_point
    d_is_3 = d == 3

    @wp.func
    def search_around(
        arg: CellArg,
        x: vector,
        max_dist: real,
        filter_data: Any,
        filter_target: Any,
        center: counts,
        environment: int,
    ):
        smallest = wp.min(arg.cell_size)
        best_cell = int(-1)
        best_coords = Coords(real(OUTSIDE))
        # Half a cell at least, as numbers of nodes on faces round either way.
        reach = wp.max(max_dist, real(0.5) * smallest)
        best_sq = reach * reach
        radius = real(0.5) * smallest
        while True:
            lower, upper = counts(), counts()
            for k in range(d):
                u = (x[k] - arg.origin[k]) / arg.cell_size[k]
                r = radius / arg.cell_size[k]
                last = real(arg.res[k] - 1)
                lower[k] = int(wp.floor(wp.clamp(u - r, real(0.0), last)))
                upper[k] = int(wp.floor(wp.clamp(u + r, real(0.0), last)))
            slices = int(1)
            if wp.static(d_is_3):
                slices = upper[d - 1] - lower[d - 1] + 1
            for i in range(lower[0], upper[0] + 1):
                for j in range(lower[1], upper[1] + 1):
                    for m in range(slices):
                        at = lower
                        at[0] = i
                        at[1] = j
                        if wp.static(d_is_3):
                            at[d - 1] = lower[d - 1] + m
                        cell = first_cell(arg, environment) + cell_number(arg.res, at)
                        if filter_func(filter_data, cell) == filter_target:
                            coords, distance_sq = closest_point(arg, cell, x)
                            if distance_sq < best_sq or (
                                distance_sq == best_sq and (best_cell < 0 or cell < best_cell)
                            ):
                                best_sq = distance_sq
                                best_cell = cell
                                best_coords = coords
            # Cells beyond the box are farther than `radius`.
            if radius >= reach or (best_cell >= 0 and best_sq <= radius * radius):
                break
            radius = wp.min(real(3.0) * radius, reach)
        return make_free_sample(best_cell, best_coords)

    return search_around
