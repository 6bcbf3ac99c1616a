"""Scalar types: `wp.float32(0.5)`, `wp.uint8(7)`, ...

A scalar type is used as an annotation, as the `dtype` of an array, as a conversion in kernels, and
at Python scope as a small value object. Integers of up to 64 bits wrap as in C (`wp.uint8(300)`
holds 44), longer ones are errors; floats keep the Python number and are rounded where they are
stored. Arithmetic gives plain Python numbers: ints wrap to the type and divide as in C, and types
do not mix.
"""

from __future__ import annotations

import builtins
import ctypes
import operator
import typing

from warp._src import errors
from warp._src.argument_kinds import above
from warp._src.arguments import shown, spelled
from warp._src.types.arithmetic import (
    bfloat16_from_bits,
    bfloat16_to_bits,
    divide,
    floor_divide,
    half_from_bits,
    half_to_bits,
    power,
    remainder,
)


class ScalarType(type):
    """Metaclass of the scalar types: lets NumPy read them as dtypes."""

    @property
    def _element_(cls):
        """NumPy's type for what is in memory; bfloat16 is `uint16`."""
        import numpy

        return numpy.dtype(cls._numpy_name_)

    @property
    def __numpy_dtype__(cls):
        if issubclass(cls, bfloat16):
            raise AttributeError("NumPy has no bfloat16")
        return cls._element_

    @property
    def dtype(cls):
        """The attribute that NumPy before 2.4 looks for.

        Raises:
            AttributeError: NumPy is newer, which looks for something else.
        """
        import numpy

        if "_numpy_name_" not in cls.__dict__ or _at_least(numpy.__version__, 2, 4):
            raise AttributeError(f"'{cls.__name__}' has no attribute 'dtype'")
        return cls._element_


def _at_least(version: str, *wanted) -> builtins.bool:
    return tuple(map(builtins.int, version.split(".")[:2])) >= wanted


class scalar_base(metaclass=ScalarType):
    """A number of one fixed type; `value` is the Python number."""

    __slots__ = ("value",)
    _length_ = 1
    _shape_ = ()

    def __repr__(self):
        return f"{type(self).__name__}({self.value})"

    def __str__(self):
        return str(self.value)

    def __hash__(self):
        return hash(self.value)

    @property
    def __numpy_dtype__(self):
        """Lets NumPy take the type of a number."""
        return type(self).__numpy_dtype__

    def __bool__(self):
        return self.value != 0

    def __float__(self):
        return float(self.value)

    def __reduce__(self):
        return (type(self), (self.value,))

    def __eq__(self, other):
        return _compared(operator.eq, self, other)

    def __ne__(self, other):
        return _compared(operator.ne, self, other)

    def __lt__(self, other):
        return _compared(operator.lt, self, other)

    def __le__(self, other):
        return _compared(operator.le, self, other)

    def __gt__(self, other):
        return _compared(operator.gt, self, other)

    def __ge__(self, other):
        return _compared(operator.ge, self, other)

    def __add__(self, other):
        return _arithmetic("add", self, other, False, lambda a, b: a + b)

    def __radd__(self, other):
        return _arithmetic("add", self, other, True, lambda a, b: a + b)

    def __sub__(self, other):
        return _arithmetic("sub", self, other, False, lambda a, b: a - b)

    def __rsub__(self, other):
        return _arithmetic("sub", self, other, True, lambda a, b: a - b)

    def __mul__(self, other):
        return _arithmetic("mul", self, other, False, lambda a, b: a * b)

    def __rmul__(self, other):
        return _arithmetic("mul", self, other, True, lambda a, b: a * b)

    def __truediv__(self, other):
        return _arithmetic("div", self, other, False, divide)

    def __rtruediv__(self, other):
        return _arithmetic("div", self, other, True, divide)

    def __floordiv__(self, other):
        return _arithmetic("floordiv", self, other, False, floor_divide)

    def __rfloordiv__(self, other):
        return _arithmetic("floordiv", self, other, True, floor_divide)

    def __mod__(self, other):
        return _arithmetic("mod", self, other, False, remainder)

    def __rmod__(self, other):
        return _arithmetic("mod", self, other, True, remainder)

    # As in kernels, powers are those of floats.

    def __pow__(self, other):
        if isinstance(self, int_base):
            return NotImplemented
        return _arithmetic("pow", self, other, False, power)

    def __rpow__(self, other):
        if isinstance(self, int_base):
            return NotImplemented
        return _arithmetic("pow", self, other, True, power)

    def __neg__(self):
        return self.round(-self.value)

    def __pos__(self):
        return self.round(self.value)

    def __abs__(self):
        return type(self)(abs(self.value))


def fits_64_bits(number) -> bool:
    """True if `int64` or `uint64` holds an integer."""
    return -(2**63) <= number < 2**64


