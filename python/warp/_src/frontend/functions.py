"""Functions of the user: parameters, overloads, and translation per argument types.

An overload is translated once for each combination of argument types that a kernel calls it with,
so generics (`Any`, `wp.Float`) need nothing of their own: the first call decides. Tuples are passed
as their parts. Functions, types and strings as arguments are part of the combination.
"""

from __future__ import annotations

import collections.abc
import inspect
import typing

from warp._src import errors
from warp._src.frontend import names
from warp._src.frontend.bindings import LocalArray, Record, TileStack, Value, is_table
from warp._src.frontend.indexed import array_of
from warp._src.frontend.source import source_of
from warp._src.kernels.descriptions import Description, Operator
from warp._src.kernels.function import Function
from warp._src.types import annotations, dtypes
from warp._src.types.annotations import FixedArrayType, Reference, annotations_of
from warp._src.types.native import ArrayType, IndexedArrayType

# Annotations of a parameter that takes a function.
_CALLABLES = (typing.Callable, Function)
# `tuple[int, float]`, `type[wp.vec3]`, `Callable[[float], float]`.
_GENERICS = (tuple, type, collections.abc.Callable)
_KINDS = {"Int": ("int",), "Float": ("float",), "Scalar": ("int", "float")}


class Parameter:
    """One parameter: native type, or a generic annotation (None accepts everything)."""

    __slots__ = ("annotation", "by_reference", "default", "may_be_updated", "name", "native")

    def __init__(self, name, annotation, default):
        self.name = name
        self.default = default
        self.native = None
        self.by_reference = isinstance(annotation, Reference)
        if self.by_reference:
            annotation = annotation.dtype
            # An array refers to its elements as it is.
            self.by_reference = not isinstance(annotation, ArrayType)
        self.annotation = annotation
        # An argument for an array may be one of the thread, which is passed by value.
        self.may_be_updated = self.by_reference or isinstance(annotation, ArrayType)
        if not is_generic(annotation):
            self.native = dtypes.native_type(annotations.resolve(annotation))

    def accepts(self, context, binding) -> bool:
        if type(binding) is LocalArray:
            return fits_local(self.annotation, binding)
        if type(binding) is TileStack:
            return self.annotation in (typing.Any, binding.type)
        if self.native is not None:
            if type(binding) is Value:
                return binding.type == self.native
            return type(binding) is not tuple and context.static_type(binding) == self.native
        return fits_generic(context, self.annotation, binding)

    @property
    def type_name(self) -> str:
        if self.native is not None:
            return self.native.python_name
        shown = None
        if typing.get_origin(self.annotation) is type:
            return f"type[{dtypes.type_repr(typing.get_args(self.annotation)[0])}]"
        if typing.get_origin(self.annotation) is None:
            shown = getattr(self.annotation, "__name__", None)
        return (shown or str(self.annotation)).removeprefix("~").removeprefix("typing.")

    def __str__(self):
        return f"{self.name}: {self.type_name}"


def array_hint(annotation) -> str | None:
    """The hint for a parameter that several values are meant for."""
    kind = typing.get_origin(annotation) or annotation
    name = getattr(kind, "__name__", "")
    if name not in ("list", "List", "Sequence", "Iterable", "ndarray", "Tensor"):
        return None
    return "annotate it with `wp.array(dtype=...)`, and pass an array"


def is_generic(annotation) -> bool:
    """True if the type is left to the call."""
    if isinstance(annotation, ArrayType):
        if annotation.ndim is typing.Any:
            return True
        annotation = annotation.dtype
    if annotation is typing.Any or isinstance(annotation, typing.TypeVar):
        return True
    if typing.get_origin(annotation) in _GENERICS or annotation in _CALLABLES:
        return True
    if getattr(annotation, "is_open", False):
        return True
    return type(annotation).__name__ in ("GenericAnnotation", "FunctionAnnotation")


