"""Exchange with PaddlePaddle, which is imported when one of these functions is first called."""

from __future__ import annotations

import functools

from warp import _native
from warp._src.argument_kinds import ARRAY
from warp._src.arguments import checked
from warp._src.arrays.array import array
from warp._src.devices import devices
from warp._src.interop import exchange, paddle_layers
from warp._src.interop.shared_gradients import share_gradient
from warp._src.types import dtypes, scalars

_SCALARS = (
    *(scalars.bool, scalars.int8, scalars.int16, scalars.int32, scalars.int64, scalars.uint8),
    *(scalars.float16, scalars.float32, scalars.float64, scalars.bfloat16),
)
# Paddle has no unsigned integers of more than 8 bits.
_SIGNED = {
    scalars.uint16: scalars.int16,
    scalars.uint32: scalars.int32,
    scalars.uint64: scalars.int64,
}


@functools.cache
def _dtypes():
    """Paddle's dtypes by our scalar types."""
    import paddle

    found = {scalar: getattr(paddle, scalar.__name__, None) for scalar in _SCALARS}
    return {scalar: dtype for scalar, dtype in found.items() if dtype is not None}


def dtype_to_paddle(warp_dtype):
    """Paddle's dtype for a scalar type; unsigned types of 16 bits and more become signed.

    Raises:
        TypeError: there is none.
    """
    scalar = scalars.canonical_scalar(warp_dtype)
    found = _dtypes().get(_SIGNED.get(scalar, scalar))
    if found is None:
        raise TypeError(f"Paddle has no dtype for '{scalar.__name__}'")
    return found


def dtype_from_paddle(paddle_dtype):
    """The scalar type for Paddle's dtype.

    Raises:
        TypeError: there is none, for example for complex numbers.
    """
    for scalar, dtype in _dtypes().items():
        if dtype == paddle_dtype:
            return scalar
    raise TypeError(f"no scalar type for '{paddle_dtype}'")


def device_to_paddle(warp_device=None) -> str:
    """Paddle's name of a device: `cpu` or `gpu:0`."""
    device = devices.get_device(warp_device)
    return "cpu" if device.is_cpu else f"gpu:{device.ordinal}"


def device_from_paddle(paddle_device):
    """The device for one of Paddle's places, or its name.

    Raises:
        RuntimeError: it is neither CPU nor CUDA.
        ValueError: there is no such device here.
    """
    text = str(paddle_device).removeprefix("Place(").removesuffix(")").lower()
    if text in ("cpu", "gpu_pinned"):
        return devices.get_device("cpu")
    kind, _, number = text.partition(":")
    if kind not in ("gpu", "cuda"):
        raise RuntimeError(f"expects a CPU or CUDA place of Paddle, but got '{paddle_device}'")
    return devices.get_device(f"cuda:{number or 0}")


def from_paddle(
    t, dtype=None, requires_grad=None, grad=None, return_ctype=False, retain_grad=False
):
    """An array over the memory of a tensor; nothing is copied, and writes are seen on both sides.

    Args:
        t: a dense tensor of Paddle.
        dtype: element type; with a vector or matrix type the trailing dimensions become part of
            the elements. By default the scalar type of the tensor.
        requires_grad: whether the array has a gradient, which is that of the tensor and is made
            if there is none yet. By default it has one if the tensor does not stop gradients. In
            `forward` and `backward` of a `paddle.autograd.PyLayer` it is one of the array's own,
            since Paddle adds what `backward` returns to those of the tensors.
        grad: array or tensor to use as the gradient, with the strides of `t`.
        return_ctype: launches take the memory as their parameters say: a parameter of another
            element type or rank reads it as its own, unchecked. Missing dimensions have the extent
            1, and surplus ones are left out.
        retain_grad: as for `wp.array`.

    Raises:
        TypeError: it is no tensor, or holds other scalars than `dtype`.
        ValueError: shape or strides do not fit, or the array would take a copy of `grad`.
    """
    if not hasattr(t, "place") or not hasattr(t, "data_ptr"):
        raise TypeError(f"expects a dense tensor of Paddle, but got '{type(t).__name__}'")
    result = _alias(t, dtype, return_ctype)
    if return_ctype:
        result.bare = True
    import paddle

    if paddle_layers.is_lent(paddle, t):
        result.lent = True
    wanted = not t.stop_gradient if requires_grad is None else requires_grad
    if wanted and grad is None and paddle_layers.has_own_gradient(paddle, t):
        result.requires_grad = True
        result.retain_grad = retain_grad
        return result
    share_gradient(result, grad, wanted, lambda one: _alias(one, dtype), lambda: _gradient(t))
    if retain_grad:
        result.retain_grad = True
    return result


def _alias(t, dtype, bare=False):
    scalar = dtype_from_paddle(t.dtype)
    size = dtypes.type_size_in_bytes(scalar)
    strides = [step * size for step in t.strides]
    layout = exchange.fold(scalar, tuple(t.shape), strides, dtype, bare)
    index = device_from_paddle(t.place).index
    pinned = "pinned" in str(t.place)
    address = t.data_ptr() if layout[0] and 0 not in tuple(t.shape) else 0
    return exchange.alias(array, address, layout, index, t, pinned)


def _gradient(t):
    """The gradient of a tensor, made and attached to it if there is none."""
    import paddle

    if t.grad is None:
        t.stop_gradient = False
        # Paddle copies what `grad` is set to, and shares this.
        t.grad_ = paddle.zeros_like(t)
    return t.grad


@checked(a=ARRAY)
def to_paddle(a, requires_grad=None):
    """A tensor over the memory of an array; nothing is copied, and writes are seen on both sides.

    Vector and matrix elements become trailing dimensions.

    Args:
        a: an array of anything but structs.
        requires_grad: whether the tensor has the array's gradient as `grad`; by default as the
            array says.

    Raises:
        TypeError: `a` is no array, or one of structs.
    """
    if not isinstance(a, array):
        raise TypeError(f"expects an array, but got '{type(a).__name__}'")
    if dtypes.is_struct(a.dtype):
        raise TypeError(f"Paddle has no type for elements of struct '{a.dtype.__name__}'")
    t = _tensor(a)
    wanted = a.requires_grad if requires_grad is None else requires_grad
    t.stop_gradient = not wanted
    if wanted and a.requires_grad and a.grad.item_size == a.item_size:
        t.grad_ = _tensor(a.grad)
    return t


def _tensor(a):
    import paddle.utils.dlpack

    scalar = dtypes.type_scalar_type(a.dtype)
    if scalar in _SIGNED:
        numbers = a if scalar is a.dtype else a.view(scalar)
        a = numbers.view(_SIGNED[scalar])
    return paddle.utils.dlpack.from_dlpack(a.__dlpack__())


def stream_from_paddle(stream_or_device=None):
    """A stream of ours for Paddle's stream, or for the current one of a device."""
    import paddle

    stream = stream_or_device
    if stream is None or isinstance(stream, (str, int)) or "Place" in type(stream).__name__:
        stream = paddle.device.current_stream(stream)
    base = getattr(stream, "stream_base", stream)
    handle = next(
        (getattr(base, name) for name in ("cuda_stream", "raw_stream") if hasattr(base, name)), 0
    )
    device = device_from_paddle(getattr(stream, "device", "gpu:0"))
    index = exchange.cuda_index(device.ordinal)
    return _native.Stream.from_handle(index, handle or exchange.LEGACY_STREAM)
