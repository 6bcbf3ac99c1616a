"""Conversion between NumPy's dtypes and ours."""

from __future__ import annotations

import functools

from warp._src import errors
from warp._src.arguments import shown
from warp._src.types import dtypes, scalars


def dtype_to_numpy(warp_dtype):
    """NumPy's scalar type for a scalar type; bfloat16 is `uint16`.

    Raises:
        TypeError: `warp_dtype` is not a scalar type.
    """
    import numpy

    scalar = scalars.canonical_scalar(warp_dtype)
    if scalar is scalars.bool:
        return numpy.bool_
    return getattr(numpy, scalar._numpy_name_)


@functools.cache
def numpy_bfloat16():
    """NumPy's type of bfloat16, which the package ml_dtypes has; None without it."""
    try:
        import ml_dtypes
    except ImportError:
        return None
    return ml_dtypes.bfloat16


def dtype_from_numpy(numpy_dtype):
    """The scalar type for a NumPy dtype, type or dtype name.

    Raises:
        TypeError: there is no such scalar type, for example for complex numbers.
    """
    import numpy

    try:
        name = numpy.dtype(numpy_dtype).name
    except Exception:
        raise errors.WarpArgumentError(
            f"dtype_from_numpy() expects a NumPy dtype, but got {shown(numpy_dtype)}"
        ) from None
    found = _BY_NAME.get(name)
    if found is None:
        raise TypeError(f"no scalar type for the NumPy dtype '{name}'")
    return found


_BY_NAME = {
    "bool": scalars.bool,
    "bfloat16": scalars.bfloat16,
    **{t._numpy_name_: t for t in scalars.SCALAR_TYPES if t is not scalars.bfloat16},
}


def scalar_types() -> dict:
    """The scalar types that NumPy has, by its dtypes and by its types."""
    import numpy

    found = {}
    for name, scalar in _BY_NAME.items():
        if scalar is not scalars.bfloat16:
            dtype = numpy.dtype(name)
            found[dtype] = found[dtype.type] = scalar
    return found


def element_layout(dtype):
    """NumPy dtype and inner shape of one array element of type `dtype`."""
    if dtypes.is_struct(dtype):
        return dtype.__numpy_dtype__, ()
    if issubclass(dtype, scalars.scalar_base):
        return dtype._element_, ()
    return dtype._wp_scalar_type_._element_, dtype._shape_


def bfloat16_bits(numbers):
    """Bits of the nearest bfloat16 of each number, ties to even."""
    import numpy

    bits = numpy.ascontiguousarray(numbers, dtype=numpy.float32).view(numpy.uint32)
    rounded = (bits + 0x7FFF + ((bits >> 16) & 1)) >> 16
    return numpy.where(numpy.isnan(numbers), 0x7FC0, rounded).astype(numpy.uint16)
