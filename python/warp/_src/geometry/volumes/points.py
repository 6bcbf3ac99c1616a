"""Sources of volumes: sizes of voxels, backgrounds, arrays of points."""

from __future__ import annotations

import ctypes
import math

import numpy as np

from warp import _native
from warp._src import errors
from warp._src.geometry.volumes.contents import DTYPES, NAMES, NUMBERS
from warp._src.types import dtypes

ALLOCATED = ("int32", "uint32", "int64", "float", "double", "Vec3f", "Vec3d", "Vec4f", "Vec4d")


def voxel_size_of(size) -> tuple[float, float, float]:
    """Three positive edges of a voxel.

    Raises:
        TypeError: neither a number nor a sequence.
        ValueError: not three, or one is not positive and finite.
    """
    if isinstance(size, (int, float, np.floating, np.integer)):
        size = (size, size, size)
    elif not isinstance(size, (list, tuple, np.ndarray, ctypes.Array)) and not dtypes.is_vector(
        size
    ):
        raise TypeError(
            f"voxel_size must be a number or a sequence of 3 numbers, got {type(size).__name__}"
        )
    size = tuple(float(edge) for edge in size)
    if len(size) != 3:
        raise ValueError(f"voxel_size must be a number or 3 of them, got length {len(size)}")
    if not all(math.isfinite(edge) and edge > 0.0 for edge in size):
        raise ValueError(f"all voxel_size components must be finite and positive, got {size}")
    return size


def transform_of(voxel_size, translation, transform):
    """Matrix and shift from index space to the world.

    Raises:
        ValueError: neither or both of `voxel_size` and `transform` are given, or the matrix cannot
            be inverted.
    """
    if (voxel_size is None) == (transform is None):
        raise ValueError("exactly one of 'voxel_size' and 'transform' must be provided")
    if transform is None:
        matrix = np.diag(np.asarray(voxel_size_of(voxel_size), dtype=np.float32))
    else:
        matrix = np.asarray(transform, dtype=np.float32).reshape(3, 3)
    matrix = matrix.astype(np.float64)
    # As kernels and files of single precision have it.
    shift = np.asarray([float(x) for x in translation], dtype=np.float32).astype(np.float64)
    if not np.isfinite(matrix).all() or np.linalg.det(matrix) == 0.0:
        raise ValueError("the transform of a volume must be finite and invertible")
    if shift.shape != (3,) or not np.isfinite(shift).all():
        raise ValueError("the translation of a volume has three finite components")
    return matrix, shift


def background_of(value):
    """Number of a grid's type and the bytes of its background.

    Raises:
        TypeError: no grid is of the type of that value.
    """
    if isinstance(value, np.generic):
        dtype = dtypes.canonical(value.dtype.type)
    elif dtypes.is_scalar(value) or dtypes.is_vector(value):
        dtype = dtypes.canonical(type(value))
    elif hasattr(value, "__len__") and not isinstance(value, str):
        dtype = dtypes.vector(len(value), dtypes.float32)
    else:
        raise _wrong(value)
    for name in ALLOCATED:
        if dtypes.types_equal(DTYPES[name], dtype):
            break
    else:
        raise _wrong(value)
    kind = _NUMPY[dtypes.type_scalar_type(dtype)]
    value = getattr(value, "value", value)
    parts = value if hasattr(value, "__len__") else [value]
    try:
        numbers = np.array([getattr(x, "value", x) for x in parts], dtype=kind)
    except (TypeError, ValueError, OverflowError):
        raise _wrong(value) from None
    return NUMBERS[name], numbers.tobytes()


_NUMPY = {
    dtypes.int32: np.int32,
    dtypes.uint32: np.uint32,
    dtypes.int64: np.int64,
    dtypes.float32: np.float32,
    dtypes.float64: np.float64,
}


def numpy_type(number):
    """NumPy's type of the numbers in values of a grid's type, and how many there are."""
    dtype = DTYPES[NAMES[number]]
    return _NUMPY[dtypes.type_scalar_type(dtype)], dtypes.type_size(dtype)


def _wrong(value):
    return TypeError(
        f"Unsupported bg_value type for volume allocation {type(value).__name__}. Supported volume "
        f"types are {', '.join(ALLOCATED)}."
    )


def _check(points, mask, what):
    scalar = dtypes.type_scalar_type(getattr(points, "dtype", None))
    if not dtypes.is_array(points) or not points.is_contiguous or not is_threes(points, scalar):
        raise errors.WarpError(
            f"{what} must be a packed array of vec3i or vec3f, or of int32 or float32 and of shape "
            "(n, 3)"
        )
    if mask is not None and (
        not dtypes.is_array(mask)
        or mask.dtype is not dtypes.int32
        or mask.shape != (points.shape[0],)
    ):
        raise errors.WarpError("point_mask must be an array of int32, one for each point")


def arrays_on(device, points, mask, what):
    """Points as an array of vec3i or vec3 on a device, and their mask there.

    Raises:
        WarpError: as `voxels_of`.
    """
    _check(points, mask, what)
    points = points.to(device)
    if points.ndim == 2:
        is_whole = points.dtype is dtypes.int32
        points = points.view(dtypes.vector(3, dtypes.int32 if is_whole else dtypes.float32))
    return points, None if mask is None else mask.to(device)


def given(points, mask=None, what="points"):
    """The arguments of native recipes: points, whether they are voxels, their mask, and their name.

    Raises:
        WarpError: the points, or the mask, are no such array.
    """
    _check(points, mask, what)
    is_voxels = dtypes.type_scalar_type(points.dtype) is dtypes.int32
    mask = mask if mask is None else mask.to(points.device).contiguous()
    return points, is_voxels, mask, what


def tiles_of_box(low, high, voxel_size, translation, in_world):
    """The lowest voxels of the tiles that a box overlaps, int32 of shape (n, 3)."""
    corners = np.array([list(low), list(high)], dtype=np.float64)
    if in_world:
        corners = np.around((corners - np.asarray(translation)) / np.asarray(voxel_size))
    low, high = corners.astype(np.int64).tolist()
    return np.frombuffer(_native.tiles_of_box(low, high), dtype=np.int32).reshape(-1, 3)


def is_threes(points, scalar) -> bool:
    if scalar not in (dtypes.float32, dtypes.int32):
        return False
    if points.ndim == 2:
        return dtypes.type_size(points.dtype) == 1 and points.shape[1] == 3
    return (
        points.ndim == 1
        and dtypes.type_is_vector(points.dtype)
        and (dtypes.type_size(points.dtype) == 3)
    )
