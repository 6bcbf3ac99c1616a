"""Shared parts of vectors, matrices, quaternions and transforms at Python scope.

Each composite type is a `ctypes.Array` of its scalars in row-major order, so it has C layout, the
buffer protocol, and can be read by NumPy without a copy. The mixins here give it construction,
indexing and arithmetic with the rules of kernels: `vec * vec` is an error, results are rounded to
the scalar type. `float16` and `bfloat16` components are stored as bits and converted on access.
"""

from __future__ import annotations

import ctypes
import itertools

from warp import config
from warp._src import errors
from warp._src.argument_kinds import above
from warp._src.arguments import shown
from warp._src.types import arithmetic, scalars
from warp._src.types.scalars import check_integer, int_base, scalar_base, shown_name

ArrayMeta = type(ctypes.Array)
_raw_get = ctypes.Array.__getitem__
_raw_set = ctypes.Array.__setitem__
_ALL = slice(None)
# Sequences deeper than that contain themselves.
_DEEPEST = 32
# More than composites have: what has no end is none.
_MOST_NUMBERS = 1 << 20
_PYTHON_OWN = frozenset(scalars.PYTHON_TYPES.values())


class Products:
    """How operators multiply quaternions, transforms and small matrices: as kernels do.

    Then they are rounded alike. The language puts its builtin here.
    """

    multiply = None


