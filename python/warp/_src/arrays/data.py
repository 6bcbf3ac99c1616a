"""Conversion of Python data to arrays: lists, NumPy arrays, array interfaces, single elements.

Data becomes a NumPy array first. If type and place already fit and no copy is asked for, the array
aliases it; otherwise NumPy converts straight into the new array's memory (on CUDA into a host
buffer that is then copied).
"""

from __future__ import annotations

import ctypes
import math

from warp import _native
from warp._src import arguments, errors
from warp._src.arrays import hooks
from warp._src.arrays.allocation import allocate, new_array
from warp._src.arrays.layout import bytes_of, check_shape, check_strides, type_id
from warp._src.arrays.nested import contents, from_sequence
from warp._src.devices import devices
from warp._src.interop import exchange
from warp._src.types import dtypes, scalars
from warp._src.types.composites import Composite, is_number
from warp._src.types.numpy_types import bfloat16_bits, dtype_from_numpy, element_layout
from warp._src.types.scalars import scalar_base


def fill_from_data(target, data, dtype, shape, device, pinned, copy) -> None:
    """Sets up `target` from anything that holds numbers."""
    if isinstance(data, _native.Array):
        _from_array(target, data, dtype, shape, device, pinned, copy)
        return
    index = devices.resolve_index(device)
    interface = getattr(data, "__cuda_array_interface__", None)
    on_host = index == devices.CPU and hasattr(data, "__array_interface__")
    if interface is not None and not on_host:
        _from_cuda(target, data, interface, dtype, shape, device, pinned, copy)
        return
    source, dtype = to_numpy(data, dtype)
    if shape is None:
        extents = check_shape(element_shape(source, dtype))
    else:
        extents = _requested(shape, dtype, source.shape)
    _store(target, source, extents, dtype, index, pinned, copy)


