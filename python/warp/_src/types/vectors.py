"""Vector, quaternion and transform types: the factories and their behaviour at Python scope."""

from __future__ import annotations

import ctypes
import itertools
import types
import typing

from warp._src import arguments, errors
from warp._src.types import arithmetic, scalars
from warp._src.types.composites import (
    ArrayMeta,
    Composite,
    Products,
    _componentwise,
    canonical_class,
    construct_components,
    flatten_numbers,
    is_number,
    operand_error,
    scalars_of,
)
from warp._src.types.scalars import canonical_scalar, shown_name


class Vector(Composite):
    """Mixin of vectors; `wp.types.vector` makes the classes. Also the generic annotation."""

    __slots__ = ()
    _wp_generic_type_str_ = "vec_t"
    _wp_constructor_ = "vector"

    def __init__(self, *args):
        if args:
            construct_components(self, args)

    def __class_getitem__(cls, params):
        return generic_annotation(cls, params)

    def __getitem__(self, key):
        if isinstance(key, slice):
            try:
                numbers = scalars_of(self)[key]
            except (TypeError, ValueError) as problem:
                raise self._bad_slice(problem) from None
            return vector(len(numbers), self._wp_scalar_type_)._from_numbers(numbers)
        if not hasattr(key, "__index__"):
            raise self._no_index(key)
        return self._get(key)

    def __setitem__(self, key, value):
        if not isinstance(key, slice):
            self._set(key, value)
            return
        indices = self._indices(key)
        numbers = self._numbers_of(value, len(indices))
        for index, number in zip(indices, numbers, strict=True):
            self._set(index, number)

    def __iter__(self):
        return map(self._get, range(self._length_))

    def __mod__(self, other):
        return _componentwise("mod", self, other, arithmetic.remainder)

    def __matmul__(self, other):
        return self.__mul__(other)

    def __mul__(self, other):
        if hasattr(type(other), "_left_multiply"):
            return other._left_multiply(self)
        return Composite.__mul__(self, other)


class Quaternion(Vector):
    """Mixin of quaternions, stored as x, y, z, w."""

    __slots__ = ()
    _wp_generic_type_str_ = "quat_t"
    _wp_constructor_ = "quaternion"

    def __init__(self, *args):
        if len(args) == 2:
            args = (*flatten_numbers(args[0]), args[1])
        if args:
            construct_components(self, args)

    def __mul__(self, other):
        if not isinstance(other, Quaternion):
            return Composite.__mul__(self, other)
        if canonical_class(type(self)) is not canonical_class(type(other)):
            raise operand_error("mul", self, other)
        return self._like(Products.multiply(self, other))


def _check_part(name, part) -> None:
    """Refuses a number as translation or rotation of a transform."""
    if is_number(part):
        given = shown_name(type(part))
        raise errors.WarpTypeError(
            f"transform expects a sequence as '{name}', but got '{given}'",
            code="transform-part",
            facts={"name": name, "given": given},
        )


class Transformation(Vector):
    """Mixin of rigid transforms: a translation `p` and a rotation `q`, seven numbers."""

    __slots__ = ()
    _wp_generic_type_str_ = "transform_t"
    _wp_constructor_ = "transformation"

    def __init__(self, *args, p=None, q=None, **others):
        for name in others:
            raise errors.WarpTypeError(f"got an unexpected keyword argument '{name}'")
        named = [name for name, part in (("p", p), ("q", q)) if part is not None]
        if len(args) > (p is None) and named:
            raise errors.WarpTypeError(f"multiple values for argument '{named[-1]}'")
        if named:
            rest = [] if q is None else [q]
            args = (*(args or ((0, 0, 0) if p is None else p,)), *rest)
        if len(args) == 2 or named:
            for name, part in zip("pq", args, strict=False):
                _check_part(name, part)
        if not args:
            self._set(6, 1)
        elif len(args) == 1 and isinstance(args[0], (tuple, list, Composite)):
            numbers = flatten_numbers(args[0])
            construct_components(self, (numbers if len(numbers) == 7 else [*numbers, 0, 0, 0, 1],))
        elif len(args) == 1 and not is_number(args[0]) and not hasattr(args[0], "__len__"):
            given = shown_name(type(args[0]))
            raise errors.WarpTypeError(
                f"transform expects numbers, but got '{given}'",
                code="transform-number",
                facts={"given": given},
            )
        elif len(args) == 2:
            construct_components(self, ([*flatten_numbers(args[0]), *flatten_numbers(args[1])],))
        else:
            construct_components(self, args)

    @property
    def p(self):
        """The translation."""
        return vector(3, self._wp_scalar_type_)._from_numbers(scalars_of(self)[:3])

    @p.setter
    def p(self, value):
        self[0:3] = value

    @property
    def q(self):
        """The rotation, a quaternion."""
        return quaternion(self._wp_scalar_type_)._from_numbers(scalars_of(self)[3:])

    @q.setter
    def q(self, value):
        self[3:7] = value

    def __mul__(self, other):
        if not isinstance(other, Transformation):
            return Composite.__mul__(self, other)
        if canonical_class(type(self)) is not canonical_class(type(other)):
            raise operand_error("mul", self, other)
        return self._like(Products.multiply(self, other))