class Composite:
    """Mixin of all composite types; `_length_` counts scalars."""

    __slots__ = ()

    # Set by the factories.
    _wp_scalar_type_ = None
    _wp_type_params_ = ()
    _shape_ = ()

    def __repr__(self):
        components = ", ".join(repr(self._get(i)) for i in range(self._length_))
        return f"{shown_name(type(self))}([{components}])"

    def __str__(self):
        return f"[{', '.join(map(str, scalars_of(self)))}]"

    def __format__(self, spec):
        if not spec:
            return str(self)
        return f"[{', '.join(format(number, spec) for number in scalars_of(self))}]"

    def __reduce__(self):
        return (_from_bytes, (canonical_class(type(self)), bytes(self)))

    def __copy__(self):
        return type(self).from_buffer_copy(self)

    def __deepcopy__(self, memo):
        return type(self).from_buffer_copy(self)

    def __eq__(self, other):
        if isinstance(other, Composite):
            if other._shape_ != self._shape_:
                return False
        elif not hasattr(other, "__len__") or not hasattr(other, "__getitem__"):
            return NotImplemented
        try:
            return scalars_of(self) == flatten_numbers(other)
        except (TypeError, ValueError):
            return False

    __hash__ = None

    @classmethod
    def from_ptr(cls, ptr):
        """Copies the value stored at an address of host memory.

        Raises:
            RuntimeError: the address is zero.
        """
        if not ptr:
            raise errors.WarpError(
                "expects a valid address, but got a null pointer", code="null-pointer"
            )
        return cls.from_buffer_copy((ctypes.c_char * ctypes.sizeof(cls)).from_address(ptr))

    @classmethod
    def scalar_export(cls, number):
        """The result of an element access for a stored number.

        A number of Python for the types that are Python's own, else one of the scalar type; with
        `wp.config.legacy_scalar_return_types` always a number of Python.

        Raises:
            WarpTypeError: it is no number, or the class is a family of types.
        """
        scalar = cls._wp_scalar_type_
        bits = scalars.BITS.get(scalar)
        try:
            if bits:
                number = bits[1](number)
            if scalar in _PYTHON_OWN or config.legacy_scalar_return_types:
                return number
            return scalar(number)
        except (TypeError, OverflowError) as error:
            if scalar is None:
                raise family_error(cls) from None
            if isinstance(error, errors.WarpError):
                raise
            raise errors.WarpTypeError(
                f"expects what a '{cls.__name__}' stores, but got {shown(number)}"
            ) from None

    @classmethod
    def scalar_import(cls, number):
        """The stored value for a number or scalar.

        Raises:
            WarpTypeError: it is none, which a type whose numbers are stored as they are notices
                when it stores them.
        """
        bits = scalars.BITS.get(cls._wp_scalar_type_)
        if bits:
            return bits[0](
                scalars.as_float(cls, number.value if isinstance(number, scalar_base) else number)
            )
        return number.value if isinstance(number, scalar_base) else number

    def _get(self, index):
        try:
            return self.scalar_export(_raw_get(self, index))
        except IndexError:
            raise self._out_of_range(index) from None
        except TypeError as error:
            if isinstance(error, errors.WarpError):
                raise
            raise self._no_index(index) from None

    def _out_of_range(self, index):
        return errors.WarpIndexError(
            f"index {shown(index)} is out of range for the {self._length_} components of "
            f"'{shown_name(type(self))}'"
        )

    def _no_index(self, key):
        # A list that holds itself has no text.
        spelled = key if isinstance(key, (str, int, float)) or key is None else shown(key)
        return errors.WarpKeyError(
            f"expects an int or slice as index of '{shown_name(type(self))}'",
            code="index-type",
            facts={"spelled": spelled},
        )

    def _indices(self, key) -> range:
        """The indices that a slice selects."""
        try:
            return range(self._length_)[key]
        except (TypeError, ValueError) as problem:
            raise self._bad_slice(problem) from None

    def _bad_slice(self, problem):
        return errors.WarpArgumentError(f"'{shown_name(type(self))}': {problem}")

    def _set(self, index, number):
        try:
            if isinstance(number, str):
                # A conversion to bits would read it.
                raise TypeError
            number = self.scalar_import(number)
            if issubclass(self._wp_scalar_type_, int_base):
                check_integer(self._wp_scalar_type_, number)
            _raw_set(self, index, number)
        except IndexError:
            raise self._out_of_range(index) from None
        except OverflowError:
            raise _too_large(self, number) from None
        except (TypeError, ValueError):
            if not hasattr(index, "__index__") or hasattr(type(index), "shape"):
                raise self._no_index(index) from None
            if self._wp_scalar_type_ is None:
                raise family_error(type(self)) from None
            wanted, given = self._wp_scalar_type_.__name__, shown_name(type(number))
            raise errors.WarpTypeError(
                f"expects a '{wanted}' component for '{shown_name(type(self))}', but got '{given}'",
                code="component-type",
                facts={"wanted": wanted, "given": given},
            ) from None

    def _numbers_of(self, value, count) -> list:
        """The values assigned to `count` components: a number for all of them, or one for each."""
        if is_number(value):
            return [value] * count
        wanted = self._wp_scalar_type_.__name__
        if isinstance(value, str):
            raise errors.WarpTypeError(
                f"expects numbers, but got '{shown_name(type(value))}'",
                code="component-string",
                facts={"wanted": wanted},
            )
        numbers = flatten_numbers(value)
        if len(numbers) == count:
            return numbers
        message = f"expects {count} components to assign, but got {len(numbers)}"
        inner = [item for item in value if isinstance(item, Composite)]
        if inner and not isinstance(value, Composite):
            given = shown_name(type(inner[0]))
            raise errors.WarpTypeError(
                message,
                code="slice-type",
                facts={"wanted": wanted, "given": given},
            )
        raise errors.WarpShapeError(message, code="slice-size")

    def _fill(self, numbers):
        if not self._wp_is_bit_converted_:
            try:
                _raw_set(self, _ALL, numbers)
                return
            except (TypeError, OverflowError):
                pass
        for index, number in enumerate(numbers):
            self._set(index, number)

    def __add__(self, other):
        return _componentwise("add", self, other, lambda a, b: a + b)

    def __sub__(self, other):
        return _componentwise("sub", self, other, lambda a, b: a - b)

    def __mul__(self, other):
        return _scale("mul", self, other, lambda a, b: a * b)

    def __rmul__(self, other):
        return _scale("mul", self, other, lambda a, b: b * a)

    def __truediv__(self, other):
        return _scale("div", self, other, arithmetic.divide)

    def __rtruediv__(self, other):
        return _scale("div", self, other, lambda a, b: arithmetic.divide(b, a))

    def __neg__(self):
        return self._from_numbers(-a for a in scalars_of(self))

    def __pos__(self):
        return self._from_numbers(scalars_of(self))

    def _like(self, result):
        """The result of a builtin, as a value of this class if it is of its type."""
        cls = type(self)
        if type(result) is cls or canonical_class(cls) is not type(result):
            return result
        return cls.from_buffer_copy(result)

    @classmethod
    def _from_numbers(cls, numbers):
        result = cls.__new__(cls)
        result._fill(list(numbers))
        return result


def scalars_of(value):
    """The components of a composite as plain Python numbers."""
    bits = scalars.BITS.get(value._wp_scalar_type_)
    raw = _raw_get(value, _ALL)
    return [bits[1](number) for number in raw] if bits else raw


def flatten_numbers(value, depth=0):
    """Numbers of a scalar, composite, NumPy array or nested sequence, in order.

    Raises:
        TypeError: there is something else among them.
        ValueError: a sequence contains itself.
    """
    if depth > _DEEPEST:
        raise ValueError(
            f"expects numbers nested at most {_DEEPEST} deep, but got a sequence that contains "
            "itself"
        )
    if isinstance(value, Composite):
        return scalars_of(value)
    if isinstance(value, scalar_base):
        return [value.value]
    if hasattr(type(value), "tolist"):
        value = value.tolist()
    if isinstance(value, (int, float)):
        return [value]
    if isinstance(value, str):
        raise _no_numbers(value)
    try:
        # Also through what has elements by their numbers alone, as vectors of USD.
        items = iter(value)
    except TypeError as error:
        if error.__traceback__.tb_next is not None:
            # From the value's own `__iter__`, which says why.
            raise
        raise _no_numbers(value) from None
    numbers = []
    try:
        for item in itertools.islice(items, _MOST_NUMBERS):
            if isinstance(item, (int, float)):
                numbers.append(item)
            else:
                numbers += flatten_numbers(item, depth + 1)
    except KeyError:
        raise _no_numbers(value) from None
    if len(numbers) >= _MOST_NUMBERS:
        raise errors.WarpShapeError(f"expects less than {_MOST_NUMBERS} numbers")
    return numbers


