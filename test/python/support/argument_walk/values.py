"""Values that few functions want, each made by a function without arguments."""

import ctypes
import decimal
import fractions

import numpy as np
from support.argument_walk import objects

import warp as wp


class Hostile:
    """An object whose protocols fail with errors of its own."""

    def _fail(self, *args):
        raise ZeroDivisionError("this object refuses")

    __len__ = __getitem__ = __iter__ = __index__ = __float__ = __bool__ = __call__ = _fail


class Liar:
    """A sequence of three elements which has none."""

    def __len__(self):
        return 3

    def __getitem__(self, index):
        raise IndexError(index)


class AnyAttribute:
    """An object that has every attribute, each of no use."""

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return None


def nothing():
    """A callback without parameters."""


def pair(a, b):
    """A callback of two parameters."""
    return a


def anything(*args, **named):
    """A callback that takes all and gives none."""


def _in_itself():
    made = [1.0]
    made.append(made)
    return made


def _keys_in_itself():
    made = {}
    made["x"] = made
    return made


def _deep():
    made = [1.0]
    for _ in range(600):
        made = [made]
    return made


def _record():
    return np.zeros(3, dtype=[("a", "f4"), ("b", "i8")])


def _array(shape=4, dtype=float):
    return lambda: wp.zeros(shape, dtype=dtype, device="cpu")


_PLAIN = (
    *(None, True, False, 0, 1, 3, -1, -7, 2**31 - 1, 2**31, -(2**31) - 1, 2**32, 2**63, 2**64),
    *(
        10**30,
        10**400,
        1000,
        7,
        0.0,
        0.5,
        -2.0,
        1e300,
        1e-300,
        float("nan"),
        float("inf"),
        float("-inf"),
        1j,
    ),
    *("", "x", "cpu", "cuda:0", "cuda:99", "float32", "x\0y", "\ud800", "é", "/no/such/file"),
    *(b"", b"bytes", ..., NotImplemented, Exception, object, type, int, float, str, bool, list),
    *(np.float32, np.dtype("f4"), wp.float32, wp.int64, wp.vec3, wp.mat33, wp.quat, wp.array),
    *(wp.transform, wp.uint8, wp.float16, wp.bfloat16, wp.Mesh, wp.sin, wp.tile, wp, wp.utils),
    *(len, nothing, pair, anything, Hostile, decimal.Decimal("1.5"), fractions.Fraction(1, 3)),
    *((), (1,), (1, 2, 3), (-1, 2), (2**40, 2**40), ("a", "b"), (None,), ((1, 2), (3,))),
    *(frozenset({1}), range(3), range(2**40), slice(None), slice("a", None, 0), slice(5, 1, -1)),
)

