"""Names of the peer's `warp._src.types`, which packages and their tests import from there.

The package of that name is ours: a name that it does not have is looked up here.
"""

from __future__ import annotations

import importlib
import typing

from warp._src.types import annotations, dtypes, numpy_types
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
