"""DLPack, to here: arrays over the memory of other libraries' tensors."""

from __future__ import annotations

import ctypes
import sys

from warp import _native
from warp._src import errors
from warp._src.argument_kinds import DLPACK, TYPE
from warp._src.arguments import checked
from warp._src.arrays.array import array
from warp._src.devices import devices
from warp._src.interop import exchange, torch_functions
from warp._src.interop.dlpack_export import CODES, CPU, CUDA, CUDA_HOST, CUDA_MANAGED, READ_ONLY
from warp._src.types import dtypes, scalars


@checked(wp_array=DLPACK)
def to_dlpack(wp_array):
    """A DLPack capsule over an array's memory, for consumers that want no object.

    The capsule is for one use. Work that the array still waits for is ordered before what is queued
    on the CUDA default stream later.

    Raises:
        BufferError: the elements are structs, or the array is read-only.
    """
    return wp_array.__dlpack__()


@checked(source=DLPACK, dtype=TYPE)
def from_dlpack(source, dtype=None, hint=None):
    """An array over the memory of another library's array or tensor; nothing is copied.

    Args:
        source: an object with `__dlpack__`, or a DLPack capsule.
        dtype: element type; with a vector or matrix type the trailing dimensions become part of
            the elements. By default the scalar type of the data.
        hint: changes nothing: what it is for, textures in CUDA arrays, cannot be exchanged.

    Example:
        >>> import numpy as np
        >>> import warp as wp
        >>> a = wp.from_dlpack(np.zeros((5, 3), dtype=np.float32), dtype=wp.vec3)
        >>> a.shape
        (5,)

    Raises:
        TypeError: `source` cannot be exchanged, or holds other scalars than `dtype`.
        ValueError: shape or strides do not fit.
    """
    capsule = _request(source) if hasattr(source, "__dlpack__") else source
    try:
        found = _native.dlpack_inspect(capsule)
    except TypeError as error:
        got = type(capsule).__name__
        if got == "PyCapsule":
            raise
        raise errors.WarpTypeError(
            f"{error}, but got '{got}'", code="dlpack-capsule", facts={"got": got}
        ) from None
    pointer, kind, number, code, bits, lanes, extents, strides, flags = found
    scalar = CODES.get((code, bits)) if lanes == 1 else None
    if scalar is None:
        raise TypeError(f"no scalar type for DLPack type {code} of {bits} bits and {lanes} lanes")
    if strides is not None:
        strides = [stride * ctypes.sizeof(scalar._type_) for stride in strides]
    try:
        layout = exchange.fold(scalar, extents, strides, dtype)
    except errors.WarpTypeError as error:
        # DLPack counts the bits of each type, those of truth values, too.
        held = "bool8" if scalar is scalars.bool else scalar.__name__
        error.coded("dlpack-types", held=held, dtype=dtypes.type_repr(dtype))
        raise
    index = _index(kind, number)
    owner = _native.dlpack_take(capsule)
    result = exchange.alias(
        array, pointer, layout, index, owner, kind == CUDA_HOST, bool(flags & READ_ONLY)
    )
    torch = sys.modules.get("torch")
    if torch and isinstance(source, torch.Tensor) and torch_functions.is_lent(torch, source):
        result.lent = True
    return result


def _index(kind, number) -> int:
    if kind in (CPU, CUDA_HOST):
        return devices.CPU
    if kind in (CUDA, CUDA_MANAGED):
        return exchange.cuda_index(number)
    raise errors.WarpTypeError(
        f"expects memory of the CPU or of CUDA, but got DLPack device type {kind}",
        code="dlpack-device",
        facts={"kind": kind, "number": number},
    )


def _request(source):
    """Asks for a capsule that the current stream may use."""
    kind, number = source.__dlpack_device__()
    options = {}
    index = _index(kind, number)
    if kind in (CUDA, CUDA_MANAGED):
        options["stream"] = exchange.current_handle(index)
    try:
        return source.__dlpack__(max_version=(1, 0), **options)
    except TypeError:
        # Producers of before DLPack 1.0 do not know the argument.
        return source.__dlpack__(**options)
