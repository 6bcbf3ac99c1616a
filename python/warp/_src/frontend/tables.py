"""Constant tables: NumPy arrays and tuples of numbers that a kernel captures and indexes.

The compiler holds a table once, in read-only memory, and reads it at any index; derivatives of what
is read are zero. The numbers are those of the moment when the kernel is translated. Elements have
the type of the NumPy array; Python's numbers in tuples become `int32`, `float32` or `bool`, as
literals do. A conversion of an element (`float(T[i])`) rounds the numbers once, when the kernel is
compiled.
"""

from __future__ import annotations

import ast
import math

from warp._src import errors
from warp._src.frontend.access import places_of
from warp._src.frontend.bindings import INT32, Value, is_table
from warp._src.frontend.context import Part
from warp._src.types import dtypes
from warp._src.types.composites import scalars_of

# Numbers of a table; a larger one is data, which kernels get as an array.
_MOST = 1 << 20
# The most numbers of a part.
_MOST_OF_PART = 1024
_KINDS = "biuf"


class Table:
    """The contents of a table.

    Attributes:
        shape: extents; those of composites are the last ones.
        element: the type of a number.
        composite: the type of an element that is a vector or the like; or None.
        numbers: a NumPy array of them; `data`: their bytes in row-major order.
    """

    __slots__ = ("composite", "data", "element", "numbers", "shape")

    def __init__(self, numbers, dtype, composite=None):
        self.shape = list(numbers.shape)
        self.element = dtypes.native_type(dtype)
        self.composite = composite and dtypes.native_type(composite)
        self.numbers, self.data = numbers, numbers.tobytes()


def _leaves(value) -> tuple[list, tuple]:
    """The numbers of a nested tuple and its extents.

    Raises:
        ValueError: parts of the tuple differ in their extents.
    """
    if type(value) is not tuple:
        return [value], ()
    parts = [_leaves(part) for part in value]
    if not parts or any(shape != parts[0][1] for _, shape in parts):
        raise ValueError
    return [leaf for leaves, _ in parts for leaf in leaves], (len(parts), *parts[0][1])


def _type_of(leaf):
    """The type of a constant in a tuple; None if it is something else."""
    if isinstance(leaf, (dtypes.scalar_base, dtypes.Composite)):
        return type(leaf)
    for kind in (bool, int, float):
        if isinstance(leaf, kind):
            return dtypes.canonical(kind)
    return None