def _no_numbers(value):
    return errors.WarpTypeError(f"expects numbers, but got '{shown_name(type(value))}'")


def is_number(value):
    """True if `value` is one number: Python's, a Warp scalar or a NumPy scalar."""
    return isinstance(value, (int, float, scalar_base)) or (
        hasattr(value, "dtype")
        and getattr(value, "shape", None) == ()
        and hasattr(value, "item")
        and not isinstance(value, type)
    )


def construct_components(self, args):
    """Initialises a composite from nothing, one number for all, or its components."""
    if self._wp_scalar_type_ is None:
        raise family_error(type(self))
    length = self._length_
    if len(args) == 1 and not is_number(args[0]):
        numbers = flatten_numbers(args[0])
        if len(numbers) != length:
            _bad_count(self, len(numbers))
    elif len(args) == 1:
        numbers = list(args) * length
    elif len(args) == length:
        numbers = args
    else:
        _bad_count(self, len(args))
    if issubclass(self._wp_scalar_type_, int_base):
        for number in numbers:
            check_integer(self._wp_scalar_type_, number)
    self._fill(numbers)


def _bad_count(self, count):
    raise errors.WarpShapeError(
        f"expects {self._length_} components for '{shown_name(type(self))}', but got {count}",
        code="component-count",
        facts={"constructor": self._wp_constructor_, "length": self._length_, "count": count},
    )


def canonical_class(cls):
    """The factory-made class that a user's subclass stands for."""
    for base in cls.__mro__:
        if "_native_" in base.__dict__:
            return base
    return cls


def _from_bytes(cls, data):
    return cls.from_buffer_copy(data)


def _componentwise(name, a, b, operation):
    if not isinstance(b, Composite):
        if is_number(b):
            raise operand_error(name, a, b)
        return NotImplemented
    if canonical_class(type(a)) is not canonical_class(type(b)):
        raise operand_error(name, a, b)
    integers = _integer_rounding(a)
    pairs = zip(scalars_of(a), scalars_of(b), strict=True)
    return a._from_numbers([integers(operation(x, y)) for x, y in pairs])


def _scale(name, a, factor, operation):
    scalar = a._wp_scalar_type_
    if isinstance(factor, scalar_base):
        if type(factor) is not scalar:
            raise operand_error(name, a, factor)
        factor = factor.value
    elif hasattr(factor, "dtype") and getattr(factor, "shape", None) == ():
        factor = factor.item()
    if not isinstance(factor, (int, float)):
        if isinstance(factor, Composite):
            raise operand_error(name, a, factor)
        return NotImplemented
    if issubclass(scalar, scalars.int_base) and isinstance(factor, float):
        raise operand_error(name, a, factor)
    if issubclass(scalar, scalars.float_base):
        try:
            factor = scalar.round(float(factor))
        except OverflowError:
            raise _too_large(a, factor) from None
    integers = _integer_rounding(a)
    return a._from_numbers([integers(operation(x, factor)) for x in scalars_of(a)])


def _integer_rounding(a):
    if issubclass(a._wp_scalar_type_, scalars.int_base):
        return a._wp_scalar_type_.round
    return lambda number: number


def _too_large(value, number):
    return errors.WarpOverflowError(
        f"{shown(number)} is too large for the components of '{type(value).__name__}'"
    )


def family_error(cls):
    """The exception for values of a class that is a family of types."""
    return errors.WarpTypeError(
        f"'{cls.__name__}' is a family of types, make a value of one of them, such as "
        "`wp.vec3(...)`, or a type by `wp.types`"
    )


def operand_error(name, a, b):
    """The exception for operands that `name` does not take."""
    # Programs know this error by its words.
    shown = ", ".join(shown_name(type(one)) for one in (a, b))
    problem = errors.WarpTypeError(
        f"Couldn't find a function '{name}' compatible with the arguments '{shown}'"
    )
    if name == "mul" and isinstance(b, Composite) and hasattr(problem, "add_note"):
        problem.add_note("use `wp.cw_mul` or `wp.dot`")
    return problem


above.Composite = Composite
above.flatten_numbers = flatten_numbers
above.is_number = is_number
