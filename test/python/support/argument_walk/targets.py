"""All that the package offers to call: functions, constructors, methods, operators, setters."""

import enum
import inspect
import operator
import types
import typing
from dataclasses import dataclass, field

from support.argument_walk import objects
from support.argument_walk.uses import USES

import warp as wp
import warp.autograd
import warp.examples
import warp.geometry
import warp.optim
import warp.optim.linear
import warp.render
import warp.saved
import warp.sparse
import warp.types
import warp.utils
from warp._src import arguments

_MODULES = {
    "wp": wp,
    "wp.autograd": warp.autograd,
    "wp.geometry": warp.geometry,
    "wp.optim": warp.optim,
    "wp.optim.linear": warp.optim.linear,
    "wp.render": warp.render,
    "wp.saved": warp.saved,
    "wp.sparse": warp.sparse,
    "wp.types": warp.types,
    "wp.utils": warp.utils,
}
# Calls that end the process, wait for it, touch the cache of the others or believe addresses.
_EXCLUDED = frozenset(
    (
        *("wp.clear_kernel_cache", "wp.clear_lto_cache", "wp.from_ptr", "wp.saved.main"),
        *("wp.from_ipc_handle", "wp.event_from_ipc_handle"),
        *("wp.map_cuda_device", "wp.address_of", "wp.breakpoint"),
    )
)
# One object for all calls of a process: what sets its attributes would change the others.
_SHARED = frozenset(("Device", "Kernel", "Function", "Module", "Logger"))
# Methods that believe addresses.
_UNSAFE = frozenset(("from_ptr", "load_from_address", "from_buffer", "from_address"))
_OPERATORS = (
    *(operator.add, operator.sub, operator.mul, operator.truediv, operator.floordiv),
    *(operator.mod, operator.pow, operator.matmul, operator.and_, operator.or_, operator.xor),
    *(operator.lshift, operator.rshift, operator.eq, operator.ne, operator.lt, operator.le),
    *(operator.gt, operator.ge, operator.iadd, operator.isub, operator.imul, operator.itruediv),
    *(operator.contains, operator.getitem, operator.setitem, operator.delitem, operator.imatmul),
)


@dataclass(frozen=True)
class Target:
    """Something to call.

    Attributes:
        name: as users write it.
        find: gives what is called; with an object in `owner`, from an instance.
        parameters: their names; None where Python cannot tell.
        owner: the name of the recipe of the object, or None.
        kinds: what the parameters expect, of functions that say it.
        kind: "call", "operator", "set", or "use": what follows from an attribute that users have
            overwritten may be any error, but neither a crash nor a hang.
    """

    name: str
    find: typing.Callable
    parameters: tuple | None
    owner: str | None = None
    kind: str = "call"
    kinds: dict = field(default_factory=dict)


def _parameters(function):
    try:
        found = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return None
    return tuple(one.name for one in found if one.kind in (0, 1, 3))


def _kinds(function) -> dict:
    """The kinds of arguments that a function says it expects."""
    if isinstance(function, type):
        function = function.__init__
    own = getattr(function, "argument_kinds", None)
    return {} if own is None else {**arguments.COMMON, **own}


def _is_no_function(value) -> bool:
    """True if calling it says nothing of the package: exceptions, enumerations, protocols."""
    if not isinstance(value, type):
        return not callable(value) or isinstance(value, types.ModuleType)
    return issubclass(value, (BaseException, enum.Enum)) or getattr(value, "_is_protocol", False)


def functions() -> list[Target]:
    """Functions and constructors of the public modules."""
    found, seen = [], set()
    for prefix, module in _MODULES.items():
        for name in dir(module):
            value = getattr(module, name, None)
            full = f"{prefix}.{name}"
            foreign = getattr(value, "__module__", "") or ""
            if name.startswith("_") or _is_no_function(value) or not foreign.startswith("warp"):
                continue
            if full in _EXCLUDED or id(value) in seen:
                continue
            seen.add(id(value))
            find = lambda value=value: value  # noqa: E731
            found.append(Target(full, find, _parameters(value), kinds=_kinds(value)))
            if isinstance(value, type) and foreign.startswith("warp._src"):
                found += _class_functions(full, value)
    return found


def _class_functions(prefix, cls) -> list[Target]:
    found = []
    for name, held in vars(cls).items():
        full = f"{prefix}.{name}"
        if name.startswith("_") or full in _EXCLUDED or name in _UNSAFE:
            continue
        if isinstance(held, (classmethod, staticmethod)):
            value = getattr(cls, name)
            find = lambda value=value: value  # noqa: E731
            found.append(Target(full, find, _parameters(value), kinds=_kinds(value)))
    return found


def members() -> list[Target]:
    """Methods, operators and attributes of the objects."""
    found = []
    for owner, make in objects.RECIPES.items():
        sample = make()
        for name in sorted(set(dir(sample)) - set(dir(object))):
            found += _member(owner, sample, name)
        for function in _OPERATORS:
            name = f"{owner}: {function.__name__}"
            find = lambda held, function=function: lambda *args: function(held, *args)  # noqa: E731
            count = 2 if function is operator.setitem else 1
            found.append(Target(name, find, ("value",) * count, owner, "operator"))
            if function in _OPERATORS[:18]:
                back = lambda held, function=function: lambda x: function(x, held)  # noqa: E731
                found.append(Target(f"reflected {name}", back, ("value",), owner, "operator"))
        if callable(sample):
            found.append(Target(f"{owner}()", lambda held: held, _parameters(sample), owner))
    return found


def _is_swizzle(name) -> bool:
    return len(name) > 1 and set(name) <= set("xyzw")


def _member(owner, sample, name) -> list[Target]:
    full = f"{owner}.{name}"
    if name.startswith("_") or full in _EXCLUDED or name in _UNSAFE or _is_swizzle(name):
        return []
    held = inspect.getattr_static(type(sample), name, None)
    if inspect.isdatadescriptor(held):
        if getattr(held, "fset", True) is None or owner in _SHARED:
            return []
        return [Target(f"{full} =", _setter(name), ("value",), owner, "set")]
    value = getattr(sample, name, None)
    if not callable(value):
        return []
    find = lambda one: getattr(one, name)  # noqa: E731
    return [Target(full, find, _parameters(value), owner, kinds=_kinds(value))]


def uses() -> list[Target]:
    """Attributes of objects that are set, after which the objects are used."""
    found = []
    for owner, use in USES.items():
        sample = objects.RECIPES[owner]()
        held = {name for name in dir(sample) if inspect.isdatadescriptor(_static(sample, name))}
        for name in sorted(held | set(getattr(sample, "__dict__", {}))):
            if not name.startswith("_") and name not in ("ptr", "grad_ptr"):
                find = lambda one, name=name, use=use: lambda value: _set(one, name, value, use)  # noqa: E731
                found.append(Target(f"use of {owner}.{name} =", find, ("value",), owner, "use"))
    return found


def _static(sample, name):
    return inspect.getattr_static(type(sample), name, None)


def _set(held, name, value, use):
    setattr(held, name, value)
    use(held)


def _setter(name):
    return lambda held: lambda value: setattr(held, name, value)


def targets() -> list[Target]:
    """Everything."""
    return functions() + members() + uses()