def check_integer(scalar, number) -> None:
    """Refuses an integer beyond 64 bits for an integer type; smaller ones wrap as in C.

    Raises:
        WarpOverflowError: no integer type holds the number.
    """
    if isinstance(number, int) and not fits_64_bits(number) and scalar is not bool:
        length = number.bit_length()
        given = number if length <= 128 else f"an integer of {length} bits"
        raise errors.WarpOverflowError(
            f"{given} does not fit '{scalar.__name__}', nor another integer type"
        )


class int_base(scalar_base):
    """Common parts of integers of all widths."""

    __slots__ = ()

    def __init__(self, value=0):
        if isinstance(value, scalar_base):
            value = value.value
        check_integer(type(self), value)
        try:
            self.value = self._type_(value).value
        except (TypeError, AttributeError):
            raise _no_number(type(self), value, "an integer") from None

    @classmethod
    def round(cls, value):
        """The value as the type keeps it: digits above its width are lost.

        Raises:
            WarpTypeError: it is no integer.
        """
        try:
            return cls._type_(value).value
        except (TypeError, AttributeError):
            raise _no_number(cls, value, "an integer") from None

    def __int__(self):
        return self.value

    def __index__(self):
        return self.value

    def __and__(self, other):
        return _arithmetic("bit_and", self, other, False, lambda a, b: a & b)

    __rand__ = __and__

    def __or__(self, other):
        return _arithmetic("bit_or", self, other, False, lambda a, b: a | b)

    __ror__ = __or__

    def __xor__(self, other):
        return _arithmetic("bit_xor", self, other, False, lambda a, b: a ^ b)

    __rxor__ = __xor__

    def __lshift__(self, other):
        return _arithmetic("lshift", self, other, False, self._shift_left)

    def __rshift__(self, other):
        return _arithmetic("rshift", self, other, False, self._shift_right)

    def __invert__(self):
        return self.round(~self.value)

    def _shift_left(self, a, b):
        return a << b if 0 <= b < self._bits_ else 0

    def _shift_right(self, a, b):
        return a >> b if 0 <= b < self._bits_ else (-1 if a < 0 else 0)


class float_base(scalar_base):
    """Common parts of floats of all widths."""

    __slots__ = ()

    def __init__(self, value=0.0):
        if isinstance(value, scalar_base):
            value = value.value
        if not isinstance(value, (float, int)):
            value = as_float(type(self), value)
        self.value = value

    @classmethod
    def round(cls, value):
        """The nearest number of the type, as a Python float.

        Raises:
            WarpTypeError: it is no number.
        """
        try:
            return cls._type_(value).value
        except (TypeError, AttributeError, OverflowError):
            raise _no_number(cls, value, "a number") from None

    def __int__(self):
        return int(self.value)


class bool(int_base):
    """Truth value, one byte in memory."""

    __slots__ = ()
    _type_ = ctypes.c_bool
    _native_ = "i1"
    _numpy_name_ = "bool"
    _bits_ = 8

    def __init__(self, value=False):
        try:
            self.value = builtins.bool(value)
        except (TypeError, ValueError):
            raise _no_number(type(self), value, "one truth value") from None


def _compared(operation, number, other):
    try:
        return operation(number.value, other.value if isinstance(other, scalar_base) else other)
    except TypeError:
        # Python asks the other operand, and says then that there is no order.
        return NotImplemented


def as_float(cls, value) -> float:
    """The number that a value stands for, to be one of a type.

    Raises:
        WarpTypeError: it stands for none.
    """
    # Python would read the bytes of a vector as text.
    kind = type(value)
    if not (isinstance(value, str) or hasattr(kind, "__float__") or hasattr(kind, "__index__")):
        raise _no_number(cls, value, "a number")
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise _no_number(cls, value, "a number") from None


def _no_number(cls, value, wanted):
    if "_native_" not in cls.__dict__ and not hasattr(cls, "_native_"):
        return errors.WarpTypeError(
            f"'{cls.__name__}' is a family of types, make a number of one of them"
        )
    return errors.WarpArgumentError(
        f"expects {wanted} for '{cls.__name__}', but got {shown(value)}"
    )


def _arithmetic(name, self, other, swapped, operation):
    cls = type(self)
    if isinstance(other, scalar_base):
        if type(other) is not cls:
            raise TypeError(
                f"expects operands of one type for '{name}', but got '{cls.__name__}' and "
                f"'{type(other).__name__}', convert one of them"
            )
        other = other.value
    elif isinstance(other, int):
        pass
    elif isinstance(other, float):
        if issubclass(cls, int_base):
            raise TypeError(
                f"expects operands of one type for '{name}', but got '{cls.__name__}' and "
                f"'float', convert one of them"
            )
    else:
        return NotImplemented
    a, b = (other, self.value) if swapped else (self.value, other)
    if issubclass(cls, float_base):
        a = a if type(a) is float else as_float(cls, a)
        b = b if type(b) is float else as_float(cls, b)
    return self.round(operation(a, b))


