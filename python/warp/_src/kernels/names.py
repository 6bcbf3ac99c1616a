"""Lasting names of the values that a kernel's text refers to, in every process.

Values count by what they are where that can be told: numbers, strings, tuples, types, enumerations,
frozen dataclasses, functions of kernels. Others (objects, arrays, functions of Python) have no name
that lasts.
"""

from __future__ import annotations

import abc
import enum
import functools
import os
import types
import typing
from _blake2 import blake2b

from warp._src.kernels import texts
from warp._src.kernels.descriptions import Operator
from warp._src.kernels.function import Function, NativeFunction
from warp._src.language.builtins import Builtin
from warp._src.types.annotations import FixedArrayType, Reference
from warp._src.types.composites import Composite
from warp._src.types.native import ArrayType, IndexedArrayType, is_struct, members_of
from warp._src.types.scalars import scalar_base
from warp._src.types.vectors import GenericAnnotation
from warp._src.version import PACKAGE

_PLAIN = (type(None), bool, int, float, complex, str, bytes, type(...))
_DESCRIPTORS = (
    *(types.GetSetDescriptorType, types.MemberDescriptorType, types.MethodDescriptorType),
    *(types.WrapperDescriptorType, types.ClassMethodDescriptorType),
)
# Modules of this package that users write into; the others are what they are in a release.
_OPEN_MODULES = ("warp", "warp.config")
# Longer tuples and tables are not looked through.
_MOST_ITEMS = 4096
_MISSING = object()
_METACLASSES = (type, abc.ABCMeta, enum.EnumMeta)
_OF_MEMBERS = ("_value_", "_name_", "__objclass__", "_sort_order_", "_inverted_")


class UnnamedError(Exception):
    """A value, or a kernel, without a name that lasts."""


@functools.cache
def _is_ours(name) -> bool:
    """True if a module is what it is in a release; programs may add others below `warp`."""
    if name == "warp":
        return True
    if not name.startswith("warp."):
        return False
    path = os.path.join(PACKAGE, name.split(".")[1])
    return os.path.isdir(path) or os.path.isfile(f"{path}.py") or name == "warp._native"


def _is_packaged(function) -> bool:
    """True if a function is of this package's files and was not made by another function, so that
    its name says what it is."""
    home = function.__code__.co_filename.startswith(PACKAGE) and not texts.is_made(function)
    return home and "<locals>" not in function.__qualname__


