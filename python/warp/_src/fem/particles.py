"""Particles in cells - look-up, coordinates, order by cell; differentiable by positions."""

import functools

import warp as wp
from warp._src.fem.types import OUTSIDE, Ints, coords_type, make_free_sample


@functools.cache
def lookup_kernel(domain, by_domain: bool, has_environments: bool) -> wp.Kernel:
    """Kernel that finds the cell of each particle; no adjoint, numbers have none."""
    f, real = domain.functions, domain.geometry.scalar
    vector, DomainArg = wp.types.vector(domain.geometry.dimension, real), f.DomainArg
    lookup, partition_index = f.element_partition_lookup, f.element_partition_index

    @wp.kernel(enable_backward=False)
    def find_cells(
        arg: DomainArg,
        positions: wp.array(dtype=vector),
        environments: Ints,
        max_dist: real,
        cells: Ints,
    ):
        p = wp.tid()
        if wp.static(has_environments):
            cell = lookup(arg, positions[p], max_dist, environments[p]).element_index
        else:
            cell = lookup(arg, positions[p], max_dist).element_index
        if wp.static(by_domain):
            if cell >= 0:
                cell = partition_index(arg.index, cell)
        cells[p] = cell

    return find_cells


@functools.cache
def coordinates_kernel(domain, by_domain: bool) -> wp.Kernel:
    """Kernel that maps positions to coordinates in their cells."""
    f, real = domain.functions, domain.geometry.scalar
    vector, Coords = wp.types.vector(domain.geometry.dimension, real), coords_type(real)
    ElementArg, IndexArg = f.ElementArg, f.ElementIndexArg
    coordinates, element_index, outside = f.element_coordinates, f.element_index, real(OUTSIDE)

    @wp.kernel
    def find_coordinates(
        geo: ElementArg,
        index: IndexArg,
        positions: wp.array(dtype=vector),
        cells: Ints,
        coords: wp.array(dtype=Coords),
    ):
        p = wp.tid()
        cell = cells[p]
        if cell < 0:
            coords[p] = Coords(outside)
            return
        if wp.static(by_domain):
            cell = element_index(index, cell)
        coords[p] = coordinates(geo, cell, positions[p])

    return find_coordinates


@functools.cache
def order_kernel(domain, by_domain: bool, has_measures: bool, has_fractions: bool) -> wp.Kernel:
    """Kernel that writes coordinates and weights in the order of cells."""
    f, real = domain.functions, domain.geometry.scalar
    Coords, ElementArg, IndexArg = coords_type(real), f.ElementArg, f.ElementIndexArg
    measure_of, element_index, outside = f.element_measure, f.element_index, real(OUTSIDE)

    @wp.kernel
    def order_particles(
        geo: ElementArg,
        index: IndexArg,
        per_particle: int,
        measures: wp.array(dtype=real),
        fractions: wp.array(dtype=real),
        coords: wp.array(dtype=Coords),
        cells: Ints,
        offsets: Ints,
        items: Ints,
        particles: Ints,
        ordered_coords: wp.array(dtype=Coords),
        ordered_weights: wp.array(dtype=real),
    ):
        i = wp.tid()
        if i >= offsets[offsets.shape[0] - 1]:
            particles[i] = -1
            ordered_coords[i] = Coords(outside)
            ordered_weights[i] = real(0.0)
            return
        item = items[i]
        particle = item // per_particle
        cell = cells[item]
        c = coords[item]
        weight = real(1.0)
        if wp.static(has_measures):
            element = cell
            if wp.static(by_domain):
                element = element_index(index, cell)
            weight = measures[particle] / measure_of(geo, make_free_sample(element, c))
        else:
            weight = real(1.0) / real(offsets[cell + 1] - offsets[cell])
        if wp.static(has_fractions):
            weight = weight * fractions[item]
        particles[i] = particle
        ordered_coords[i] = c
        ordered_weights[i] = weight

    return order_particles


@wp.kernel(enable_backward=False)
def count_particles(offsets: Ints, largest: Ints):
    """Largest number of particles of a cell, and the number of cells that have some."""
    cell = wp.tid()
    n = offsets[cell + 1] - offsets[cell]
    wp.atomic_max(largest, 0, n)
    if n > 0:
        wp.atomic_add(largest, 1, 1)
