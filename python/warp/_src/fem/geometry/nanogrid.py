"""Sparse grids - cells at the voxels of a volume, of one size."""

from __future__ import annotations

from functools import cached_property

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.geometry.base import MAKERS, Geometry, GeometryRecord, checked_scalar, forget
from warp._src.fem.geometry.environments import (
    EnvironmentVoxels,
    checked_numbers,
    checked_points,
    merged_environments,
    packed_grid,
    transform_of,
)
from warp._src.fem.geometry.mesh import HasEntities, MeshEntities
from warp._src.fem.geometry.sparse_build import (
    fit_box,
    make_sides,
    node_numbers,
    node_places,
    shift_places,
)
from warp._src.fem.geometry.sparse_functions import sparse_functions

MAKERS.update(nanogrid=sparse_functions, adaptive=sparse_functions)


class SparseEntities(MeshEntities):
    """Vertices, edges and faces of a sparse grid; all cells run along the axes."""

    aligned = True


class SparseGrid(HasEntities, Geometry):
    """Base of sparse grids: cells at the voxels of a volume, with vertices in another one."""

    _kind = "nanogrid"
    level_count = 1

    def _set_up(self, grid, levels, count, scalar_type, cell_env, env_offsets) -> None:
        device = grid.device
        self._grid, self._levels, self._count = grid, levels, count
        self._packed = wp.zeros(count, dtype=wp.vec3i, device=device)
        self._places = wp.zeros(count, dtype=wp.vec3i, device=device)
        self._box = wp.empty(2, dtype=wp.vec3i, device=device)
        if env_offsets is None:
            env_offsets = wp.zeros(1, dtype=wp.vec3i, device=device)
        self._env_offsets = env_offsets.to(device)
        self._environments = env_offsets.shape[0]
        if cell_env is None:
            cell_env = wp.zeros(count, dtype=wp.int32, device=device)
        if cell_env.shape[0] < count:
            raise ValueError(
                f"'cell_env' expects {count} elements, one per cell, but got {cell_env.shape[0]}"
            )
        self._cell_env = cell_env.to(device)
        self._set_transform(checked_scalar(scalar_type))
        self.record = GeometryRecord(
            self._kind, "cube", 3, scalar_type, environments=self._environments > 1
        )
        self._node_grid = None
        self._read_cells()

    def _set_transform(self, real) -> None:
        info = self._grid.get_grid_info()
        matrix = np.array(info.transform_matrix, float).reshape(3, 3)
        inverse, determinant = np.linalg.inv(matrix), abs(np.linalg.det(matrix))
        if (matrix == np.diag(np.diag(matrix))).all():
            inverse, determinant = np.diag(1.0 / np.diag(matrix)), abs(np.prod(np.diag(matrix)))
        sides = [np.linalg.norm(np.cross(matrix[:, k - 2], matrix[:, k - 1])) for k in range(3)]
        mat33, vec3 = wp.types.matrix((3, 3), real), wp.types.vector(3, real)
        self.transform = info.transform_matrix
        self._matrix, self._inverse = mat33(*matrix.ravel()), mat33(*inverse.ravel())
        self._origin, self._areas = vec3(*info.translation), vec3(*sides)
        self._volume = real(determinant)

    @property
    def _cell_ijk(self):
        """Voxels of the cells, by the name that programs know."""
        return self._packed

    def _read_cells(self) -> None:
        """Reads the volume's voxels; nothing is read from the device."""
        grid, n = self._grid, self._count
        with extend.unrecorded():
            voxels = self._packed
            if grid.get_voxel_count() > n:
                voxels = wp.empty(grid.get_voxel_count(), dtype=wp.vec3i, device=grid.device)
            grid.get_voxels(out=voxels)
            if voxels is not self._packed:
                wp.copy(self._packed, voxels, count=n)
        shift_places(self._packed, self._cell_env, self._env_offsets, self._places)
        fit_box(grid, self._packed, self._levels, self._box)
        corners, mask = node_places(grid, self._packed, self._levels)
        if self.is_rebuildable and self._node_grid is not None:
            self._node_grid.rebuild(corners, point_mask=mask)
        else:
            self._node_grid = self._make_node_grid(corners, mask)
        self._corners = corners
        for name in ("_entities", "_sides"):
            self.__dict__.pop(name, None)
        forget(self)

    def _make_node_grid(self, places, mask, per_cell: int = 8) -> wp.Volume:
        """Volume of nodes, of which a cell has so many, with room if this one is rebuildable."""
        room = {}
        if self.is_rebuildable:
            info, most = self._grid.get_rebuild_info(), places.shape[0]
            leaves = min(most, per_cell * info.max_leaf_node_count)
            lowers = min(leaves, per_cell * info.max_lower_node_count)
            uppers = min(lowers, per_cell * info.max_upper_node_count)
            room = {"rebuildable": True, "max_active_voxels": most, "max_leaf_nodes": leaves}
            room |= {"max_lower_nodes": lowers, "max_upper_nodes": uppers}
        size = self._grid.get_voxel_size()
        return wp.Volume.allocate_by_voxels(
            places, voxel_size=size, device=self._grid.device, point_mask=mask, **room
        )

    @cached_property
    def _entities(self) -> SparseEntities:
        vertices = node_numbers(self._node_grid, self._corners)
        return SparseEntities(self.vertex_count(), vertices, self.cell)

    @cached_property
    def _sides(self):
        return make_sides(self._grid, self._packed, self._places, self._levels, self.level_count)

    @property
    def cell_grid(self) -> wp.Volume:
        """Volume of the cells."""
        return self._grid

    @property
    def vertex_grid(self) -> wp.Volume:
        """Volume of the vertices; its numbers are those of the vertices."""
        return self._node_grid

    @property
    def cell_env(self) -> wp.array:
        """Environment of each cell."""
        return self._cell_env

    @property
    def env_offsets(self) -> wp.array:
        """(environments,) of vec3i: distance of an environment's voxels in the volume."""
        return self._env_offsets

    def cell_count(self) -> int:
        """Number of cells; of a rebuildable grid the room for cells."""
        return self._count

    def vertex_count(self) -> int:
        """Number of vertices; of a rebuildable grid the room for them."""
        return self._node_grid.get_voxel_count()

    def fill_cell_arg(self, arg, device) -> None:
        """Fills an argument of the functions of cells."""
        arg.grid, arg.places, arg.levels = self._grid.id, self._places, self._levels
        arg.cell_env, arg.env_offsets = self._cell_env, self._env_offsets
        arg.level_count, arg.box = self.level_count, self._box
        arg.transform, arg.inverse = self._matrix, self._inverse
        arg.origin, arg.volume = self._origin, self._volume

    def fill_side_arg(self, arg, device) -> None:
        """Fills an argument of the functions of sides."""
        self.fill_cell_arg(arg.cell_arg, device)
        sides = self._sides
        arg.places, arg.flags, arg.side_cells = sides.places, sides.flags, sides.cells
        arg.boundary, arg.areas = sides.boundary, self._areas