def _requested(shape, dtype, given):
    """The extents that are asked for, whatever data of shape `given` is nested like.

    Raises:
        ValueError: there are more or fewer numbers.
    """
    inner = () if dtypes.is_struct(dtype) else getattr(dtype, "_shape_", ())
    length, size = math.prod(inner), math.prod(given)
    requested = check_shape(_infer(shape, size // length))
    if math.prod(requested) * length != size:
        of = f" of '{dtypes.type_repr(dtype)}' with {length} numbers each" if inner else ""
        raise errors.WarpShapeError(
            f"expects data for shape {requested}{of}, but got shape {tuple(given)}"
        )
    return requested


def _infer(shape, size):
    extents = [shape] if hasattr(shape, "__index__") else list(shape)
    if extents.count(-1) == 1:
        rest = math.prod(extent for extent in extents if extent != -1)
        extents[extents.index(-1)] = size // rest if rest else 0
    return extents


def to_numpy(data, dtype):
    """A NumPy array of `data`, and the element type (that of the data if `dtype` is None)."""
    import numpy

    if isinstance(data, (list, tuple)):
        source = from_sequence(data, dtype)
    elif isinstance(data, (Composite, ctypes.Structure)):
        source = from_sequence([data], dtype)
    elif isinstance(data, (int, float, scalar_base)):
        raise errors.WarpTypeError(f"expects a sequence or an array as data, but got {data!r}")
    else:
        try:
            source = numpy.asarray(data)
        except (TypeError, ValueError) as error:
            raise errors.WarpTypeError(f"cannot make an array of the data: {error}") from None
    if dtype is not None and dtypes.is_struct(dtype):
        layout = element_layout(dtype)[0]
        if source.size == 0:
            # Lists without a struct do not say what they have none of.
            source = source.astype(layout)
        if source.dtype != layout:
            raise errors.WarpTypeError(
                f"expects records of struct '{dtype.__name__}', but got '{source.dtype}'"
            )
        return source, dtype
    if source.dtype.kind not in "biuf" and source.dtype.name != "bfloat16":
        raise errors.WarpTypeError(f"expects numbers as data, but got '{source.dtype}'")
    if source.ndim == 0:
        # NumPy's own arrays of one number; a plain number is refused above.
        source = source.reshape(1)
    if dtype is None:
        dtype = dtype_from_numpy(source.dtype)
    return source, dtype


def element_shape(source, dtype):
    """Extents that remain when the inner dimensions are folded into the element type."""
    inner = getattr(dtype, "_shape_", ())
    if not inner or dtypes.is_struct(dtype):
        return source.shape
    length = math.prod(inner)
    if source.ndim > len(inner) and source.shape[-len(inner) :] == inner:
        return source.shape[: -len(inner)]
    if source.ndim > 1 and source.shape[-1] == length:
        return source.shape[:-1]
    if source.shape == inner:
        return (1,)
    if source.ndim > len(inner) + 1 and source.shape[-len(inner) - 1 :] == (*inner, 1):
        return source.shape[: -len(inner) - 1]
    if source.ndim == 1 and source.size % length == 0:
        return (source.size // length,)
    if source.ndim > 1 and source.shape[-1] % length == 0:
        return (*source.shape[:-1], source.shape[-1] // length)
    raise errors.WarpShapeError(
        f"expects inner dimensions {inner} for elements of type '{dtypes.type_repr(dtype)}', "
        f"but got shape {source.shape}"
    )


def _store(target, source, extents, dtype, index, pinned, copy):
    """Puts NumPy data into an array, by alias where allowed."""
    import numpy

    layout, inner = element_layout(dtype)
    scalar = getattr(dtype, "_wp_scalar_type_", dtype)
    if scalar is scalars.bfloat16 and source.dtype.name == "bfloat16":
        source = source.view("uint16")
    elif scalar is scalars.bfloat16 and source.dtype.kind == "f":
        source = bfloat16_bits(source)
    if (
        not copy
        and index == devices.CPU
        and source.dtype == layout
        and _alias(target, source, extents, dtype, inner)
    ):
        return
    allocate(target, extents, dtype, index, pinned)
    if not target.size:
        return
    host = target
    if index != devices.CPU:
        host = new_array(type(target))
        allocate(host, extents, dtype, devices.CPU)
    with numpy.errstate(invalid="ignore", over="ignore"):
        host._host_view()[...] = source.reshape(extents + inner)
    if host is not target:
        _native.copy_array(target, host)


def _alias(target, source, extents, dtype, inner) -> bool:
    """Lets `target` use the memory of a NumPy array; False if its layout does not allow it."""
    if not source.flags.aligned:
        return False
    shaped = source if source.shape == extents + inner else None
    if shaped is None:
        if not source.flags.c_contiguous:
            return False
        shaped = source.reshape(extents + inner)
    outer = len(extents)
    strides = shaped.strides
    item_size = dtypes.type_size_in_bytes(dtype)
    step = item_size
    for extent, stride in zip(inner, strides[outer:], strict=True):
        step //= extent
        if stride != step:
            return False
    if any(stride < 0 or stride > 2**31 - 1 for stride in strides[:outer]):
        return False
    pointer = source.__array_interface__["data"][0] if source.size else 0
    target._setup(
        pointer,
        extents,
        strides[:outer],
        dtype,
        type_id(dtype),
        item_size,
        devices.CPU,
        source,
        False,
    )
    if not source.flags.writeable:
        target._protect()
    return True


def _from_array(target, data, dtype, shape, device, pinned, copy):
    index = data.device_index if device is None else devices.resolve_index(device)
    source = data
    if dtype is not None and not dtypes.types_equal(dtype, data.dtype):
        if shape is not None and dtypes.types_equal(dtypes.type_scalar_type(dtype), data.dtype):
            source = _folded(data.contiguous(), dtype, _requested(shape, dtype, data.shape))
        else:
            values, place = data.numpy(), device or data.device
            source = hooks.plain_array(values, dtype=dtype, shape=shape, device=place)
            copy = False
    elif shape is not None:
        source = source.contiguous().reshape(check_shape(_infer(shape, source.size)))
    if not copy and source.device_index == index:
        target._setup(
            source.ptr or 0,
            source.shape,
            source.strides,
            source.dtype,
            source.type_id,
            source.item_size,
            index,
            source,
            source.pinned,
        )
        if source.read_only:
            target._protect()
        return
    allocate(target, source.shape, source.dtype, index, pinned)
    if source.size:
        _native.copy_array(target, source)


def _folded(source, dtype, extents):
    """The numbers of a packed array as elements of that many numbers."""
    size = dtypes.type_size_in_bytes(dtype)
    return source._view(0, extents, exchange.packed_strides(extents, size), dtype)


def _from_cuda(target, data, interface, dtype, shape, device, pinned, copy):
    """From another library's CUDA array, after what its stream still has to do."""
    import numpy

    if interface.get("mask") is not None:
        raise errors.WarpTypeError("an array with a mask cannot be used as data")
    where = _cuda_device_of(data)
    _native.share_with_others()
    if interface.get("stream") is not None:
        exchange.wait_for(interface["stream"], where)
    pointer, read_only = interface["data"]
    extents, strides = tuple(interface["shape"]), interface.get("strides")
    if dtype is not None and dtypes.is_struct(dtype):
        if numpy.dtype(interface["typestr"]).itemsize != dtypes.type_size_in_bytes(dtype):
            raise errors.WarpTypeError(f"expects records of struct '{dtype.__name__}'")
        layout = dtype, extents, strides
    else:
        # NumPy has no bfloat16; the libraries that do spell it as two raw bytes.
        raw_bytes = interface["typestr"][1:] == "V2"
        scalar = scalars.bfloat16 if raw_bytes else dtype_from_numpy(interface["typestr"])
        fits = dtype is None or exchange.same_bits(
            scalar, getattr(dtype, "_wp_scalar_type_", dtype)
        )
        whole = dtype if fits and shape is None else None
        layout = exchange.fold(scalar, extents, strides, whole)
    source = exchange.alias(type(target), pointer or 0, layout, where, data, read_only=read_only)
    _from_array(target, source, dtype, shape, device, pinned, copy)


def _cuda_device_of(data) -> int:
    """The array interface does not name the device; DLPack, which most have too, does."""
    if hasattr(data, "__dlpack_device__"):
        return exchange.cuda_index(data.__dlpack_device__()[1])
    return devices.resolve_index("cuda")


def borrow(target, ptr, extents, strides, dtype, index, capacity, deleter, owner=None) -> None:
    """Sets up an array over memory that somebody else owns."""
    item_size = dtypes.type_size_in_bytes(dtype)
    if strides is None:
        needed = item_size * math.prod(extents)
    else:
        strides = check_strides(strides, extents)
        needed = bytes_of(extents, strides, item_size)
    if capacity is not None and capacity < needed:
        raise errors.WarpShapeError(f"expects a capacity of {needed} bytes, but got {capacity}")
    if deleter is not None:
        owner = Deleter(ptr, capacity or needed, deleter)
    target._setup(ptr, extents, strides, dtype, type_id(dtype), item_size, index, owner, False)
    if index != devices.CPU and needed:
        # Its owner knows nothing of launches that wait for their code.
        _native.note_foreign(index, ptr, deleter is not None)


class Deleter(_native.Finalized):
    """Calls `deleter(ptr, size)` when the last array over the memory is gone."""

    def __init__(self, ptr, size, deleter):
        self.ptr, self.size, self.deleter = ptr, size, deleter

    def _release(self):
        # Never called twice, also where an interrupt ends it.
        deleter, self.deleter = self.deleter, None
        if deleter is not None:
            deleter(self.ptr, self.size)


def element_bytes(dtype, value) -> bytes:
    """Memory of one array element made from `value`.

    Raises:
        TypeError, ValueError: `value` cannot be converted.
    """
    wanted = dtypes.type_repr(dtype)
    if dtypes.is_struct(dtype):
        if is_number(value) and value == 0:
            return bytes(dtypes.type_size_in_bytes(dtype))
        if type(value) is not dtype:
            raise TypeError(
                f"expects a '{wanted}' value, but got '{dtypes.type_repr(type(value))}'"
            )
        return contents(value)
    if hasattr(type(value), "tolist") and not isinstance(value, Composite):
        value = value.tolist()
    try:
        if issubclass(dtype, Composite):
            return bytes(value if isinstance(value, dtype) else dtype(value))
        number = value.value if isinstance(value, scalar_base) else value
        bits = scalars.BITS.get(dtype)
        if issubclass(dtype, scalars.int_base):
            scalars.check_integer(dtype, number)
        return bytes(dtype._type_(bits[0](number) if bits else number))
    except TypeError:
        got = arguments.spelled(value)
        raise TypeError(f"expects a '{wanted}' value, but got {got}") from None
    except (ValueError, OverflowError) as error:
        raise ValueError(
            f"cannot make a '{wanted}' of {arguments.spelled(value)}: {error}"
        ) from None
