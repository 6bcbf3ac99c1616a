"""Arrays of one thread, as `wp.zeros(shape=(2, 3), dtype=float)` makes in a kernel.

They are values like all else: one vector for each scalar of the element, whose components are
picked by the index. So they pass through branches, loops and calls, live in registers, and their
derivatives are exact. An assignment makes a new value of the variable; a function that assigns to
a parameter gives its last value back to the caller. A part of an array (`a[0]`, `a[1:]`) is a copy
to be read. One whose address is reckoned with lies in memory (`thread_memory`).
"""

from __future__ import annotations

import ast
import itertools
import math

from warp._src import errors
from warp._src.frontend import struct_classes, thread_memory
from warp._src.frontend.bindings import LocalArray, Value
from warp._src.frontend.context import Part
from warp._src.types import dtypes

# Components that a thread's registers, and the choice by an index, are good for.
_MOST = 1024


def leaves_of(native) -> list:
    """The scalars of an element as (type, count), one entry per number, composite or field."""
    if native.kind == "struct":
        return [leaf for _, field in native.fields for leaf in leaves_of(field)]
    if native.kind in ("vec", "mat", "quat", "transform"):
        return [(native.element, len(places_in(native)))]
    return [(native, 1)]


def places_in(native) -> list[tuple]:
    """Indices of the components of a composite, in order."""
    shape = native.shape or ([4] if native.kind == "quat" else [7])
    return list(itertools.product(*map(range, shape)))


class LocalPointer:
    """The `ptr` of a thread's array: an address to make an array of, with other elements."""

    __slots__ = ("array",)

    def __init__(self, array):
        self.array = array


