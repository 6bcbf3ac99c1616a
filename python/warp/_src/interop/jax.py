"""Exchange with JAX. JAX is imported when one of these functions is first called."""

from __future__ import annotations

import functools

from warp._src.argument_kinds import ARRAY, DLPACK
from warp._src.arguments import checked, shown
from warp._src.arrays.array import array
from warp._src.arrays.copies import clone
from warp._src.devices import devices
from warp._src.interop.dlpack import from_dlpack
from warp._src.interop.packages import load
from warp._src.types import scalars

_NAMES = {
    scalars.bool: "bool_",
    **{t: t.__name__ for t in scalars.SCALAR_TYPES},
}


@functools.cache
def _dtypes():
    """JAX's scalar types by ours."""
    jax = load("jax.numpy")

    return {scalar: getattr(jax.numpy, name) for scalar, name in _NAMES.items()}


@functools.cache
def _scalars():
    jax = load("jax.numpy")

    return {jax.numpy.dtype(dtype): scalar for scalar, dtype in _dtypes().items()}


def dtype_to_jax(warp_dtype):
    """JAX's scalar type for a scalar type.

    Raises:
        TypeError: `warp_dtype` is not a scalar type.
    """
    return _dtypes()[scalars.canonical_scalar(warp_dtype)]


def dtype_from_jax(jax_dtype):
    """The scalar type for a dtype of JAX.

    Raises:
        TypeError: there is none, for example for complex numbers.
    """
    jax = load("jax.numpy")

    try:
        found = _scalars().get(jax.numpy.dtype(jax_dtype))
    except (TypeError, ValueError):
        found = None
    if found is None:
        raise TypeError(f"no scalar type for {shown(jax_dtype)}")
    return found


def device_to_jax(warp_device=None):
    """JAX's device for one of ours.

    Raises:
        RuntimeError: JAX has no such device in this process.
    """
    jax = load("jax")

    warp_device = devices.get_device(warp_device)
    try:
        found = jax.local_devices(backend="cuda" if warp_device.is_cuda else "cpu")
    except RuntimeError:
        found = []
    for candidate in found:
        if warp_device.is_cpu or candidate.local_hardware_id == warp_device.ordinal:
            return candidate
    raise RuntimeError(f"JAX has no device for '{warp_device}'")


def device_from_jax(jax_device):
    """The device for one of JAX's in this process.

    Raises:
        TypeError: `jax_device` is no device of JAX.
        ValueError: JAX's device belongs to another process, or is neither CPU nor CUDA.
    """
    jax = load("jax")

    if not isinstance(jax_device, jax.Device):
        raise TypeError(f"device_from_jax() expects a device of JAX, but got {shown(jax_device)}")
    if jax_device.process_index != jax.process_index():
        raise ValueError(f"JAX's device '{jax_device}' belongs to another process")
    if jax_device.platform == "cpu":
        return devices.get_device("cpu")
    if jax_device.platform not in ("gpu", "cuda"):
        raise ValueError(f"expects a CPU or CUDA device of JAX, but got '{jax_device}'")
    return devices.get_device(f"cuda:{jax_device.local_hardware_id}")


@checked(warp_array=ARRAY)
def to_jax(warp_array):
    """A JAX array over the memory of an array.

    Nothing is copied if the array is contiguous and aligned as JAX wants it.

    JAX takes its arrays for immutable: do not write to `warp_array` while the JAX array is in use.

    Raises:
        TypeError: `warp_array` is no array.
        BufferError: it is one of structs.
    """
    jax = load("jax.dlpack")

    if not isinstance(warp_array, array):
        raise TypeError(f"expects an array, but got '{type(warp_array).__name__}'")
    if not warp_array.is_contiguous:
        # Which strides JAX can use depends on its version; before 0.7 it read them wrongly.
        warp_array = clone(warp_array, requires_grad=False)
    return jax.dlpack.from_dlpack(warp_array)


@checked(jax_array=DLPACK)
def from_jax(jax_array, dtype=None):
    """An array over the memory of a JAX array; nothing is copied.

    JAX takes its arrays for immutable: kernels may read the array, and must not write to it.

    Args:
        jax_array: a JAX array that lives on one device.
        dtype: element type; with a vector or matrix type the trailing dimensions become part of
            the elements. By default the scalar type of the data.

    Raises:
        TypeError: `jax_array` is none, has no memory because JAX traces, or holds other scalars.
        ValueError: it was deleted or donated, or its shape does not fit.
        BufferError: it is spread over several devices.
    """
    jax = load("jax")

    if isinstance(jax_array, jax.core.Tracer):
        raise TypeError(
            "from_jax: the array has no memory while JAX traces, use `wp.jax_kernel` or "
            "`wp.jax_callable` there"
        )
    if not hasattr(jax_array, "__dlpack__"):
        raise TypeError(
            f"from_jax: expects a JAX array of numbers, but got '{type(jax_array).__name__}'"
        )
    if isinstance(jax_array, jax.Array) and jax_array.is_deleted():
        raise ValueError("from_jax: the array has been deleted or donated")
    result = from_dlpack(jax_array, dtype)
    result._protect()
    return result
