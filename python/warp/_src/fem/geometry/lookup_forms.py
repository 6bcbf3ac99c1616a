"""Look-up - the nine forms of `lookup`: with a distance, a filter, an environment, a guess."""

from types import SimpleNamespace
from typing import Any

import warp as wp
from warp._src.fem.types import OUTSIDE, AnyArray, coords_type, make_free_sample, sample_type


@wp.func
def array_filter(data: AnyArray, cell: int):
    return data[cell]


def add_lookup_forms(f: SimpleNamespace, record, make_search) -> None:
    """Adds `cell_lookup` and `make_filtered_cell_lookup`.

    Args:
        f: functions of the geometry.
        record: its record.
        make_search: makes, for a filter or None, the function of (arg, position, max_dist,
            filter data, filter target, environment) that finds the nearest cell.
    """
    real, several = record.scalar, record.environments
    vector, Sample, CellArg = wp.types.vector(record.dimension, real), sample_type(real), f.CellArg
    position, environment_of = f.cell_position, f.cell_environment_index
    guided = getattr(f, "guided_lookup", None)
    has_guided = guided is not None
    search, filtered_search = make_search(None), make_search(array_filter)

    @wp.func
    def cell_lookup(arg: CellArg, x: vector, max_dist: real, environment: int):
        return search(arg, x, max_dist, 0, 0, environment)

    @wp.func
    def cell_lookup(arg: CellArg, x: vector, guess: Sample):
        if wp.static(has_guided):
            return guided(arg, x, guess)
        else:
            distance = wp.length(position(arg, guess) - x)
            return search(arg, x, distance, 0, 0, environment_of(arg, guess.element_index))

    @wp.func
    def cell_lookup(arg: CellArg, x: vector, environment: int):
        return search(arg, x, real(0.0), 0, 0, environment)

    @wp.func
    def cell_lookup(
        arg: CellArg,
        x: vector,
        max_dist: real,
        filter_array: AnyArray,
        filter_target: Any,
        environment: int,
    ):
        return filtered_search(arg, x, max_dist, filter_array, filter_target, environment)

    @wp.func
    def cell_lookup(
        arg: CellArg, x: vector, filter_array: AnyArray, filter_target: Any, environment: int
    ):
        return filtered_search(arg, x, real(0.0), filter_array, filter_target, environment)

    if not several:

        @wp.func
        def cell_lookup(arg: CellArg, x: vector):
            return search(arg, x, real(0.0), 0, 0, 0)

        @wp.func
        def cell_lookup(arg: CellArg, x: vector, max_dist: real):
            return search(arg, x, max_dist, 0, 0, 0)

        @wp.func
        def cell_lookup(arg: CellArg, x: vector, filter_array: AnyArray, filter_target: Any):
            return filtered_search(arg, x, real(0.0), filter_array, filter_target, 0)

        @wp.func
        def cell_lookup(
            arg: CellArg, x: vector, max_dist: real, filter_array: AnyArray, filter_target: Any
        ):
            return filtered_search(arg, x, max_dist, filter_array, filter_target, 0)

    f.cell_lookup = cell_lookup
    f.make_filtered_cell_lookup = make_search


def add_partition_lookup(f: SimpleNamespace, record, geometry) -> None:
    """Adds `element_partition_lookup`: the nearest cell of the domain's partition."""
    real, several = record.geometry.scalar, record.geometry.environments
    vector = wp.types.vector(record.geometry.dimension, real)
    DomainArg, partition_index = f.DomainArg, f.element_partition_index
    IndexArg = f.ElementIndexArg

    @wp.func
    def is_inside(data: IndexArg, cell: int):
        return partition_index(data, cell) >= 0

    is_whole = record.partition.kind == "whole"
    search = geometry.make_filtered_cell_lookup(None if is_whole else is_inside)

    @wp.func
    def element_partition_lookup(arg: DomainArg, x: vector, max_dist: real, environment: int):
        return search(arg.geo, x, max_dist, arg.index, True, environment)

    @wp.func
    def element_partition_lookup(arg: DomainArg, x: vector, environment: int):
        return search(arg.geo, x, real(0.0), arg.index, True, environment)

    if not several:

        @wp.func
        def element_partition_lookup(arg: DomainArg, x: vector, max_dist: real):
            return search(arg.geo, x, max_dist, arg.index, True, 0)

        @wp.func
        def element_partition_lookup(arg: DomainArg, x: vector):
            return search(arg.geo, x, real(0.0), arg.index, True, 0)

    f.element_partition_lookup = element_partition_lookup


def box_search(f: SimpleNamespace, d: int, real, size_of, place_of, chosen) -> wp.Function:
    """Function of (arg, position, max_dist, filter data, filter target, environment) that finds the
    nearest chosen cell of a grid, the lowest of several, in boxes of growing radius.

    Args:
        f: functions of the geometry. d, real: axes and scalar type.
        size_of: function of (arg): the size of a cell along each axis.
        place_of: function of (arg, position, radius in cells per axis): number of a cell per axis
            that is not beyond the grid.
        chosen: function of (arg, numbers per axis, filter data, filter target, environment): a
            cell, or -1 if it does not count.
    """
    vector, Coords, closest = wp.types.vector(d, real), coords_type(real), f.cell_closest_point
    CellArg, is_space, half = f.CellArg, d == 3, real(0.5)

    @wp.func
    def search(arg: CellArg, x: vector, max_dist: real, data: Any, target: Any, environment: int):
        size = size_of(arg)
        smallest = wp.min(size)
        best_cell = int(-1)
        best_coords = Coords(real(OUTSIDE))
        # Half a cell at least, as numbers of nodes on faces round either way.
        reach = wp.max(max_dist, half * smallest)
        best_sq = reach * reach
        radius = half * smallest
        while True:
            r = wp.cw_div(vector(radius), size)
            lower = place_of(arg, x, -r, environment)
            upper = place_of(arg, x, r, environment)
            layers = int(1)
            if wp.static(is_space):
                layers = upper[d - 1] - lower[d - 1] + 1
            for i in range(lower[0], upper[0] + 1):
                for j in range(lower[1], upper[1] + 1):
                    for layer in range(layers):
                        at = lower
                        at[0] = i
                        at[1] = j
                        if wp.static(is_space):
                            at[d - 1] = lower[d - 1] + layer
                        cell = chosen(arg, at, data, target, environment)
                        if cell >= 0:
                            coords, distance_sq = closest(arg, cell, x)
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

    return search
