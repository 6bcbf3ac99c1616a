"""Fields of structs: what is assigned is checked and stored, and the arrays behind it are kept.

An array is stored as the descriptor that kernels use; its layout is the native module's.
"""

from __future__ import annotations

import ctypes
import typing

from warp import _native
from warp._src import errors
from warp._src.arrays import hooks
from warp._src.devices import devices
from warp._src.types import dtypes, scalars
from warp._src.types.composites import Composite, flatten_numbers, is_number
from warp._src.types.native import ArrayType
from warp._src.types.scalars import ScalarType, scalar_base

# Addresses have 8 bytes, numbers 4.
_NUMBERS = {8: ctypes.c_uint64, 4: ctypes.c_int32}
_FORMATS = {8: "<u8", 4: "<i4"}


class ArrayDescriptor(ctypes.Structure):
    """An array as kernels see it; strides are in bytes."""

    _fields_ = [
        (name, _NUMBERS[size] * count if count > 1 else _NUMBERS[size])
        for name, _, size, count in _native.DESCRIPTOR_FIELDS
    ]

    numpy_format = {
        "names": [name for name, *_ in _native.DESCRIPTOR_FIELDS],
        "formats": [
            (_FORMATS[size], (count,)) if count > 1 else _FORMATS[size]
            for _, _, size, count in _native.DESCRIPTOR_FIELDS
        ],
        "offsets": [offset for _, offset, *_ in _native.DESCRIPTOR_FIELDS],
        "itemsize": _native.DESCRIPTOR_SIZE,
    }


ArrayType.make_descriptor = ArrayDescriptor


def describe(array, gradient=None) -> ArrayDescriptor:
    """The descriptor of an array and of its gradient; all zero for None."""
    descriptor = ArrayDescriptor()
    if array is None:
        return descriptor
    descriptor.data = array.ptr or 0
    descriptor.grad = (gradient.ptr or 0) if gradient is not None else 0
    for axis, (extent, stride) in enumerate(zip(array.shape, array.strides, strict=True)):
        descriptor.shape[axis] = extent
        descriptor.strides[axis] = stride
    descriptor.ndim = array.ndim
    # Lets a launch see that the array is out of reach; 0 says nothing.
    descriptor.flags = 0 if array.pinned else array.device_index + 2
    if array.read_only:
        descriptor.flags |= _native.READ_ONLY_FLAG
    return descriptor


class FieldMark:
    """A field in the pickled attributes of a struct class, which makes its fields itself."""