def fits_generic(context, annotation, binding) -> bool:
    """True if a binding is what a generic annotation asks for."""
    if annotation is typing.Any:
        return True
    if type(binding) is Record:
        return isinstance(annotation, type) and isinstance(binding.description, annotation)
    if typing.get_origin(annotation) is tuple:
        return type(binding) is tuple and fits_parts(context, annotation, binding)
    if typing.get_origin(annotation) is type:
        (wanted,) = typing.get_args(annotation)
        return isinstance(binding, type) and dtypes.types_equal(dtypes.canonical(binding), wanted)
    if typing.get_origin(annotation) is not None or annotation in _CALLABLES:
        return type(binding) is not Value and (
            callable(binding) or isinstance(binding, names.BuiltinRef)
        )
    native = binding.type if type(binding) is Value else context.static_type(binding)
    return native is not None and fits_native(annotation, native)


def fits_local(annotation, array) -> bool:
    """True if a parameter takes an array of a thread: it is an array of its rank and element."""
    if annotation is typing.Any:
        return True
    return (
        isinstance(annotation, ArrayType)
        and not isinstance(annotation, IndexedArrayType)
        and annotation.ndim in (typing.Any, len(array.shape))
        and fits_element(annotation.dtype, array.element)
    )


def fits_native(annotation, native) -> bool:
    """True if a type of the compiler is what a generic annotation asks for."""
    if annotation is typing.Any:
        return True
    if isinstance(annotation, ArrayType):
        kind = "struct" if isinstance(annotation, IndexedArrayType) else "array"
        found = array_of(native) if native.kind == kind else None
        return (
            found is not None
            and annotation.ndim in (typing.Any, found.rank)
            and fits_element(annotation.dtype, found.element)
        )
    if isinstance(annotation, typing.TypeVar):
        return fits_element(annotation, native)
    if hasattr(annotation, "is_open"):
        return annotation.fits(native)
    family = getattr(annotation, "family", None)
    if family is None:
        return True
    kind = {dtypes.Vector: "vec", dtypes.Matrix: "mat", dtypes.Quaternion: "quat"}.get(family)
    return native.kind == (kind or "transform") and fits_extents(annotation.params, native)


def fits_parts(context, annotation, parts) -> bool:
    """True if a tuple is what `tuple[float, int]` or `tuple[float, ...]` asks for."""
    wanted = typing.get_args(annotation)
    if len(wanted) == 2 and wanted[1] is Ellipsis:
        wanted = wanted[:1] * len(parts)
    if len(parts) != len(wanted):
        return False
    return all(
        Parameter("", dtype, None).accepts(context, part)
        for dtype, part in zip(wanted, parts, strict=True)
    )


def fits_element(dtype, native) -> bool:
    if dtype is typing.Any:
        return True
    if isinstance(dtype, typing.TypeVar):
        kinds = _KINDS.get(dtype.__name__)
        return kinds is None or native.kind in kinds
    if type(dtype).__name__ == "GenericAnnotation":
        return native.kind in ("vec", "mat", "quat", "transform")
    return dtypes.native_type(dtype) == native


def fits_extents(params, native) -> bool:
    extents = [param for param in params if isinstance(param, int)]
    if extents and extents != native.shape:
        return False
    for param in params:
        if not isinstance(param, int) and not fits_element(param, native.element):
            return False
    return True


NOTHING_DECLARED = (typing.Any, None, type(None))


