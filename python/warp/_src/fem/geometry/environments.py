"""Environments of sparse grids - voxels of all environments side by side in one grid."""

from __future__ import annotations

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.types import AnyArray, Ints, Levels, Vectors, Voxels

REBUILD_INVALID_INPUT = wp.constant(wp.uint32(wp.Volume.REBUILD_INVALID_INPUT))


@wp.func
def _voxel_of(x: wp.vec3, inverse: wp.mat33, origin: wp.vec3):
    u = inverse * (x - origin) + wp.vec3(0.5, 0.5, 0.5)
    return wp.vec3i(int(wp.floor(u[0])), int(wp.floor(u[1])), int(wp.floor(u[2])))


@wp.kernel(enable_backward=False)
def _to_voxels(points: Vectors, inverse: wp.mat33, origin: wp.vec3, voxels: Voxels):
    i = wp.tid()
    voxels[i] = _voxel_of(points[i], inverse, origin)


@wp.func
def _floor_to(x: int, alignment: int):
    q = x // alignment
    return wp.where(x - q * alignment < 0, q - 1, q) * alignment


@wp.kernel(enable_backward=False)
def _bound(voxels: Voxels, environments: Ints, mask: Ints, widths: Levels, low: Ints, high: Ints):
    i = wp.tid()
    if mask:
        if mask[i] == 0:
            return
    e = environments[i]
    if e < 0 or e >= low.shape[0]:
        return
    last = voxels[i][0]
    if widths:
        last += (1 << int(widths[i])) - 1
    wp.atomic_min(low, e, voxels[i][0])
    wp.atomic_max(high, e, last)


@wp.kernel(enable_backward=False)
def _lay_out(low: Ints, high: Ints, guard: int, alignment: int, offsets: Voxels):
    """Places the environments along the first axis, `guard` voxels apart; one thread."""
    start = int(0)
    for e in range(low.shape[0]):
        if low[e] > high[e]:
            offsets[e] = wp.vec3i(start, 0, 0)
            start += -_floor_to(-guard, alignment)
        else:
            first = _floor_to(low[e], alignment)
            offsets[e] = wp.vec3i(-_floor_to(low[e] - start, alignment), 0, 0)
            start += -_floor_to(-(high[e] - first + 1 + guard), alignment)


@wp.kernel(enable_backward=False)
def _pack(
    voxels: Voxels,
    environments: Ints,
    mask: Ints,
    offsets: Voxels,
    packed: Voxels,
    is_valid: Ints,
    first_bad: Ints,
):
    i = wp.tid()
    packed[i] = wp.vec3i()
    is_valid[i] = 0
    if mask:
        if mask[i] == 0:
            return
    e = environments[i]
    if e < 0 or e >= offsets.shape[0]:
        wp.atomic_min(first_bad, 0, i)
        return
    packed[i] = voxels[i] + offsets[e]
    is_valid[i] = 1


@wp.kernel(enable_backward=False)
def _write_cells(
    grid: wp.uint64, voxels: Voxels, is_valid: Ints, values: AnyArray, of_cells: AnyArray
):
    i = wp.tid()
    if is_valid:
        if is_valid[i] == 0:
            return
    p = voxels[i]
    cell = wp.volume_lookup_index(grid, p[0], p[1], p[2])
    if cell >= 0:
        of_cells[cell] = values[i]


def write_cells(grid, voxels, is_valid, values, of_cells) -> None:
    """Writes values of voxels in the order of a grid's cells; those of mask 0 do not count."""
    inputs = [grid.id, voxels, is_valid, values]
    with extend.unrecorded():
        wp.launch(_write_cells, voxels.shape, inputs, [of_cells], device=grid.device)


@wp.kernel(enable_backward=False)
def _report(first_bad: Ints, count: int, status: wp.array(dtype=wp.uint32)):
    if first_bad[0] < count:
        status[0] = status[0] | REBUILD_INVALID_INPUT