class LocalArrays(Part):
    """Translates what is done with arrays of a thread."""

    def builtin_zeros(self, node):
        """`wp.zeros(shape, dtype)` of a shape known at compile time."""
        arguments, keywords = self.context.constructors.arguments(node)
        given = dict(zip(("shape", "dtype"), arguments, strict=False)) | keywords
        if len(arguments) > 2 or not set(given) <= {"shape", "dtype"} or "shape" not in given:
            raise self.context.type_error(node, "'zeros' expects `shape` and `dtype` in a kernel")
        shape = self.shape(given["shape"], node)
        native = self.context.constructors.native(given.get("dtype", float), node)
        leaves = leaves_of(native)
        if any(scalar.kind == "array" for scalar, _ in leaves):
            raise self.context.type_error(node, "elements of a thread's array cannot hold arrays")
        size = math.prod(shape)
        if size * sum(count for _, count in leaves) > _MOST:
            raise self.context.error(
                node,
                f"an array of a thread has at most {_MOST} numbers, but shape {shape} of "
                f"'{native.python_name}' has {size * sum(count for _, count in leaves)}",
                "pass an array with a part for each thread",
                errors.WarpCodegenValueError,
            )
        if thread_memory.is_addressed(self.context.source, node):
            return thread_memory.make(self.context, shape, native, node)
        self.context.at(node)
        parts = [
            self.builder.zero(self.context.access.composite_type([size * count], scalar))
            for scalar, count in leaves
        ]
        return LocalArray(shape, native, parts)

    def shape(self, binding, node) -> tuple[int, ...]:
        """A shape as ints.

        Raises:
            WarpCodegenValueError: it is not known at compile time, or an extent is not positive.
        """
        extents = binding if type(binding) is tuple else (binding,)
        known = [
            extent.constant() if type(extent) is Value else getattr(extent, "value", extent)
            for extent in extents
        ]
        if not all(isinstance(extent, int) for extent in known):
            raise self.context.error(
                node,
                "an array of a thread has its shape at compile time",
                kind=errors.WarpCodegenValueError,
                code="local-array-shape",
            )
        if not 1 <= len(known) <= 4 or min(known) < 1:
            raise self.context.error(
                node,
                f"expects 1 to 4 positive extents, but got {tuple(known)}",
                kind=errors.WarpCodegenValueError,
            )
        return tuple(int(extent) for extent in known)

    def attribute(self, array, name, node):
        """`shape`, `ndim`, `size`, `dtype`."""
        if name == "shape":
            return array.shape
        if name == "ndim":
            return len(array.shape)
        if name == "size":
            return math.prod(array.shape)
        if name == "dtype":
            return struct_classes.dtype_of(self.context, array.element, node)
        if name == "ptr":
            return LocalPointer(array)
        raise self.context.access.no_attribute(array, name, node)

    def reinterpreted(self, array, shape, native, node):
        """A copy of the numbers of an array as elements of another type."""
        shape = self.shape(shape, node)
        old, new = leaves_of(array.element), leaves_of(native)
        size = math.prod(shape) * sum(count for _, count in new)
        given = math.prod(array.shape) * sum(count for _, count in old)
        if len(old) != 1 or len(new) != 1 or old[0][0] != new[0][0] or size != given:
            raise self.context.type_error(
                node,
                f"the numbers of a '{array.python_name}' are not those of shape {shape} of "
                f"'{native.python_name}'",
            )
        return LocalArray(shape, native, array.parts, is_copy=True)

    # Elements.

    def subscript(self, array, items, node):
        """An element, or a copy of a part."""
        if len(items) > len(array.shape):
            raise self.context.error(
                node,
                f"expects at most {len(array.shape)} indices, but got {len(items)}",
                kind=errors.WarpCodegenIndexError,
            )
        if any(isinstance(item, ast.Slice) for item in items) or len(items) < len(array.shape):
            return self.part(array, items, node)
        number = self.number(array, [self.context.expressions.expr(item) for item in items], node)
        return self.read(array, number, node)

    def number(self, array, indices, node):
        """Row-major number of an element: an int if all indices are, else a value."""
        number = 0
        for index, extent in zip(indices, array.shape, strict=True):
            if isinstance(index, dtypes.scalar_base):
                index = index.value
            if type(index) is Value and index.constant() is not None:
                index = index.constant()
            if isinstance(index, int):
                if not -extent <= index < extent:
                    raise self.context.access.index_error(node, index, extent, "index")
                index = int(index) + (extent if index < 0 else 0)
            else:
                index = self.from_start(index, extent, node)
            number = self.plus(self.times(number, extent, node), index, node)
        return number

    def from_start(self, index, extent, node):
        """An index as `int32`, one below zero counted from the end."""
        index = self.context.materialize(index, node)
        if index.type.kind != "int":
            raise self.context.type_error(
                node,
                f"array index must be an integer, but got '{index.type.python_name}'",
                "use `int(...)`",
            )
        self.context.at(node)
        return self.builder.position(index, extent)

    def plus(self, a, b, node):
        if isinstance(a, int) and isinstance(b, int):
            return a + b
        if isinstance(a, int) and a == 0:
            return b
        return self.context.expressions.operator(
            node, "add", self.context.materialize(a, node), self.context.materialize(b, node)
        )

    def times(self, a, factor, node):
        if isinstance(a, int):
            return a * factor
        factor = self.context.materialize(factor, node)
        return self.context.expressions.operator(node, "mul", a, factor)

    def read(self, array, number, node):
        """The element of a row-major number."""
        self.context.at(node)
        parts = iter(array.parts)
        return self.read_as(array.element, parts, number, node)

    def read_as(self, native, parts, number, node):
        if native.kind == "struct":
            fields = [self.read_as(field, parts, number, node) for _, field in native.fields]
            return self.builder.struct_create(native, fields)
        part = next(parts)
        count = leaves_of(native)[0][1]
        first = self.times(number, count, node)
        found = [
            self.builder.extract(part, [self.place(first, offset, node)]) for offset in range(count)
        ]
        if native.kind in ("vec", "mat", "quat", "transform"):
            return self.builder.construct(native, found)
        return found[0]

    def place(self, first, offset, node):
        return self.context.materialize(self.plus(first, offset, node) if offset else first, node)

    def written(self, array, number, value, node):
        """The array with another element."""
        if array.is_copy:
            raise self.context.error(
                node,
                "a part of a thread's array is a copy and cannot be assigned to",
                "index the array itself, with all indices",
            )
        if value.type != array.element:
            raise self.context.type_error(
                node,
                f"expects '{array.element.python_name}' for an element of the array, but got "
                f"'{value.type.python_name}'",
            )
        made = []
        self.write_as(value, iter(array.parts), number, made, node)
        return LocalArray(array.shape, array.element, made)

    def write_as(self, value, parts, number, made, node):
        native = value.type
        if native.kind == "struct":
            for name, _ in native.fields:
                field = self.builder.struct_get(value, name)
                self.write_as(field, parts, number, made, node)
            return
        part = next(parts)
        first = self.times(number, leaves_of(native)[0][1], node)
        components = [value]
        if native.kind in ("vec", "mat", "quat", "transform"):
            components = self.context.slices.components(value, len(places_in(native)), node)
        self.context.at(node)
        for offset, component in enumerate(components):
            part = self.builder.insert(part, [self.place(first, offset, node)], component)
        made.append(part)

    def update(self, call, position, name, array):
        """Gives a caller's variable the value that a function has left in a parameter."""
        places = getattr(call, "args", [])
        given = places[position] if position < len(places) else None
        for keyword in getattr(call, "keywords", ()):
            if keyword.arg == name:
                given = keyword.value
        if given is None:
            return
        if type(array) is Value:
            self.context.slots.write_back(given, array, call)
            return
        if isinstance(given, ast.Call):
            # The result of a call is nobody's variable.
            return
        known = self.context.env.get(getattr(given, "id", None))
        if type(known) is not type(array):
            raise self.context.error(
                given,
                f"the function assigns to '{name}', and a part of a thread's array is a copy",
                "pass the array itself",
            )
        self.context.env[given.id] = array
        self.context.lines[given.id] = self.context.source.line(call)

    # Parts.

    def part(self, array, items, node):
        """A copy of a row or slice."""
        choices, shape = [], []
        for axis, extent in enumerate(array.shape):
            item = items[axis] if axis < len(items) else ast.Slice()
            if isinstance(item, ast.Slice):
                positions = list(self.context.access.slice_range(item, extent, node))
                shape.append(len(positions))
                choices.append(positions)
            else:
                choices.append([self.context.expressions.expr(item)])
        if not shape or 0 in shape:
            raise self.context.error(node, "an empty part of a thread's array is not supported")
        elements = [
            self.read(array, self.number(array, place, node), node)
            for place in itertools.product(*choices)
        ]
        return self.from_elements(tuple(shape), array.element, elements, node)

    def from_elements(self, shape, native, elements, node):
        columns = [[] for _ in leaves_of(native)]
        for element in elements:
            self.take_leaves(element, iter(columns), node)
        self.context.at(node)
        parts = [
            self.builder.construct(
                self.context.access.composite_type([len(column)], column[0].type), column
            )
            for column in columns
        ]
        return LocalArray(shape, native, parts, is_copy=True)

    def take_leaves(self, value, columns, node):
        native = value.type
        if native.kind == "struct":
            self.context.at(node)
            for name, _ in native.fields:
                self.take_leaves(self.builder.struct_get(value, name), columns, node)
        elif native.kind in ("vec", "mat", "quat", "transform"):
            count = len(places_in(native))
            next(columns).extend(self.context.slices.components(value, count, node))
        else:
            next(columns).append(value)