class Overload:
    """One Python function that kernels can call."""

    def __init__(self, function, source=None):
        self.function = function
        self.source = source or source_of(function)
        self.parameters = self.read_parameters()
        self.result = self.read_result()
        self.generic = sum(parameter.native is None for parameter in self.parameters)
        # Position and name of the parameters by reference.
        self.references = {i: one.name for i, one in enumerate(self.parameters) if one.by_reference}
        # Names whose values a caller may ask for at the end, and the arguments they stand for.
        self.outputs = [one.name for one in self.parameters if one.may_be_updated]

    def read_parameters(self):
        arguments = self.source.tree.args
        for extra, stars in ((arguments.vararg, "*"), (arguments.kwarg, "**")):
            if extra is not None:
                raise errors.WarpCodegenError(
                    f"`{stars}{extra.arg}` is not supported in kernel functions",
                    **self.source.place(extra),
                )
        declared = self.read_annotations()
        parameters = []
        signature = inspect.signature(self.function)
        for argument in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs):
            if argument.arg not in declared:
                raise errors.WarpCodegenKeyError(
                    f"parameter '{argument.arg}' of '{self.function.__name__}' has no annotation",
                    hint=f"write `{argument.arg}: float`, or `typing.Any` for any type",
                    **self.source.place(argument),
                )
            default = signature.parameters[argument.arg].default
            try:
                parameters.append(Parameter(argument.arg, declared[argument.arg], default))
            except TypeError as problem:
                raise errors.WarpCodegenTypeError(
                    f"parameter '{argument.arg}' of '{self.function.__name__}': {problem}",
                    hint=array_hint(declared[argument.arg]),
                    **self.source.place(argument),
                ) from None
        return parameters

    def read_annotations(self):
        try:
            return annotations_of(self.function)
        except Exception as problem:
            raise errors.WarpCodegenTypeError(
                f"annotation of '{self.function.__name__}' cannot be evaluated: {problem}",
                **self.source.place(self.source.tree),
            ) from None

    def read_result(self):
        """Native types of the declared results; None where left open."""
        declared = self.read_annotations().get("return", typing.Any)
        origin = typing.get_origin(declared)
        if origin is tuple:
            return [
                None
                if is_generic(part) or typing.get_origin(part)
                else dtypes.native_type(annotations.resolve(part))
                for part in typing.get_args(declared)
            ]
        if declared in NOTHING_DECLARED or origin is not None or is_generic(declared):
            return None
        if isinstance(declared, FixedArrayType):
            return [LocalArray(declared.shape, dtypes.native_type(declared.dtype))]
        return [dtypes.native_type(annotations.resolve(declared))]

    @property
    def declares_result(self) -> bool:
        """True if it is annotated to return a value, which a kernel cannot."""
        return self.read_annotations().get("return") not in (None, type(None))

    def bind(self, context, arguments, keywords, node):
        """Bindings in the order of the parameters, or the reason why not."""
        if len(arguments) > len(self.parameters):
            return f"takes {len(self.parameters)} arguments, but got {len(arguments)}"
        keywords = dict(keywords)
        bound = list(arguments)
        for position, parameter in enumerate(self.parameters):
            name = parameter.name
            if position < len(arguments):
                if name in keywords:
                    return f"argument '{name}' is given twice"
            elif name in keywords:
                bound.append(keywords.pop(name))
            elif parameter.default is not inspect.Parameter.empty:
                bound.append(context.user_calls.default_value(parameter, node))
            else:
                return f"argument '{name}' is missing"
        if keywords:
            return f"no parameter '{next(iter(keywords))}'"
        for position, (parameter, binding) in enumerate(zip(self.parameters, bound, strict=False)):
            if parameter.native is not None and context.literals_follow:
                bound[position] = binding = context.literal_as(parameter.native, binding, node)
            if not parameter.accepts(context, binding):
                return f"argument '{parameter.name}' does not take '{context.type_name(binding)}'"
        return bound

    def declaration(self, name) -> str:
        """Its parameters behind the name by which users call the function."""
        return f"{name}({', '.join(map(str, self.parameters))})"


class Specialization:
    """A translated function: its symbol and the shape of what it returns.

    arguments: shapes of the arguments. results: types of all values that it returns. updated:
    position and name of each parameter by reference whose new value follows the results.
    """

    __slots__ = ("arguments", "results", "shape", "symbol", "updated")

    def __init__(self, symbol, shape, arguments=(), results=(), updated=()):
        self.updated = updated
        self.symbol = symbol
        self.shape = shape
        self.arguments = arguments
        self.results = results

    def without_residuals(self):
        """The same with the first part of the result alone."""
        first = self.shape[0]
        count = _size(first)
        return Specialization(self.symbol, first, self.arguments, self.results[:count])


def _size(shape) -> int:
    """Values that a shape is made from."""
    if shape is None:
        return 1
    return sum(map(_size, getattr(shape, "parts", shape)))


NOTHING = object()


def overload_of(function) -> Overload:
    """The overload for a Python function, made once."""
    found = function.__dict__.get("_warp_overload")
    if found is None:
        found = function._warp_overload = Overload(function)
    return found


def is_static(binding) -> bool:
    """True if a binding is passed by specialising the callee."""
    kinds = (type, str, names.BuiltinRef, Function, Description, Operator)
    return isinstance(binding, kinds) or is_table(binding)
