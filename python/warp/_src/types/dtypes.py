"""The types of the package under their public names, and questions about types."""

from __future__ import annotations

import builtins
import ctypes
import typing

from warp._src.argument_kinds import above
from warp._src.types import scalars
from warp._src.types.composites import Composite
from warp._src.types.matrices import Matrix, matrix
from warp._src.types.matrices import matrix_from_cols as matrix_from_cols
from warp._src.types.matrices import matrix_from_rows as matrix_from_rows
from warp._src.types.native import (
    canonical,
    has_arrays,
    is_struct,
    register,
)
from warp._src.types.native import classes_of as classes_of
from warp._src.types.native import dtype_of as dtype_of
from warp._src.types.native import members_of as members_of
from warp._src.types.native import native_text as native_text
from warp._src.types.native import native_type as native_type
from warp._src.types.native import type_repr as type_repr
from warp._src.types.native import types_equal as types_equal
from warp._src.types.scalars import (
    FLOAT_TYPES,
    INT_TYPES,
    SCALAR_TYPES,
    ScalarType,
    float16,
    float32,
    float64,
    int8,
    int16,
    int32,
    int64,
    uint8,
    uint16,
    uint32,
    uint64,
)
from warp._src.types.scalars import PYTHON_TYPES as PYTHON_TYPES
from warp._src.types.scalars import bfloat16 as bfloat16
from warp._src.types.scalars import bool as bool
from warp._src.types.scalars import float_base as float_base
from warp._src.types.scalars import handle as handle
from warp._src.types.scalars import int_base as int_base
from warp._src.types.scalars import scalar_base as scalar_base
from warp._src.types.vectors import (
    Quaternion,
    Transformation,
    Vector,
    quaternion,
    transformation,
    vector,
)

# Generic annotations: any int, any float, any of both.
Int = typing.TypeVar("Int", *INT_TYPES)
Float = typing.TypeVar("Float", *FLOAT_TYPES)
Scalar = typing.TypeVar("Scalar", *SCALAR_TYPES)

spatial_vectorh = vector(6, float16, name="spatial_vectorh")
spatial_vectorf = vector(6, float32, name="spatial_vectorf")
spatial_vectord = vector(6, float64, name="spatial_vectord")
spatial_matrixh = matrix((6, 6), float16, name="spatial_matrixh")
spatial_matrixf = matrix((6, 6), float32, name="spatial_matrixf")
spatial_matrixd = matrix((6, 6), float64, name="spatial_matrixd")
spatial_vector = spatial_vectorf
spatial_matrix = spatial_matrixf


def _named_types() -> dict:
    """`vec2b` ... `vec4d`, `mat22h` ... `mat44d`, `quath` ..., and those without a suffix."""
    suffixes = {
        "b": int8,
        "ub": uint8,
        "s": int16,
        "us": uint16,
        "i": int32,
        "ui": uint32,
        "l": int64,
        "ul": uint64,
        "h": float16,
        "f": float32,
        "d": float64,
    }
    named = {}
    for suffix, dtype in suffixes.items():
        for length in (2, 3, 4):
            name = f"vec{length}{suffix}"
            named[name] = vector(length, dtype, name=name)
        if dtype in FLOAT_TYPES:
            for n in (2, 3, 4):
                name = f"mat{n}{n}{suffix}"
                named[name] = matrix((n, n), dtype, name=name)
            named[f"quat{suffix}"] = quaternion(dtype, name=f"quat{suffix}")
            name = f"transform{suffix}"
            named[name] = transformation(dtype, name=name)
    for name in [name for name in named if name.endswith("f")]:
        named[name[:-1]] = named[name]
    return named


NAMED_TYPES = _named_types()
globals().update(NAMED_TYPES)

# Families of scalar types.
int_types = tuple(INT_TYPES)
float_types = tuple(FLOAT_TYPES)
scalar_types = tuple(SCALAR_TYPES)
scalar_and_bool_types = (*scalar_types, scalars.bool)

# The notation of users for generic vectors: `wp.vec[3, float]`.
vec = Vector
mat = Matrix


# `type_is_vector` and its like are about types, `is_vector` and its like about values.


def _class_of(x):
    return None if isinstance(x, type) else type(x)


def is_array(x) -> builtins.bool:
    """True if `x` is an array, indexed or not, or an annotation of one.

    Example:
        >>> import warp as wp
        >>> wp.types.is_array(wp.zeros(3, device="cpu")), wp.types.is_array([1, 2])
        (True, False)
    """
    return type_is_array(type(x)) or hasattr(type(x), "_wp_array_annotation_")


def is_value(x) -> builtins.bool:
    """True if `x` is a number, scalar or composite."""
    return is_scalar(x) or is_composite(x)


def is_int(x) -> builtins.bool:
    """True if `x` is a scalar of a type of integers, or a Python `int`."""
    return type_is_int(_class_of(x))


def is_float(x) -> builtins.bool:
    """True if `x` is a scalar of a type of floats, or a Python `float`."""
    return type_is_float(_class_of(x))


def is_scalar(x) -> builtins.bool:
    """True if `x` is a number or a truth value."""
    return type_is_scalar(_class_of(x))


def is_composite(x) -> builtins.bool:
    """True if `x` is a vector, matrix, quaternion or transform."""
    return type_is_composite(_class_of(x))


