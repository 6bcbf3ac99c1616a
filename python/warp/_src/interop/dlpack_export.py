"""DLPack, from here: what arrays answer when NumPy, PyTorch, JAX, CuPy and others ask for one.

The native module deals with the structs and their lifetime. Here are the types, the devices, and
the streams: a producer on CUDA is told the stream on which the consumer will read, and lets that
one wait for its own.
"""

from __future__ import annotations

import sys

from warp import _native
from warp._src import errors
from warp._src.arrays import hooks
from warp._src.arrays.copies import clone
from warp._src.devices import devices
from warp._src.interop import exchange
from warp._src.types import dtypes, scalars
from warp._src.version import calling_frame

CPU, CUDA, CUDA_HOST, CUDA_MANAGED = 1, 2, 3, 13
READ_ONLY, COPIED = 1, 2

_INT, _UINT, _FLOAT, _BFLOAT, _BOOL = 0, 1, 2, 4, 6
CODES = {
    (_BOOL, 8): scalars.bool,
    (_BFLOAT, 16): scalars.bfloat16,
    **{(_INT, t._bits_): t for t in scalars.INT_TYPES if t._native_[0] == "s"},
    **{(_UINT, t._bits_): t for t in scalars.INT_TYPES if t._native_[0] == "u"},
    **{(_FLOAT, t._bits_): t for t in scalars.FLOAT_TYPES if t is not scalars.bfloat16},
}
_CODE_OF = {scalar._native_: code for code, scalar in CODES.items()}


def dlpack_device(array) -> tuple[int, int]:
    """Kind and number of the device that an array is on."""
    device = array.device
    return (CPU, 0) if device.is_cpu else (CUDA, device.ordinal)


def export(array, stream=None, max_version=None, dl_device=None, copy=None):
    """The capsule of `array.__dlpack__`.

    Raises:
        BufferError: the elements are structs, or a copy is needed but not allowed.
        ValueError: `stream` is no stream.
        WarpError: a graph is being captured on the CPU, with work that writes the array.
    """
    dtype = array.dtype
    if dtypes.is_struct(dtype):
        raise BufferError(f"DLPack has no type for elements of struct '{dtype.__name__}'")
    scalar = getattr(dtype, "_wp_scalar_type_", dtype)
    if copy is False and dl_device is None and _asked_by_mpi():
        _check_for_mpi(array, scalar)
    if hooks.captures and array.device_index == devices.CPU:
        # The consumer would read and write before the captured work, and once only.
        hooks.check_settled(array)
    source, array = array, _moved(array, dl_device, copy)
    device = dlpack_device(array)
    if device[0] == CUDA:
        _order(array.device_index, stream)
    if dl_device is not None and dl_device[0] == CUDA_HOST:
        device = (CUDA_HOST, dl_device[1])
    flags = COPIED if array is not source else READ_ONLY if array.read_only else 0
    versioned = max_version is not None and max_version[0] >= 1
    if flags & READ_ONLY and not versioned and not _asked_by_jax():
        raise BufferError(
            "a read-only array needs a consumer of DLPack 1.0, which can be told, or a copy: "
            "use `wp.clone(a)`"
        )
    code, bits = _CODE_OF[scalar._native_]
    inner = tuple(getattr(dtype, "_shape_", ()))
    return _native.dlpack_export(array, code, bits, inner, *device, versioned, flags)


def _asked_by_jax() -> bool:
    """True if the consumer is JAX, whose arrays nobody writes to, told or not."""
    name = calling_frame().f_globals.get("__name__", "")
    return name.partition(".")[0] == "jax"


def _asked_by_mpi() -> bool:
    """True if the consumer is mpi4py, the one library that asks from native code for no copy."""
    name = calling_frame().f_globals.get("__name__", "")
    return "mpi4py.MPI" in sys.modules and name.partition(".")[0] not in ("torch", "jax", "numpy")


def _check_for_mpi(array, scalar) -> None:
    """Rejects what MPI would do at the wrong time, or to bytes in place of numbers.

    Raises:
        BufferError: the numbers are of a type that mpi4py does not know.
        WarpError: a graph is being captured.
    """
    if scalar is scalars.bfloat16:
        raise BufferError(
            "mpi4py takes 'bfloat16' for bytes, which MPI would add one by one: reduce in "
            "float32, and send `a.view(wp.uint16)`"
        )
    if _native.is_capturing(array.device_index):
        raise errors.WarpError(
            "MPI cannot be captured: it would run now, and not when the graph is launched, "
            "capture the work before and after it as graphs of their own"
        )


def _moved(array, dl_device, copy):
    """The array itself if it is where the consumer wants it, else a copy there."""
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
    _native.share_with_others()
    if stream is None:
        stream = exchange.LEGACY_STREAM
    if isinstance(stream, bool) or not hasattr(stream, "__index__"):
        raise TypeError(f"expects an int or None as stream, but got {stream!r}")
    stream = stream.__index__()
    if stream == -1:
        return
    if stream <= 0:
        raise ValueError(f"expects -1, 1, 2 or the address of a stream, but got {stream}")
    exchange.let_wait(stream, index)
