"""Volumes made of points, and made again of others in the room that was kept for them."""

from __future__ import annotations

import itertools
import operator

import numpy as np

from warp import _native
from warp._src import errors
from warp._src.devices import devices
from warp._src.geometry.volumes import points
from warp._src.geometry.volumes.contents import INDEX, ON_INDEX
from warp._src.types import dtypes

# Status bits, by the level of nodes that had no room.
LEAF_CAPACITY, LOWER_CAPACITY, UPPER_CAPACITY, VOXEL_CAPACITY = 1, 2, 4, 8

# Bytes of the grids that kernels build, at most: they take the room for all nodes at once.
MOST_ROOM = 1 << 30


class Recipe:
    """How the grid of a volume follows from points.

    Args:
        kind: "tiles", whose voxels are all there, or "voxels", which are there alone.
        number, background: type and bytes of values.
        transform: matrix and shift from index space to the world.
        capacities: of leaves, lower and upper nodes, and voxels; None: as many as there are.
    """

    def __init__(self, kind, number, background, transform, capacities=None):
        self.kind, self.number = kind, ON_INDEX if kind == "voxels" else number
        self.background, self.transform, self.capacities = background, transform, capacities
        matrix, shift = transform
        self.native = _native.GridRecipe(
            kind == "voxels", self.number, background or b"", matrix.ravel(), shift
        )

    @property
    def room(self) -> int:
        """Bytes of a grid with as many nodes as there is room for."""
        return self.native.bytes_for(self.capacities)


def capacity(value, default, name) -> int:
    """Room for nodes.

    Raises:
        ValueError: not positive, or more than 32 bits.
    """
    if value is None:
        return max(default, 1)
    value = operator.index(value)
    if not 0 < value < 2**32:
        raise ValueError(f"{name} must be positive and fit in uint32, but got {value}")
    return value


def room(names, values, given):
    """Capacities; the default of each is the one before it."""
    first = len(given) if dtypes.is_array(given) else 1
    return list(
        itertools.accumulate(
            zip(names, values, strict=True),
            lambda former, entry: capacity(entry[1], former, entry[0]),
            initial=first,
        )
    )[1:]


def check_status(status, device):
    """Checks the array that a status goes to.

    Raises:
        WarpError: it is no uint32 array of the device.
    """
    if not dtypes.is_array(status) or status.dtype is not dtypes.uint32 or status.size < 1:
        raise errors.WarpError("status must be an array of uint32 with at least one element")
    if status.device != device:
        raise errors.WarpError(f"status must be on '{device}', but is on '{status.device}'")


def builds_there(device, recipe) -> bool:
    """True if kernels build the grids of a recipe, in room for as many nodes as it says."""
    if device.is_cpu or recipe.capacities is None:
        return False
    return recipe.room <= MOST_ROOM


def counts_there(device, given) -> bool:
    """True if kernels find out how large the grid of points is, and build it."""
    if device.is_cpu or not dtypes.is_array(given) or given.device != device:
        return False
    return given.size > 0 and not _native.is_capturing(device.index)


def _of_size(cls, recipe, given, what, device, mask):
    """A volume with as much room as the grid of points takes; None where the host has to do it."""
    from warp._src.geometry.device.refit import slot_of
    from warp._src.geometry.device.voxel_order import VoxelOrder
    from warp._src.geometry.device.voxels import VoxelTree

    given, mask = points.arrays_on(device, given, mask, what)
    order = VoxelOrder(len(given), device)
    order.run(given, mask, recipe)
    recipe.capacities = order.capacities(recipe)
    if recipe.capacities is None or recipe.room > MOST_ROOM:
        recipe.capacities = None
        return None
    tree = VoxelTree(recipe, device)
    volume = cls._of_tree(tree)
    tree.write(slot_of(volume.id, device), order)
    volume._recipe = None
    return volume


def by_points(cls, recipe, given, what, device, room, status, mask):
    """A volume of the class with the grid of points.

    room: capacities, or None where the volume is not made again.
    """
    device = devices.get_device(device)
    recipe.capacities = room
    if status is not None:
        check_status(status, device)
    if builds_there(device, recipe):
        from warp._src.geometry.device.voxels import VoxelTree

        given, mask = points.arrays_on(device, given, mask, what)
        volume = cls._of_tree(VoxelTree(recipe, device))
        volume.rebuild(given, status, mask)
        return volume
    if room is None and counts_there(device, given):
        volume = _of_size(cls, recipe, given, what, device, mask)
        if volume is not None:
            return volume
    grid = recipe.native.make(*points.given(given, mask, what))
    problem = 0 if room is None else _native.missing_room(grid, room)
    if problem:
        grid = recipe.native.make_empty()
    volume = cls._of_grids(grid, device)
    if room is not None:
        volume._recipe = recipe
        if status is not None:
            status.fill_(problem)
    return volume


def dense(cls, values, min_world, voxel_size, bg_value, device):
    """A volume with the values of a dense array; see `Volume.load_from_numpy`."""
    values = np.asarray(values)
    number, background = points.background_of(bg_value)
    kind, count = points.numpy_type(number)
    wanted = 4 if count > 1 else 3
    if values.ndim != wanted or (count > 1 and values.shape[3] != count):
        shown = f"(x, y, z, {count})" if count > 1 else "(x, y, z)"
        raise errors.WarpError(f"expects an array of shape {shown}, but got {values.shape}")
    packed = np.ascontiguousarray(values.astype(kind, casting="unsafe"))
    transform = points.transform_of(points.voxel_size_of(voxel_size), min_world, None)
    recipe = Recipe("tiles", number, background, transform)
    grid = recipe.native.make_dense(packed, values.shape[:3])
    return cls._of_grids(grid, devices.get_device(device))


def index_or_values(bg_value):
    """Type and background of a grid of tiles; without a value its voxels have numbers."""
    return (INDEX, bytes(8)) if bg_value is None else points.background_of(bg_value)
