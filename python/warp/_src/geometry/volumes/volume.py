"""`Volume`: a sparse grid of values, in a NanoVDB buffer."""

from __future__ import annotations

import os

from warp import _native
from warp._src import errors
from warp._src.argument_kinds import (
    ARRAY,
    BYTES,
    COUNT,
    NUMBER,
    NUMBERS,
    PATH,
    POINT,
    TEXT,
    VALUE,
    VOXEL,
)
from warp._src.arguments import checked
from warp._src.arrays.array import array
from warp._src.devices import devices
from warp._src.geometry.volumes import allocation, points
from warp._src.geometry.volumes.described import GridContents
from warp._src.geometry.volumes.leaves import LeafValues
from warp._src.geometry.volumes.rebuilding import Rebuildable
from warp._src.types import dtypes


class Volume(GridContents, Rebuildable, LeafValues):
    """A sparse grid of values, which kernels read by its `id`.

    Args:
        data: array of bytes with a NanoVDB grid, checked before it is used.
        copy: whether to copy it; else it stays the caller's and is kept.

    Attributes:
        id: what kernels get, as `wp.uint64`.
        device: where it is.

    Raises:
        RuntimeError: the bytes are no grid, damaged, or of a version or type that is not there.

    Example:
        >>> import numpy as np, warp as wp
        >>> volume = wp.Volume.load_from_numpy(np.ones((4, 4, 4)), voxel_size=0.1, device="cpu")
        >>> volume.get_tile_count(), volume.dtype.__name__
        (1, 'float32')
    """

    CLOSEST = 0
    LINEAR = 1

    @checked(data=ARRAY)
    def __init__(self, data, copy=True):
        if not dtypes.is_array(data) or dtypes.type_size_in_bytes(data.dtype) != 1:
            raise errors.WarpError("a Volume is made of an array of bytes")
        if data.ndim != 1 or not data.is_contiguous:
            raise errors.WarpError("a Volume is made of a packed array of one dimension")
        if copy:
            self._take(_native.copy_grids(data.numpy()), data.device)
        else:
            self._borrow(data)

    def __reduce__(self):
        return _of_bytes, (self.array(), str(self.device))

    @classmethod
    def _of_grids(cls, grids, device) -> Volume:
        """A volume of `GridBytes`, which are kept or copied to the device."""
        volume = cls.__new__(cls)
        volume._take(grids, device)
        return volume

    @classmethod
    def _of_tree(cls, tree) -> Volume:
        """A volume that kernels build in the room of a `VoxelTree`."""
        volume = cls.__new__(cls)
        volume._built = tree
        volume._recipe = tree.recipe
        volume._borrow(tree.data, tree.empty)
        return volume

    def _take(self, grids, device):
        self._native = _native.Volume(grids, devices.resolve_index(device))
        self._finish(device)

    def _borrow(self, data, *contents):
        """Leaves the grid in the memory of an array; its contents, if the host has them."""
        index = devices.resolve_index(data.device)
        self._native = _native.Volume(data.ptr, data.size, index, *contents)
        self._finish(data.device, data)

    def _finish(self, device, data=None):
        self.device, self.id = device, self._native.id
        self._borrowed = data
        self._published()

    def _published(self):
        """Finds the grid where it is now."""
        self._data = self._borrowed
        if self._data is None:
            at, size = self._native.data, self._native.size
            self._data = array(ptr=at, dtype=dtypes.uint8, shape=size, device=self.device)
            self._data._kept = self._native.memory
        super()._published()

    # Files and other memory.

    @classmethod
    @checked(file_or_buffer=PATH | BYTES)
    def load_from_nvdb(cls, file_or_buffer, device=None) -> Volume:
        """The first grid of a `.nvdb` file, given as an open file, bytes or a path.

        Raises:
            RuntimeError: the file is damaged, or of a version, type or codec that is not there.
        """
        data = file_or_buffer
        if hasattr(data, "read"):
            data = data.read()
        if isinstance(data, (str, os.PathLike)):
            with open(data, "rb") as file:
                data = file.read()
        return cls._of_grids(_native.read_grids(data), devices.get_device(device))

    @checked(codec=TEXT)
    def save_to_nvdb(self, path, codec="none"):
        """Writes the grids of this volume's memory to a file; gives the path.

        codec: "none", "zip", or "blosc", which needs the library libblosc of the system.

        Raises:
            RuntimeError: there is no such codec, or this is not the first grid of the memory.
        """
        if self._built is not None:
            self._native.refresh()
        self._native.save(os.fspath(path), codec)
        return path

    @classmethod
    @checked(path=PATH, grid=TEXT)
    def load_from_vdb(cls, path, grid: str | None = None, device=None) -> Volume:
        """A grid of a `.vdb` file of OpenVDB, the first if no name is given.

        OpenVDB trusts what a file says, so a process of its own reads it: a damaged file is an
        error here, however it ends there.

        Raises:
            ImportError: the component `libwarp_openvdb.so` is not there.
            RuntimeError: the file is damaged, or has no such grid, or one of a type that NanoVDB
                has not.
        """
        from warp._src.geometry.volumes import vdb

        data = _native.read_grids(vdb.read(path, grid))
        return cls._of_grids(data, devices.get_device(device))

    @checked(path=PATH, grid=TEXT)
    def save_to_vdb(self, path, grid: str = "density"):
        """Writes the grid to a `.vdb` file under a name; gives the path.

        Raises:
            ImportError: the component `libwarp_openvdb.so` is not there.
            RuntimeError: the file cannot be written, or OpenVDB has no grid of this type.
        """
        from warp._src.geometry.volumes import vdb

        vdb.write(self, path, grid)
        return path

    @classmethod
    @checked(grid_ptr=COUNT, buffer_size=COUNT)
    def load_from_address(cls, grid_ptr, buffer_size=0, device=None) -> Volume:
        """A volume of a grid in memory, which stays the caller's; no size: that of one grid.

        Raises:
            RuntimeError: the address is 0, or no grid is there.
        """
        if not grid_ptr:
            raise errors.WarpError("invalid address of a grid: 0")
        device = devices.get_device(device)
        volume = cls.__new__(cls)
        index = devices.resolve_index(device)
        volume._native = _native.Volume(grid_ptr, buffer_size, index)
        size = volume._native.size
        volume._finish(device, array(ptr=grid_ptr, dtype=dtypes.uint8, shape=size, device=device))
        return volume

    def load_next_grid(self) -> Volume | None:
        """The grid behind this one in memory; None if it is the last."""
        start = self._native.next
        if not start:
            return None
        rest = self._data.size - start
        following = Volume.load_from_address(self._data.ptr + start, rest, self.device)
        following._previous_grid = self
        return following

    # Made of points.

    @classmethod
    @checked(ndarray=NUMBERS, min_world=POINT, voxel_size=NUMBER, bg_value=VALUE)
    def load_from_numpy(
        cls, ndarray, min_world=(0.0, 0.0, 0.0), voxel_size=1.0, bg_value=0.0, device=None
    ) -> Volume:
        """A volume with the values of an array of shape (x, y, z), or (x, y, z, n) of vectors.

        Args:
            min_world: where the first voxel is in the world.
            voxel_size: edge of a voxel, or three.
            bg_value: value elsewhere. Its type is that of the grid: a Python float makes float32,
                an int int32, a sequence float32 vectors; values are converted to it.

        Raises:
            RuntimeError: the array is of another shape.
            TypeError, ValueError: no grid has such values, or voxels such a size.
        """
        return allocation.dense(cls, ndarray, min_world, voxel_size, bg_value, device)

    @classmethod
    @checked(min=POINT, max=POINT, voxel_size=VOXEL, bg_value=VALUE, translation=POINT)
    def allocate(
        cls,
        min,
        max,
        voxel_size,
        bg_value=0.0,
        translation=(0.0, 0.0, 0.0),
        points_in_world_space=False,
        device=None,
    ) -> Volume:
        """A volume of the tiles that a box overlaps, whose corners belong to it.

        Args: as `allocate_by_tiles`; `min` and `max` are voxels, or points of the world.
        """
        size = points.voxel_size_of(voxel_size)
        tiles = points.tiles_of_box(min, max, size, translation, points_in_world_space)
        given = array(tiles, dtype=dtypes.int32, device="cpu")
        return cls.allocate_by_tiles(given, size, bg_value, translation, device)

    @classmethod
    @checked(
        tile_points=ARRAY,
        voxel_size=VOXEL,
        translation=POINT,
        status=ARRAY,
        point_mask=ARRAY,
        max_tiles=COUNT,
        max_lower_nodes=COUNT,
        max_upper_nodes=COUNT,
        bg_value=VALUE,
    )
    def allocate_by_tiles(
        cls,
        tile_points,
        voxel_size=None,
        bg_value=0.0,
        translation=(0.0, 0.0, 0.0),
        device=None,
        transform=None,
        rebuildable=False,
        max_tiles=None,
        max_lower_nodes=None,
        max_upper_nodes=None,
        status=None,
        point_mask=None,
    ) -> Volume:
        """A volume with the tiles of 8^3 voxels around points.

        Args:
            tile_points: voxels (vec3i or int32 of shape (n, 3)), or points of the world (floats).
            voxel_size, transform: edge of a voxel or three of them, or a matrix.
            bg_value: value of all voxels, whose type the grid has; None numbers voxels instead.
            rebuildable, max_tiles, max_lower_nodes, max_upper_nodes: keep room for `rebuild`.
            status: uint32 array for `REBUILD_...` bits; a grid without room is left empty.
            point_mask: int32 array; points with 0 are left out.

        Raises:
            RuntimeError: an array is of another type, shape, layout or device.
            TypeError: no grid is of the type of `bg_value`.
            ValueError: sizes or capacities are not positive, or the transform is missing.
        """
        placed = points.transform_of(voxel_size, translation, transform)
        number, background = allocation.index_or_values(bg_value)
        recipe = allocation.Recipe("tiles", number, background, placed)
        wanted = (max_tiles, max_lower_nodes, max_upper_nodes)
        room = None
        if rebuildable or any(value is not None for value in wanted):
            room = allocation.room(
                ("max_tiles", "max_lower_nodes", "max_upper_nodes"), wanted, tile_points
            )
            room = (*room, room[0] * 512)
        return allocation.by_points(
            cls, recipe, tile_points, "tile_points", device, room, status, point_mask
        )

    @classmethod
    @checked(
        voxel_points=ARRAY,
        voxel_size=VOXEL,
        translation=POINT,
        status=ARRAY,
        point_mask=ARRAY,
        max_active_voxels=COUNT,
        max_leaf_nodes=COUNT,
        max_lower_nodes=COUNT,
        max_upper_nodes=COUNT,
    )
    def allocate_by_voxels(
        cls,
        voxel_points,
        voxel_size=None,
        translation=(0.0, 0.0, 0.0),
        device=None,
        transform=None,
        rebuildable=False,
        max_active_voxels=None,
        max_leaf_nodes=None,
        max_lower_nodes=None,
        max_upper_nodes=None,
        status=None,
        point_mask=None,
    ) -> Volume:
        """A volume in which the voxels of points have numbers, as elements of any array.

        Args: as `allocate_by_tiles`.
        """
        placed = points.transform_of(voxel_size, translation, transform)
        recipe = allocation.Recipe("voxels", None, None, placed)
        wanted = (max_active_voxels, max_leaf_nodes, max_lower_nodes, max_upper_nodes)
        names = ("max_active_voxels", "max_leaf_nodes", "max_lower_nodes", "max_upper_nodes")
        room = None
        if rebuildable or any(value is not None for value in wanted):
            voxels, *nodes = allocation.room(names, wanted, voxel_points)
            room = (*nodes, voxels)
        return allocation.by_points(
            cls, recipe, voxel_points, "voxel_points", device, room, status, point_mask
        )


def _of_bytes(data, device):
    """A volume of the bytes of its grids, on a device or, if that is not here, the current one."""
    there = devices.get_device(devices.present(device))
    return Volume(data if data.device is there else data.to(there))
