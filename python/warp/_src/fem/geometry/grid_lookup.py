"""Look-up in regular grids: the cell by arithmetic, the nearest selected one by growing boxes."""

import functools
from types import SimpleNamespace
from typing import Any

import warp as wp
from warp._src.fem.geometry.lookup_forms import add_lookup_forms, box_search
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
    def place_of(arg: CellArg, x: vector, shift: vector, environment: int):
        """Numbers along the axes of the nearest cell to a position and a shift in cells."""
        at = counts()
        for k in range(d):
            u = (x[k] - arg.origin[k]) / arg.cell_size[k] + shift[k]
            # Clamped before the conversion: far positions have no number.
            at[k] = int(wp.floor(wp.clamp(u, real(0.0), real(arg.res[k] - 1))))
        return at

    @wp.func
    def size_of(arg: CellArg):
        return arg.cell_size

    @functools.cache
    def make_search(filter_func=None):
        if filter_func is not None:

            @wp.func
            def chosen(arg: CellArg, at: counts, data: Any, target: Any, environment: int):
                cell = first_cell(arg, environment) + cell_number(arg.res, at)
                return wp.where(filter_func(data, cell) == target, cell, -1)

            search_around = box_search(f, d, real, size_of, place_of, chosen)

        @wp.func
        def nearest(
            arg: CellArg, x: vector, max_dist: real, data: Any, target: Any, environment: int
        ):
            if not wp.dot(x, x) >= real(0.0):
                return make_free_sample(-1, Coords(real(OUTSIDE)))
            if wp.static(filter_func is None):
                center = place_of(arg, x, vector(), environment)
                cell = first_cell(arg, environment) + cell_number(arg.res, center)
                coords, _distance_sq = closest_point(arg, cell, x)
                return make_free_sample(cell, coords)
            else:
                return search_around(arg, x, max_dist, data, target, environment)

        return nearest

    add_lookup_forms(f, record, make_search)