class Names:
    """Names of values, and what has been met on the way: objects with a number, and attributes.

    Attributes:
        threads: of a block; None if that is not known.
    """

    def __init__(self, threads=None):
        self.threads = threads
        self._parts: list[str] = []
        # The numbered objects, by address; `_held` keeps addresses from being used again.
        self._numbers: dict = {}
        self._held: list = []
        # Modules and classes, with the words that were looked for in them.
        self._owners: list = []

    def function(self, function) -> str:
        """The lasting name of a Python function that may be translated."""
        raise NotImplementedError

    def _number(self, value) -> tuple:
        """The number of an object, and whether it is a new one."""
        found = self._numbers.get(id(value))
        if found is not None:
            return found, False
        self._held.append(value)
        self._numbers[id(value)] = len(self._held)
        return len(self._held), True

    def token(self, value) -> str:
        """The lasting name of a value.

        Raises:
            UnnamedError: it has no name that lasts.
        """
        kind = type(value)
        if kind in _PLAIN:
            return f"{kind.__name__} {value!r}"
        method = _METHODS.get(kind)
        if method is not None:
            return method(self, value, kind)
        if isinstance(value, (tuple, list)):
            if len(value) > _MOST_ITEMS:
                raise UnnamedError
            parts = ", ".join(map(self.token, value))
            return f"{kind.__module__}.{kind.__qualname__}({parts})"
        if kind is dict and len(value) <= _MOST_ITEMS:
            pairs = [f"{self.token(a)}: {self.token(b)}" for a, b in value.items()]
            return f"{{{', '.join(pairs)}}}"
        if isinstance(value, type):
            return self._class(value)
        if isinstance(value, types.ModuleType):
            return self._module(value)
        if isinstance(value, enum.Enum):
            return f"{self._class(kind)}.{value._name_}"
        if isinstance(value, Function):
            return self._function_of_kernels(value)
        if isinstance(value, Builtin):
            return f"builtin {value.key}"
        if getattr(getattr(kind, "__dataclass_params__", None), "frozen", False):
            parts = [self.token(getattr(value, name)) for name in kind.__dataclass_fields__]
            return f"{self._class(kind)}({', '.join(parts)})"
        if isinstance(value, Operator):
            return f"operator {value.name}"
        return self._number_token(value, kind) or self._annotation(value, kind)

    def _number_token(self, value, kind) -> str | None:
        if isinstance(value, (int, float)):
            return f"{kind.__name__} of {int(value) if isinstance(value, int) else float(value)!r}"
        if isinstance(value, scalar_base):
            return f"{self._class(kind)}({value.value!r})"
        if isinstance(value, Composite):
            return f"{self._class(kind)}({bytes(value).hex()})"
        if is_struct(kind):
            fields = [self.token(getattr(value, name)) for name in kind._wp_fields_]
            return f"{self._class(kind)}({', '.join(fields)})"
        if kind.__module__ == "numpy" and getattr(value, "shape", None) == ():
            return (
                f"numpy {value.dtype} {value.tobytes().hex()}" if hasattr(value, "item") else None
            )
        if kind.__module__ == "numpy" and kind.__name__ == "ndarray" and value.dtype.kind in "biuf":
            digest = blake2b(value.tobytes(), digest_size=32).hexdigest()
            return f"table {value.dtype.str} {value.shape} {digest}"
        return None

    def _array_type(self, value, kind) -> str:
        return f"{kind.__qualname__}({self.token(value.dtype)}, {value.ndim})"

    def _annotation(self, value, kind) -> str:
        if kind is typing.TypeVar:
            return f"TypeVar({value.__name__}, {self.token(value.__constraints__)})"
        if kind is GenericAnnotation:
            return f"generic({self.token(value.family)}, {self.token(tuple(value.params))})"
        if kind is Reference:
            return f"ref({self.token(value.dtype)})"
        if kind is FixedArrayType or (kind.__name__ == "TileType" and _is_ours(kind.__module__)):
            return f"{kind.__name__}({self.token(value.dtype)}, {self.token(value.shape)})"
        if kind.__name__ == "TileStackType" and _is_ours(kind.__module__):
            return f"TileStackType({self.token(value.dtype)}, {value.capacity})"
        if typing.get_origin(value) is not None:
            arguments = self.token(list(typing.get_args(value)))
            return f"{self.token(typing.get_origin(value))}[{arguments}]"
        if kind is types.BuiltinFunctionType and isinstance(
            value.__self__, (types.ModuleType, type(None))
        ):
            return f"python {value.__module__}.{value.__qualname__}"
        if kind.__module__ == "numpy" and kind.__name__ == "ufunc":
            return f"ufunc {value.__name__}"
        if kind is types.FunctionType and _is_packaged(value):
            return f"function {value.__module__}.{value.__qualname__}"
        if kind is staticmethod:
            return self.token(value.__func__)
        if kind in _DESCRIPTORS:
            return f"descriptor {value.__qualname__}"
        if kind.__name__ == "_Adjoint" and _is_ours(kind.__module__):
            return "adjoint"
        if getattr(value, "__module__", None) == "typing":
            return f"typing {value!r}"
        raise UnnamedError

    def _function_of_kernels(self, value) -> str:
        if isinstance(value, NativeFunction) and value.is_block_barrier:
            # A module has the address of other native code in this process.
            return "barrier"
        if not type(value).has_lasting_name:
            raise UnnamedError
        if _is_packaged(value.func):
            return f"library {value.__module__}.{value.__qualname__}"
        if id(value) in self._numbers:
            return f"func {self._numbers[id(value)]}"
        parts = [repr(value.key), self.token(value.handle)]
        parts += [self.token(value.pullback), self.token(value.pushforward)]
        for group in (value.overloads, value.pullbacks, value.replays):
            parts.append(" ".join(map(self.function, group)))
        number, _ = self._number(value)
        self._parts.append(f"func {number}: {'; '.join(parts)}")
        return f"func {number}"

    # Values that have attributes.

    def _module(self, module) -> str:
        name = module.__name__
        if _is_ours(name) and name not in _OPEN_MODULES:
            return f"module {name}"
        if type(module) is not types.ModuleType and not _is_ours(name):
            raise UnnamedError
        number, is_new = self._number(module)
        if is_new:
            self._parts.append(f"module {number}: {name}")
            self._owners.append(_owner_of(module))
        return f"module {number}"

    def _class(self, cls) -> str:
        home = cls.__module__
        spelled = f"{home}.{cls.__qualname__}"
        if home == "builtins" or home == "typing" or home == "numpy":
            return f"type {spelled}"
        if is_struct(cls):
            return self._struct(cls, f"struct {spelled} {cls._native_}")
        if _is_ours(home):
            return f"type {spelled} {getattr(cls, '_native_', '')}"
        if id(cls) in self._numbers:
            return f"class {self._numbers[id(cls)]}"
        if not issubclass(cls, (Composite, scalar_base)) and (
            type(cls) not in _METACLASSES or "__class_getitem__" in dir(cls)
        ):
            raise UnnamedError
        members = []
        if issubclass(cls, enum.Enum):
            for name, member in cls.__members__.items():
                own = {k: v for k, v in vars(member).items() if k not in _OF_MEMBERS}
                members.append(f"{name}: {self.token((member._value_, own))}")
        number, _ = self._number(cls)
        native = getattr(cls, "_native_", "")
        self._parts.append(f"class {number}: {spelled} {native} {members}")
        self._owners.append(ClassOwner(cls))
        return f"class {number}"

    def _struct(self, cls, spelled) -> str:
        """A struct class, whose fields' classes count, and attributes that a text has words for."""
        number, is_new = self._number(cls)
        if is_new:
            fields = [self.token(dtype) for dtype in cls._wp_fields_.values()]
            self._parts.append(f"struct {number}: {spelled} {fields}")
            self._owners.append(StructOwner(cls))
        return f"struct {number}"


