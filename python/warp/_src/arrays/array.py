"""`wp.array`: a typed, strided view of device memory.

The descriptor (address, shape, byte strides, element type, device) lives in the native base class,
where launches read it without Python. This file adds what users see; `data` turns lists, NumPy
arrays and interface objects into arrays, `create` has `zeros`, `full` and so on.
The native part keeps the object that owns the memory alive; nobody can replace it.
"""

from __future__ import annotations

import ctypes
import typing

from warp import _native
from warp._src import errors
from warp._src.argument_kinds import DATA
from warp._src.arguments import checked, forwarded
from warp._src.arrays import hooks
from warp._src.arrays.allocation import allocate
from warp._src.arrays.copies import assign, clone
from warp._src.arrays.data import borrow, element_bytes, fill_from_data
from warp._src.arrays.gradients import ArrayGradients, wants_wide_gradient
from warp._src.arrays.layout import bytes_of, check_shape, element_type
from warp._src.arrays.observers import Observers, observed_fill
from warp._src.arrays.operators import ArrayArithmetic
from warp._src.arrays.protocols import ArrayProtocols
from warp._src.arrays.views import ArrayViews
from warp._src.devices import devices, memory
from warp._src.types import annotations, dtypes, scalars
from warp._src.types.arithmetic import bfloat16_from_bits
from warp._src.types.native import ArrayType
from warp._src.types.numpy_types import element_layout, numpy_bfloat16
from warp._src.types.struct_fields import describe

if typing.TYPE_CHECKING:
    import numpy as np

# For type checkers, to which `wp.array[wp.vec3]` is a type.
_Element = typing.TypeVar("_Element")


