"""Making arrays."""

from __future__ import annotations

import typing
import warnings

from warp._src.argument_kinds import ARRAY
from warp._src.arguments import checked
from warp._src.arrays.allocation import allocate, new_array
from warp._src.arrays.array import array
from warp._src.arrays.copies import empty_like
from warp._src.arrays.data import borrow
from warp._src.arrays.gradients import wants_wide_gradient
from warp._src.arrays.layout import check_shape, element_type
from warp._src.devices import devices, memory
from warp._src.types import dtypes
from warp._src.types.numpy_types import dtype_from_numpy


@checked()
def empty(
    shape=None,
    dtype: typing.Any = float,
    device=None,
    requires_grad=False,
    pinned=False,
    retain_grad=False,
    length=None,
    n=None,
    grad_dtype=None,
    strides=None,
    ndim=None,
):
    """An array with undefined contents.

    Args:
        shape: extent or extents, at most 4.
        dtype: element type.
        device: where the array lives; the current default if None.
        requires_grad: allocate an array for derivatives, too.
        pinned: host memory that CUDA devices reach directly.
        retain_grad: keep derivatives of intermediate results.
        length, n: extent of a one-dimensional array, instead of `shape`.
        grad_dtype: element type of the gradient, as for `wp.array`.
        strides: bytes between neighbours along each dimension; packed if None.
        ndim: number of dimensions, checked against `shape`.

    Raises:
        TypeError, ValueError: element type, shape or device cannot be used.
        WarpMemoryError: not enough memory.
    """
    length = n if length is None else length
    if length is not None:
        if shape is not None:
            raise ValueError("expects `shape` or `length`, but got both")
        shape = length
    result = new_array(array)
    extents = check_shape(shape)
    if ndim is not None and ndim != len(extents):
        raise ValueError(f"expects {ndim} dimensions, but got shape {extents}")
    index = devices.resolve_index(device)
    allocate(result, extents, element_type(dtype), index, pinned, strides)
    if wants_wide_gradient(result.dtype, grad_dtype):
        result._wide_grad = True
    if requires_grad:
        result.requires_grad = True
    if retain_grad:
        result.retain_grad = True
    return result


@checked()
def zeros(
    shape=None,
    dtype: typing.Any = float,
    device=None,
    requires_grad=False,
    pinned=False,
    retain_grad=False,
    length=None,
    n=None,
    grad_dtype=None,
    **layout,
):
    """An array of zeros; arguments as for `empty`."""
    result = empty(
        shape, dtype, device, requires_grad, pinned, retain_grad, length, n, grad_dtype, **layout
    )
    result.zero_()
    return result


@checked()
def ones(
    shape=None,
    dtype: typing.Any = float,
    device=None,
    requires_grad=False,
    pinned=False,
    retain_grad=False,
    length=None,
    n=None,
    grad_dtype=None,
    **layout,
):
    """An array whose components are all one; arguments as for `empty`."""
    return full(
        shape, 1, dtype, device, requires_grad, pinned, retain_grad, length, n, grad_dtype, **layout
    )


@checked()
def full(
    shape=None,
    value: typing.Any = 0,
    dtype: typing.Any = None,
    device=None,
    requires_grad=False,
    pinned=False,
    retain_grad=False,
    length=None,
    n=None,
    grad_dtype=None,
    **layout,
):
    """An array of equal elements; the element type is by default that of `value`."""
    if dtype is None:
        dtype = _type_of_value(value)
    result = empty(
        shape, dtype, device, requires_grad, pinned, retain_grad, length, n, grad_dtype, **layout
    )
    result.fill_(value)
    return result


