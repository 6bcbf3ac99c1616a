"""Kinds of arguments of public functions: in words, and which values are of them.

Tests run after a call has failed (`arguments.checked`), so they may be slow; each takes any value.
"""

from __future__ import annotations

import operator
import os
import types
import typing

# Functions and classes of modules that import this one; each module puts its own here.
above = types.SimpleNamespace()


class Kind:
    """A kind of argument: in words, and which values are of it."""

    def __init__(self, wanted: str, test: typing.Callable):
        self.wanted = wanted
        self._test = test

    def fits(self, value) -> bool:
        """True if a value is of the kind; one whose own methods fail is not."""
        try:
            return bool(self._test(value))
        except Exception:
            return False

    def __or__(self, other):
        return Kind(
            f"{self.wanted} or {other.wanted}",
            lambda value: self.fits(value) or other.fits(value),
        )


def _is_array(value) -> bool:
    return above.type_is_array(type(value))


def _is_number(value) -> bool:
    return above.is_number(value) and value == value and abs(float(value)) < float("inf")


def _is_integer(value) -> bool:
    return not isinstance(value, bool) and -(2**63) <= operator.index(value) < 2**63


def _is_flag(value) -> bool:
    kinds = (bool, int, above.scalar_base)
    return isinstance(value, kinds) or type(value).__name__ in ("bool_", "bool")


def _is_path(value) -> bool:
    return "\0" not in os.fsdecode(os.fsencode(value)).replace("\udcff", "")


def _is_device(value) -> bool:
    return above.get_device(value) is not None


def _is_type(value) -> bool:
    return above.canonical(value) is not None


def _is_shape(value) -> bool:
    return above.check_shape(value) is not None


def _is_point(value) -> bool:
    numbers = [float(number) for number in value]
    return len(numbers) == 3


def sequence_of(kind: Kind, wanted: str) -> Kind:
    """A list or tuple (of arrays: `wanted`) whose elements are of a kind."""
    return Kind(
        f"a list of {wanted}",
        lambda value: isinstance(value, (list, tuple)) and all(map(kind.fits, value)),
    )


def instance(cls, wanted: str) -> Kind:
    """An object of a class; `cls` may be a function that gives it."""

    def test(value):
        return isinstance(value, cls if isinstance(cls, (type, tuple)) else cls())

    return Kind(wanted, test)


def offers(wanted: str, *attributes: str) -> Kind:
    """An object whose class has all these attributes."""
    return Kind(wanted, lambda value: all(hasattr(type(value), name) for name in attributes))


def _is_names(value) -> bool:
    return isinstance(value, (list, tuple, set, frozenset)) and all(
        isinstance(name, str) for name in value
    )


def _is_data(value) -> bool:
    import numpy

    return _is_array(value) or numpy.asarray(value).dtype.kind in "biufV"


def _is_value(value) -> bool:
    if isinstance(value, (above.Composite, above.StructInstance)):
        return True
    return bool(above.flatten_numbers(value))


def _is_dim(value) -> bool:
    extents = value if isinstance(value, (tuple, list)) else (value,)
    return len(extents) <= 4 and all(0 <= operator.index(extent) < 2**31 for extent in extents)


def _is_module(value) -> bool:
    return above.imported_module(value) is not None


def _is_operator(value) -> bool:
    return _is_array(value) or any(
        base.__name__ in ("BsrMatrix", "LinearOperator", "Operators", "FSAI")
        for base in type(value).__mro__
    )


def named(wanted: str, *classes: str) -> Kind:
    """Objects of classes of these names, whose modules need not be loaded."""
    return Kind(wanted, lambda value: any(base.__name__ in classes for base in type(value).__mro__))


