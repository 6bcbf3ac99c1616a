"""Exchange with PyTorch. PyTorch is imported when one of these functions is first called."""

from __future__ import annotations

import functools
import warnings

from warp import _native
from warp._src.argument_kinds import ARRAY
from warp._src.arguments import checked
from warp._src.arrays.array import array
from warp._src.devices import devices
from warp._src.interop import exchange, torch_functions
from warp._src.interop.packages import load
from warp._src.interop.shared_gradients import share_gradient
from warp._src.types import dtypes, scalars

_NAMES = {
    scalars.bool: "bool",
    **{t: t.__name__ for t in scalars.SCALAR_TYPES},
}


@functools.cache
def _dtypes():
    """PyTorch's dtypes by our scalar types."""
    torch = load("torch")

    return {scalar: getattr(torch, name) for scalar, name in _NAMES.items()}


@functools.cache
def _scalars():
    return {dtype: scalar for scalar, dtype in _dtypes().items()}


def dtype_to_torch(warp_dtype):
    """PyTorch's dtype for a scalar type.

    Raises:
        TypeError: `warp_dtype` is not a scalar type.
    """
    return _dtypes()[scalars.canonical_scalar(warp_dtype)]


def dtype_from_torch(torch_dtype):
    """The scalar type for PyTorch's dtype.

    Raises:
        TypeError: there is none, for example for complex numbers.
    """
    found = _scalars().get(torch_dtype)
    if found is None:
        raise TypeError(f"no scalar type for '{torch_dtype}'")
    return found


def device_to_torch(warp_device=None) -> str:
    """PyTorch's name of a device."""
    warp_device = devices.get_device(warp_device)
    return "cpu" if warp_device.is_cpu else f"cuda:{warp_device.ordinal}"


def device_from_torch(torch_device):
    """The device for a `torch.device` or its name.

    Raises:
        ValueError: there is no such device here.
    """
    return devices.get_device(str(torch_device))


def from_torch(t, dtype=None, requires_grad=None, grad=None, return_ctype=False, retain_grad=False):
    """An array over the memory of a tensor; nothing is copied, and writes are seen on both sides.

    Work on the array is ordered after work on PyTorch's default stream. Around work on other
    streams use `stream_from_torch`, or exchange by `wp.from_dlpack`, which orders them.

    Args:
        t: a strided tensor.
        dtype: element type; with a vector or matrix type the trailing dimensions become part of
            the elements. By default the scalar type of the tensor.
        requires_grad: whether the array has a gradient, which is that of the tensor and is made
            if there is none yet. By default as the tensor says. In `forward` and `backward` of a
            `torch.autograd.Function` it is one of the array's own, zero at the begin of each
            backward pass, since PyTorch adds what `backward` returns to those of the tensors.
        grad: array or tensor to use as the gradient, with the strides of `t`.
        return_ctype: launches take the memory as their parameters say: a parameter of another
            element type or rank reads it as its own, unchecked. Missing dimensions have the extent
            1, and surplus ones are left out.
        retain_grad: as for `wp.array`.

    Raises:
        TypeError: the tensor is sparse, or holds other scalars than `dtype`.
        ValueError: shape or strides do not fit.
    """
    torch = load("torch")

    if isinstance(t, torch.Tensor) and (t.layout is not torch.strided or t.is_neg()):
        raise TypeError(
            "expects a strided tensor in memory, use `to_dense` or `resolve_neg` before"
        )
    result = _alias(t, dtype, return_ctype)
    if return_ctype:
        result.bare = True
    if torch_functions.is_lent(torch, t):
        result.lent = True
    wanted = t.requires_grad if requires_grad is None else requires_grad
    if wanted and grad is None and torch_functions.has_own_gradient(torch, t):
        torch_functions.give_own_gradient(result, retain_grad)
        return result
    share_gradient(result, grad, wanted, lambda one: _alias(one, dtype), lambda: _gradient(t))
    if retain_grad:
        result.retain_grad = True
    return result


def _alias(t, dtype, bare=False):
    torch = load("torch")

    if not isinstance(t, torch.Tensor):
        raise TypeError(f"expects a tensor, but got '{type(t).__name__}'")
    scalar = dtype_from_torch(t.dtype)
    size = t.element_size()
    layout = exchange.fold(
        scalar, tuple(t.shape), [step * size for step in t.stride()], dtype, bare
    )
    index = device_from_torch(t.device).index
    pinned = index == devices.CPU and t.is_pinned()
    address = t.data_ptr()
    if not address and t.numel():
        raise TypeError(
            f"expects a tensor in memory, but got '{type(t).__name__}' without, as PyTorch has "
            "them while it traces"
        )
    return exchange.alias(array, address, layout, index, t, pinned)


def _gradient(t):
    """The gradient of a tensor, made and attached to it if there is none."""
    torch = load("torch")

    holds = t.is_leaf or t.retains_grad
    if holds and t.grad is not None:
        return t.grad
    made = torch.empty_strided(t.shape, t.stride(), dtype=t.dtype, device=t.device).zero_()
    if holds:
        t.grad = made
    return made


@checked(a=ARRAY)
def to_torch(a, requires_grad=None):
    """A tensor over the memory of an array; nothing is copied, and writes are seen on both sides.

    Vector and matrix elements become trailing dimensions. Work that PyTorch queues on its current
    stream is ordered after work on the array.

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
        raise TypeError(f"PyTorch has no type for elements of struct '{a.dtype.__name__}'")
    torch = load("torch")

    if not a.requires_grad:
        torch_functions.warn_of_sum(torch, a.ptr)
    t = _tensor(a)
    if a.requires_grad if requires_grad is None else requires_grad:
        t.requires_grad_()
        if a.requires_grad and a.grad.item_size == a.item_size:
            t.grad = _tensor(a.grad)
    return t


def _tensor(a):
    torch = load("torch")

    if a.read_only:
        warnings.warn(
            "the array is read-only, and PyTorch has no such tensors: do not write to this one, "
            "or call `to_torch` with `wp.clone(a)`",
            stacklevel=3,
        )
    # A capsule is faster than the protocol, which PyTorch needs for streams and read-only memory.
    plain = a.device_index == devices.CPU and not a.read_only
    return torch.from_dlpack(a.__dlpack__() if plain else a)


def stream_from_torch(stream_or_device=None):
    """A stream of ours for PyTorch's stream, or for the current one of a device.

    Example:
        with wp.ScopedStream(wp.stream_from_torch()):
            wp.launch(...)  # in order with what PyTorch queues
    """
    torch = load("torch")

    stream = stream_or_device
    if not isinstance(stream, torch.cuda.Stream):
        stream = torch.cuda.current_stream(stream)
    index = exchange.cuda_index(stream.device.index)
    return _native.Stream.from_handle(index, stream.cuda_stream or exchange.LEGACY_STREAM)


def stream_to_torch(stream_or_device=None):
    """PyTorch's stream for one of ours, or for the current one of a device."""
    torch = load("torch")

    stream = stream_or_device
    if not isinstance(stream, _native.Stream):
        stream = devices.get_stream(stream)
    if stream.cuda_stream in (0, exchange.LEGACY_STREAM):
        return torch.cuda.default_stream(stream.device.ordinal)
    result = torch.cuda.ExternalStream(
        stream.cuda_stream, device=torch.device("cuda", stream.device.ordinal)
    )
    # PyTorch does not own the stream; the object keeps ours from being destroyed.
    result.warp_stream = stream
    return result
