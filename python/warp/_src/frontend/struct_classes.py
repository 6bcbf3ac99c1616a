"""Classes of struct values, for what kernels take from a class: functions, constants, types.

A value knows the name and fields of its struct. Several classes may have them, such as those that a
function makes with other functions in each; then the one counts that the text being translated
mentions, or else a text that calls it.
"""

from __future__ import annotations

import types as python_types
import typing

from warp._src.kernels import declared
from warp._src.types import dtypes
from warp._src.types.annotations import annotations_of

_MISSING = object()


def member(context, native, name, node):
    """The attribute of a struct's class, or None if kernels can take none of that name.

    Raises:
        WarpCodegenError: several classes are meant alike, and they differ.
    """
    if not any(name in dtypes.members_of(cls) for cls in dtypes.classes_of(native)):
        return None
    cls = dtype_of(context, native, node)
    found = getattr(cls, name) if name in dtypes.members_of(cls) else None
    return None if isinstance(found, property) else found


def dtype_of(context, native, node):
    """The Python type of a type of the compiler, where it is a struct the class that is meant.

    Raises:
        WarpCodegenError: several classes are meant alike, and they differ.
    """
    classes = dtypes.classes_of(native) if native.kind == "struct" else ()
    if all(_alike(classes[0], cls) for cls in classes[1:]):
        return dtypes.dtype_of(native)
    session = context.session
    for function in (context.function, *(one.function for one in reversed(session.active))):
        seen: list = []
        _mentioned(function, seen)
        found = [cls for cls in classes if any(cls is one for one in seen)]
        if len(found) == 1:
            return found[0]
    name = native.python_name
    raise context.error(
        node,
        f"there are {len(classes)} structs '{name}' with these fields, whose attributes differ",
        f"take the attribute from the class, as in `{name}.attribute`",
    )


def _alike(cls, other) -> bool:
    """True if two classes give kernels the same attributes."""
    mine, others = dtypes.members_of(cls), dtypes.members_of(other)
    return all(
        _same(mine.get(name, _MISSING), others.get(name, _MISSING)) for name in mine | others
    )


def _same(one, other) -> bool:
    kind = type(one)
    if one is other:
        return True
    if kind in (python_types.FunctionType, property) and kind is type(other):
        # For Python alone.
        return True
    if isinstance(one, (bool, int, float, str, dtypes.scalar_base)):
        return kind is type(other) and repr(one) == repr(other)
    return isinstance(one, dtypes.Composite) and kind is type(other) and bytes(one) == bytes(other)


def _mentioned(function, seen) -> None:
    """Appends the classes that a function's annotations and names mean."""
    for annotation in annotations_of(function).values():
        _add(annotation, seen)
    space = declared.names_of(function)
    names = {*function.__code__.co_names, *function.__code__.co_freevars}
    for name in names & space.keys():
        value = space[name]
        if isinstance(value, python_types.ModuleType):
            for other in names & vars(value).keys():
                _add(vars(value)[other], seen)
        _add(value, seen)


def _add(value, seen) -> None:
    """Appends a struct class, those of its fields, and those in an annotation or value."""
    kind = value if isinstance(value, type) else type(value)
    if dtypes.is_struct(kind):
        if not any(kind is one for one in seen):
            seen.append(kind)
            for dtype in kind._wp_fields_.values():
                _add(dtype, seen)
    elif kind.__module__.startswith("warp._src.types.") and hasattr(value, "dtype"):
        _add(value.dtype, seen)
    else:
        for part in typing.get_args(value):
            _add(part, seen)