class Field:
    """Descriptor of one field: checks and converts around the raw ctypes field."""

    def __init__(self, struct, name, dtype, raw):
        self.struct = struct
        self.name = name
        self.dtype = dtype
        self.raw = raw
        self.offset = raw.offset

    def __reduce__(self):
        return FieldMark, ()

    def __get__(self, instance, owner=None):
        if instance is None:
            return self
        dtype = self.dtype
        if isinstance(dtype, ArrayType):
            if self.name not in instance._held:
                instance._held[self.name] = self._array_at(instance)
            return instance._held[self.name]
        if dtypes.is_struct(dtype):
            inner = self.inner(instance)
            given, record = instance._given.get(self.name, (None, None))
            return given if record is not None and record == bytes(inner) else inner._shown()
        number = self.raw.__get__(instance, owner)
        bits = scalars.BITS.get(dtype)
        return bits[1](number) if bits else number

    def _array_at(self, instance):
        """The array that a struct made from memory refers to, which nobody keeps alive for it."""
        descriptor = self.raw.__get__(instance)
        if not descriptor.data:
            return None
        ndim = min(max(descriptor.ndim, 1), self.dtype.ndim)
        reach = descriptor.flags & _native.OWNER_MASK
        layout = {
            "dtype": self.dtype.dtype,
            "shape": tuple(descriptor.shape[:ndim]),
            "strides": tuple(descriptor.strides[:ndim]),
            "device": devices.by_index(reach - 2) if reach else "cpu",
        }
        grad = None
        if descriptor.grad:
            grad = hooks.plain_array(ptr=descriptor.grad, **layout)
        found = hooks.plain_array(ptr=descriptor.data, grad=grad, **layout)
        if descriptor.flags & _native.READ_ONLY_FLAG:
            found._protect()
        return found

    def inner(self, instance):
        """The struct in the field, over the memory of the instance."""
        held = instance._held
        if self.name not in held:
            held[self.name] = self.dtype.from_buffer(instance, self.offset)
        return held[self.name]

    def __set__(self, instance, value):
        dtype = self.dtype
        if isinstance(dtype, ArrayType):
            self._set_array(instance, value)
        elif dtypes.is_struct(dtype):
            given = dtype._accepted(value)
            if given is None:
                raise self._error(value)
            inner = self.inner(instance)
            inner.assign(given)
            instance._given.pop(self.name, None)
            if given is not value:
                instance._given[self.name] = (value, bytes(inner))
        elif isinstance(dtype, ScalarType):
            self._set_scalar(instance, value)
        else:
            self._set_composite(instance, value)

    def _set_scalar(self, instance, value):
        if not is_number(value):
            raise self._error(value)
        if isinstance(value, scalar_base):
            value = value.value
        try:
            bits = scalars.BITS.get(self.dtype)
            if issubclass(self.dtype, scalars.int_base):
                scalars.check_integer(self.dtype, value)
            self.raw.__set__(instance, bits[0](value) if bits else value)
        except TypeError:
            raise self._error(value) from None

    def _set_composite(self, instance, value):
        dtype = self.dtype
        if value is None:
            self.raw.__set__(instance, dtype())
            return
        if is_number(value) or dtypes.is_struct(type(value)):
            raise self._error(value)
        if isinstance(value, Composite) and value._shape_ != dtype._shape_:
            raise self._error(value)
        try:
            numbers = flatten_numbers(value)
        except TypeError:
            raise self._error(value) from None
        if len(numbers) != dtype._length_:
            raise ValueError(
                f"field '{self.name}' of struct '{self.struct}' expects {dtype._length_} "
                f"components for '{dtypes.type_repr(dtype)}', but got {len(numbers)}"
            )
        self.raw.__set__(instance, dtype(*numbers))

    def _set_array(self, instance, value):
        expected = self.dtype
        if value is not None:
            if not isinstance(value, _native.Array):
                raise self._error(value)
            if expected.dtype is not typing.Any and not dtypes.types_equal(
                value.dtype, expected.dtype
            ):
                raise self._error(value)
            if value.ndim != expected.ndim:
                raise self._error(value)
            self._check_descriptor(value)
        # A gradient that nobody has used is looked for again when somebody does.
        descriptor = describe(value, getattr(value, "grad_in_use", None))
        if value is not None:
            descriptor.flags |= value._facts
        self.raw.__set__(instance, descriptor)
        instance._held[self.name] = value

    def _check_descriptor(self, value):
        """Asks an array whose class describes itself, which may refuse."""
        if type(value).__ctype__ is hooks.plain_array.__ctype__:
            return
        try:
            rank = getattr(value.__ctype__(), "ndim", value.ndim)
            if rank != value.ndim:
                raise ValueError(
                    f"its descriptor has {rank} dimensions, but the array has {value.ndim}"
                )
        except Exception as problem:
            raise errors.WarpTypeError(
                f"Struct field '{self.name}' cannot refer to a '{type(value).__name__}': {problem}"
            ) from problem

    def _error(self, value):
        got = repr(value) if dtypes.type_is_array(type(value)) else dtypes.type_repr(type(value))
        message = (
            f"field '{self.name}' of struct '{self.struct}' expects "
            f"'{dtypes.type_repr(self.dtype)}', but got '{got}'"
        )
        if isinstance(self.dtype, type) and issubclass(self.dtype, Composite) and is_number(value):
            message += f", construct the value: `{dtypes.type_repr(self.dtype)}(...)`"
        return errors.WarpTypeError(
            message, code="field-type", facts={"field": self, "value": value}
        )
