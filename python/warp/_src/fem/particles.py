"""Particles in cells - look-up, coordinates, order by cell; differentiable by positions."""

import functools

import warp as wp
from warp import extend
from warp._src.fem.types import OUTSIDE, coords_type, make_free_sample


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
        environments: wp.array(dtype=wp.int32),
        max_dist: real,
        cells: wp.array(dtype=wp.int32),
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
        cells: wp.array(dtype=wp.int32),
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
        cells: wp.array(dtype=wp.int32),
        offsets: wp.array(dtype=wp.int32),
        items: wp.array(dtype=wp.int32),
        particles: wp.array(dtype=wp.int32),
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
def _make_keys(
    cells: wp.array(dtype=wp.int32),
    cell_count: int,
    keys: wp.array(dtype=wp.int32),
    items: wp.array(dtype=wp.int32),
):
    i = wp.tid()
    cell = cells[i]
    # Particles outside come last.
    keys[i] = wp.where(cell < 0 or cell >= cell_count, cell_count, cell)
    items[i] = i


@wp.kernel(enable_backward=False)
def _find_offsets(keys: wp.array(dtype=wp.int32), count: int, offsets: wp.array(dtype=wp.int32)):
    """Number of keys below that of the thread."""
    cell = wp.tid()
    low = int(0)
    high = count
    while low < high:
        middle = (low + high) // 2
        if keys[middle] < cell:
            low = middle + 1
        else:
            high = middle
    offsets[cell] = low


def sort_by_cell(cells, cell_count: int):
    """Stable order of particles by their cells.

    Args:
        cells: (n,) of int32; numbers that are no cell come last.
        cell_count: number of cells.

    Returns:
        (offsets, items): first place of each cell and of what is outside, (cell_count + 1,), and
        the numbers of particles in order.
    """
    device, n = cells.device, cells.shape[0]
    with extend.unrecorded():
        keys, items = (wp.empty(2 * n, dtype=wp.int32, device=device) for _ in range(2))
        offsets = wp.empty(cell_count + 1, dtype=wp.int32, device=device)
        wp.launch(_make_keys, n, [cells, cell_count], [keys, items], device=device)
        wp.utils.radix_sort_pairs(keys, items, n, 0, max(cell_count, 1).bit_length())
        wp.launch(_find_offsets, cell_count + 1, [keys, n], [offsets], device=device)
    return offsets, items[:n]


@wp.kernel(enable_backward=False)
def count_particles(offsets: wp.array(dtype=wp.int32), largest: wp.array(dtype=wp.int32)):
    """Largest number of particles of a cell, and the number of cells that have some."""
    cell = wp.tid()
    n = offsets[cell + 1] - offsets[cell]
    wp.atomic_max(largest, 0, n)
    if n > 0:
        wp.atomic_add(largest, 1, 1)


@wp.kernel(enable_backward=False)
def mark_cells(offsets: wp.array(dtype=wp.int32), mask: wp.array(dtype=wp.int32)):
    """1 for cells with particles, else 0."""
    cell = wp.tid()
    mask[cell] = wp.where(offsets[cell + 1] > offsets[cell], 1, 0)