def checked_points(points, device) -> wp.array:
    """Points as an array of vec3i or vec3.

    Raises:
        RuntimeError: they are of another type.
    """
    if extend.is_array(points) and points.is_contiguous:
        points = points.to(device)
        if points.ndim == 1 and points.dtype in (wp.vec3i, wp.vec3):
            return points
        if points.ndim == 2 and points.shape[1] == 3 and points.dtype in (wp.int32, wp.float32):
            return points.view(wp.vec3i if points.dtype is wp.int32 else wp.vec3)
    raise RuntimeError(
        "points must be contiguous and either a 1D Warp array of vec3f or vec3i or a 2D n-by-3 "
        f"array of int32 or float32, but got {extend.shown(points)}"
    )


def checked_numbers(name: str, values, count: int, device, dtype=wp.int32):
    """An optional array with a number per point, on a device.

    Raises:
        RuntimeError: it is of another type or size.
    """
    if values is None:
        return None
    fits = extend.is_array(values) and values.ndim == 1 and values.is_contiguous
    if not fits or values.dtype is not dtype or values.shape[0] < count:
        raise RuntimeError(
            f"'{name}' expects a contiguous array of {extend.type_repr(dtype)} of at least "
            f"{count} elements, but got {extend.shown(values)}"
        )
    return values.to(device)


class EnvironmentVoxels:
    """Voxels with environments, packed into one grid.

    Attributes:
        packed, is_valid: voxels in the grid, and a mask of those that count.
        offsets: (environments,) of vec3i, what is added to voxels.
        first_bad: (1,) number of the first point of no environment; the count if there is none.
    """

    def __init__(self, points, environments, count: int, mask, transform, levels=None):
        self.environments, self._mask, self.levels = environments, mask, levels
        self.device, self.count = points.device, count
        matrix, origin = transform
        with extend.unrecorded():
            if points.dtype is wp.vec3:
                voxels = wp.empty(points.shape, dtype=wp.vec3i, device=self.device)
                inverse = wp.mat33(*np.linalg.inv(matrix).astype(np.float32).ravel().tolist())
                inputs = [points, inverse, wp.vec3(*origin.tolist())]
                wp.launch(_to_voxels, points.shape, inputs, [voxels], device=self.device)
                points = voxels
        self._voxels = points

    def lay_out(self, offsets, guard: int, alignment: int = 1) -> None:
        """Writes offsets that keep environments `guard` voxels apart."""
        with extend.unrecorded():
            low = wp.full(self.count, 2**30, dtype=wp.int32, device=self.device)
            high = wp.full(self.count, -(2**30), dtype=wp.int32, device=self.device)
            inputs = [self._voxels, self.environments, self._mask, self.levels]
            wp.launch(_bound, self._voxels.shape, inputs, [low, high], device=self.device)
            wp.launch(_lay_out, 1, [low, high, guard, alignment], [offsets], device=self.device)

    def pack(self, offsets) -> None:
        """Moves the voxels by the offsets of their environments."""
        n = self._voxels.shape
        with extend.unrecorded():
            self.offsets = offsets
            self.packed = wp.empty(n, dtype=wp.vec3i, device=self.device)
            self.is_valid = wp.empty(n, dtype=wp.int32, device=self.device)
            self.first_bad = wp.full(1, n[0], dtype=wp.int32, device=self.device)
            inputs = [self._voxels, self.environments, self._mask, offsets]
            outputs = [self.packed, self.is_valid, self.first_bad]
            wp.launch(_pack, n, inputs, outputs, device=self.device)

    def check(self) -> None:
        """Raises ValueError for a point of no environment."""
        first = int(self.first_bad.numpy()[0])
        if first < self._voxels.shape[0]:
            number = int(self.environments[first : first + 1].numpy()[0])
            raise ValueError(
                f"Environment index {number} of point {first} is out of bounds, "
                f"there are {self.count} environments"
            )

    def report(self, status) -> None:
        """Sets a bit of `status` if a point has no environment."""
        if status is not None:
            inputs = [self.first_bad, self._voxels.shape[0]]
            with extend.unrecorded():
                wp.launch(_report, 1, inputs, [status.flatten()], device=self.device)

    def name_cells(self, grid, cell_env) -> None:
        """Writes the environments of the cells of a grid of the packed voxels."""
        write_cells(grid, self.packed, self.is_valid, self.environments, cell_env)


