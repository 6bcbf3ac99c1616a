"""Adaptive sparse grids of a field or of a hierarchy of grids, with limits on neighbours' sizes."""

import functools

import warp as wp
from warp import extend
from warp._src.fem.geometry.adaptive import AdaptiveNanogrid, levels_of_cells
from warp._src.fem.geometry.sparse_functions import find_cell
from warp._src.fem.types import Ints, Levels, Voxels


@wp.kernel(enable_backward=False)
def _refine_places(voxels: Voxels, shift: int, out: Voxels):
    i = wp.tid()
    p = voxels[i]
    out[i] = wp.vec3i(p[0] << shift, p[1] << shift, p[2] << shift)


@wp.kernel(enable_backward=False)
def _find_levels(voxels: Voxels, grids: wp.array(dtype=wp.uint64), levels: Levels):
    """The finest grid that has a voxel."""
    i = wp.tid()
    p = voxels[i]
    found = grids.shape[0] - 1
    for k in range(grids.shape[0]):
        level = grids.shape[0] - 1 - k
        if wp.volume_lookup_index(grids[level], p[0] >> level, p[1] >> level, p[2] >> level) >= 0:
            found = level
    levels[i] = wp.uint8(found)


@wp.kernel(enable_backward=False)
def _count_children(refinement: Ints, counts: Ints):
    """8 of a cell to refine, 1 of one to keep, 0 of one to drop."""
    i = wp.tid()
    counts[i] = wp.where(refinement[i] > 0, 8, wp.where(refinement[i] == 0, 1, 0))


@wp.kernel(enable_backward=False)
def _write_children(
    voxels: Voxels,
    levels: Levels,
    counts: Ints,
    ends: Ints,
    fine_voxels: Voxels,
    fine_levels: Levels,
):
    i = wp.tid()
    first = ends[i] - counts[i]
    level = int(levels[i]) - wp.where(counts[i] == 8, 1, 0)
    for k in range(counts[i]):
        corner = wp.vec3i((k >> 2) << level, ((k >> 1) & 1) << level, (k & 1) << level)
        fine_voxels[first + k] = voxels[i] + corner
        fine_levels[first + k] = wp.uint8(level)