def _make_int(bits, signed):
    name = f"{'' if signed else 'u'}int{bits}"
    return ScalarType(
        name,
        (int_base,),
        {
            "__slots__": (),
            "__module__": __name__,
            "__doc__": f"{'Signed' if signed else 'Unsigned'} integer of {bits} bits.",
            "_type_": getattr(ctypes, f"c_{name}"),
            "_native_": f"{'si' if signed else 'ui'}{bits}",
            "_numpy_name_": name,
            "_bits_": bits,
        },
    )


if typing.TYPE_CHECKING:

    class int8(int_base): ...

    class int16(int_base): ...

    # In kernels the two are the same.
    int32: typing.TypeAlias = int

    class int64(int_base): ...

    class uint8(int_base): ...

    class uint16(int_base): ...

    class uint32(int_base): ...

    class uint64(int_base): ...

else:
    int8, int16, int32, int64 = (_make_int(bits, True) for bits in (8, 16, 32, 64))
    uint8, uint16, uint32, uint64 = (_make_int(bits, False) for bits in (8, 16, 32, 64))


class handle(uint64):
    """Identifier of a native object, such as a mesh."""

    __slots__ = ()
    _native_ = "ui64"
    _numpy_name_ = "uint64"


class float16(float_base):
    """IEEE half precision."""

    __slots__ = ()
    _type_ = ctypes.c_ushort
    _native_ = "f16"
    _numpy_name_ = "float16"
    _bits_ = 16

    @classmethod
    def round(cls, value):
        """The nearest number of 16 bits, ties to even, as a Python float."""
        return half_from_bits(half_to_bits(as_float(cls, value)))


class bfloat16(float_base):
    """The upper half of a float32. NumPy sees its bits as `uint16`."""

    __slots__ = ()
    _type_ = ctypes.c_ushort
    _native_ = "bf16"
    _numpy_name_ = "uint16"
    _bits_ = 16

    @classmethod
    def round(cls, value):
        """The nearest bfloat16, ties to even, as a Python float."""
        return bfloat16_from_bits(bfloat16_to_bits(as_float(cls, value)))


if typing.TYPE_CHECKING:
    float32: typing.TypeAlias = float
else:

    class float32(float_base):
        """IEEE single precision."""

        __slots__ = ()
        _type_ = ctypes.c_float
        _native_ = "f32"
        _numpy_name_ = "float32"
        _bits_ = 32


class float64(float_base):
    """IEEE double precision."""

    __slots__ = ()
    _type_ = ctypes.c_double
    _native_ = "f64"
    _numpy_name_ = "float64"
    _bits_ = 64


# Scalars stored as raw bits: value to bits and back.
BITS = {
    float16: (half_to_bits, half_from_bits),
    bfloat16: (bfloat16_to_bits, bfloat16_from_bits),
}

INT_TYPES = (int8, uint8, int16, uint16, int32, uint32, int64, uint64)
FLOAT_TYPES = (float16, bfloat16, float32, float64)
SCALAR_TYPES = (*INT_TYPES, *FLOAT_TYPES)
# Python's own types in annotations.
PYTHON_TYPES = {int: int32, float: float32, builtins.bool: bool}


def canonical_scalar(dtype):
    """The scalar type that `dtype` (a scalar type or Python's int, float, bool) stands for.

    Raises:
        TypeError: it stands for none.
    """
    scalar = PYTHON_TYPES.get(dtype, dtype) if isinstance(dtype, type) else dtype
    if isinstance(scalar, ScalarType) and "_native_" in scalar.__dict__:
        return scalar
    raise TypeError(f"expects a scalar type, but got {described(dtype)}")


def shown_name(kind) -> str:
    """Name of a class in messages: `vec5f`, where `__name__` is that of all vectors, `vec_t`."""
    return vars(kind).get("_wp_name_") or kind.__name__


def described(dtype) -> str:
    """How messages call what is given for a type, with the type that is perhaps meant."""
    if isinstance(dtype, str):
        text, name = f"the string '{dtype}'", dtype
    elif isinstance(dtype, type) and typing.get_origin(dtype) is None:
        name = shown_name(dtype)
        home = dtype.__module__
        text = f"'{home}.{name}'" if home == "numpy" else f"'{name}'"
    else:
        # NumPy's element types have names.
        text, name = spelled(dtype), getattr(dtype, "name", "")
        text = text if "'" in text else f"'{text}'"
    known = {one.__name__ for one in SCALAR_TYPES}
    return f"{text}, use `wp.{name}`" if name in known else text


above.scalar_base = scalar_base
