"""Runs a kernel's text in Python, one thread after the other: the reference of random programs.

The numbers are NumPy's scalars, which have a width, wrap, and are IEEE 754. The text is run with
`wp`, `int`, `float`, `range`, `min`, `max` and `abs` replaced by what is here. Where an operator of
NumPy differs from a kernel's, programs call the function: `wp.div` and `wp.mod` of integers. Views
of one NumPy array may be passed under several names.
"""

import ast
import itertools
from types import SimpleNamespace

import numpy as np


def plain(value):
    """The NumPy value of a composite or scalar."""
    return value.data if isinstance(value, Composite) else value


class Kind:
    """A scalar type: converts as kernels do, saturating from floats and wrapping from integers."""

    def __init__(self, dtype):
        self.dtype = np.dtype(dtype)

    def __call__(self, value=0):
        if self.dtype.kind not in "iu":
            return self.dtype.type(value)
        info = np.iinfo(self.dtype)
        if isinstance(value, float | np.floating):
            if np.isnan(value):
                return self.dtype.type(0)
            return self.dtype.type(int(max(int(info.min), min(int(info.max), value))))
        low, high = int(info.min), int(info.max)
        return self.dtype.type((int(value) - low) % (high - low + 1) + low)


KINDS = {
    name: Kind(name)
    for name in (
        *("int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"),
        *("float16", "float32", "float64"),
    )
}
SINGLE, INTEGER = KINDS["float32"], KINDS["int32"]


class Composite:
    """A vector or matrix."""

    def __init__(self, data):
        self.data = data

    def __getitem__(self, index):
        return self.data[index]

    def __setitem__(self, index, value):
        self.data[index] = value

    def __add__(self, other):
        return Composite(self.data + other.data)

    def __sub__(self, other):
        return Composite(self.data - other.data)

    def __neg__(self):
        return Composite(-self.data)

    def __mul__(self, other):
        if isinstance(other, Composite):
            return Composite(self.data @ other.data)
        return Composite(self.data * other)


class CompositeKind:
    """A type of vectors or matrices."""

    def __init__(self, shape, kind):
        self.shape, self.kind = shape, kind

    def __call__(self, *values):
        values = values or np.zeros(self.shape)
        return Composite(np.array(values, self.kind.dtype).reshape(self.shape))


class Record:
    """A struct."""

    def __init__(self, kinds):
        self.__dict__.update({name: kind() for name, kind in kinds.items()})


def make_struct(definition):
    """A `wp.struct`: a callable that makes records."""
    kinds = definition.__annotations__

    def make():
        return Record(kinds)

    make.kinds = kinds
    return make


class Array:
    """An array of a launch; `element` is its kind. An element is a view until it is assigned."""

    def __init__(self, data, element):
        self.data, self.element = data, element

    def __getitem__(self, index):
        found = self.data[index]
        if isinstance(self.element, CompositeKind):
            return Composite(found)
        if isinstance(self.element, Kind):
            return found
        record = self.element()
        for name, kind in self.element.kinds.items():
            value = found[name]
            record.__dict__[name] = (
                Composite(value.copy()) if isinstance(kind, CompositeKind) else value
            )
        return record

    def __setitem__(self, index, value):
        if isinstance(value, Record):
            for name, field in value.__dict__.items():
                self.data[name][index] = plain(field)
        else:
            self.data[index] = plain(value)


def combine(function):
    """An atomic operation."""

    def run(array, *rest):
        *index, value = rest
        index = index[0] if len(index) == 1 else tuple(index)
        old = array[index]
        array[index] = function(old, value)
        return old

    return run


def divide(a, b):
    """The quotient of integers, toward zero; 0 for a zero divisor."""
    if b == 0:
        return type(a)(0)
    exact = abs(int(a)) // abs(int(b))
    return Kind(type(a))(exact if (a < 0) == (b < 0) else -exact)


def remainder(a, b):
    """The remainder with the sign of the dividend; 0 for a zero divisor."""
    if b == 0:
        return type(a)(0)
    exact = abs(int(a)) % abs(int(b))
    return Kind(type(a))(exact if a >= 0 else -exact)


def smaller(a, b):
    return np.fmin(a, b) if isinstance(a, np.floating) else min(a, b)


def larger(a, b):
    return np.fmax(a, b) if isinstance(a, np.floating) else max(a, b)


def dot(a, b):
    total = a.data[0] * b.data[0]
    for x, y in zip(a.data[1:], b.data[1:], strict=True):
        total = total + x * y
    return total


class Thread:
    """The index of the thread that runs."""

    index = ()

    def tid(self):
        index = tuple(map(np.int32, self.index))
        return index[0] if len(index) == 1 else index


THREAD = Thread()
VEC3, MAT22 = CompositeKind((3,), SINGLE), CompositeKind((2, 2), SINGLE)
VEC2 = CompositeKind((2,), SINGLE)
WP = SimpleNamespace(
    **KINDS,
    kernel=lambda *given, **options: given[0] if given else (lambda function: function),
    func=lambda function: function,
    struct=make_struct,
    array=lambda **options: None,
    array2d=lambda **options: None,
    tid=THREAD.tid,
    vec2=VEC2,
    vec3=VEC3,
    mat22=MAT22,
    types=SimpleNamespace(vector=lambda length, kind: CompositeKind((length,), kind)),
    div=divide,
    mod=remainder,
    min=smaller,
    max=larger,
    abs=abs,
    sqrt=np.sqrt,
    dot=dot,
    where=lambda condition, a, b: a if condition else b,
    atomic_add=combine(lambda a, b: a + b),
    atomic_sub=combine(lambda a, b: a - b),
    atomic_min=combine(smaller),
    atomic_max=combine(larger),
    atomic_and=combine(lambda a, b: a & b),
    atomic_or=combine(lambda a, b: a | b),
    atomic_xor=combine(lambda a, b: a ^ b),
)


def count(*bounds):
    """The counters of a loop."""
    return map(np.int32, range(*map(int, bounds)))


def copied(value):
    """The value of a name when an element is assigned to it."""
    return Composite(value.data.copy()) if isinstance(value, Composite) else value


class CopyElements(ast.NodeTransformer):
    """Assigns copies, where Python would assign views of elements."""

    def visit_Assign(self, node):
        if isinstance(node.value, ast.Subscript | ast.Name | ast.Attribute):
            name = ast.Name("copied", ast.Load())
            node.value = ast.copy_location(ast.Call(name, [node.value], []), node.value)
        return ast.fix_missing_locations(node)


def load(text):
    """The names that the text defines."""
    space = {"wp": WP, "int": INTEGER, "float": SINGLE, "range": count}
    space |= {"min": smaller, "max": larger, "abs": abs, "copied": copied, "OPTIONS": {}}
    exec(compile(CopyElements().visit(ast.parse(text)), "<reference>", "exec"), space)
    return space


def launch(kernel, dim, arguments):
    """Run a kernel of `load`; arguments are `Array`s and scalars."""
    extents = dim if isinstance(dim, tuple) else (dim,)
    with np.errstate(all="ignore"):
        for index in itertools.product(*map(range, extents)):
            THREAD.index = index
            kernel(*arguments)
