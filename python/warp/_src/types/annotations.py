"""Annotations of kernel parameters and struct fields.

`wp.array(dtype=wp.vec3)`, `wp.array2d(dtype=float)` and `wp.array[wp.vec3]` give an `ArrayType`, a
value that compares by element type and rank; `wp.indexedarray` and its like an `IndexedArrayType`.
`resolve` turns any annotation into the canonical form that the front end and the launch use: a
scalar, composite or struct class, or an `ArrayType`. An indexed array is a struct there.
"""

from __future__ import annotations

import sys
import typing

from warp._src import errors
from warp._src.arguments import shown, spelled
from warp._src.types import native
from warp._src.types.native import ArrayType, IndexedArrayType
from warp._src.types.vectors import GenericAnnotation, unwrapped


class Reference:
    """Annotation of a parameter that a function may assign to for its caller."""

    __slots__ = ("dtype",)

    def __init__(self, dtype):
        self.dtype = dtype

    @property
    def value_type(self):
        """The type behind the reference."""
        return self.dtype

    def __eq__(self, other):
        return self.dtype == other.dtype if isinstance(other, Reference) else NotImplemented

    def __hash__(self):
        return hash((Reference, self.dtype))

    def __repr__(self):
        return f"wp.ref[{native.type_repr(self.dtype)}]"


class FixedArrayType:
    """The result of `wp.fixedarray(shape, dtype)`: the type of an array of one thread."""

    __slots__ = ("dtype", "shape")
    _wp_array_annotation_ = True

    def __init__(self, dtype, shape):
        self.dtype = native.canonical(dtype)
        self.shape = tuple(shape) if isinstance(shape, (tuple, list)) else (shape,)
        if shape is None:
            self.shape = ()
        elif not 1 <= len(self.shape) <= 4 or not all(
            isinstance(extent, int) and extent > 0 for extent in self.shape
        ):
            raise ValueError(f"expects 1 to 4 positive extents, but got {spelled(shape)}")

    @property
    def ndim(self):
        return len(self.shape)

    def __eq__(self, other):
        if not isinstance(other, FixedArrayType):
            return NotImplemented
        return self.dtype is other.dtype and self.shape == other.shape

    def __hash__(self):
        return hash((self.dtype, self.shape))

    def __repr__(self):
        return f"fixedarray(shape={self.shape}, dtype={native.type_repr(self.dtype)})"


class fixedarray:
    """Annotates what a `@wp.func` returns: an array that `wp.zeros` made in it.

    Args:
        dtype: type of an element.
        shape: extents, known at compile time.

    Raises:
        TypeError, ValueError: the type or an extent cannot be used.
    """

    _wp_array_ = True

    def __new__(cls, dtype=float, shape=None) -> FixedArrayType:
        return FixedArrayType(dtype, shape)


class ref:
    """`wp.ref[T]`: annotates a parameter of a `@wp.func` that is passed by reference.

    An assignment of the function to it, or to a part of it, changes the caller's variable or the
    element of an array that it has passed. The place is read before the call and written after it,
    without atomics. Derivatives take it into account.

    Example:
        >>> import warp as wp
        >>> @wp.func
        ... def advance(x: wp.ref[float], step: float):
        ...     x += step
    """

    def __class_getitem__(cls, dtype):
        return Reference(dtype)


def address_of(expr):
    """In kernels, the address of an element of an array, or of a part of it.

    As an argument of native code it is also that of a variable: the code gets the address of a copy
    of this one number, which is written back after the call.

    Raises:
        TypeError: outside of kernels.
    """
    raise TypeError("`wp.address_of` can be used in kernels and functions of kernels only")


def from_subscript(params, ndim, made=ArrayType):
    """The type for `wp.array[dtype]` and `wp.array[dtype, typing.Literal[n]]`."""
    if isinstance(params, tuple):
        if ndim is not None and ndim > 1:
            raise errors.WarpTypeError(
                f"expects an element type alone, but got {len(params)} parameters",
                code="array-parameters",
                facts={"ndim": ndim},
            )
        if len(params) != 2:
            raise TypeError(f"expects `wp.array[dtype, ndim]`, but got {len(params)} parameters")
        dtype, rank = params
        ndim = rank if rank is typing.Any else unwrapped(rank)[0]
    else:
        dtype = params
    return made(dtype, ndim)


def evaluate(annotation, namespaces):
    """Evaluates an annotation written as a string, as `from __future__ import annotations` does.

    Args:
        annotation: what `__annotations__` holds.
        namespaces: dictionaries to look names up in, first match wins.
    """
    if not isinstance(annotation, str):
        return annotation
    merged = {}
    for namespace in reversed(namespaces):
        merged.update(namespace)
    return eval(annotation, merged)


def annotations_of(function) -> dict:
    """Annotations of a Python function by name, those written as strings evaluated.

    Example:
        >>> from warp import extend
        >>> def twice(x: "float"):
        ...     return 2.0 * x
        >>> extend.annotations_of(twice)
        {'x': <class 'float'>}
    """
    found = function.__annotations__
    if not any(isinstance(annotation, str) for annotation in found.values()):
        return found
    import inspect

    closure = inspect.getclosurevars(function).nonlocals
    spaces = [closure, function.__globals__]
    return {name: evaluate(value, spaces) for name, value in found.items()}


def check_annotations(owner, declared) -> None:
    """Refuses arrays of derived classes as annotations: their class says nothing of their type.

    Args:
        owner: whose annotations they are, for the message.
        declared: annotations by name.

    Raises:
        TypeError: there is one.
    """
    for name, one in declared.items():
        kind = type(one)
        if native.has_arrays(kind) and not kind.__module__.startswith("warp._src."):
            raise TypeError(
                f"'{name}' of '{owner}' has an array of '{kind.__name__}' as its annotation, use "
                "`wp.array(dtype=...)`"
            )


def resolve(annotation):
    """The canonical form of an annotation.

    Raises:
        TypeError: it names no type that kernels know.
    """
    if isinstance(annotation, IndexedArrayType) and not is_generic(annotation):
        return annotation.record
    if isinstance(annotation, ArrayType) or annotation is typing.Any:
        return annotation
    if hasattr(annotation, "is_open"):
        # A tile's, whose module need not be loaded.
        return annotation
    return native.canonical(annotation)


def caller_namespaces(cls, depth=2):
    """Namespaces that string annotations of a decorated class refer to: locals, globals, module.

    Raises:
        TypeError: it is no class.
    """
    if not isinstance(cls, type):
        raise TypeError(f"wp.struct() expects a class to decorate, but got {shown(cls)}")
    module = sys.modules.get(cls.__module__)
    frame = sys._getframe(depth)
    return [frame.f_locals, frame.f_globals, vars(module) if module else {}]


def is_generic(annotation) -> bool:
    """True if an annotation leaves the type open."""
    if isinstance(annotation, ArrayType):
        if annotation.ndim is typing.Any:
            return True
        annotation = annotation.dtype
    return annotation is typing.Any or isinstance(annotation, (typing.TypeVar, GenericAnnotation))
