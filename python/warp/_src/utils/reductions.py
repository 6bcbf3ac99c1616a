"""Sums, inner products and casts of arrays, by kernels that are made per type."""

import functools
import operator

import numpy as np

import warp as wp
from warp.extend import (
    canonical,
    checked,
    errors,
    type_repr,
    type_scalar_type,
    type_size,
    types_equal,
)
from warp.extend.kinds import ARRAY
from warp.types import float32, float64


def _wide(dtype):
    """The type with components in double precision, in which sums are made."""
    if type_size(dtype) == 1:
        return float64
    shape = dtype._shape_
    return wp.types.vector(*shape, float64) if len(shape) == 1 else wp.types.matrix(shape, float64)


@functools.cache
def _sum_kernel(dtype):
    wide = _wide(dtype)

    @wp.kernel(name=f"array_sum_{type_repr(dtype)}", module=__name__)
    def add(values: wp.array(dtype=dtype), out: wp.array(dtype=wide)):
        wp.atomic_add(out, 0, wide(values[wp.tid()]))

    return add


@functools.cache
def _inner_kernel(dtype):
    wide, is_scalar = _wide(dtype), type_size(dtype) == 1

    @wp.kernel(name=f"array_inner_{type_repr(dtype)}", module=__name__)
    def multiply(a: wp.array(dtype=dtype), b: wp.array(dtype=dtype), out: wp.array(dtype=float64)):
        i = wp.tid()
        if wp.static(is_scalar):
            wp.atomic_add(out, 0, wide(a[i]) * wide(b[i]))
        else:
            wp.atomic_add(out, 0, wp.dot(wide(a[i]), wide(b[i])))

    return multiply


@functools.cache
def _axis_kernels(dtype):
    """Sum and inner product along the last of four dimensions."""
    real, wide, is_scalar = type_scalar_type(dtype), _wide(dtype), type_size(dtype) == 1
    kernel = functools.partial(wp.kernel, module=__name__)

    @kernel(name=f"array_sum_axis_{type_repr(dtype)}")
    def add(values: wp.array4d(dtype=dtype), count: int, out: wp.array3d(dtype=dtype)):
        i, j, k = wp.tid()
        total = wide()
        for n in range(count):
            total += wide(values[i, j, k, n])
        out[i, j, k] = dtype(total)

    @kernel(name=f"array_inner_axis_{type_repr(dtype)}")
    def multiply(
        a: wp.array4d(dtype=dtype),
        b: wp.array4d(dtype=dtype),
        count: int,
        out: wp.array3d(dtype=real),
    ):
        i, j, k = wp.tid()
        total = float64()
        for n in range(count):
            if wp.static(is_scalar):
                total += wide(a[i, j, k, n]) * wide(b[i, j, k, n])
            else:
                total += wp.dot(wide(a[i, j, k, n]), wide(b[i, j, k, n]))
        out[i, j, k] = real(total)

    return add, multiply


def _axis_last(array, axis):
    """A view of four dimensions, the last of which is `axis`."""
    shape, strides = list(array.shape), list(array.strides)
    shape.append(shape.pop(axis))
    strides.append(strides.pop(axis))
    missing = 4 - len(shape)
    return array._view(0, [1] * missing + shape, [0] * missing + strides)


def _without_axis(out, axis):
    """A view of three dimensions that lacks `axis`, whose extent is one."""
    shape, strides = list(out.shape), list(out.strides)
    del shape[axis], strides[axis]
    missing = 3 - len(shape)
    return out._view(0, [1] * missing + shape, [0] * missing + strides)