class Nanogrid(SparseGrid):
    """Cells at the active voxels of a volume.

    Args:
        grid: the volume; best one that has numbers alone, as `allocate_by_voxels` makes.
        temporary_store: ignored.
        scalar_type: `wp.float32` or `wp.float64`.
        cell_env: (cells,) of int32, the environment of each cell.
        env_offsets: (environments,) of vec3i, what was added to an environment's voxels.
        rebuildable: keeps room, so that `rebuild` takes other voxels without reading from the
            device; elements beyond the cells in use do not count.

    Raises:
        ValueError: the volume has no active voxel.
        RuntimeError: `rebuildable` with a volume that is not.
    """

    def __init__(
        self,
        grid,
        temporary_store=None,
        scalar_type: type = wp.float32,
        cell_env=None,
        env_offsets=None,
        rebuildable: bool = False,
    ):
        if rebuildable and not grid.is_rebuildable:
            raise RuntimeError("Rebuildable Nanogrids require a rebuildable Volume")
        self.is_rebuildable = rebuildable
        count = (
            grid.get_rebuild_info().max_voxel_count
            if rebuildable
            else grid.get_active_stats().voxel_count
        )
        if count == 0:
            raise ValueError("Nanogrid requires at least one active cell")
        self._lays_out, self._guard = False, 0
        levels = wp.zeros(count, dtype=wp.uint8, device=grid.device)
        self._set_up(grid, levels, count, scalar_type, cell_env, env_offsets)

    @classmethod
    def from_environment_voxels(
        cls,
        points=None,
        point_envs=None,
        env_count=None,
        env_offsets=None,
        *,
        point_mask=None,
        guard_cells: int = 3,
        voxel_size=1.0,
        translation=(0.0, 0.0, 0.0),
        transform=None,
        temporary_store=None,
        scalar_type: type = wp.float32,
        device=None,
        rebuildable: bool = False,
        max_active_voxels=None,
        max_leaf_nodes=None,
        max_lower_nodes=None,
        max_upper_nodes=None,
        status=None,
        cell_ijks=None,
    ) -> Nanogrid:
        """A grid of several environments at one place.

        Args:
            points: (n,) of vec3i, voxels, or of vec3, positions in them; or a list of arrays, one
                per environment, also by the name `cell_ijks`.
            point_envs: (n,) of int32, the environment of each point.
            env_count: number of environments.
            env_offsets: (environments,) of vec3i, where they go in the volume; laid out along the
                first axis, `guard_cells` voxels apart, if None.
            point_mask: (n,) of int32, 0 for points to leave out.
            voxel_size, translation, transform: as of `wp.Volume.allocate_by_voxels`.
            scalar_type: `wp.float32` or `wp.float64`.
            device: device of the grid.
            rebuildable, max_active_voxels, max_leaf_nodes, max_lower_nodes, max_upper_nodes,
                status: as of `wp.Volume.allocate_by_voxels`.

        Raises:
            ValueError: an environment out of range, named with its point.
        """
        points = cell_ijks if points is None else points
        if points is not None and not extend.is_array(points):
            # An array per environment; offsets may take the place of `point_envs`.
            env_offsets = point_envs if env_offsets is None else env_offsets
            env_count = len(points)
            points, point_envs = merged_environments(points, device)
        if points is None or point_envs is None or env_count is None:
            raise TypeError("expects 'points', 'point_envs' and 'env_count'")
        room = {"max_active_voxels": max_active_voxels, "max_leaf_nodes": max_leaf_nodes}
        room |= {"max_lower_nodes": max_lower_nodes, "max_upper_nodes": max_upper_nodes}
        lays_out, placing = env_offsets is None, (voxel_size, translation, transform)
        grid, cell_env, env_offsets, voxels = packed_grid(
            *(points, point_envs, point_mask, None),
            count=env_count,
            offsets=env_offsets,
            placing=placing,
            device=device,
            guard=guard_cells,
            rebuildable=rebuildable,
            status=status,
            **room,
        )
        if rebuildable:
            voxels.report(status)
        else:
            voxels.check()
        made = cls(grid, None, scalar_type, cell_env, env_offsets, rebuildable)
        made._lays_out, made._guard = lays_out, guard_cells
        return made

    def rebuild(self, points, point_envs=None, *, status=None, point_mask=None):
        """Takes other voxels; topologies of spaces have a `rebuild` of their own.

        Args:
            points: (n,) of vec3i or vec3; with `point_envs` of their environments.
            point_envs: (n,) of int32, needed if there are several environments.
            status: (1,) of uint32 that gets bits of `wp.Volume`.
            point_mask: (n,) of int32, 0 for points to leave out.

        Returns:
            `status`.
        """
        if not self.is_rebuildable:
            raise RuntimeError("Nanogrid was not constructed in rebuildable mode")
        device = self._grid.device
        points = checked_points(points, device)
        n = points.shape[0]
        environments = checked_numbers("point_envs", point_envs, n, device)
        mask = checked_numbers("point_mask", point_mask, n, device)
        if environments is None:
            if self._environments > 1:
                raise ValueError("point_envs is required when rebuilding several environments")
            status = self._grid.rebuild(points, status=status, point_mask=mask)
        else:
            info = self._grid.get_grid_info()
            place = transform_of(None, info.translation, info.transform_matrix)
            voxels = EnvironmentVoxels(points, environments, self._environments, mask, place)
            if self._lays_out and self._environments > 1:
                voxels.lay_out(self._env_offsets, self._guard)
            voxels.pack(self._env_offsets)
            status = self._grid.rebuild(voxels.packed, status=status, point_mask=voxels.is_valid)
            voxels.name_cells(self._grid, self._cell_env)
            voxels.report(status)
        self.rebuild_topology_from_cells()
        return status

    def rebuild_topology_from_cells(self) -> None:
        """Takes over the voxels of the volume after its own `rebuild`."""
        if not self.is_rebuildable:
            raise RuntimeError("Nanogrid was not constructed in rebuildable mode")
        self._read_cells()