_MADE = {
    "[]": list,
    "[1, 2, 3]": lambda: [1, 2, 3],
    "[0.5, nan]": lambda: [0.5, float("nan")],
    "[None, None]": lambda: [None, None],
    "[[1, 2], [3]]": lambda: [[1, 2], [3]],
    "['a', 1]": lambda: ["a", 1],
    "a list in itself": _in_itself,
    "a dict in itself": _keys_in_itself,
    "a deep list": _deep,
    "{}": dict,
    "{'x': 1}": lambda: {"x": 1},
    "{1: 2}": lambda: {1: 2},
    "set()": set,
    "object()": object,
    "Hostile()": Hostile,
    "Liar()": Liar,
    "AnyAttribute()": AnyAttribute,
    "iter([1])": lambda: iter([1]),
    "bytearray": lambda: bytearray(8),
    "memoryview": lambda: memoryview(b"1234"),
    "c_int": lambda: ctypes.c_int(3),
    "c_float * 3": lambda: (ctypes.c_float * 3)(),
    "np f4 (4,)": lambda: np.ones(4, "f4"),
    "np f8 (2, 3)": lambda: np.ones((2, 3)),
    "np i8 (3,)": lambda: np.arange(3),
    "np (0,)": lambda: np.zeros(0, "f4"),
    "np ()": lambda: np.array(1.5),
    "np nan": lambda: np.full(3, np.nan),
    "np object": lambda: np.array([None, "a", 3], dtype=object),
    "np text": lambda: np.array(["a", "b"]),
    "np complex": lambda: np.ones(3, complex),
    "np record": _record,
    "np of rank 6": lambda: np.ones((1,) * 6, "f4"),
    "np strided": lambda: np.ones((4, 6), "f4")[::2, ::-3],
    "np big endian": lambda: np.ones(3, ">f4"),
    "np read-only": lambda: np.broadcast_to(np.float32(1), (3,)),
    "np.float64": lambda: np.float64(0.5),
    "np.int16": lambda: np.int16(-3),
    "np.datetime64": lambda: np.datetime64("2020-01-01"),
    "wp.float32()": lambda: wp.float32(0.5),
    "wp.int64()": lambda: wp.int64(-3),
    "wp.bool()": lambda: wp.bool(True),
    "wp.vec3()": lambda: wp.vec3(1.0, 2.0, 3.0),
    "wp.vec2i()": lambda: wp.vec2i(1, 2),
    "wp.vec3 of nan": lambda: wp.vec3(float("nan")),
    "wp.mat33()": lambda: wp.mat33(1.0),
    "wp.quat()": lambda: wp.quat(),
    "wp.transform()": lambda: wp.transform(),
    "floats": _array(),
    "floats (0,)": _array(0),
    "floats (1,)": _array(1),
    "floats (2, 3)": _array((2, 3)),
    "floats (1, 1, 1, 1)": _array((1, 1, 1, 1)),
    "floats strided": lambda: wp.zeros((4, 4), dtype=float, device="cpu")[:, 1],
    "float64s": _array(4, wp.float64),
    "float16s": _array(4, wp.float16),
    "ints": lambda: wp.array([0, 3, 1, 2], dtype=int, device="cpu"),
    "ints out of range": lambda: wp.array([10**8, -5, 7], dtype=int, device="cpu"),
    "int64s": _array(3, wp.int64),
    "uint8s": _array(8, wp.uint8),
    "bools": _array(4, wp.bool),
    "vec3s": _array(3, wp.vec3),
    "vec3s of nan": lambda: wp.full(3, wp.vec3(float("nan")), dtype=wp.vec3, device="cpu"),
    "mat33s": _array(2, wp.mat33),
    "structs": lambda: wp.zeros(3, dtype=objects.Pair, device="cpu"),
    "many ints": lambda: wp.array(np.arange(999) * 7 % 1000, dtype=int, device="cpu"),
    "many vec3s": lambda: wp.array(np.random.default_rng(0).random((333, 3)), dtype=wp.vec3),
    "ints (2, 3)": lambda: wp.array([[0, 1, 2], [2, 1, 3]], dtype=int, device="cpu"),
    "field": lambda: wp.array(np.random.default_rng(0).random((5, 4, 6)) - 0.5, dtype=float),
    "transforms": _array((2, 2), wp.transform),
    "[floats]": lambda: [objects.floats()],
    "[floats, 2.0]": lambda: [objects.floats(), 2.0],
    "[ints, vec3s]": lambda: [objects.ints(1, 2), objects.corners()],
    "[vec3s, vec3s]": lambda: [objects.corners(), objects.corners()],
    "[float16s]": lambda: [wp.zeros(4, dtype=wp.float16, device="cpu")],
    "an annotation": lambda: wp.array(dtype=float),
}


# Values that are of a kind, and still wrong for most functions.
PLAUSIBLE = {
    "an array": (
        *("floats", "floats (0,)", "floats (1,)", "floats (2, 3)", "floats (1, 1, 1, 1)"),
        *("floats strided", "float64s", "float16s", "ints", "ints out of range", "int64s"),
        *("uint8s", "bools", "vec3s", "vec3s of nan", "mat33s", "structs", "a indexedarray"),
        *("a array2d", "many ints", "many vec3s", "ints (2, 3)", "field", "transforms"),
    ),
    "an integer of at least 0": ("0", "1", "3", "7", "1000", "2147483647"),
    "an integer": ("0", "1", "3", "-1", "-7", "1000", "2147483647", "-2147483649"),
    "a finite number": ("0.0", "0.5", "-2.0", "1e+300", "1e-300", "3"),
    "a positive number": ("0.5", "1e+300", "1e-300", "3"),
    "three numbers": ("(1, 2, 3)", "wp.vec3()", "wp.vec3 of nan", "np nan", "[1, 2, 3]"),
    "True or False": ("True", "False"),
    "a list of arrays": ("[floats]", "[ints, vec3s]", "[]", "[vec3s, vec3s]", "[float16s]"),
    "a list": ("[]", "[floats]", "[1, 2, 3]", "[floats, 2.0]"),
    "a scalar, vector, matrix or struct type": (
        *("float32", "int64", "vec3f", "mat33f", "float16", "uint8", "a Pair type", "quatf"),
    ),
}


def plausible(kind) -> tuple:
    """Names of values for an argument of a kind; none where none are listed."""
    for wanted, names in PLAUSIBLE.items():
        if kind.wanted.removesuffix(" or None") == wanted:
            return names
    return ()


def _shown(value) -> str:
    return getattr(value, "__name__", None) or repr(value)[:40]


def wrong_values() -> dict:
    """All values by name, as functions that make them."""
    plain = {f"{_shown(value)}": (lambda value=value: value) for value in _PLAIN}
    made = {f"a {name}": make for name, make in objects.RECIPES.items()}
    return plain | _MADE | made