class _Reduction:
    """The common checks of a sum and an inner product."""

    def __init__(self, name, first, out, out_dtype, count, axis):
        if axis is not None:
            axis = operator.index(axis)
            if not -first.ndim <= axis < first.ndim:
                raise IndexError(
                    f"{name}() axis {axis} is out of bounds for an array with "
                    f"{first.ndim} dimensions"
                )
            axis %= first.ndim
        length = first.size if axis is None else first.shape[axis]
        count = length if count is None else count
        if not 0 <= count <= length:
            raise errors.WarpError(f"{name}() takes 0 to {length} elements, got a count of {count}")
        shape = (
            (1,)
            if axis is None
            else tuple(1 if i == axis else n for i, n in enumerate(first.shape))
        )
        self.axis, self.count, self.on_host = axis, count, out is None
        if out is None:
            if first.device.is_capturing:
                raise NotImplementedError(f"a graph needs an explicit out array for {name}()")
            out = wp.empty(shape, dtype=out_dtype, device=first.device)
        elif out.device != first.device:
            raise errors.WarpError("out storage device should match values array")
        elif not types_equal(out.dtype, out_dtype):
            raise errors.WarpError(f"out array should have type {type_repr(out_dtype)}")
        elif out.shape != shape:
            raise errors.WarpError(f"out array should have shape {shape}")
        if type_scalar_type(first.dtype) not in (float32, float64):
            raise errors.WarpError(f"Unsupported data type: {type_repr(first.dtype)}")
        self.out = out

    def run(self, whole, along, *arrays):
        """Reduces by one of two functions that give kernels; returns the result."""
        device, dtype = self.out.device, arrays[0].dtype
        if self.axis is not None:
            views = [_axis_last(array, self.axis) for array in arrays]
            out = _without_axis(self.out, self.axis)
            inputs = [*views, self.count]
            wp.launch(along(dtype), out.shape, inputs, [out], device=device)
            return self.out
        parts = [array.contiguous().flatten()[: self.count] for array in arrays]
        total = self._wide_total(arrays)
        total.zero_()
        if self.count:
            wp.launch(whole(dtype), self.count, parts, [total], device=device)
        if total is not self.out:
            cast = _cast_kernel(total.dtype, self.out.dtype, 1)
            wp.launch(cast, 1, [self.out, total], device=device)
        return self.out.numpy()[0] if self.on_host else self.out

    def _wide_total(self, arrays):
        """The array that a sum is made in: of doubles, since millions of terms are added."""
        wide = _wide(self.out.dtype)
        if types_equal(wide, self.out.dtype):
            return self.out
        recorded = any(array.requires_grad for array in arrays)
        return wp.empty(1, dtype=wide, device=self.out.device, requires_grad=recorded)


@checked(values=ARRAY, out=ARRAY)
def array_sum(values, out=None, value_count: int | None = None, axis: int | None = None):
    """The sum of all elements, or along one axis, made in double precision.

    Args:
        values: float32, float64, or vectors and matrices of them.
        out: gets the result: one element of the type of `values`, or an array of the shape of
            `values` with extent 1 along `axis`.
        value_count: how many of the first elements (along the axis) to add, by default all.
        axis: the dimension to add along, negative from the last one.

    Returns:
        `out` if it is given; else a NumPy value, or a new array if `axis` is given.

    Raises:
        IndexError: there is no such axis.
        RuntimeError: device, type or shape of `out` do not fit, or the type of `values`.
        NotImplementedError: a graph is being captured and there is no `out`.
    """
    task = _Reduction("array_sum", values, out, canonical(values.dtype), value_count, axis)
    return task.run(_sum_kernel, lambda dtype: _axis_kernels(dtype)[0], values)