class GenericAnnotation:
    """A partly specified type such as `wp.Vector[wp.Float, 3]`, for generic kernels."""

    def __init__(self, family, params):
        self.family = family
        self.params = params

    def __repr__(self):
        return f"{self.family.__name__}{list(self.params)}"


def unwrapped(params) -> tuple:
    """Parameters of a type; `typing.Literal[3]` is how type checkers want an extent.

    Raises:
        TypeError: such a literal has several values, or an extent is not positive.
    """
    found = []
    for one in params if isinstance(params, tuple) else (params,):
        values = typing.get_args(one) if typing.get_origin(one) is typing.Literal else (one,)
        if len(values) != 1:
            raise TypeError(f"Expected a single Literal value as an extent, but got {one}")
        if isinstance(values[0], int) and values[0] < 1:
            raise TypeError(f"an extent has to be a positive integer, but got {values[0]}")
        found += values
    return tuple(found)


def generic_annotation(family, params):
    """`Vector[3, float]` and `Vector[float, 3]` give the type when both are concrete."""
    params = unwrapped(params)
    if not params:
        raise TypeError(f"{family.__name__}[...] expects parameters of a type, but got none")
    if all(isinstance(one, typing.TypeVar) for one in params) and params[-1].__bound__ is int:
        # The parameters of a generic class, for type checkers.
        return types.GenericAlias(family, params)
    if family is Vector and len(params) != 2:
        raise TypeError(
            f"Vector[...] requires 2 parameters, dtype and length, but got {len(params)}"
        )
    if len(params) == 1 and family in (Quaternion, Transformation):
        made = quaternion if family is Quaternion else transformation
        try:
            return made(params[0])
        except TypeError:
            return GenericAnnotation(family, params)
    extents = [p for p in params if isinstance(p, int)]
    dtypes = [p for p in params if not isinstance(p, int)]
    if len(extents) == 1 and len(dtypes) == 1 and family is Vector:
        try:
            return vector(extents[0], dtypes[0])
        except TypeError:
            pass
    return GenericAnnotation(family, params)


def is_open(param) -> bool:
    """True if a parameter of a type is left to the call: `typing.Any`, `wp.Float`."""
    return param is typing.Any or isinstance(param, typing.TypeVar)


def _component(index):
    doc = f"Component {index}, a Python number."
    return property(
        lambda self: self._get(index), lambda self, value: self._set(index, value), doc=doc
    )


class _NoComponent:
    """A component that a short vector lacks; other attributes may be added to instances."""

    __slots__ = ("_name",)

    def __init__(self, name):
        self._name = name

    @property
    def __doc__(self):
        """Hundreds of swizzles have no text of their own until it is read."""
        return (
            f"In kernels the vector of the components {', '.join(self._name)}.\n\n"
            "Raises:\n    AttributeError: outside of kernels, or there are fewer components."
        )

    def __get__(self, owner, cls=None):
        return self if owner is None else self.__set__(owner, None)

    def __set__(self, owner, value):
        raise AttributeError(f"'{shown_name(type(owner))}' object has no attribute '{self._name}'")


for _count in (2, 3, 4):
    for _name in map("".join, itertools.product("xyzw", repeat=_count)):
        # Swizzles are of kernels.
        setattr(Vector, _name, _NoComponent(_name))
_NO_COMPONENTS = {name: _NoComponent(name) for name in "xyzw"}
_COMPONENTS = [_component(index) for index in range(4)]
_cache: dict = {}
# The largest sizes in bytes of 32 bits.
MOST_COMPONENTS = 2**28


