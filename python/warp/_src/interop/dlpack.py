"""DLPack, both ways: the protocol by which NumPy, PyTorch, JAX, CuPy and others share tensors.

`dlpack_export` and `dlpack_take` of the native module deal with the structs and their lifetime.
Here are the types, the devices, and the streams: a producer on CUDA is told the stream on which the
consumer will read, and lets that one wait for its own.
"""

from __future__ import annotations

import ctypes

from warp import _native
from warp._src.devices import device as devices
from warp._src.interop import exchange as interop
from warp._src.types import scalars
from warp._src.types import dtypes as types

CPU, CUDA, CUDA_HOST, CUDA_MANAGED = 1, 2, 3, 13
READ_ONLY, COPIED = 1, 2

_INT, _UINT, _FLOAT, _BFLOAT, _BOOL = 0, 1, 2, 4, 6
_CODES = {
    (_BOOL, 8): scalars.bool,
    (_BFLOAT, 16): scalars.bfloat16,
    **{(_INT, t._bits_): t for t in scalars.INT_TYPES if t._native_[0] == "s"},
    **{(_UINT, t._bits_): t for t in scalars.INT_TYPES if t._native_[0] == "u"},
    **{(_FLOAT, t._bits_): t for t in scalars.FLOAT_TYPES if t is not scalars.bfloat16},
}
_CODE_OF = {scalar._native_: code for code, scalar in _CODES.items()}


def dlpack_device(array) -> tuple[int, int]:
    """Kind and number of the device that an array is on."""
    device = array.device
    return (CPU, 0) if device.is_cpu else (CUDA, device.ordinal)


def export(array, stream=None, max_version=None, dl_device=None, copy=None):
    """What `array.__dlpack__` does.

    Raises:
        BufferError: the elements are structs, or a copy is needed but not allowed.
        ValueError: `stream` is no stream.
    """
    dtype = array.dtype
    if types.is_struct(dtype):
        raise BufferError(f"DLPack has no type for elements of struct '{dtype.__name__}'")
    source, array = array, _moved(array, dl_device, copy)
    device = dlpack_device(array)
    if device[0] == CUDA:
        _order(array.device_index, stream)
    if dl_device is not None and dl_device[0] == CUDA_HOST:
        device = (CUDA_HOST, dl_device[1])
    flags = COPIED if array is not source else READ_ONLY if array.read_only else 0
    versioned = max_version is not None and max_version[0] >= 1
    if flags & READ_ONLY and not versioned:
        raise BufferError("a read-only array needs a consumer of DLPack 1.0")
    scalar = getattr(dtype, "_wp_scalar_type_", dtype)
    code, bits = _CODE_OF[scalar._native_]
    inner = tuple(getattr(dtype, "_shape_", ()))
    return _native.dlpack_export(array, code, bits, inner, *device, versioned, flags)


def _moved(array, dl_device, copy):
    """The array itself if it is where the consumer wants it, else a copy there."""
    from warp._src.arrays.create import clone

    target = array.device
    if dl_device is not None:
        kind, number = dl_device
        if kind == CUDA_HOST and array.pinned:
            kind = CPU
        if kind not in (CPU, CUDA):
            raise BufferError(f"cannot export an array on '{target}' to DLPack device {dl_device}")
        target = devices.get_device("cpu" if kind == CPU else f"cuda:{number}")
    if target is array.device and not copy:
        return array
    if copy is False:
        raise BufferError(f"exporting from '{array.device}' to '{target}' needs a copy")
    return clone(array, target, requires_grad=False)


def _order(index, stream) -> None:
    """Makes the consumer's stream wait for ours."""
    if stream is None:
        stream = interop.LEGACY_STREAM
    if isinstance(stream, bool) or not hasattr(stream, "__index__"):
        raise TypeError(f"expects an int or None as stream, but got {stream!r}")
    stream = stream.__index__()
    if stream == -1:
        return
    if stream <= 0:
        raise ValueError(f"expects -1, 1, 2 or the address of a stream, but got {stream}")
    interop.let_wait(stream, index)


def to_dlpack(array):
    """A DLPack capsule over an array's memory, for consumers that want no object.

    The capsule is for one use. Work that the array still waits for is ordered before what is queued
    on the CUDA default stream later.

    Raises:
        BufferError: the elements are structs, or the array is read-only.
    """
    return array.__dlpack__()


def from_dlpack(source, dtype=None):
    """An array over the memory of another library's array or tensor; nothing is copied.

    Args:
        source: an object with `__dlpack__`, or a DLPack capsule.
        dtype: element type; with a vector or matrix type the trailing dimensions become part of
            the elements. By default the scalar type of the data.

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
    found = _native.dlpack_inspect(capsule)
    pointer, kind, number, code, bits, lanes, extents, strides, flags = found
    scalar = _CODES.get((code, bits)) if lanes == 1 else None
    if scalar is None:
        raise TypeError(f"no scalar type for DLPack type {code} of {bits} bits and {lanes} lanes")
    if strides is not None:
        strides = [stride * ctypes.sizeof(scalar._type_) for stride in strides]
    layout = interop.fold(scalar, extents, strides, dtype)
    index = _index(kind, number)
    owner = _native.dlpack_take(capsule)
    return interop.alias(pointer, layout, index, owner, kind == CUDA_HOST, bool(flags & READ_ONLY))


def _index(kind, number) -> int:
    if kind in (CPU, CUDA_HOST):
        return devices.CPU
    if kind in (CUDA, CUDA_MANAGED):
        return interop.cuda_index(number)
    raise TypeError(f"expects memory of the CPU or of CUDA, but got DLPack device type {kind}")


def _request(source):
    """Asks for a capsule that the current stream may use."""
    kind, number = source.__dlpack_device__()
    options = {}
    if kind in (CUDA, CUDA_MANAGED):
        options["stream"] = interop.current_handle(_index(kind, number))
    try:
        return source.__dlpack__(max_version=(1, 0), **options)
    except TypeError:
        # Producers of before DLPack 1.0 do not know the argument.
        return source.__dlpack__(**options)
