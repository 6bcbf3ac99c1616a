"""`@wp.struct`: records shared by Python and kernels.

A decorated class becomes a `ctypes.Structure` with C layout, so an instance is the bytes that a
kernel gets, and arrays of structs are plain memory. On top of ctypes each field has a `Field`
descriptor that checks what is assigned, says what it expects, and keeps referenced arrays alive
(`struct_fields`).
"""

from __future__ import annotations

import ctypes
import types as python_types
import typing
import warnings

from warp import _native
from warp._src import errors
from warp._src.argument_kinds import DICT, NONE, TEXT, Kind, above
from warp._src.arguments import checked, misfit, spelled
from warp._src.devices.devices import get_device
from warp._src.types import annotations, dtypes
from warp._src.types.composites import flatten_numbers
from warp._src.types.native import ArrayType
from warp._src.types.scalars import ScalarType
from warp._src.types.struct_fields import ArrayDescriptor, Field, FieldMark
from warp._src.version import calling_frame


class _OfClass:
    """An attribute of classes that gives way to a field of the same name."""

    def __init__(self, get):
        self.get = get

    def __get__(self, cls, owner=None):
        return self.get(cls)


class StructType(type(ctypes.Structure)):
    """Metaclass of struct classes; describes the struct."""

    # The parts that an instance is pickled as; `pickling` sets this.
    reduce_instance: typing.ClassVar[typing.Callable]

    @_OfClass
    def key(cls):
        return cls.__name__

    @_OfClass
    def vars(cls):
        """Fields by name, each with `label` and `type`."""
        return {
            name: python_types.SimpleNamespace(
                label=name, type=getattr(dtype, "_wp_annotation_", dtype)
            )
            for name, dtype in cls._wp_fields_.items()
        }

    @_OfClass
    def ctype(cls):
        return cls

    @_OfClass
    def cls(cls):
        return cls

    @property
    def native_name(cls):
        return cls._native_

    @property
    def __numpy_dtype__(cls):
        import numpy

        return numpy.dtype(cls.numpy_dtype())

    def __setattr__(cls, name, value):
        # Picklers that send a class as its attributes set them on a class of this name.
        if isinstance(value, FieldMark):
            return
        if "_wp_fields_" in cls.__dict__ and name in cls._wp_fields_:
            raise AttributeError(f"field '{name}' of struct '{cls.__name__}' cannot be replaced")
        super().__setattr__(name, value)
        if name == "_wp_fields_":
            for field, dtype in value.items():
                raw = cls.__dict__[field]
                super().__setattr__(field, Field(cls.__name__, field, dtype, raw))
            dtypes.register(cls)