NONE = Kind("None", lambda value: value is None)
ANYTHING = Kind("anything", lambda value: True)
ARRAY = Kind("an array", _is_array)
ARRAYS = sequence_of(ARRAY, "arrays")
NUMBER = Kind("a finite number", _is_number)
POSITIVE = Kind("a positive number", lambda value: _is_number(value) and value > 0)
INTEGER = Kind("an integer", _is_integer)
COUNT = Kind("an integer of at least 0", lambda value: _is_integer(value) and value >= 0)
SMALL = Kind(
    "an integer of at least 0 below 2^31",
    lambda value: _is_integer(value) and 0 <= value < 2**31,
)
FLAG = Kind("True or False", _is_flag)
TEXT = instance(str, "a string")
PATH = Kind("a path", _is_path)
BYTES = instance((bytes, bytearray, memoryview), "bytes")
DEVICE = Kind("a device, such as 'cpu' or 'cuda:0'", _is_device)
TYPE = Kind("a scalar, vector, matrix or struct type", _is_type)
SHAPE = Kind("an integer or 1 to 4 integers of at least 0", _is_shape)
POINT = Kind("three numbers", _is_point)
CALLABLE = Kind("a function", lambda value: callable(value) and not isinstance(value, type))
LIST = instance((list, tuple), "a list")
DICT = instance(dict, "a dict")
STREAM = offers("a wp.Stream", "wait_stream")
EVENT = offers("a wp.Event", "is_complete")
KERNEL = offers("a kernel (`@wp.kernel`)", "specialize", "is_generic")
TAPE = offers("a wp.Tape", "record_launch")
NAMES = Kind("a list of strings", _is_names)
VALUE = Kind("a number, or a vector, matrix or struct", _is_value)
DATA = Kind("an array, or numbers in lists", _is_data)
NUMBERS = Kind("numbers in lists or in an array of NumPy", _is_data)
DIM = Kind("1 to 4 integers of at least 0", _is_dim)
DIMS = DIM | Kind(
    "a dict of them",
    lambda value: isinstance(value, dict) and all(map(_is_dim, value.values())),
)
AXES = Kind("a list with the number of each axis", lambda value: all(map(_is_integer, value)))
PAIR = Kind("two integers", lambda value: len(value) == 2 and all(map(_is_integer, value)))
BETAS = Kind("two numbers", lambda value: len(value) == 2 and all(map(_is_number, value)))
TRIPLES = Kind("a list of triples of integers", lambda value: all(len(one) == 3 for one in value))
VOXEL = Kind("a positive number or three", lambda value: POSITIVE.fits(value) or _is_point(value))
TRANSFORMS = Kind("an array of transforms of two dimensions", lambda value: value.ndim == 2)
FUNCTION = Kind("a Python function", lambda value: hasattr(value, "__code__"))
DLPACK = Kind(
    "a DLPack capsule or an array with `__dlpack__`",
    lambda value: hasattr(type(value), "__dlpack__") or type(value).__name__ == "PyCapsule",
)
GRAPH = named("a wp.Graph", "Graph")
MESHES = sequence_of(named("a wp.Mesh", "Mesh"), "meshes")
VOLUME = named("a wp.Volume", "Volume")
MODULE = Kind("a module, or its name", _is_module)
MODULES = sequence_of(MODULE, "modules")
MATRIX = named("a BsrMatrix", "BsrMatrix")
SPARSE = named("a BsrMatrix or an expression of one", "BsrMatrix", "Operators")
OPERATOR = Kind("a BsrMatrix, an array or a LinearOperator", _is_operator)
# Parameters that all iterative solvers have.
SOLVER = {
    **dict.fromkeys(("A", "M"), OPERATOR),
    **dict.fromkeys(("b", "x"), ARRAY),
    **dict.fromkeys(("maxiter", "check_every"), INTEGER),
}
TIMINGS = Kind(
    "a list of wp.TimingResult",
    lambda value: (
        isinstance(value, (list, tuple))
        and all(type(one).__name__ == "TimingResult" for one in value)
    ),
)
GRAPH_MODE = named("a JaxCallableGraphMode", "JaxCallableGraphMode")
JAX_CALLABLE = named("what `jax_callable` gives", "JaxCallable")
GRADIENTS = Kind("names of kernels", lambda value: all(isinstance(one, object) for one in value))
TRANSLATION = Kind(
    "a translated module", lambda value: type(value).__module__.startswith("warp._native")
)
NATIVE_GRAPH = offers("a captured graph", "device_index", "launch")
