"""Constructors of composite values by family, at Python scope: `wp.vector(1.0, 2.0)`.

In kernels the same names are builtins of the registry.
"""

from __future__ import annotations

import ctypes

from warp._src.arguments import shown
from warp._src.types import dtypes, scalars
from warp._src.types.composites import Composite, flatten_numbers, is_number
from warp._src.types.matrices import matrix_from_cols, matrix_from_rows
from warp._src.types.scalars import scalar_base


def _scalar(args, dtype):
    """The scalar type asked for, or that of the arguments."""
    if dtype is not None:
        return dtype
    for value in args:
        if isinstance(value, scalar_base):
            return type(value)
        if isinstance(value, Composite):
            return value._wp_scalar_type_
    plain = [value for value in args if isinstance(value, (int, float))]
    return int if plain and all(isinstance(value, int) for value in plain) else float


def vector(*components, length=None, dtype=None):
    """A vector of the given components, or with one component repeated `length` times.

    Called with a length and a type alone (`wp.vector(3, float)`), the vector type.

    Raises:
        TypeError: there are no components and no `dtype`.
    """
    if len(components) == 2 and isinstance(components[1], type):
        return dtypes.vector(*components)
    if not components and length is not None and dtype is None:
        raise TypeError("expects `dtype` for a vector without components")
    if not (length is None or isinstance(length, int)):
        raise TypeError(f"expects an integer as `length` of a vector, but got {shown(length)}")
    count = length or sum(map(len, map(flatten_numbers, components)))
    return dtypes.vector(count, _scalar(components, dtype))(*components)


def matrix(*components, shape=None, dtype=None):
    """A matrix of the given shape; one component fills it.

    Called with a shape and a type alone (`wp.matrix((3, 3), float)`), the matrix type.

    Raises:
        TypeError: there is no `shape`.
    """
    if len(components) == 2 and isinstance(components[1], type):
        return dtypes.matrix(*components)
    if shape is None:
        raise TypeError("expects `shape` for a matrix")
    try:
        shape = tuple(shape)
    except TypeError:
        raise TypeError(
            f"expects two extents as `shape` of a matrix, but got {shown(shape)}"
        ) from None
    return dtypes.matrix(shape, _scalar(components, dtype))(*components)


def quaternion(*components, dtype=None):
    """A quaternion from x, y, z, w, or from the imaginary part and w."""
    scalar = _scalar(components, dtype)
    return dtypes.quaternion(float if scalar is int else scalar)(*components)


def transformation(*components, dtype=None, p=None, q=None):
    """A rigid transform from a translation and a rotation, or from seven numbers."""
    scalar = _scalar((*components, p, q), dtype)
    return dtypes.transformation(float if scalar is int else scalar)(*components, p=p, q=q)


def identity(n, dtype=float):
    """The identity matrix of n rows."""
    result = dtypes.matrix((n, n), dtype)()
    for row in range(n):
        result[row, row] = 1
    return result


def quat_identity(dtype=float):
    """The rotation that changes nothing."""
    return dtypes.quaternion(dtype)(0, 0, 0, 1)


def transform_identity(dtype=float):
    """The rigid transform that changes nothing."""
    return dtypes.transformation(dtype)()


def cast(a, dtype):
    """The bits of `a` as another type of the same size.

    Raises:
        TypeError: the types differ in size.
    """
    ctype = dtypes.type_ctype(dtype)
    if not (isinstance(a, Composite) or is_number(a)):
        raise TypeError(f"cast() expects a number or a vector as `a`, but got {shown(a)}")
    source = a if isinstance(a, Composite) else dtypes.type_ctype(type(a))(_number(a))
    if ctypes.sizeof(source) != ctypes.sizeof(ctype):
        raise TypeError(
            f"expects types of one size to cast, but got {ctypes.sizeof(source)} and "
            f"{ctypes.sizeof(ctype)} bytes"
        )
    found = ctype.from_buffer_copy(source)
    if isinstance(found, Composite):
        return found
    canonical = dtypes.canonical(dtype)
    bits = scalars.BITS.get(canonical)
    return canonical(bits[1](found.value) if bits else found.value)


def _number(a):
    number = a.value if isinstance(a, scalar_base) else a
    bits = scalars.BITS.get(type(a))
    return bits[0](number) if bits else number


CONSTRUCTORS = {
    function.__name__: function
    for function in (
        vector,
        matrix,
        matrix_from_rows,
        matrix_from_cols,
        quaternion,
        transformation,
        identity,
        quat_identity,
        transform_identity,
        cast,
    )
}
