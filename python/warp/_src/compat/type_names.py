"""Names of the peer's `warp._src.types`, which packages and their tests import from there.

The package of that name is ours: a name that it does not have is looked up here.
"""

from __future__ import annotations

import builtins
import importlib
import typing

from warp import _native
from warp._src.types import annotations, dtypes, native, numpy_types, scalars
from warp._src.types.scalars import int8, int16, uint8, uint16

Any = typing.Any
Reference = annotations.Reference
vector_types = tuple(
    dtype
    for name, dtype in dtypes.NAMED_TYPES.items()
    if name[:3] == "vec" and not name[-1:].isdigit()
)
# Kinds of arrays, by the peer's numbers.
ARRAY_TYPE_REGULAR, ARRAY_TYPE_INDEXED, ARRAY_TYPE_FABRIC, ARRAY_TYPE_FABRIC_INDEXED = range(4)
dtype_from_numpy = numpy_types.dtype_from_numpy
non_atomic_types = (int8, int16, uint8, uint16)


def strides_from_shape(shape, dtype) -> tuple:
    """Byte strides of a packed array."""
    strides, step = [], dtypes.type_size_in_bytes(dtype)
    for extent in reversed(shape):
        strides.append(step)
        step *= extent
    return tuple(reversed(strides))


def get_type_code(kind) -> str:
    """Short text of a type, as it is part of the peer's names of kernels.

    Raises:
        TypeError: there is none.
    """
    if kind is Any:
        return "?"
    if isinstance(kind, type) and issubclass(kind, dtypes.Composite):
        scalar = get_type_code(kind._wp_scalar_type_)
        if issubclass(kind, (dtypes.Quaternion, dtypes.Transformation)):
            return ("q" if issubclass(kind, dtypes.Quaternion) else "t") + scalar
        extents = "".join(map(str, kind._shape_))
        return ("v" if len(kind._shape_) == 1 else "m") + extents + scalar
    if isinstance(kind, type) and kind in _CODES:
        return _CODES[kind]
    if dtypes.is_array(kind):
        rank = "?" if kind.ndim is Any else kind.ndim
        return f"{_PREFIXES[array_type_id(kind)]}{rank}{get_type_code(kind.dtype)}"
    if dtypes.is_struct(kind):
        return kind.__name__
    if dtypes.is_tile(kind):
        extents = () if kind.shape is Any else kind.shape
        shape = "".join("?" if one is Any else str(one) for one in extents) or "?"
        return f"tr{shape}{get_type_code(kind.dtype)}"
    raise TypeError(f"Unrecognized type '{kind}'")


def array_type_id(kind) -> int:
    """Number of the kind of an array or of an annotation of one."""
    from warp._src.arrays import fabric

    plain = isinstance(kind, native.ArrayType) and not isinstance(kind, native.IndexedArrayType)
    if isinstance(kind, (fabric.indexedfabricarray, fabric.IndexedFabricArrayType)):
        return ARRAY_TYPE_FABRIC_INDEXED
    if isinstance(kind, (fabric.fabricarray, fabric.FabricArrayType)):
        return ARRAY_TYPE_FABRIC
    if plain or isinstance(kind, _native.Array):
        return ARRAY_TYPE_REGULAR
    return ARRAY_TYPE_INDEXED


_PREFIXES = ("a", "ia", "fa", "ifa")
_CODES = {
    int: "i4",
    float: "f4",
    **dict.fromkeys((builtins.bool, scalars.bool), "b"),
    **{t: f"{t.__name__[0]}{t._bits_ // 8}" for t in (*scalars.INT_TYPES, *scalars.FLOAT_TYPES)},
    scalars.bfloat16: "bf2",
}


def _np_float32_to_bfloat16_bits(values):
    """The bits of NumPy's float32 rounded to bfloat16, ties to even; a NaN stays one."""
    import numpy

    values = numpy.ascontiguousarray(values, numpy.float32)
    bits = values.view(numpy.uint32)
    rounded = bits + (0x7FFF + ((bits >> 16) & 1)).astype(numpy.uint32)
    quiet = bits | numpy.uint32(0x400000)
    return (numpy.where(numpy.isnan(values), quiet, rounded) >> 16).astype(numpy.uint16)


def _np_bfloat16_bits_to_float32(bits):
    """NumPy's float32 for bits of bfloat16."""
    import numpy

    return (numpy.asarray(bits).astype(numpy.uint32) << 16).view(numpy.float32)


def __getattr__(name):
    if name.startswith("__"):
        raise AttributeError(name)
    return getattr(importlib.import_module("warp.types"), name)
