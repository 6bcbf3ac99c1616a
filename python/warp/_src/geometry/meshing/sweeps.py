"""Meshes in a sequence of poses: checked, their bounds, and a grid around them."""

from __future__ import annotations

import math

import numpy as np

import warp as wp
from warp._src.types import dtypes


@wp.kernel(enable_backward=False, module="unique")
def _bound_mesh(
    points: wp.array(dtype=wp.vec3),
    mesh: int,
    low: wp.array(dtype=wp.vec3),
    high: wp.array(dtype=wp.vec3),
):
    p = points[wp.tid()]
    if wp.isfinite(p):
        wp.atomic_min(low, mesh, p)
        wp.atomic_max(high, mesh, p)


@wp.kernel(enable_backward=False, module="unique")
def _bound_poses(
    low: wp.array(dtype=wp.vec3),
    high: wp.array(dtype=wp.vec3),
    transforms: wp.array2d(dtype=wp.transform),
    bounds: wp.array(dtype=wp.vec3),
):
    mesh, pose, corner = wp.tid()
    a = low[mesh]
    b = high[mesh]
    if a[0] <= b[0]:
        at = wp.vec3(
            wp.where((corner & 1) == 0, a[0], b[0]),
            wp.where((corner & 2) == 0, a[1], b[1]),
            wp.where((corner & 4) == 0, a[2], b[2]),
        )
        p = wp.transform_point(transforms[mesh, pose], at)
        wp.atomic_min(bounds, 0, p)
        wp.atomic_max(bounds, 1, p)


def _as_transforms(transforms, device):
    if dtypes.is_array(transforms):
        if transforms.ndim != 2:
            raise ValueError(
                f"expects 'transforms' of shape (meshes, poses), but got {tuple(transforms.shape)}"
            )
        if transforms.dtype is not wp.transform:
            raise TypeError(
                "expects 'transforms' of wp.transform, but got "
                f"{dtypes.type_repr(transforms.dtype)}"
            )
        return transforms.to(device)
    given = np.asarray(transforms, dtype=np.float32)
    if given.ndim != 3 or given.shape[2] != 7:
        raise ValueError(f"expects 'transforms' of shape (meshes, poses, 7), but got {given.shape}")
    return wp.array(given, dtype=wp.transform, ndim=2, device=device)


class Sweep:
    """Meshes and their poses, checked, on one device."""

    def __init__(self, meshes, transforms, device):
        if not len(meshes):
            raise ValueError("expects at least one mesh in 'meshes'")
        self.meshes = list(meshes)
        self.device = meshes[0].device if device is None else wp.get_device(device)
        for i, mesh in enumerate(self.meshes):
            if mesh.device != self.device:
                raise ValueError(
                    f"expects meshes on '{self.device}', but meshes[{i}] is on '{mesh.device}'"
                )
        self.transforms = _as_transforms(transforms, self.device)
        rows, poses = self.transforms.shape
        if rows != len(self.meshes):
            raise ValueError(
                f"expects a row of 'transforms' for each of {len(self.meshes)} meshes, but got "
                f"{rows}"
            )
        if not poses:
            raise ValueError("expects at least one pose in 'transforms'")

    def bounds(self):
        """The least and the greatest corner, in 64 bits."""
        device, infinity = self.device, math.inf
        count = len(self.meshes)
        low = wp.full(count, wp.vec3(infinity), dtype=wp.vec3, device=device)
        high = wp.full(count, wp.vec3(-infinity), dtype=wp.vec3, device=device)
        for i, mesh in enumerate(self.meshes):
            given = [mesh.points, i, low, high]
            wp.launch(_bound_mesh, len(mesh.points), inputs=given, device=device)
        both = wp.array([[infinity] * 3, [-infinity] * 3], dtype=wp.vec3, device=device)
        dim = (*self.transforms.shape, 8)
        wp.launch(_bound_poses, dim, inputs=[low, high, self.transforms, both], device=device)
        least, greatest = both.numpy().astype(np.float64)
        if not (least <= greatest).all():
            raise ValueError("expects a mesh with vertices in 'meshes', but all are empty")
        return least, greatest


class SweepGrid:
    """The grid that samples a field: `shape`, `lower`, `upper`; and the bounds of what is in it."""

    def __init__(self, sweep, voxel_size, resolution, lower, upper, padding):
        _check_grid(voxel_size, resolution, lower, upper)
        self.low, self.high = sweep.bounds()
        if lower is not None:
            self.shape = tuple(map(int, resolution))
            self.lower = np.array(list(lower), dtype=np.float64)
            self.upper = np.array(list(upper), dtype=np.float64)
            if not (self.lower < self.upper).all():
                raise ValueError(f"expects 'lower' below 'upper', but got {lower} and {upper}")
            return
        extent = self.high - self.low
        if voxel_size is None:
            self.shape = tuple(map(int, resolution))
            margin = padding + 2.0 * extent / (np.array(self.shape) - 1.0)
        else:
            # A whole number of cells, two or more around what is in it.
            cells = np.ceil((extent + 2.0 * padding) / voxel_size + 4.0)
            self.shape = tuple(int(n) + 1 for n in cells)
            margin = 0.5 * (cells * voxel_size - extent)
        self.lower, self.upper = self.low - margin, self.high + margin

    @property
    def spacing(self):
        return (self.upper - self.lower) / (np.array(self.shape) - 1.0)

    @property
    def reach(self) -> float:
        """A distance from everywhere in the grid to everywhere in the bounds."""
        low, high = np.minimum(self.low, self.lower), np.maximum(self.high, self.upper)
        return float(np.linalg.norm(high - low)) * (1.0 + 1e-6)


def _check_grid(voxel_size, resolution, lower, upper) -> None:
    if (lower is None) != (upper is None):
        raise ValueError("expects both 'lower' and 'upper', or neither")
    if (voxel_size is None) == (resolution is None):
        raise ValueError("expects either 'voxel_size' or 'resolution'")
    if voxel_size is not None:
        if not voxel_size > 0.0:
            raise ValueError(f"expects voxel_size > 0, but got {voxel_size}")
        if lower is not None:
            raise ValueError(
                "expects 'resolution' with 'lower' and 'upper', which need not be a whole number "
                "of voxels apart, but got 'voxel_size'"
            )
    elif len(tuple(resolution)) != 3 or min(map(int, resolution)) < 2:
        raise ValueError(f"expects three numbers from 2 on in 'resolution', but got {resolution}")