def is_vector(x) -> builtins.bool:
    """True if `x` is a vector."""
    return type_is_vector(_class_of(x))


def is_matrix(x) -> builtins.bool:
    """True if `x` is a matrix."""
    return type_is_matrix(_class_of(x))


def is_quaternion(x) -> builtins.bool:
    """True if `x` is a quaternion."""
    return type_is_quaternion(_class_of(x))


def is_transformation(x) -> builtins.bool:
    """True if `x` is a transform."""
    return type_is_transformation(_class_of(x))


def type_is_int(t) -> builtins.bool:
    """True if `t` is a scalar type of integers, or Python's `int`."""
    return t is int or (
        isinstance(t, ScalarType) and issubclass(t, scalars.int_base) and t is not scalars.bool
    )


def type_is_float(t) -> builtins.bool:
    """True if `t` is a scalar type of floats, or Python's `float`."""
    return t is float or (isinstance(t, ScalarType) and issubclass(t, scalars.float_base))


def type_is_scalar(t) -> builtins.bool:
    """True if `t` is a type of numbers or of truth values."""
    return type_is_int(t) or type_is_float(t) or t is scalars.bool or t is builtins.bool


def _is_family(t, family) -> builtins.bool:
    return isinstance(t, type) and issubclass(t, family)


def type_is_composite(t) -> builtins.bool:
    """True if `t` is a type of vectors, matrices, quaternions or transforms."""
    return _is_family(t, Composite)


def type_is_vector(t) -> builtins.bool:
    """True if `t` is a type of vectors.

    Example:
        >>> import warp as wp
        >>> wp.types.type_is_vector(wp.vec3), wp.types.type_is_vector(wp.quat)
        (True, False)
    """
    return _is_family(t, Vector) and not _is_family(t, (Quaternion, Transformation))


def type_is_matrix(t) -> builtins.bool:
    """True if `t` is a type of matrices.

    Example:
        >>> import warp as wp
        >>> wp.types.type_is_matrix(wp.mat33), wp.types.type_is_matrix(wp.vec3)
        (True, False)
    """
    return _is_family(t, Matrix)


def type_is_quaternion(t) -> builtins.bool:
    """True if `t` is a type of quaternions.

    Example:
        >>> import warp as wp
        >>> wp.types.type_is_quaternion(wp.quatd), wp.types.type_is_quaternion(wp.vec4)
        (True, False)
    """
    return _is_family(t, Quaternion)


def type_is_transformation(t) -> builtins.bool:
    """True if `t` is a type of transforms.

    Example:
        >>> import warp as wp
        >>> wp.types.type_is_transformation(wp.transform), wp.types.type_is_transformation(float)
        (True, False)
    """
    return _is_family(t, Transformation)


def type_is_array(t) -> builtins.bool:
    """True if `t` is a class of arrays, indexed or not, such as `wp.array`.

    Example:
        >>> import warp as wp
        >>> wp.types.type_is_array(wp.array), wp.types.type_is_array(list)
        (True, False)
    """
    return has_arrays(t)


def type_is_tile(t) -> builtins.bool:
    """True if `t` is what tiles are made by, `wp.tile`."""
    return getattr(t, "key", None) == "tile" and not isinstance(t, type)


def is_tile(t) -> builtins.bool:
    """True if `t` is an annotation of a tile, such as `wp.tile[float, 16]`.

    Outside of kernels there are no others.
    """
    return hasattr(t, "_wp_tile_")


def type_is_struct(t) -> builtins.bool:
    """True if `t` is a class that `wp.struct` has made.

    Example:
        >>> import warp as wp
        >>> wp.types.type_is_struct(wp.vec3)
        False
    """
    return isinstance(t, type) and is_struct(t)


def type_is_value(t) -> builtins.bool:
    """True if `t` is a scalar type or one of composites."""
    return type_is_scalar(t) or type_is_composite(t)


def type_scalar_type(t):
    """The scalar type of a scalar or composite type.

    Raises:
        TypeError: `t` is no type of array elements.

    Example:
        >>> import warp as wp
        >>> wp.types.type_scalar_type(wp.mat22d) is wp.float64
        True
    """
    t = canonical(t)
    return getattr(t, "_wp_scalar_type_", t)


def type_ctype(dtype):
    """The ctypes type with the layout of `dtype`; float16 and bfloat16 are `c_ushort`."""
    dtype = canonical(dtype)
    return dtype._type_ if isinstance(dtype, ScalarType) else dtype


def type_size_in_bytes(dtype) -> int:
    """Size of an element of type `dtype` in bytes."""
    return ctypes.sizeof(type_ctype(dtype))


def type_size(dtype) -> int:
    """Number of scalars in an element of type `dtype`; 1 for a struct.

    Raises:
        TypeError: `dtype` is no type of array elements.

    Example:
        >>> import warp as wp
        >>> wp.types.type_size(wp.mat33), wp.types.type_size(float)
        (9, 1)
    """
    return getattr(canonical(dtype), "_length_", 1)


for _dtype in (scalars.bool, *SCALAR_TYPES, *set(NAMED_TYPES.values())):
    register(_dtype)
above.type_is_array = type_is_array

__all__ = sorted(
    name
    for name in globals()
    if name[0] != "_"
    and name not in ("above", "annotations", "builtins", "ctypes", "scalars", "typing")
    and name not in ("classes_of", "members_of")
)
