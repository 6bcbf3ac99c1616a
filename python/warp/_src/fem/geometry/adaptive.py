"""Adaptive sparse grids - cells of sizes 1, 2, 4, ... at voxels of a volume."""

from __future__ import annotations

import warp as wp
from warp import extend
from warp._src.fem.geometry.environments import (
    EnvironmentVoxels,
    checked_numbers,
    checked_offsets,
    checked_points,
    merged_environments,
    transform_of,
)
from warp._src.fem.geometry.nanogrid import SparseGrid


@wp.kernel(enable_backward=False)
def write_levels(
    grid: wp.uint64,
    voxels: wp.array(dtype=wp.vec3i),
    levels: wp.array(dtype=wp.uint8),
    is_valid: wp.array(dtype=wp.int32),
    cell_levels: wp.array(dtype=wp.uint8),
):
    """Levels in the order of a grid's numbers."""
    i = wp.tid()
    if is_valid:
        if is_valid[i] == 0:
            return
    p = voxels[i]
    cell = wp.volume_lookup_index(grid, p[0], p[1], p[2])
    if cell >= 0:
        cell_levels[cell] = levels[i]


class AdaptiveNanogrid(SparseGrid):
    """Cells of several sizes; see `adaptive_nanogrid_from_field` and `_from_hierarchy`.

    Args:
        cell_grid: volume of the lowest fine voxel of each cell.
        cell_level: (cells,) of uint8: a cell has 2^level fine voxels along an edge.
        level_count: number of levels, at most 8.
        temporary_store: ignored.
        scalar_type: `wp.float32` or `wp.float64`.
        cell_env, env_offsets: as of `Nanogrid`.

    Raises:
        ValueError: no cells, too many levels.
    """

    _kind = "adaptive"

    def __init__(
        self,
        cell_grid,
        cell_level,
        level_count: int,
        temporary_store=None,
        scalar_type: type = wp.float32,
        cell_env=None,
        env_offsets=None,
    ):
        if not 1 <= level_count <= 8:
            raise ValueError(f"'level_count' expects 1 to 8, but got {level_count}")
        count = cell_grid.get_voxel_count()
        if count == 0:
            raise ValueError("Adaptive Nanogrid requires at least one active cell")
        if cell_level.dtype is not wp.uint8 or cell_level.shape[0] < count:
            raise ValueError(f"'cell_level' expects {count} elements of uint8, one per cell")
        self.level_count = int(level_count)
        self._set_up(cell_grid, cell_level, count, scalar_type, cell_env, env_offsets)

    @property
    def cell_level(self) -> wp.array:
        """Level of each cell."""
        return self._levels

    def stacked_face_count(self) -> int:
        """Number of faces of cells, with those of each size."""
        return self._entities.face_count

    def stacked_edge_count(self) -> int:
        """Number of edges of cells, with those of each size."""
        return self._entities.edge_count

    @classmethod
    def from_environment_voxels(
        cls,
        points=None,
        cell_levels=None,
        point_envs=None,
        env_count=None,
        level_count=None,
        env_offsets=None,
        *,
        point_mask=None,
        voxel_size=1.0,
        translation=(0.0, 0.0, 0.0),
        transform=None,
        temporary_store=None,
        scalar_type: type = wp.float32,
        device=None,
        cell_ijks=None,
    ) -> AdaptiveNanogrid:
        """A grid of several environments at one place.

        Args:
            points: (n,) of vec3i, lowest fine voxels of cells, or of vec3, positions in them; or a
                list of arrays, one per environment, also by the name `cell_ijks`.
            cell_levels: (n,) of uint8, or a list of arrays.
            level_count: number of levels.
            point_envs, env_count, env_offsets, point_mask, voxel_size, translation, transform,
                scalar_type, device: as of `Nanogrid.from_environment_voxels`; offsets are
                multiples of the coarsest cell's size.

        Raises:
            ValueError: an environment out of range, named with its point.
        """
        points = cell_ijks if points is None else points
        if points is not None and not extend.is_array(points):
            # An array per environment, then the number of levels and the offsets.
            level_count = point_envs if level_count is None else level_count
            env_offsets = env_count if env_offsets is None else env_offsets
            env_count = len(points)
            cell_levels, _ = merged_environments(cell_levels, device)
            points, point_envs = merged_environments(points, device)
        given = (points, cell_levels, point_envs, env_count, level_count)
        if any(one is None for one in given):
            raise TypeError(
                "expects 'points', 'cell_levels', 'point_envs', 'env_count' and 'level_count'"
            )
        device = wp.get_device(device) if device is not None else points.device
        points = checked_points(points, device)
        n = points.shape[0]
        environments = checked_numbers("point_envs", point_envs, n, device)
        mask = checked_numbers("point_mask", point_mask, n, device)
        levels = checked_numbers("cell_levels", cell_levels, n, device, wp.uint8)
        place = transform_of(voxel_size, translation, transform)
        voxels = EnvironmentVoxels(points, environments, int(env_count), mask, place, levels)
        coarsest = 1 << (level_count - 1)
        if env_offsets is None:
            env_offsets = wp.empty(env_count, dtype=wp.vec3i, device=device)
            voxels.lay_out(env_offsets, coarsest, coarsest)
        else:
            env_offsets = checked_offsets(env_offsets, env_count, device, coarsest)
        voxels.pack(env_offsets)
        grid = wp.Volume.allocate_by_voxels(
            voxels.packed,
            voxel_size=voxel_size if transform is None else None,
            translation=translation,
            transform=transform,
            device=device,
            point_mask=voxels.is_valid,
        )
        voxels.check()
        count = grid.get_voxel_count()
        cell_env = wp.zeros(count, dtype=wp.int32, device=device)
        voxels.name_cells(grid, cell_env)
        return cls(
            grid,
            levels_of_cells(grid, voxels.packed, levels, voxels.is_valid),
            level_count,
            None,
            scalar_type,
            cell_env,
            env_offsets,
        )


def levels_of_cells(grid, voxels, levels, is_valid=None) -> wp.array:
    """Levels, given per voxel, in the order of a grid's cells; voxels with mask 0 do not count."""
    with extend.unrecorded():
        out = wp.zeros(grid.get_voxel_count(), dtype=wp.uint8, device=grid.device)
        inputs = [grid.id, voxels, levels, is_valid]
        wp.launch(write_levels, voxels.shape, inputs, [out], device=grid.device)
    return out
