"""Names: what a free name refers to, and what types are called in messages."""

from __future__ import annotations

import ast
import builtins
import difflib

from warp import _native
from warp._src import errors
from warp._src.language import namespace
from warp._src.language.public import library_function
from warp._src.types import dtypes

# Python's own functions and types that mean something in a kernel.
PYTHON_NAMES = frozenset(
    (
        *("abs", "bool", "float", "int", "len", "max", "min", "pow", "print", "range"),
        *("reversed", "round", "slice", "tuple", "type", "True", "False"),
    )
)
# Functions of `math` and `numpy` whose counterpart has another name.
MATH_NAMES = {
    "absolute": "abs",
    "arccos": "acos",
    "arcsin": "asin",
    "arctan": "atan",
    "arctan2": "atan2",
    "fabs": "abs",
    "fmod": "mod",
    "fmax": "max",
    "fmin": "min",
    "maximum": "max",
    "minimum": "min",
    "power": "pow",
    "hypot": None,
}
# Builtins that the translator expands itself; `translator` fills in their names.
SPECIAL_BUILTINS: set[str] = set()


class BuiltinRef:
    """A builtin of the registry, named in a kernel."""

    __slots__ = ("name",)

    def __init__(self, name):
        self.name = name


def literal_name(binding) -> str:
    """The type name of a compile-time binding."""
    kind = type(binding)
    if kind is bool:
        return "bool"
    if kind is int:
        return "int32"
    if kind is float:
        return "float32"
    return describe(binding)


def describe(value) -> str:
    """A short phrase for a Python object."""
    if isinstance(value, BuiltinRef):
        return f"the builtin '{value.name}'"
    if value is None:
        return "'None'"
    if isinstance(value, str):
        return "a string"
    if isinstance(value, type):
        return f"the type '{dtypes.type_repr(value)}'"
    if callable(value) and hasattr(value, "__name__"):
        return f"the function '{value.__name__}'"
    name = dtypes.type_repr(type(value))
    return f"{'an' if name[0] in 'aeiou' else 'a'} '{name}'"


def resolve(context, name, node):
    """The Python object a free name refers to: closure, global, builtin."""
    function = context.function
    free = function.__code__.co_freevars
    if name in free:
        try:
            return function.__closure__[free.index(name)].cell_contents
        except ValueError:
            raise context.error(
                node,
                f"'{name}' has no value yet in the enclosing function",
                kind=errors.WarpCodegenKeyError,
            ) from None
    space = function.__globals__
    if name in space:
        return space[name]
    if name in PYTHON_NAMES:
        return getattr(builtins, name)
    if name in SPECIAL_BUILTINS or _native.Builder.has_builtin(name):
        return BuiltinRef(name)
    if found := library_function(name):
        return found
    # Names of types may be used bare, as `vec3(...)`.
    found = getattr(dtypes, name, None)
    if isinstance(found, type):
        return found
    raise undefined(context, name, node)


def proposal(name, known) -> str | None:
    """The hint with the known name that is closest to one; None if none is close."""
    close = difflib.get_close_matches(name, known, n=1)
    return f"did you mean `{close[0]}`?" if close else None


def undefined(context, name, node):
    known = [*context.env, *context.function.__globals__, *PYTHON_NAMES]
    hint = proposal(name, [n for n in known if " " not in n])
    if hasattr(builtins, name):
        return context.error(
            node,
            f"Python's '{name}' is not supported in kernels",
            kind=errors.WarpCodegenKeyError,
        )
    return context.error(
        node,
        f"'{name}' is not defined",
        hint,
        errors.WarpCodegenKeyError,
        code="undefined",
        facts={"name": name},
    )


def module_attribute(context, module, name, node):
    """The meaning of `module.name` in a kernel."""
    root = module.__name__.partition(".")[0]
    if root in ("math", "numpy"):
        value = getattr(module, name, None)
        if isinstance(value, (int, float)):
            return value
        target = MATH_NAMES.get(name, name)
        if target and _native.Builder.has_builtin(target):
            return BuiltinRef(target)
        if isinstance(value, type):
            return value
        raise context.error(
            node,
            f"'{module.__name__}.{name}' has no counterpart in kernels",
            kind=errors.WarpCodegenAttributeError,
        )
    if root == "warp":
        value = getattr(module, name, None)
        if isinstance(value, type) or (value is not None and not callable(value)):
            return value
        top = module is namespace or module.__name__ == "warp"
        if top and name in ("int", "float"):
            return getattr(builtins, name)
        if top and (name in SPECIAL_BUILTINS or _native.Builder.has_builtin(name)):
            return BuiltinRef(name)
        if value is not None:
            return value
        raise _missing(context, module, name, node)
    try:
        return getattr(module, name)
    except AttributeError:
        raise _missing(context, module, name, node) from None


def _missing(context, module, name, node):
    return context.error(
        node,
        f"module '{module.__name__}' has no attribute '{name}'",
        proposal(name, dir(module)),
        errors.WarpCodegenAttributeError,
        code="attribute-module",
        facts={"name": name, "module": module.__name__, "called": _written(node)},
    )


def _written(node) -> str:
    """A chain of names as it is written."""
    parts = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    parts.append(getattr(node, "id", ""))
    return ".".join(reversed(parts))