def _type_of_value(value):
    if isinstance(value, bool):
        return bool
    if hasattr(value, "dtype") and hasattr(value, "shape"):
        scalar = dtype_from_numpy(value.dtype)
        if value.shape == ():
            return scalar
        make = dtypes.vector if len(value.shape) == 1 else dtypes.matrix
        return make(value.shape[0] if len(value.shape) == 1 else value.shape, scalar)
    if isinstance(value, (list, tuple)):
        rows = [len(row) if isinstance(row, (list, tuple)) else 0 for row in value]
        if any(rows):
            return dtypes.matrix((len(rows), rows[0]), float)
        integers = all(isinstance(number, int) for number in value)
        return dtypes.vector(len(value), int if integers else float)
    return type(value)


@checked(src=ARRAY)
def zeros_like(src, device=None, requires_grad=None, pinned=None, retain_grad=False, dtype=None):
    """An array of zeros with shape and element type of `src`; arguments as for `empty_like`."""
    result = empty_like(src, device, requires_grad, pinned, retain_grad, dtype)
    result.zero_()
    return result


@checked(src=ARRAY)
def ones_like(src, device=None, requires_grad=None, pinned=None, retain_grad=False, dtype=None):
    """An array of ones with shape and element type of `src`; arguments as for `empty_like`."""
    return full_like(src, 1, device, requires_grad, pinned, retain_grad, dtype)


@checked(src=ARRAY)
def full_like(
    src, value, device=None, requires_grad=None, pinned=None, retain_grad=False, dtype=None
):
    """An array of equal elements with shape and element type of `src`, else as `empty_like`."""
    result = empty_like(src, device, requires_grad, pinned, retain_grad, dtype)
    result.fill_(value)
    return result


@checked()
def from_numpy(arr, dtype=None, shape=None, device=None, requires_grad=False, retain_grad=False):
    """A copy of a NumPy array; without `dtype`, short inner dimensions become vec or mat elements.

    An array of shape (n, 2..4) becomes vectors and one of shape (n, 2..4, same) matrices.
    """
    if dtype is None:
        dtype = dtype_from_numpy(arr.dtype)
        inner = arr.shape[1:]
        if len(inner) == 2 and inner[0] == inner[1] and 2 <= inner[0] <= 4:
            dtype = dtypes.matrix(inner, dtype)
        elif len(inner) == 1 and 2 <= inner[0] <= 4:
            dtype = dtypes.vector(inner[0], dtype)
    return array(
        arr,
        dtype=dtype,
        shape=shape,
        device=device,
        requires_grad=requires_grad,
        retain_grad=retain_grad,
    )


def from_ptr(ptr, length, dtype=None, shape=None, device=None):
    """An array over existing memory.

    Deprecated, as in NVIDIA Warp: `wp.array(ptr=...)` says the same.
    """
    warnings.warn(
        "Warp DeprecationWarning: This version of wp.from_ptr() is deprecated, use "
        "`wp.array(ptr=..., shape=..., dtype=...)`",
        stacklevel=2,
    )
    return array(
        ptr=ptr,
        shape=shape if shape is not None else length,
        dtype=dtype or float,
        device=device,
        capacity=None if shape is None else length * dtypes.type_size_in_bytes(dtype or float),
    )


def from_ipc_handle(handle: bytes, dtype, shape, strides=None, device=None):
    """An array over the memory of an array of another process.

    Args:
        handle: what `array.ipc_handle()` gave there.
        dtype, shape, strides: those of that array.
        device: the CUDA device that the memory is on.

    Raises:
        RuntimeError: the device is no CUDA device, or the handle leads nowhere or to memory of
            this process, where the array itself is to be used.
    """
    device = devices.get_device(device)
    if not device.is_cuda:
        raise RuntimeError(f"expects a CUDA device to share memory on, but got '{device}'")
    mapped = memory.Imported(device.index, handle[: memory.HANDLE_BYTES])
    offset = int.from_bytes(handle[memory.HANDLE_BYTES :], "little")
    result, extents, dtype = new_array(array), check_shape(shape), element_type(dtype)
    pointer = mapped.ptr + offset
    borrow(result, pointer, extents, strides, dtype, device.index, None, None, owner=mapped)
    return result