class StructInstance(ctypes.Structure):
    """Base of struct classes. `Name(field=value, ...)`; fields not given are zero."""

    # The base has none.
    _wp_fields_: typing.ClassVar[dict] = {}
    # Instances are keys of `Tape.gradients`, each for itself.
    __hash__ = object.__hash__

    def __init__(self, **fields):
        super().__init__()
        for name, value in fields.items():
            setattr(self, name, value)

    @property
    def _held(self):
        """Objects behind array and struct fields, by field name."""
        held = self.__dict__.get("_objects_held")
        if held is None:
            held = self.__dict__["_objects_held"] = {}
        return held

    @property
    def _given(self):
        """The values of fields that show them as something else, by name, with their bytes."""
        given = self.__dict__.get("_objects_given")
        if given is None:
            given = self.__dict__["_objects_given"] = {}
        return given

    def __setattr__(self, name, value):
        if name not in self._wp_fields_:
            raise AttributeError(
                f"struct '{type(self).__name__}' has no field '{name}', it has: "
                + ", ".join(self._wp_fields_)
            )
        super().__setattr__(name, value)

    @checked()
    def assign(self, value):
        """Copies all fields from another instance of the same struct, and returns self.

        Raises:
            TypeError: `value` is of another type.
        """
        if type(value) is not type(self):
            raise TypeError(
                f"expects a '{type(self).__name__}' to assign, but got '{type(value).__name__}'"
            )
        for name in self._wp_fields_:
            StructInstance.__setattr__(self, name, getattr(value, name))
        return self

    @classmethod
    def _accepted(cls, value):
        """The instance that a value assigned to a field of this type stands for, or None."""
        return value if type(value) is cls else None

    def _shown(self):
        """The value of a field of this type for users."""
        return self

    def _inner(self, name):
        """The struct in a field."""
        return type(self).__dict__[name].inner(self)

    def refresh(self) -> None:
        """Looks again at the arrays in fields, whose gradients are going to be used.

        Raises:
            TypeError: it is called with what is no struct.
        """
        if not isinstance(self, StructInstance):
            raise misfit("refresh", "self", _STRUCT, self)
        for name, dtype in self._wp_fields_.items():
            if dtypes.is_struct(dtype):
                self._inner(name).refresh()
            elif isinstance(dtype, ArrayType) and (held := getattr(self, name)) is not None:
                gradient = held.grad
                address = (gradient.ptr or 0) if gradient is not None else 0
                descriptor = type(self).__dict__[name].raw.__get__(self)
                if descriptor.grad != address:
                    descriptor.grad = address

    @checked()
    def to(self, device):
        """Copy of the struct whose arrays live on `device`.

        Raises:
            ValueError: there is no such device.
        """
        copy = type(self)()
        for name, dtype in self._wp_fields_.items():
            value = getattr(self, name)
            if name in self._given and value is not None and value.device == get_device(device):
                pass
            elif dtypes.is_struct(dtype):
                value = self._inner(name).to(device)
            elif isinstance(dtype, ArrayType) and value is not None:
                value = value.to(device)
            StructInstance.__setattr__(copy, name, value)
        return copy

    @classmethod
    def numpy_dtype(cls):
        """Description of the layout that `numpy.dtype` accepts."""
        formats = [_numpy_format(dtype) for dtype in cls._wp_fields_.values()]
        return {
            "names": list(cls._wp_fields_),
            "formats": formats,
            "offsets": [cls.__dict__[name].offset for name in cls._wp_fields_],
            "itemsize": ctypes.sizeof(cls),
        }

    @checked()
    def numpy_value(self):
        """The fields as a NumPy record."""
        import numpy

        self.refresh()
        return numpy.frombuffer(bytes(self), dtype=type(self).numpy_dtype())[0]

    def arrays(self):
        """All arrays held by the struct and the structs in it."""
        for name, dtype in self._wp_fields_.items():
            if dtypes.is_struct(dtype):
                yield from self._inner(name).arrays()
            elif isinstance(dtype, ArrayType) and getattr(self, name) is not None:
                yield getattr(self, name)

    @classmethod
    def from_ptr(cls, ptr):
        """Copies an instance stored at an address of host memory; array fields become None.

        Raises:
            RuntimeError: the address is zero.
        """
        if not ptr:
            raise RuntimeError("expects a valid address, but got a null pointer")
        result = cls()
        ctypes.memmove(ctypes.addressof(result), ptr, ctypes.sizeof(cls))
        return result

    def __ctype__(self):
        return self

    def __reduce_ex__(self, protocol):
        return StructType.reduce_instance(self)

    def __copy__(self):
        result = type(self).from_buffer_copy(self)
        self._share(result)
        return result

    def _share(self, other) -> None:
        """Lets an instance with the same bytes hold the same arrays."""
        for name, held in self.__dict__.get("_objects_held", {}).items():
            if isinstance(held, StructInstance):
                held._share(other._inner(name))
            else:
                other._held[name] = held
        if "_objects_given" in self.__dict__:
            other._given.update(self._given)

    def __repr__(self):
        lines = "".join(
            f"\t{name}={getattr(self, name)!r},\n".replace("\n\t", "\n\t\t").replace("\n)", "\n\t)")
            for name in self._wp_fields_
        )
        return f"{type(self).__name__}(\n{lines})"


_STRUCT = Kind("a struct (`@wp.struct`)", lambda value: isinstance(value, StructInstance))


def struct(c=None, *, module=None) -> typing.Any:
    """Makes a struct type from a class with annotated fields.

    Fields are scalars, vectors, matrices, quaternions, transforms, arrays and other structs. The
    layout is that of C. Fields start at zero; a default that says otherwise is not used, which a
    warning tells. Use the class to make instances, as an annotation and as `dtype` of arrays. Its
    methods and properties are for Python, not for kernels; an `__init__` is not called. Kernels
    take `wp.func` functions, constants and types from a value as from the class: `p.volume(p.r)`.

    Example:
        >>> import warp as wp
        >>> @wp.struct
        ... class Particle:
        ...     position: wp.vec3
        ...     mass: float
        >>> p = Particle()
        >>> p.mass = 2.0

    Raises:
        TypeError: the class has bases or a field of an unknown type.
    """
    if c is None:
        return lambda decorated: _make_struct(decorated, annotations.caller_namespaces(decorated))
    return _make_struct(c, annotations.caller_namespaces(c))


@checked(name=TEXT, fields=DICT, module=TEXT | NONE)
def struct_from_fields(
    name: str, fields: typing.Mapping[str, typing.Any], *, module: str | None = None
) -> type:
    """Makes a struct type from names and types, as `wp.struct` does from a class.

    Args:
        name: of the struct, in messages and in compiled code.
        fields: type of each field: scalars, vectors, matrices, quaternions, transforms, arrays and
            other structs.
        module: name of the module that the struct belongs to, by default the caller's.

    Raises:
        TypeError: a field has an unknown type.
        ValueError: a name is no identifier.

    Example:
        >>> import warp as wp
        >>> from warp import extend
        >>> Sample = extend.struct_from_fields("Sample", {"x": wp.vec3, "weight": float})
        >>> sample = Sample()
        >>> sample.weight = 0.5
        >>> sample.x
        vec3f([0.0, 0.0, 0.0])
    """
    for one in (name, *fields):
        if not isinstance(one, str) or not one.isidentifier():
            raise ValueError(f"struct_from_fields: {spelled(one)} is no identifier")
    home = module or calling_frame().f_globals.get("__name__", "__main__")
    cls = type(name, (), {"__annotations__": dict(fields), "__module__": home})
    return _make_struct(cls, [])