class array(
    ArrayViews,
    ArrayGradients,
    ArrayProtocols,
    ArrayArithmetic,
    _native.Array,
    typing.Generic[_Element],
):
    """An array of scalars, vectors, matrices, quaternions, transforms or structs.

    Args:
        data: nested lists or tuples, a NumPy array, another array, or an object with
            `__array_interface__` or `__cuda_array_interface__`. Inner dimensions that match the
            shape of `dtype` become part of the element.
        dtype: element type; by default that of `data`.
        shape: extents, at most 4; by default those of `data`.
        strides: distance of neighbours along each dimension in bytes, without data.
        ptr: address of existing memory on `device`.
        capacity: bytes available at `ptr`.
        device: where the array lives.
        pinned: host memory that CUDA devices reach directly.
        copy: False uses the memory of `data` if type and device allow it.
        deleter: called with address and size when memory given by `ptr` is no longer used.
        ndim: number of dimensions, checked against the data.
        grad: array of the same shape and strides for derivatives.
        requires_grad: whether derivatives are wanted; `grad` is allocated on its first use.
        retain_grad: keep derivatives of intermediate results.
        length: extent of a one-dimensional array, instead of `shape`.
        grad_dtype: element type of the gradient, or of its components; by default that of the
            array. Elements of 16 bits may have one of 32, `float32`, so that sums over several
            launches are not rounded in between.

    Without data, `shape` and `ptr` the call gives an annotation: `wp.array(dtype=wp.vec3)`.

    Example:
        >>> import warp as wp
        >>> a = wp.array([[0.0, 1.0, 2.0]], dtype=wp.vec3, device="cpu")
        >>> a.shape
        (1,)

    Raises:
        TypeError: element type or data cannot be used.
        ValueError: shapes do not fit together.
    """

    # The arguments the array was made with, to be read: storing another one changes nothing.
    deleter = None

    if not typing.TYPE_CHECKING:  # To a checker the call always gives an array.

        def __new__(
            cls,
            data=None,
            dtype: typing.Any = typing.Any,
            shape=None,
            *args,
            ptr=None,
            length=None,
            **kw,
        ) -> typing.Any:
            if data is None and shape is None and ptr is None and length is None and not args:
                if kw.keys() - {"ndim"}:
                    raise ValueError("expects `data`, `shape` or `ptr` to make an array")
                return ArrayType(dtype, kw.get("ndim") or 1)
            return _native.Array.__new__(cls)

    def __class_getitem__(cls, params):
        if cls is not array:
            raise TypeError(
                f"Subscript syntax not supported for '{cls.__name__}': annotate with `wp.array`"
            )
        return annotations.from_subscript(params, 1)

    @typing.overload
    def __init__(
        self, data: typing.Any = None, *, dtype: type[_Element], **options: typing.Any
    ) -> None: ...
    @typing.overload
    def __init__(
        self, data: typing.Any, dtype: type[_Element], *rest: typing.Any, **options: typing.Any
    ) -> None: ...
    @typing.overload
    def __init__(
        self: array[typing.Any],
        data: typing.Any = None,
        dtype: typing.Any = None,
        *rest: typing.Any,
        **options: typing.Any,
    ) -> None: ...
    def __init__(
        self,
        data=None,
        dtype: typing.Any = typing.Any,
        shape=None,
        strides=None,
        ptr=None,
        capacity=None,
        device=None,
        pinned=False,
        copy=True,
        deleter=None,
        ndim=None,
        grad=None,
        requires_grad=False,
        retain_grad=False,
        length=None,
        grad_dtype=None,
    ):
        if length is not None:
            if shape is not None:
                raise ValueError("expects `shape` or `length`, but got both")
            shape = (length,)
        dtype = None if dtype is typing.Any or dtype is None else element_type(dtype)
        if data is not None:
            if ptr is not None:
                raise ValueError("expects `data` or `ptr`, but got both")
            fill_from_data(self, data, dtype, shape, device, pinned, copy)
        else:
            dtype = element_type(float) if dtype is None else dtype
            index = devices.resolve_index(device)
            extents = check_shape(shape)
            if ptr is None:
                allocate(self, extents, dtype, index, pinned, strides)
            else:
                borrow(self, ptr, extents, strides, dtype, index, capacity, deleter)
                if deleter is not None:
                    self.deleter = deleter
        if ndim is not None and ndim != self.ndim:
            if data is None or self.size or ndim < self.ndim:
                raise ValueError(f"expects {ndim} dimensions, but got shape {self.shape}")
            # An empty list does not say how many dimensions it has.
            allocate(self, (*self.shape, *(0,) * (ndim - self.ndim)), self.dtype, self.device_index)
        if type(self) is not array and type(self).__ctype__ is not array.__ctype__:
            self._describe_itself()
        if wants_wide_gradient(self.dtype, grad_dtype):
            self._wide_grad = True
        if grad is not None:
            self.grad = grad
        elif requires_grad:
            self.requires_grad = True
        if retain_grad:
            self.retain_grad = True

    _wp_array_ = True
    # True if launches take the memory as their parameters say; read where types do not fit.
    bare = False

    @property
    def device(self):
        """The device that the memory belongs to."""
        return devices.by_index(self.device_index)

    @property
    def capacity(self) -> int:
        """Bytes from the first element to the end of the last."""
        return bytes_of(self.shape, self.strides, self.item_size)

    def __reduce_ex__(self, protocol):
        return hooks.reduce_array(self, protocol)

    def __len__(self):
        return self.shape[0] if self.ndim else 1

    def __bool__(self):
        return True

    def __repr__(self):
        return f"array(shape={self.shape}, dtype={dtypes.type_repr(self.dtype)})"

    def _repr_html_(self):
        from warp._src.notebooks import array_html

        return array_html(self, dtypes.type_repr(self.dtype))

    def __str__(self):
        return str(self.numpy())

    def __matmul__(self, other):
        if hasattr(other, "_wp_multiplies_vectors_"):
            return NotImplemented
        raise TypeError("`@` is not defined for arrays, use `wp.tile_matmul` or NumPy")

    def numpy(self) -> np.ndarray:
        """The elements as a NumPy array; shares memory with a `cpu` array, else a copy.

        Arrays of bfloat16 are of the type that the package ml_dtypes has, or bits without it.
        Waits for work on CUDA streams that may still write them.

        Raises:
            RuntimeError: a graph is being captured on the array's device; on the CPU, one with work
                that writes the array.
        """
        if self.device_index != devices.CPU:
            if _native.is_capturing(self.device_index):
                raise errors.WarpError(
                    f"cannot read an array on '{self.device}' while a graph is being captured on it"
                )
            _native.join_streams(_native.current_stream(self.device_index))
            return self.to("cpu", requires_grad=False).numpy()
        if self.pinned:
            _native.synchronize_busy_streams()
        if hooks.captures:
            hooks.check_settled(self)
        if Observers.active:
            Observers.lend(self)
        found = self._host_view()
        if getattr(self.dtype, "_wp_scalar_type_", self.dtype) is scalars.bfloat16:
            kind = numpy_bfloat16()
            return found if kind is None else found.view(kind)
        return found

    def _host_view(self):
        import numpy

        number, inner = element_layout(self.dtype)
        if self.size == 0:
            return numpy.empty(self.shape + inner, number)
        interface = self._interface()
        if not number.names:
            return numpy.asarray(_Lent(self, interface))
        view = numpy.ndarray(
            interface["shape"],
            number,
            numpy.asarray(_Memory(self)),
            strides=interface["strides"],
        )
        return view

    def list(self) -> list:
        """All elements in row-major order, as Python numbers, composites or structs."""
        flat = self.contiguous().numpy()
        if self.dtype is scalars.bfloat16:
            bits = flat.reshape(-1).view("uint16").tolist()
            return [bfloat16_from_bits(one) for one in bits]
        if issubclass(self.dtype, scalars.scalar_base):
            return flat.reshape(-1).tolist()
        data, step = flat.tobytes(), self.item_size
        starts = range(0, len(data), step)
        return [self.dtype.from_buffer_copy(data[start : start + step]) for start in starts]

    def ipc_handle(self) -> bytes:
        """The bytes with which another process uses the memory, see `wp.from_ipc_handle`.

        Raises:
            RuntimeError: the memory comes from a pool, or is not on a CUDA device.
        """
        return memory.ipc_handle(self)

    @property
    def memory_kind(self):
        """The kind of memory that backs the array."""
        return memory.memory_kind(self)

    @checked()
    def to(self, device, requires_grad=None):
        """The array itself if it is on `device`, else a copy there."""
        if devices.resolve_index(device) == self.device_index:
            return self
        return clone(self, device=device, requires_grad=requires_grad)

    @checked(src=DATA)
    def assign(self, src) -> None:
        """Copies from an array, an indexed one, a NumPy array or lists of the same shape.

        For two packed arrays, elements go to as many first elements of this one.

        Raises:
            ValueError: the shapes differ, or there are too many elements.
        """
        assign(self, src, whole=False)

    def _check_writable(self, what=None) -> None:
        if self.read_only:
            lead = "the array" if what is None else f"{what}(): the array that it writes"
            raise ValueError(
                f"{lead} is read-only, its memory is another library's: use a copy, `wp.clone(a)`"
            )

    def zero_(self) -> None:
        """Sets all bytes to zero."""
        self._check_writable("zero_")
        if self.size == 0:
            return
        self._fill(bytes(self.item_size), "zero_")

    def _fill(self, pattern, name) -> None:
        if Observers.active:
            observed_fill(self, pattern, name)
        else:
            _native.fill_array(self, pattern)

    def fill_(self, value) -> None:
        """Sets every element to `value`: a number, or what the element type can be made from.

        Raises:
            TypeError, ValueError: `value` is no element of the array's type.
        """
        self._check_writable("fill_")
        pattern = element_bytes(self.dtype, value)
        if self.size:
            self._fill(pattern, "fill_")

    def fill(self, value) -> None:
        """`fill_` under NumPy's name."""
        self.fill_(value)

    def __ctype__(self):
        return describe(self, self.grad)

    def cptr(self):
        """The elements as a ctypes pointer, for an array on the CPU, which it keeps alive.

        Raises:
            RuntimeError: the array is elsewhere, or not contiguous.
        """
        if self.device_index != devices.CPU or not self.is_contiguous:
            raise errors.WarpError(
                "expects a contiguous array on 'cpu' for a pointer of ctypes, but got "
                f"{self!r} on '{self.device}'"
            )
        if hooks.captures:
            hooks.check_settled(self)
        if Observers.active:
            Observers.lend(self)
        element = dtypes.type_ctype(self.dtype)
        pointer = ctypes.cast(self.ptr or 0, ctypes.POINTER(element))
        pointer._array = self
        return pointer