class Tables(Part):
    """Translates subscripts of constant tables."""

    def of_tuple(self, binding):
        """The NumPy array, scalar type and composite type of a tuple; None if it is no table."""
        try:
            leaves, shape = _leaves(binding)
        except ValueError:
            return None
        kinds = {_type_of(leaf) for leaf in leaves}
        if kinds == {dtypes.int32, dtypes.float32}:
            kinds = {dtypes.float32}
        if len(kinds) != 1 or None in kinds:
            return None
        import numpy

        (kind,) = kinds
        if not issubclass(kind, dtypes.Composite):
            numbers = [getattr(leaf, "value", leaf) for leaf in leaves]
            return numpy.array(numbers, object).reshape(shape), kind, None
        numbers = [scalars_of(leaf) for leaf in leaves]
        extents = tuple(kind._shape_)
        return numpy.array(numbers, object).reshape(shape + extents), kind._wp_scalar_type_, kind

    def table(self, binding, node) -> Table | None:
        """The table of a NumPy array or tuple; None for a tuple of something else.

        Raises:
            WarpCodegenTypeError: the array holds something else than numbers.
            WarpCodegenValueError: it is empty, too long, or a number does not fit its type.
        """
        if type(binding) is tuple:
            found = self.of_tuple(binding)
            if found is None:
                return None
        else:
            dtype = getattr(dtypes, binding.dtype.name, None)
            if binding.dtype.kind not in _KINDS or not dtypes.type_is_scalar(dtype):
                raise self.context.type_error(
                    node, f"a constant table holds numbers, but the array has '{binding.dtype}'"
                )
            found = binding, dtype, None
        numbers, dtype, composite = found
        if not 0 < numbers.size <= _MOST:
            raise self.context.value_error(
                node,
                f"a constant table has 1 to {_MOST} numbers, but this one has {numbers.size}",
                "pass it as an array argument",
            )
        return Table(self.stored(numbers, dtype, node), dtype, composite)

    def stored(self, numbers, dtype, node):
        """The numbers as the type holds them."""
        import numpy

        name = dtypes.canonical(dtype).__numpy_dtype__
        if numbers.dtype != object:
            return numpy.ascontiguousarray(numbers, name)
        if dtype is dtypes.int32:
            for number in numbers.flat:
                self.context.integer(number, node)
        with numpy.errstate(over="ignore"):
            made = numbers.astype(name)
        for number, kept in zip(numbers.flat, made.flat, strict=True):
            if not math.isfinite(kept) and math.isfinite(number):
                raise self.context.value_error(
                    node,
                    f"number {number} does not fit '{dtypes.type_repr(dtype)}'",
                    "use a NumPy array of 'float64'",
                )
        return made

    def chain(self, node):
        """The value of `T[i][j]`, where `T` is a table; None for everything else."""
        items, root = [], node
        while isinstance(root, ast.Subscript):
            index = root.slice
            items[:0] = index.elts if isinstance(index, ast.Tuple) else [index]
            root = root.value
        if root is node.value or not isinstance(root, (ast.Name, ast.Attribute)):
            return None
        if any(isinstance(item, ast.Slice) for item in items):
            return None
        binding = self.context.expressions.expr(root)
        if not is_table(binding) and (type(binding) is not tuple or not self.of_tuple(binding)):
            return None
        indices = self.indices(items)
        if type(binding) is tuple and all(map(self.is_known, indices)):
            # Numbers of a tuple stay numbers of Python.
            return None
        return self.read(binding, indices, node)

    def indices(self, items) -> list:
        """The bindings of indices; slices stay syntax."""
        return [
            item if isinstance(item, ast.Slice) else self.context.expressions.expr(item)
            for item in items
        ]

    @staticmethod
    def is_known(index) -> bool:
        return type(index) is not Value or index.constant() is not None

    def read(self, binding, indices, node):
        """An element, or a row as a vector or matrix; None for a tuple that is no table."""
        table = self.table(binding, node)
        if table is None:
            return None
        rank = len(table.shape)
        if len(indices) > rank:
            raise self.context.error(
                node,
                f"expects at most {rank} {'index' if rank == 1 else 'indices'} for a table of "
                f"shape {tuple(table.shape)}, but got {len(indices)}",
                kind=errors.WarpCodegenIndexError,
            )
        chosen = []
        for axis, extent in enumerate(table.shape):
            index = indices[axis] if axis < len(indices) else ast.Slice()
            if isinstance(index, ast.Slice):
                positions = self.context.access.slice_range(index, extent, node)
                chosen.append(([self.builder.constant(INT32, at) for at in positions], True))
            else:
                chosen.append(([self.context.materialize(index, node)], False))
        return self.selected(table, chosen, node)

    def selected(self, table, chosen, node):
        lengths = [len(choices) for choices, remains in chosen if remains]
        if len(lengths) > 2 or not 0 < math.prod(lengths) <= _MOST_OF_PART:
            raise self.context.type_error(
                node,
                "a part of a table is a number, or a vector or matrix of at most "
                f"{_MOST_OF_PART} numbers, but this one has shape {tuple(lengths)}",
                "use more indices",
            )
        self.context.at(node)
        values = [self.element(table, place) for place in places_of(chosen)]
        if not lengths:
            return values[0]
        native = table.composite
        if native is None or lengths != list(native.shape or [len(values)]):
            native = self.context.access.composite_type(lengths, table.element)
        return self.builder.construct(native, values)

    def element(self, table, place):
        """A number; a constant if its place is known."""
        known = [index.constant() for index in place]
        inside = [
            type(at) is int and -extent <= at < extent
            for at, extent in zip(known, table.shape, strict=True)
        ]
        if all(inside):
            return self.builder.constant(table.element, table.numbers[tuple(known)].item())
        return self.builder.table_get(table.element, table.shape, table.data, place)