def merged_environments(parts, device=None) -> tuple:
    """One array of arrays per environment, and the environment of each element.

    Raises:
        ValueError: there are none, or of different types.
    """
    parts = list(parts)
    if not parts or not all(extend.is_array(part) and part.ndim == 1 for part in parts):
        raise ValueError("expects at least one array of voxels, one per environment")
    device = wp.get_device(device) if device is not None else parts[0].device
    numbers = np.repeat(np.arange(len(parts), dtype=np.int32), [len(part) for part in parts])
    merged = wp.empty(len(numbers), dtype=parts[0].dtype, device=device)
    first = 0
    for part in parts:
        wp.copy(merged, part, dest_offset=first, count=len(part))
        first += len(part)
    return merged, wp.array(numbers, dtype=wp.int32, device=device)


def transform_of(voxel_size, translation, transform) -> tuple:
    """Matrix and translation of a grid, in float64."""
    if transform is None:
        if voxel_size is None:
            raise ValueError("'voxel_size' expects a number where 'transform' is None")
        matrix = np.diag(np.broadcast_to(np.asarray(voxel_size, float), 3))
    else:
        matrix = np.array(transform, dtype=float).reshape(3, 3)
    return matrix, np.array(translation, dtype=float).reshape(3)


def checked_offsets(offsets, count: int, device, alignment: int = 1) -> wp.array:
    """Offsets of environments as an array on a device.

    Raises:
        ValueError: they are not one vec3i per environment, or not multiples of `alignment`.
    """
    if not extend.is_array(offsets):
        offsets = wp.array(np.array(offsets, np.int32), dtype=wp.vec3i, device=device)
    if offsets.dtype is not wp.vec3i or offsets.shape != (count,):
        raise ValueError(f"'env_offsets' expects {count} of vec3i, one per environment")
    if alignment > 1 and (offsets.numpy() % alignment).any():
        raise ValueError(
            f"'env_offsets' expects multiples of {alignment}, the coarsest cell's size"
        )
    return offsets.to(device)


def packed_grid(
    points, point_envs, mask, levels, *, count, offsets, placing, device, guard, alignment=1, **room
):
    """A volume of the voxels of all environments, with the environment of each cell.

    Args:
        points, point_envs, mask, levels: voxels, their environments, 0 for those to leave out, and
            levels or None.
        count: number of environments.
        offsets: what is added to an environment's voxels; laid out, `guard` voxels apart, if None.
        placing: (voxel_size, translation, transform). room: more arguments of the volume.

    Returns:
        (volume, environment of each cell, offsets, the `EnvironmentVoxels`).
    """
    device = wp.get_device(device) if device is not None else points.device
    points = checked_points(points, device)
    n = points.shape[0]
    environments = checked_numbers("point_envs", point_envs, n, device)
    mask = checked_numbers("point_mask", mask, n, device)
    levels = checked_numbers("cell_levels", levels, n, device, wp.uint8)
    if count < 1:
        raise ValueError(f"'env_count' expects at least 1, but got {count}")
    voxels = EnvironmentVoxels(
        points, environments, int(count), mask, transform_of(*placing), levels
    )
    if offsets is None:
        offsets = wp.empty(count, dtype=wp.vec3i, device=device)
        voxels.lay_out(offsets, guard, alignment)
    else:
        offsets = checked_offsets(offsets, count, device, alignment)
    voxels.pack(offsets)
    voxel_size, translation, transform = placing
    grid = wp.Volume.allocate_by_voxels(
        voxels.packed,
        voxel_size=voxel_size if transform is None else None,
        translation=translation,
        transform=transform,
        device=device,
        point_mask=voxels.is_valid,
        **room,
    )
    cell_env = wp.zeros(grid.get_voxel_count(), dtype=wp.int32, device=device)
    voxels.name_cells(grid, cell_env)
    return grid, cell_env, offsets, voxels