@checked(a=ARRAY, b=ARRAY, out=ARRAY)
def array_inner(a, b, out=None, count: int | None = None, axis: int | None = None):
    """The inner product of two arrays, of all elements or along one axis.

    Args:
        a, b: arrays of one shape and type: float32, float64, or vectors and matrices of them.
        out: gets the result: one scalar, or an array of the shape of `a` with extent 1 along
            `axis`.
        count: how many of the first elements (along the axis) to take, by default all.
        axis: the dimension to go along, negative from the last one.

    Returns:
        `out` if it is given; else a NumPy value, or a new array if `axis` is given.

    Raises:
        ValueError: the shapes differ.
        IndexError: there is no such axis.
        RuntimeError: devices or types do not fit, or `out`.
        NotImplementedError: a graph is being captured and there is no `out`.
    """
    if a.shape != b.shape:
        raise errors.WarpShapeError(
            f"array_inner() arguments must have the same shape, got {a.shape} and {b.shape}"
        )
    if a.device != b.device:
        raise errors.WarpError(
            f"A and b array storage devices do not match ({a.device} vs {b.device})"
        )
    if not types_equal(a.dtype, b.dtype):
        raise errors.WarpError(
            f"A and b array data types do not match ({type_repr(a.dtype)} vs {type_repr(b.dtype)})"
        )
    task = _Reduction("array_inner", a, out, type_scalar_type(a.dtype), count, axis)
    return task.run(_inner_kernel, lambda dtype: _axis_kernels(dtype)[1], a, b)


def _scalars(array):
    """All scalars of a packed array as one dimension."""
    scalar, size = type_scalar_type(array.dtype), type_size(array.dtype)
    flat = array.flatten()
    return flat._view(
        0, (flat.size * size,), (np.dtype(wp.dtype_to_numpy(scalar)).itemsize,), scalar
    )


@functools.cache
def _cast_kernel(source, target, rank):
    name = f"array_cast_{type_repr(source)}_{type_repr(target)}_{rank}"
    kernel = functools.partial(wp.kernel, name=name, module=__name__)
    from_type, to_type = wp.array(dtype=source, ndim=rank), wp.array(dtype=target, ndim=rank)
    if rank == 1:

        @kernel
        def cast(dest: to_type, src: from_type):
            i = wp.tid()
            dest[i] = target(src[i])
    elif rank == 2:

        @kernel
        def cast(dest: to_type, src: from_type):
            i, j = wp.tid()
            dest[i, j] = target(src[i, j])
    elif rank == 3:

        @kernel
        def cast(dest: to_type, src: from_type):
            i, j, k = wp.tid()
            dest[i, j, k] = target(src[i, j, k])
    else:

        @kernel
        def cast(dest: to_type, src: from_type):
            i, j, k, n = wp.tid()
            dest[i, j, k, n] = target(src[i, j, k, n])

    return cast


@checked(in_array=ARRAY, out_array=ARRAY)
def array_cast(in_array, out_array, count: int | None = None) -> None:
    """Converts elements to the type of another array.

    Where the dimensions or the shapes of elements differ, both are taken as flat lists of scalars.

    Args:
        in_array: what to convert.
        out_array: gets the result.
        count: number of elements, by default all; arrays of several dimensions are cast whole.

    Raises:
        RuntimeError: devices, shapes or counts do not fit.
    """
    if in_array.device != out_array.device:
        raise errors.WarpError(
            f"Array storage devices do not match ({in_array.device} vs {out_array.device})"
        )
    inner = [getattr(array.dtype, "_shape_", ()) for array in (in_array, out_array)]
    if in_array.ndim != out_array.ndim or inner[0] != inner[1]:
        count = None if count is None else count * type_size(in_array.dtype)
        in_array, out_array = _scalars(in_array), _scalars(out_array)
    count = in_array.size if count is None else count
    if in_array.ndim > 1 and count < in_array.size:
        raise errors.WarpError(
            "Partial cast is not supported for arrays with more than one dimension"
        )
    if types_equal(in_array.dtype, out_array.dtype):
        if count:
            wp.copy(out_array, in_array, count=count)
        return
    if in_array.ndim > 1 and in_array.shape != out_array.shape:
        raise errors.WarpError(f"Array shapes do not match ({in_array.shape} vs {out_array.shape})")
    if not 0 <= count <= min(in_array.size, out_array.size):
        raise errors.WarpError(
            f"Cast count ({count}) exceeds the input size ({in_array.size}) or output size "
            f"({out_array.size})"
        )
    kernel = _cast_kernel(in_array.dtype, out_array.dtype, in_array.ndim)
    dim = count if in_array.ndim == 1 else in_array.shape
    wp.launch(kernel, dim, [out_array, in_array], device=out_array.device)
