"""Adaptive sparse grids - cells of sizes 1, 2, 4, ... at voxels of a volume."""

from __future__ import annotations

import warp as wp
from warp import extend
from warp._src.fem.geometry.environments import (
    merged_environments,
    packed_grid,
    write_cells,
)
from warp._src.fem.geometry.nanogrid import SparseGrid


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
        coarsest, placing = 1 << (level_count - 1), (voxel_size, translation, transform)
        grid, cell_env, env_offsets, voxels = packed_grid(
            *(points, point_envs, point_mask, cell_levels),
            count=env_count,
            offsets=env_offsets,
            placing=placing,
            device=device,
            guard=coarsest,
            alignment=coarsest,
        )
        voxels.check()
        return cls(
            grid,
            levels_of_cells(grid, voxels.packed, voxels.levels, voxels.is_valid),
            level_count,
            None,
            scalar_type,
            cell_env,
            env_offsets,
        )


def levels_of_cells(grid, voxels, levels, is_valid=None) -> wp.array:
    """Levels, given per voxel, in the order of a grid's cells; voxels with mask 0 do not count."""
    out = wp.zeros(grid.get_voxel_count(), dtype=wp.uint8, device=grid.device)
    write_cells(grid, voxels, is_valid, levels, out)
    return out