def make_composite(name, shown, mixin, length, dtype, attributes):
    """Creates the `ctypes.Array` class of a composite type.

    Args:
        name: that the type has in this package, or None; then it is that of its family.
        shown: the name in messages of a type that has none.
    """
    namespace = {
        "_wp_name_": name or shown,
        "__module__": "warp.types",
        "_length_": length,
        "_type_": dtype._type_,
        "_wp_scalar_type_": dtype,
        "_wp_is_bit_converted_": dtype in scalars.BITS,
        "_wp_generic_type_hint_": mixin,
        **attributes,
    }
    # `warp.types` finds types by the qualified name, for other processes.
    namespace.setdefault("__qualname__", name or shown)
    return ArrayMeta(name or mixin._wp_generic_type_str_, (mixin, ctypes.Array), namespace)


def vector(length=None, dtype=None, *, name=None) -> typing.Any:
    """The vector type of `length` components of scalar type `dtype`.

    Without components it is what an empty slice gives; kernels have no such values.

    Raises:
        ValueError: the length is negative or no integer.
    """
    if not isinstance(length, int) or isinstance(length, bool):
        length, dtype = dtype, length
    if is_open(length) or is_open(dtype):
        return GenericAnnotation(Vector, (length, dtype))
    if not isinstance(length, int) or length < 0:
        got = arguments.shown(length)
        raise ValueError(f"expects a vector length of at least 0, but got {got}")
    if length > MOST_COMPONENTS:
        raise ValueError(f"expects a vector length of at most {MOST_COMPONENTS}, but got {length}")
    dtype = canonical_scalar(dtype)
    key = (Vector, length, dtype)
    if key not in _cache:
        attributes = {
            "__doc__": f"{length} numbers of type {dtype.__name__}.",
            "_shape_": (length,),
            "_wp_type_params_": (length, dtype),
            "_wp_type_args_": {"length": length, "dtype": dtype},
            "_native_": f"!warp.vec<{length} x {dtype._native_}>",
        }
        attributes.update(_NO_COMPONENTS)
        attributes.update(zip("xyzw"[:length], _COMPONENTS[:length], strict=True))
        shown = f"vec{length}{SUFFIX[dtype]}"
        _cache[key] = make_composite(name, shown, Vector, length, dtype, attributes)
    return _cache[key]


def quaternion(dtype=None, *, name=None):
    """The quaternion type of scalar type `dtype`."""
    if is_open(dtype):
        return GenericAnnotation(Quaternion, (dtype,))
    dtype = canonical_scalar(dtype)
    key = (Quaternion, dtype)
    if key not in _cache:
        attributes = {
            "__doc__": f"A quaternion: x, y, z and w, its real part, of type {dtype.__name__}.",
            "_shape_": (4,),
            "_wp_type_params_": (dtype,),
            "_wp_type_args_": {"dtype": dtype},
            "_native_": f"!warp.quat<{_float_native('quaternion', dtype)}>",
            **dict(zip("xyzw", _COMPONENTS, strict=True)),
        }
        _cache[key] = make_composite(name, f"quat{SUFFIX[dtype]}", Quaternion, 4, dtype, attributes)
    return _cache[key]


def transformation(dtype=None, *, name=None):
    """The rigid transform type of scalar type `dtype`."""
    if is_open(dtype):
        return GenericAnnotation(Transformation, (dtype,))
    dtype = canonical_scalar(dtype)
    key = (Transformation, dtype)
    if key not in _cache:
        attributes = {
            "__doc__": f"A translation, then a rotation's quaternion, of type {dtype.__name__}.",
            "_shape_": (7,),
            "_wp_type_params_": (dtype,),
            "_wp_type_args_": {"dtype": dtype},
            "_native_": f"!warp.transform<{_float_native('transformation', dtype)}>",
        }
        shown = f"transform{SUFFIX[dtype]}"
        _cache[key] = make_composite(name, shown, Transformation, 7, dtype, attributes)
    return _cache[key]


def _float_native(what, dtype):
    if dtype not in scalars.FLOAT_TYPES:
        raise TypeError(f"expects a float type for a {what}, but got '{dtype.__name__}'")
    return dtype._native_


SUFFIX = {
    scalars.bool: "bool",
    scalars.int8: "b",
    scalars.uint8: "ub",
    scalars.int16: "s",
    scalars.uint16: "us",
    scalars.int32: "i",
    scalars.uint32: "ui",
    scalars.int64: "l",
    scalars.uint64: "ul",
    scalars.handle: "handle",
    scalars.float16: "h",
    scalars.bfloat16: "bf",
    scalars.float32: "f",
    scalars.float64: "d",
}
