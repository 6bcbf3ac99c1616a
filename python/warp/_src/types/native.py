"""Types in Python and in the compiler: which one stands for which, and the types of arrays.

`canonical(dtype)` maps Python's own types and user subclasses to the one class that stands for a
type; `native_type` and `dtype_of` translate to and from the types of the compiler.
"""

from __future__ import annotations

import sys
import typing
import weakref

from warp import _native
from warp._src import errors
from warp._src.argument_kinds import TYPE, above
from warp._src.arguments import checked, shown, spelled
from warp._src.types import scalars
from warp._src.types.composites import Composite, canonical_class
from warp._src.types.matrices import matrix
from warp._src.types.scalars import PYTHON_TYPES, SCALAR_TYPES, scalar_base, shown_name
from warp._src.types.vectors import GenericAnnotation, quaternion, transformation, vector


def canonical(dtype):
    """The one class that stands for `dtype`.

    Raises:
        TypeError: `dtype` is not a scalar, composite or struct type.

    Example:
        >>> import warp as wp
        >>> wp.types.canonical(float) is wp.float32
        True
    """
    found = PYTHON_TYPES.get(dtype, dtype) if isinstance(dtype, type) else dtype
    if isinstance(found, type):
        if "_native_" in found.__dict__:
            return found
        if issubclass(found, (Composite, scalar_base)) and hasattr(found, "_native_"):
            return canonical_class(found)
    raise TypeError(
        f"expects a scalar, vector, matrix or struct type, but got {scalars.described(dtype)}"
    )


_native_types: dict = {}
_dtypes: dict = {}


# Classes of structs by native type, of which several may have the same.
_structs: dict = {}


@checked(dtype=TYPE)
def register(dtype) -> None:
    """Makes `dtype_of` find `dtype` by the text of its native type."""
    _dtypes[native_text(dtype)] = dtype
    if is_struct(dtype):
        _structs.setdefault(dtype._native_, weakref.WeakSet()).add(dtype)


def classes_of(native) -> list:
    """The struct classes that share a type of the compiler."""
    return list(_structs.get(str(native), ()))


def members_of(cls) -> dict:
    """The attributes of a struct class that are no fields, by name."""
    return {
        name: value
        for name, value in vars(cls).items()
        if name not in cls._wp_fields_
        and not name.startswith(("_fields_", "_wp_", "_native_", "__"))
    }


def native_text(dtype) -> str:
    """The compiler's spelling of a type: `f32`, `!warp.vec<3 x f32>`, `!warp.array<1 x f32>`."""
    text = getattr(dtype, "_native_", None)
    if text is not None and not isinstance(text, property):
        return text
    return canonical(dtype)._native_


def native_type(dtype):
    """The compiler's type for a scalar, composite, struct or array type.

    Raises:
        TypeError: it is none.
    """
    try:
        found = _native_types.get(dtype)
    except TypeError:
        # An object without a hash is no type: this says so.
        canonical(dtype)
        raise
    if found is None:
        found = _native_types[dtype] = _native.Type.parse(native_text(dtype))
    return found


def dtype_of(native):
    """The Python type for a type of the compiler (or its text).

    Raises:
        TypeError: there is none.
    """
    try:
        text = str(native)
    except RecursionError:
        raise TypeError(f"expects a type of the compiler, but got {shown(native)}") from None
    found = _dtypes.get(text)
    if found is None:
        found = _dtypes[text] = _parse(text)
    return found


def _parse(text: str):
    for dtype in (scalars.bool, *SCALAR_TYPES):
        if dtype._native_ == text:
            return dtype
    family, _, rest = text.partition("<")
    rest = rest[:-1]
    if family == "!warp.array":
        rank, _, element = rest.partition(" x ")
        return ArrayType(dtype_of(element), int(rank))
    if family == "!warp.vec":
        length, _, element = rest.partition(" x ")
        return vector(int(length), dtype_of(element))
    if family == "!warp.mat":
        shape, _, element = rest.partition(" x ")
        return matrix(tuple(map(int, shape.split("x"))), dtype_of(element))
    if family == "!warp.quat":
        return quaternion(dtype_of(rest))
    if family == "!warp.transform":
        return transformation(dtype_of(rest))
    raise TypeError(f"no Python type for '{text}'")


def has_arrays(kind) -> bool:
    """True if a class is one of arrays, indexed or not."""
    return isinstance(kind, type) and hasattr(kind, "_wp_array_")


def is_struct(dtype) -> bool:
    return getattr(dtype, "_wp_struct_", False) is True


def type_repr(t) -> str:
    """Short name of a type, as in messages.

    Example:
        >>> import warp as wp
        >>> wp.types.type_repr(wp.vec3), wp.types.type_repr(int)
        ('vec3f', 'int32')
    """
    if isinstance(t, type):
        return shown_name(PYTHON_TYPES.get(t, t))
    # An annotation of an array takes itself for one.
    return t.described() if issubclass(type(t), ArrayType) else spelled(t)


def types_equal(a, b) -> bool:
    """True if two types or annotations mean the same.

    Example:
        >>> import warp as wp
        >>> wp.types.types_equal(wp.vec3, wp.types.vector(3, float))
        True
    """
    try:
        return native_text(a) == native_text(b)
    except TypeError:
        pass
    try:
        return a is b or (a == b) is True
    except Exception:
        # Arrays of NumPy cannot be compared with all others.
        return False


def _element_type(dtype):
    # A missing type is named in annotations, and refused when it is used.
    if isinstance(dtype, GenericAnnotation) or getattr(dtype, "_wp_absent_", False):
        return dtype
    try:
        return canonical(dtype)
    except TypeError as error:
        raise TypeError(f"cannot make an array of this element type: {error}") from None