@wp.kernel(enable_backward=False)
def _mark_coarse_neighbours(
    grid: wp.uint64,
    voxels: Voxels,
    levels: Levels,
    level_count: int,
    by_vertex: int,
    refinement: Ints,
):
    """Marks neighbours of more than one level above a cell."""
    i = wp.tid()
    level = int(levels[i])
    for n in range(27):
        d = wp.vec3i(n // 9 - 1, (n // 3) % 3 - 1, n % 3 - 1)
        steps = wp.abs(d[0]) + wp.abs(d[1]) + wp.abs(d[2])
        if steps == 1 or (by_vertex == 1 and steps > 0):
            p = voxels[i] + wp.vec3i(d[0] << level, d[1] << level, d[2] << level)
            beside = find_cell(grid, p, levels, level_count)
            if beside >= 0:
                if int(levels[beside]) > level + 1:
                    refinement[beside] = 1


def _refined(voxels, levels, refinement) -> tuple:
    """Voxels and levels after cells were divided, kept or dropped, in the order of cells."""
    device, n = voxels.device, voxels.shape[0]
    with extend.unrecorded():
        counts, ends = (wp.empty(n, dtype=wp.int32, device=device) for _ in range(2))
        wp.launch(_count_children, n, [refinement], [counts], device=device)
        count = 0
        if n:
            wp.utils.array_scan(counts, ends, inclusive=True)
            count = int(ends[n - 1 :].numpy()[0])
        fine_voxels = wp.empty(count, dtype=wp.vec3i, device=device)
        fine_levels = wp.empty(count, dtype=wp.uint8, device=device)
        outputs = [fine_voxels, fine_levels]
        wp.launch(_write_children, n, [voxels, levels, counts, ends], outputs, device=device)
    return fine_voxels, fine_levels


def _voxels_of(grid) -> wp.array:
    voxels = wp.empty(grid.get_voxel_count(), dtype=wp.vec3i, device=grid.device)
    grid.get_voxels(out=voxels)
    return voxels


def enforce_nanogrid_grading(
    cell_grid, cell_level, level_count: int, grading: str | None = None, temporary_store=None
) -> tuple:
    """Refines cells until neighbours differ by one level at most.

    Args:
        cell_grid, cell_level, level_count: as of `AdaptiveNanogrid`.
        grading: "face" or "vertex": what neighbours share; None or "none" for no limit.

    Returns:
        (grid, levels)

    Raises:
        ValueError: an unknown grading.
    """
    if grading not in (None, "none", "face", "vertex"):
        raise ValueError(f"'grading' expects None, 'face' or 'vertex', but got {grading!r}")
    if grading in (None, "none") or level_count <= 2:
        return cell_grid, cell_level
    info, device = cell_grid.get_grid_info(), cell_grid.device
    by_vertex = int(grading == "vertex")
    # A division can call for others once per level.
    for _ in range(level_count):
        voxels = _voxels_of(cell_grid)
        n = voxels.shape[0]
        with extend.unrecorded():
            refinement = wp.zeros(n, dtype=wp.int32, device=device)
            inputs = [cell_grid.id, voxels, cell_level, level_count, by_vertex]
            wp.launch(_mark_coarse_neighbours, n, inputs, [refinement], device=device)
        fine_voxels, fine_levels = _refined(voxels, cell_level, refinement)
        if fine_voxels.shape[0] == n:
            break
        cell_grid = wp.Volume.allocate_by_voxels(
            fine_voxels,
            translation=info.translation,
            transform=info.transform_matrix,
            device=device,
        )
        cell_level = levels_of_cells(cell_grid, fine_voxels, fine_levels)
    return cell_grid, cell_level


def adaptive_nanogrid_from_hierarchy(
    grids: list, grading: str | None = None, temporary_store=None
) -> AdaptiveNanogrid:
    """Makes an adaptive grid of grids that do not overlap.

    Args:
        grids: volumes, from the finest to the coarsest; voxels double from one to the next.
        grading: see `enforce_nanogrid_grading`.

    Raises:
        ValueError: there are no grids.
    """
    if not grids:
        raise ValueError("'grids' expects at least one volume, but got none")
    device, count = grids[0].device, len(grids)
    parts = [_voxels_of(grid) for grid in grids]
    with extend.unrecorded():
        merged = wp.empty(sum(len(part) for part in parts), dtype=wp.vec3i, device=device)
        first = 0
        for level, part in enumerate(parts):
            n = part.shape[0]
            out = merged[first : first + n]
            wp.launch(_refine_places, n, [part, level], [out], device=device)
            first += n
    info = grids[0].get_grid_info()
    grid = wp.Volume.allocate_by_voxels(
        merged, transform=info.transform_matrix, translation=info.translation, device=device
    )
    voxels = _voxels_of(grid)
    with extend.unrecorded():
        levels = wp.empty(voxels.shape, dtype=wp.uint8, device=device)
        ids = wp.array([one.id for one in grids], dtype=wp.uint64, device=device)
        wp.launch(_find_levels, voxels.shape, [voxels, ids], [levels], device=device)
    grid, levels = enforce_nanogrid_grading(grid, levels, count, grading)
    return AdaptiveNanogrid(grid, levels, count)


@functools.cache
def _refinement_integrand():
    """Integrand that says how far each cell has to be divided."""
    from warp._src.fem.forms.integrand import integrand
    from warp._src.fem.operators import lookup
    from warp._src.fem.types import Domain, Field, Sample

    @integrand
    def count_refinement(
        s: Sample,
        domain: Domain,
        field: Field,
        sample_count: int,
        level_count: int,
        coarse_grid: wp.uint64,
        voxels: Voxels,
        levels: Levels,
    ):
        cell = s.qp_index
        level = int(levels[cell])
        top = level_count - 1
        p = voxels[cell]
        own = wp.vec3i(p[0] >> level, p[1] >> level, p[2] >> level)
        rng = wp.rand_init((level << 24) ^ (own[0] << 12) ^ (own[1] << 6) ^ own[2])
        scale = 1.0 / float(1 << (top - level))
        center = wp.vec3(own) * scale + wp.vec3(0.5 * (scale - 1.0))
        finest = int(level_count)
        for _k in range(sample_count):
            u = center + wp.sample_unit_cube(rng) * scale
            there = lookup(domain, wp.volume_index_to_world(coarse_grid, u))
            if there.element_index >= 0:
                wanted = int(wp.floor(float(field(there)) * float(level_count)))
                if wanted >= 0:
                    finest = wp.min(finest, wp.min(wanted, top))
        return wp.where(finest < level_count, level - wp.clamp(finest, 0, level), -1)

    return count_refinement


def adaptive_nanogrid_from_field(
    coarse_grid,
    level_count: int,
    refinement_field,
    samples_per_voxel: int = 64,
    grading: str | None = None,
    temporary_store=None,
) -> AdaptiveNanogrid:
    """Makes an adaptive grid by a field of wanted sizes.

    Args:
        coarse_grid: volume of the coarsest cells; there are none outside of it.
        level_count: number of levels.
        refinement_field: 0 where cells have to be finest, 1 where coarsest; cells where all
            samples are negative are left out.
        samples_per_voxel: number of random points per cell where the field is read.
        grading: see `enforce_nanogrid_grading`.
    """
    from warp._src.fem.domains import Cells
    from warp._src.fem.interpolate import interpolate

    device, top = coarse_grid.device, level_count - 1
    coarse = _voxels_of(coarse_grid)
    with extend.unrecorded():
        voxels = wp.empty(coarse.shape, dtype=wp.vec3i, device=device)
        levels = wp.full(coarse.shape, top, dtype=wp.uint8, device=device)
        wp.launch(_refine_places, coarse.shape, [coarse, top], [voxels], device=device)
    domain = Cells(refinement_field.geometry)
    for _ in range(level_count):
        n = voxels.shape[0]
        refinement = wp.zeros(n, dtype=wp.int32, device=device)
        values = {"sample_count": samples_per_voxel, "level_count": level_count}
        values |= {"coarse_grid": coarse_grid.id, "voxels": voxels, "levels": levels}
        with wp.ScopedDevice(device):
            interpolate(
                _refinement_integrand(),
                dest=refinement,
                at=domain,
                dim=n,
                fields={"field": refinement_field},
                values=values,
            )
        voxels, levels = _refined(voxels, levels, refinement)
    if not voxels.shape[0]:
        raise ValueError("the field leaves no cell: it is negative at all samples")
    info, scale = coarse_grid.get_grid_info(), 1.0 / (1 << top)
    shift = (scale - 1.0) * 0.5
    size = coarse_grid.get_voxel_size()
    grid = wp.Volume.allocate_by_voxels(
        voxels,
        translation=[t + shift * s for t, s in zip(info.translation, size)],
        transform=info.transform_matrix * scale,
        device=device,
    )
    levels = levels_of_cells(grid, voxels, levels)
    grid, levels = enforce_nanogrid_grading(grid, levels, level_count, grading)
    return AdaptiveNanogrid(grid, levels, level_count)
