"""`@wp.kernel(module="unique")`: a module of its own for each kernel, one kernel for equal ones.

Factories make the same kernel again and again. Two are the same if their text, what it captures and
their options are: then the first one is given, with its compiled code. Captured values count by
value where that is cheap to see (numbers, strings, functions by their own text and captures) and by
identity where it cannot change (classes, modules, builtins). A kernel that captures anything else
is never given twice.
"""

from __future__ import annotations

import enum
import functools
import itertools
import types
import weakref

from warp._src import errors
from warp._src.kernels import modules, texts
from warp._src.kernels.function import Function
from warp._src.language.builtins import Builtin
from warp._src.types.composites import Composite
from warp._src.types.native import ArrayType
from warp._src.types.scalars import scalar_base

_known: weakref.WeakValueDictionary = weakref.WeakValueDictionary()
_numbers = itertools.count(1)
_VALUES = (type(None), bool, int, float, complex, str, bytes)
_FIXED = (types.BuiltinFunctionType, types.MethodDescriptorType, Builtin)


_NO_NAMES: frozenset = frozenset()


class _UnknownError(Exception):
    """A captured value that may change unseen."""


class _Same:
    """Something that equals itself alone."""

    __slots__ = ("held",)

    def __init__(self, held):
        self.held = held

    def __eq__(self, other):
        return type(other) is _Same and self.held is other.held

    def __hash__(self):
        return id(self.held)


def unique(make, func, name, options, module_options):
    """The kernel of a function in a module of its own; one made before, if it is the same.

    Args:
        make: called as `make(func, name, module, options)` for a new one.
    """
    key = _key(func, name, options, module_options)
    found = None if key is None else _known.get(key)
    # Its captured values may have changed before it was translated.
    if found is not None and _key(found.func, name, options, module_options) == key:
        return found
    module = modules.make_unique(func.__module__, name or func.__name__, next(_numbers))
    module.options.update(module_options)
    made = make(func, name, module, options)
    if key is not None:
        made.unique_key = key
        _known[key] = made
    return made


def check(kernel) -> None:
    """Called when a kernel is translated: lets go of one whose captures are others by now."""
    key = kernel.unique_key
    if key is not None and _token(kernel.func) != key[0]:
        _known.pop(key, None)
        kernel.unique_key = None


def _token(func):
    """The identity of a function, or None where it captures values that may change unseen."""
    try:
        return _function(func, set())
    except (_UnknownError, errors.WarpCodegenError):
        return None


def _key(func, name, options, module_options):
    token = _token(func)
    if token is None:
        return None
    try:
        return (
            token,
            name,
            _value(options, _NO_NAMES, set()),
            _value(module_options, _NO_NAMES, set()),
        )
    except _UnknownError:
        return None


def _function(func, active) -> tuple:
    """The identity of a Python function: its text and its captured values."""
    code = func.__code__
    if code in active:
        return ("again", code.co_name)
    active = {*active, code}
    names = _names(code)
    cells = func.__closure__ or ()
    captured = {}
    for name, cell in zip(code.co_freevars, cells, strict=True):
        try:
            captured[name] = cell.cell_contents
        except ValueError:
            raise _UnknownError from None
    declared = []
    for name, annotation in func.__annotations__.items():
        if isinstance(annotation, str):
            names = names | _names_of_text(annotation)
        else:
            declared.append((name, _value(annotation, names, active)))
    for name in names:
        if name not in captured and name in func.__globals__:
            captured[name] = func.__globals__[name]
    return (
        func.__module__,
        func.__qualname__,
        texts.block_of(func).lines,
        tuple(func.__annotations__),
        tuple(declared),
        _value(func.__defaults__, names, active),
        tuple((name, _value(captured[name], names, active)) for name in sorted(captured)),
    )


# By code object.
_known_names = texts.ByCode()


def _names(code) -> frozenset:
    """Global names and attributes that a code object and those in it use."""
    found = _known_names.get(code)
    if found is None:
        inner = [const for const in code.co_consts if isinstance(const, types.CodeType)]
        found = frozenset(code.co_names).union(*map(_names, inner))
        _known_names[code] = found
    return found


@functools.lru_cache(1024)
def _names_of_text(annotation) -> frozenset:
    return _names(compile(annotation, "<annotation>", "eval"))


def _value(value, names, active):
    """The part of a key for a captured value."""
    kind = type(value)
    if kind in _VALUES:
        return kind, repr(value)
    part = _PARTS.get(kind)
    if part is not None:
        return part(value, names, active)
    if isinstance(value, (tuple, list)):
        return kind.__name__, tuple(_value(one, names, active) for one in value)
    if kind is dict:
        pairs = value.items()
        return "dict", tuple((_value(a, names, active), _value(b, names, active)) for a, b in pairs)
    if isinstance(value, enum.Enum):
        return _Same(kind), value.name
    if isinstance(value, _FIXED) or (hasattr(kind, "__get__") and kind is not types.FunctionType):
        return _Same(value)
    if isinstance(value, (types.ModuleType, type)):
        return _Same(value), _attributes(value, names, active)
    if isinstance(value, Function):
        return _device_function(value, active)
    if isinstance(value, ArrayType):
        return _array_type(value, names, active)
    if isinstance(value, scalar_base):
        return _Same(kind), repr(value.value)
    if isinstance(value, Composite):
        return _Same(kind), tuple(repr(value._get(i)) for i in range(value._length_))
    raise _UnknownError


def _attributes(owner, names, active):
    """The attributes of a module or class that the text may name."""
    if getattr(owner, "__name__", "").partition(".")[0] == "warp" or owner in active:
        return ()
    active = {*active, owner}
    held = vars(owner)
    used = sorted(names & held.keys())
    return tuple([(name, _value(held[name], names, active)) for name in used])


def _array_type(value, names, active):
    return type(value).__name__, value.ndim, _value(value.dtype, names, active)


def _device_function(function, active):
    if function.has_derivative or function.__class__ is not Function:
        return _Same(function)
    return "func", tuple(_function(one, active) for one in function.overloads)


# Functions by the exact type of a value, for the most frequent types: `_value` asks them before it
# tests for others, and they give the same.
_PARTS = {
    types.FunctionType: lambda value, names, active: _function(value, active),
    types.ModuleType: lambda value, names, active: (
        _Same(value),
        _attributes(value, names, active),
    ),
    type: lambda value, names, active: (_Same(value), _attributes(value, names, active)),
    Function: lambda value, names, active: _device_function(value, active),
    ArrayType: _array_type,
}