# Methods by the exact type of a value, for the most frequent types: `token` asks them before it
# tests for others, and they give the same.
_METHODS = {
    type: lambda names, value, kind: names._class(value),
    types.ModuleType: lambda names, value, kind: names._module(value),
    types.FunctionType: Names._annotation,
    types.BuiltinFunctionType: Names._annotation,
    Function: lambda names, value, kind: names._function_of_kernels(value),
    Builtin: lambda names, value, kind: f"builtin {value.key}",
    ArrayType: Names._array_type,
    IndexedArrayType: Names._array_type,
}


def is_plain(value) -> bool:
    """True if a value is what its text says, and short."""
    return type(value) in _PLAIN and not (isinstance(value, (str, bytes)) and len(value) > 64)


class Owner:
    """A module or class: what the words of texts mean as its attributes."""

    def __init__(self, value):
        self.value = value
        self._done: set = set()

    def found(self, words) -> list[tuple]:
        """Attributes with these names that were not asked for before, in order of the alphabet."""
        known: set = set()
        for space in self._spaces():
            known |= words & space.keys()
        fresh = sorted(known - self._done)
        self._done.update(fresh)
        values = [(word, self._get(word)) for word in fresh]
        return [(word, value) for word, value in values if value is not _MISSING]

    def _spaces(self):
        return (vars(self.value),)

    def _get(self, word):
        return vars(self.value)[word]


class OpenOwner(Owner):
    """A module that makes attributes when they are asked for."""

    def found(self, words) -> list[tuple]:
        import warnings

        fresh = sorted(words - self._done)
        self._done.update(fresh)
        with warnings.catch_warnings():
            # A word need not be meant as a name.
            warnings.simplefilter("ignore")
            values = [(word, getattr(self.value, word, _MISSING)) for word in fresh]
        return [(word, value) for word, value in values if value is not _MISSING]


class PackageOwner(Owner):
    """This package: what users have put into it, and numbers."""

    def _get(self, word):
        value = vars(self.value)[word]
        if isinstance(value, types.ModuleType):
            return value if value.__name__ in _OPEN_MODULES else _MISSING
        if isinstance(value, type) or callable(value):
            home = getattr(value, "__module__", None) or type(value).__module__
            return _MISSING if _is_ours(str(home)) else value
        return _MISSING if _is_ours(type(value).__module__) else value


class ClassOwner(Owner):
    """A class with its bases, as far as they are not Python's or ours."""

    def __init__(self, value):
        super().__init__(value)
        self._bases = [
            base
            for base in value.__mro__
            if base.__module__ not in ("builtins", "enum", "ctypes")
            and not _is_ours(base.__module__)
        ]
        if issubclass(value, enum.Enum):
            self._done.update(value.__members__)

    def _spaces(self):
        return map(vars, self._bases)

    def _get(self, word):
        return next(vars(base)[word] for base in self._bases if word in vars(base))


class StructOwner(Owner):
    """A struct class: its attributes, not its fields."""

    def found(self, words) -> list[tuple]:
        return super().found(words & members_of(self.value).keys())


def _owner_of(module) -> Owner:
    name = module.__name__
    if name == "warp":
        return PackageOwner(module)
    if "__getattr__" in vars(module) and name != "numpy" and not _is_ours(name):
        return OpenOwner(module)
    return Owner(module)
