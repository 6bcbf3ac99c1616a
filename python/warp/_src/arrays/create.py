"""Making arrays without data, and copying between them."""

from __future__ import annotations

from warp import _native
from warp._src import errors
from warp._src.devices import device as devices
from warp._src.types import dtypes as types
from warp._src.arrays.array import allocate, array, new_array
from warp._src.arrays.gradients import check_gradient_type
from warp._src.arrays.layout import check_shape, element_type
from warp._src.arrays.indexed import indexedarray
from warp._src.derivatives.versions import Watch


def empty(
    shape=None,
    dtype=float,
    device=None,
    requires_grad=False,
    pinned=False,
    retain_grad=False,
    length=None,
    n=None,
    grad_dtype=None,
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

    Raises:
        TypeError, ValueError: element type, shape or device cannot be used.
        WarpMemoryError: not enough memory.
    """
    length = n if length is None else length
    if length is not None:
        if shape is not None:
            raise ValueError("expects `shape` or `length`, but got both")
        shape = length
    result = new_array()
    extents = check_shape(shape)
    allocate(result, extents, element_type(dtype), devices.resolve_index(device), pinned)
    check_gradient_type(result.dtype, grad_dtype)
    if requires_grad:
        result.requires_grad = True
    if retain_grad:
        result.retain_grad = True
    return result


def zeros(
    shape=None,
    dtype=float,
    device=None,
    requires_grad=False,
    pinned=False,
    retain_grad=False,
    length=None,
    n=None,
    grad_dtype=None,
):
    """An array of zeros; arguments as for `empty`."""
    result = empty(
        shape, dtype, device, requires_grad, pinned, retain_grad, length, n, grad_dtype
    )
    result.zero_()
    return result


def ones(
    shape=None,
    dtype=float,
    device=None,
    requires_grad=False,
    pinned=False,
    retain_grad=False,
    length=None,
    n=None,
    grad_dtype=None,
):
    """An array whose components are all one; arguments as for `empty`."""
    return full(shape, 1, dtype, device, requires_grad, pinned, retain_grad, length, n, grad_dtype)


def full(
    shape=None,
    value=0,
    dtype=None,
    device=None,
    requires_grad=False,
    pinned=False,
    retain_grad=False,
    length=None,
    n=None,
    grad_dtype=None,
):
    """An array of equal elements; the element type is by default that of `value`."""
    if dtype is None:
        dtype = _type_of_value(value)
    result = empty(
        shape, dtype, device, requires_grad, pinned, retain_grad, length, n, grad_dtype
    )
    result.fill_(value)
    return result


def _type_of_value(value):
    if isinstance(value, bool):
        return bool
    if hasattr(value, "dtype") and hasattr(value, "shape"):
        from warp._src.types.numpy_types import dtype_from_numpy

        scalar = dtype_from_numpy(value.dtype)
        if value.shape == ():
            return scalar
        make = types.vector if len(value.shape) == 1 else types.matrix
        return make(value.shape[0] if len(value.shape) == 1 else value.shape, scalar)
    if isinstance(value, (list, tuple)):
        rows = [len(row) if isinstance(row, (list, tuple)) else 0 for row in value]
        if any(rows):
            return types.matrix((len(rows), rows[0]), float)
        integers = all(isinstance(number, int) for number in value)
        return types.vector(len(value), int if integers else float)
    return type(value)


def _like(src, device, dtype, requires_grad, pinned):
    if not isinstance(src, (array, indexedarray)):
        raise TypeError(f"expects an array, but got '{type(src).__name__}'")
    where = src.device if device is None else devices.get_device(device)
    if requires_grad is None:
        requires_grad = src.requires_grad
    if pinned is None:
        pinned = src.pinned and where.is_cpu
    return empty(src.shape, dtype or src.dtype, where, requires_grad, pinned)


def empty_like(src, device=None, requires_grad=None, pinned=None, dtype=None):
    """An array with shape and element type of `src` and undefined contents."""
    return _like(src, device, dtype, requires_grad, pinned)


def zeros_like(src, device=None, requires_grad=None, pinned=None, dtype=None):
    """An array of zeros with shape and element type of `src`."""
    result = _like(src, device, dtype, requires_grad, pinned)
    result.zero_()
    return result


def ones_like(src, device=None, requires_grad=None, pinned=None, dtype=None):
    """An array of ones with shape and element type of `src`."""
    return full_like(src, 1, device, requires_grad, pinned, dtype)


def full_like(src, value, device=None, requires_grad=None, pinned=None, dtype=None):
    """An array of equal elements with shape and element type of `src`."""
    result = _like(src, device, dtype, requires_grad, pinned)
    result.fill_(value)
    return result


def clone(src, device=None, requires_grad=None, pinned=None):
    """A contiguous copy, on the device of `src` unless another one is named."""
    result = _like(src, device, None, requires_grad, pinned)
    copy(result, src)
    return result


def from_numpy(arr, dtype=None, shape=None, device=None, requires_grad=False):
    """A copy of a NumPy array; without `dtype`, short inner dimensions become vec or mat elements.

    An array of shape (n, 2..4) becomes vectors and one of shape (n, 2..4, same) matrices.
    """
    if dtype is None:
        from warp._src.types.numpy_types import dtype_from_numpy

        dtype = dtype_from_numpy(arr.dtype)
        inner = arr.shape[1:]
        if len(inner) == 2 and inner[0] == inner[1] and 2 <= inner[0] <= 4:
            dtype = types.matrix(inner, dtype)
        elif len(inner) == 1 and 2 <= inner[0] <= 4:
            dtype = types.vector(inner[0], dtype)
    return array(arr, dtype=dtype, shape=shape, device=device, requires_grad=requires_grad)


def assign(dest, src) -> None:
    """Copies to an array, indexed or not, from one of the same shape or what can be made one.

    Raises:
        ValueError: the shapes differ.
    """
    if not isinstance(src, (array, indexedarray)):
        src = array(src, dtype=dest.dtype, device="cpu", copy=False)
    if src.shape != dest.shape:
        raise ValueError(f"expects shape {dest.shape} to assign, but got {src.shape}")
    copy(dest, src)


def copy(dest, src, dest_offset=0, src_offset=0, count=0, stream=None) -> None:
    """Copies elements between arrays on any devices.

    Args:
        dest, src: arrays of equal shape, or of equal element size if offsets or count are given.
            With offsets or count, those that are indexed have one dimension.
        dest_offset, src_offset: first element to write and read.
        count: number of elements, 0 for all of `src`.
        stream: CUDA stream to use.

    Raises:
        ValueError: shapes, element sizes or ranges do not fit together.
    """
    for name, value in (("dest", dest), ("src", src)):
        if not isinstance(value, (array, indexedarray)):
            raise TypeError(f"expects an array as '{name}', but got '{type(value).__name__}'")
    dest._check_writable()
    if dest.item_size != src.item_size:
        raise errors.WarpShapeError(
            f"expects elements of equal size to copy, but got '{types.type_repr(src.dtype)}' "
            f"({src.item_size} bytes) and '{types.type_repr(dest.dtype)}' ({dest.item_size} bytes)"
        )
    whole = not dest_offset and not src_offset and count in (0, src.size)
    if whole and dest.shape == src.shape:
        if src.size:
            _copy_all(dest, src, stream)
        return
    count = count or src.size - src_offset
    views = [
        _range(array, offset, count, name)
        for array, offset, name in ((dest, dest_offset, "dest"), (src, src_offset, "src"))
    ]
    if count:
        _copy_all(*views, stream)


def _copy_all(dest, src, stream):
    if isinstance(dest, indexedarray) or isinstance(src, indexedarray):
        from warp._src.arrays.indexed_copies import copy_elements

        copy_elements(dest, src, stream)
    elif Watch.active:
        from warp._src.derivatives.observers import watched_copy

        watched_copy(dest, src, stream)
    else:
        _native.copy_array(dest, src, stream)


def _range(source, offset, count, name):
    """Elements offset .. offset+count of an array in row-major order, as a view."""
    if offset < 0 or count < 0 or offset + count > source.size:
        raise errors.WarpShapeError(
            f"elements {offset} to {offset + count} are out of range for '{name}' with "
            f"{source.size} elements"
        )
    if isinstance(source, indexedarray):
        return source.part(offset, count, name)
    if source.ndim == 1:
        stride = source.strides[0]
    elif source.is_contiguous:
        stride = source.item_size
    else:
        raise errors.WarpShapeError(
            f"expects '{name}' to be contiguous or one-dimensional to copy a part of it"
        )
    part = source._view(offset * stride, (count,), (stride,))
    if source.grad is not None:
        part.grad = _range(source.grad, offset, count, name)
    return part


def from_ptr(ptr, length, dtype=None, shape=None, device=None):
    """An array over existing memory."""
    return array(
        ptr=ptr,
        shape=shape if shape is not None else length,
        dtype=dtype or float,
        device=device,
        capacity=None if shape is None else length * types.type_size_in_bytes(dtype or float),
    )