class _Lent:
    """Lends the memory of an array to NumPy."""

    def __init__(self, owner, interface):
        self.owner = owner
        self.__array_interface__ = interface


class _Memory:
    """Lends the memory of an array to NumPy as bytes."""

    def __init__(self, owner):
        self.owner = owner
        length = owner.strides[0] * (owner.shape[0] - 1) + owner.item_size
        for extent, stride in zip(owner.shape[1:], owner.strides[1:], strict=True):
            length += stride * (extent - 1)
        self.__array_interface__ = {
            "data": (owner.ptr, owner.read_only),
            "shape": (length,),
            "typestr": "|u1",
            "version": 3,
        }


class RankedArray:
    """`wp.array2d` and its like: `wp.array` with a given number of dimensions."""

    def __init__(self, ndim):
        self.ndim = ndim
        self.__name__ = f"array{ndim}d"

    def __call__(self, *args, **kwargs):
        # Data has the dimensions that it has, as in NVIDIA Warp.
        if not args and kwargs.get("data") is None:
            kwargs.setdefault("ndim", self.ndim)
        return forwarded(array, *args, **kwargs)

    def __getitem__(self, params):
        return annotations.from_subscript(params, self.ndim)

    def __instancecheck__(self, value):
        return isinstance(value, array) and value.ndim == self.ndim

    def __repr__(self):
        return f"warp.{self.__name__}"


hooks.plain_array = array
ArrayType.array_class = array
if typing.TYPE_CHECKING:
    array1d: typing.TypeAlias = array[_Element]
    array2d: typing.TypeAlias = array[_Element]
    array3d: typing.TypeAlias = array[_Element]
    array4d: typing.TypeAlias = array[_Element]
else:
    array1d, array2d, array3d, array4d = map(RankedArray, (1, 2, 3, 4))