def _make_struct(cls, namespaces):
    import inspect

    name = cls.__name__
    if cls.__bases__ != (object,):
        bases = ", ".join(base.__name__ for base in cls.__bases__)
        raise errors.WarpTypeError(
            f"struct '{name}' cannot inherit from '{bases}'",
            code="struct-bases",
        )
    declared = inspect.get_annotations(cls)
    annotations.check_annotations(name, declared)
    for attribute, value in cls.__dict__.items():
        if attribute in declared and not _is_zero(value):
            warnings.warn(
                f"the default of field '{attribute}' of struct '{name}' is not used, fields start "
                "at zero: assign it after making the struct",
                stacklevel=3,
            )
    fields = {
        field: _field_type(name, field, annotation, [*namespaces, {name: None}])
        for field, annotation in declared.items()
    }
    for field, dtype in fields.items():
        if getattr(dtype, "_wp_absent_", False):
            # The module that declares it can be imported; making an instance says what is missing.
            return dtype.struct_with(name, field)
    about = {name: getattr(cls, name) for name in ("__module__", "__qualname__", "__doc__")}
    return make_struct(name, fields, StructInstance, {**_members(cls, declared), **about})


def _members(cls, declared) -> dict:
    """Attributes: methods and properties for Python, functions and constants for kernels, too."""
    return {
        name: value
        for name, value in cls.__dict__.items()
        if name not in declared
        and name not in _MADE_HERE
        and not name.startswith(("_fields_", "_wp_", "_native_"))
        and (not name.startswith("__") or callable(value))
    }


def _is_zero(value) -> bool:
    try:
        return not any(flatten_numbers(value))
    except TypeError:
        return value is None


def make_struct(name, fields, base, attributes):
    """A struct class of this name, with types by field."""
    namespace = {
        **attributes,
        "_fields_": [(field, _ctype(dtype)) for field, dtype in fields.items()],
        "_wp_struct_": True,
        "_native_": _spelled(name, fields),
    }
    made = StructType(name, (base,), namespace)
    made._wp_fields_ = fields
    return made


def _spelled(name, fields) -> str:
    """A struct's type as the compiler writes it."""
    types = [dtypes.native_text(dtype) for dtype in fields.values()]
    is_plain = "".join((name, *fields)).isascii()
    names = fields if is_plain else [f'"{field}"' for field in fields]
    parts = ", ".join(f"{field}: {dtype}" for field, dtype in zip(names, types, strict=True))
    text = f'!warp.struct<"{name}", {{{parts}}}>'
    # Names that are not ASCII are written in bytes.
    return text if is_plain else str(_native.Type.parse(text))


def _field_type(struct_name, field, annotation, namespaces):
    place = f"field '{field}' of struct '{struct_name}'"
    if field in _RESERVED:
        raise TypeError(f"{place}: the name is taken, choose another")
    try:
        dtype = annotations.evaluate(annotation, namespaces)
        if getattr(dtype, "_wp_absent_", False):
            return dtype
        if isinstance(dtype, ArrayType) and dtype.ndim is typing.Any:
            raise TypeError(f"'{dtype!r}' leaves the number of dimensions open, say which")
        dtype = annotations.resolve(dtype)
    except (TypeError, NameError) as error:
        raise TypeError(f"{place}: its annotation {error}") from None
    if dtype is typing.Any or (isinstance(dtype, ArrayType) and dtype.dtype is typing.Any):
        raise TypeError(f"{place} expects a concrete type, but got 'Any'")
    return dtype


# The code that a class cannot hold itself: instances are memory with checked fields.
_MADE_HERE = {
    *("__init__", "__new__", "__setattr__", "__delattr__", "__getattribute__"),
    *("__dict__", "__weakref__", "__slots__"),
}
_RESERVED = {name for name in dir(StructInstance) if not name.startswith("__")}


def _ctype(dtype):
    return ArrayDescriptor if isinstance(dtype, ArrayType) else dtypes.type_ctype(dtype)


def _numpy_format(dtype):
    if isinstance(dtype, ArrayType):
        return ArrayDescriptor.numpy_format
    if dtypes.is_struct(dtype):
        return dtype.numpy_dtype()
    if isinstance(dtype, ScalarType):
        return dtype._element_.str
    number = dtype._wp_scalar_type_._element_.str
    shape = dtype._shape_
    return f"{shape[0]}{number}" if len(shape) == 1 else f"{shape}{number}"


above.StructInstance = StructInstance