def _written(dtype) -> str:
    """An element type as programs write it in annotations."""
    if not isinstance(dtype, type) or not issubclass(dtype, (Composite, scalar_base)):
        return getattr(dtype, "__name__", None) or type_repr(dtype)
    name = shown_name(dtype)
    if getattr(sys.modules.get("warp"), name, None) is dtype:
        return f"wp.{name}"
    scalar = _written(dtype._wp_scalar_type_)
    kind = native_type(dtype).kind
    if kind == "vec":
        return f"wp.types.vector(length={dtype._length_}, dtype={scalar})"
    if kind == "mat":
        return f"wp.types.matrix(shape={dtype._shape_}, dtype={scalar})"
    family = "quaternion" if kind == "quat" else "transformation"
    return f"wp.types.{family}(dtype={scalar})"


def _union(one, other):
    try:
        return typing.Union[one, other]  # noqa: UP007
    except Exception:
        # Not a type: Python says that there is no `|` of the two.
        return NotImplemented


class ArrayType:
    """Type of an array: `dtype` (a class, or `typing.Any`) and `ndim` (or `typing.Any`).

    Programs put attributes of their own on annotations, such as the extents they mean by `shape`.
    """

    _wp_array_annotation_ = True
    # The descriptor of an array for kernels; `struct_fields`, which has it, sets this.
    make_descriptor: typing.ClassVar[typing.Callable]
    # `wp.array`; `arrays.array`, which has it, sets this.
    array_class: typing.ClassVar[type]

    @property
    def __class__(self):
        """`isinstance` takes the annotation of an array for an array, as in NVIDIA Warp."""
        return self.array_class if type(self) is ArrayType else type(self)

    def __getattr__(self, name):
        if name == "shape":
            return (0,) * (1 if self.ndim is typing.Any else self.ndim)
        if name == "vars":
            # Attributes by which packages find the members of an array: none are fields of a
            # struct.
            self.vars = {}
            return self.vars
        if name == "memory_kind" and type(self) is ArrayType:
            return self.array_class.memory_kind.fget(self)
        raise AttributeError(f"an annotation of an array has no attribute '{name}'")

    def __init__(self, dtype, ndim=1):
        if ndim is not typing.Any and not (isinstance(ndim, int) and 1 <= ndim <= 4):
            spelled = repr(ndim) if isinstance(ndim, (int, str)) else shown(ndim)
            raise errors.WarpShapeError(
                f"expects an array of 1 to 4 dimensions, but got {spelled}",
                code="array-rank",
                facts={"spelled": spelled},
            )
        if dtype is None:
            dtype = typing.Any
        if dtype is not typing.Any and not isinstance(dtype, typing.TypeVar):
            dtype = _element_type(dtype)
        self.dtype = dtype
        self.ndim = ndim

    @property
    def _native_(self):
        return f"!warp.array<{self.ndim} x {native_text(self.dtype)}>"

    def __reduce__(self):
        # Pickle by itself asks for `__class__`.
        return type(self), (self.dtype, self.ndim), vars(self)

    def __eq__(self, other):
        if type(self) is not type(other):
            return NotImplemented
        return self.dtype is other.dtype and self.ndim == other.ndim

    def __hash__(self):
        return hash((self.dtype, self.ndim))

    def described(self) -> str:
        """The name in messages, as the compiler writes it."""
        if self.ndim is typing.Any:
            return f"array(dtype={type_repr(self.dtype)}, ndim=Any)"
        suffix = "" if self.ndim == 1 else f"{self.ndim}d"
        return f"array{suffix}(dtype={type_repr(self.dtype)})"

    def __repr__(self):
        if self.ndim is typing.Any:
            return f"wp.array[{_written(self.dtype)}, Any]"
        suffix = "" if self.ndim == 1 else f"{self.ndim}d"
        return f"wp.array{suffix}[{_written(self.dtype)}]"

    def __or__(self, other):
        return _union(self, other)

    def __ror__(self, other):
        return _union(other, self)

    def __call__(self, *args, **kwargs):
        raise TypeError(f"'{self!r}' is an annotation, use `wp.array(data, ...)` to make an array")

    # Nothing is freed: an annotation, also one by `array.__new__(array)`, has no memory. A function
    # of Python would lose an interrupt (Ctrl-C) that arrives in it.
    __del__ = object.__init__

    def __ctype__(self):
        """The descriptor of no array."""
        return self.make_descriptor()


# Packages tell annotations from arrays by this name.
ArrayType.__name__ = "_ArrayAnnotation"


class IndexedArrayType(ArrayType):
    """Type of an indexed array: `dtype` and `ndim`."""

    # Makes the struct for an element type and a rank; `arrays.indexed`, which has it, sets this.
    make_record: typing.ClassVar[typing.Callable]

    @property
    def _native_(self):
        return self.record._native_

    @property
    def record(self):
        """The struct that kernels know it as."""
        return self.make_record(self.dtype, self.ndim)

    # The name that programs write.
    shown = "indexedarray"

    def described(self):
        return "indexed" + super().described()

    def __repr__(self):
        rank = "" if self.ndim == 1 else f", Literal[{self.ndim}]"
        rank = ", Any" if self.ndim is typing.Any else rank
        return f"wp.{self.shown}[{_written(self.dtype)}{rank}]"

    def __call__(self, *args, **kwargs):
        raise TypeError(f"'{self!r}' is an annotation, use `wp.indexedarray(data, indices)`")


above.canonical = canonical
