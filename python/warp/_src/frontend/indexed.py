"""Indexed arrays: accesses of their elements become accesses of the array behind them.

An indexed array is a struct of that array, one array of indices per dimension, and an integer whose
bits say which dimensions have indices (`warp._src.arrays.indexed`). The arrays of indices of the
others have the extents of their dimension and can be read, but mean nothing: a position is found
without a branch, so that equal ones are seen to be equal.

An attribute may have arrays as elements (`warp._src.arrays.fabric_rows`): a kernel makes a row from
its address and its length where it is indexed.
"""

from __future__ import annotations

from warp._src.frontend.bindings import BOOL, INT32
from warp._src.frontend.context import Part
from warp._src.types import dtypes
from warp._src.types.native import IndexedArrayType

_NAMES = ("indexedarray(", *(f"indexedarray{ndim}d(" for ndim in (2, 3, 4)))
_ROWS = "fabricarrayarray("


def array_of(native):
    """The type of an array, or of that behind an indexed array; None for other types."""
    if native.kind == "array":
        return native
    # No struct of a user has such a name.
    if native.kind == "struct" and native.struct_name.startswith((*_NAMES, _ROWS)):
        return native.fields[0][1]
    return None


def has_rows(native) -> bool:
    """True if a type is that of an attribute whose elements are arrays."""
    return native.kind == "struct" and native.struct_name.startswith(_ROWS)


class Indexed(Part):
    """Translates accesses of indexed arrays."""

    def resolved(self, binding, indices, node):
        """Array and indices of an element; ordinary arrays are what they are."""
        if binding.type.kind != "struct" or array_of(binding.type) is None:
            return binding, indices
        if has_rows(binding.type):
            return self.row(binding, indices[0], node), indices[1:]
        positions = [self.position(binding, *one, node) for one in enumerate(indices)]
        self.context.at(node)
        return self.builder.struct_get(binding, "data"), positions

    def row(self, rows, index, node):
        """The array that an element of an attribute is."""
        self.context.at(node)
        place = []
        for name in ("rows", "lengths"):
            found, indices = self.resolved(self.builder.struct_get(rows, name), [index], node)
            place.append(self.builder.load(found, indices))
        address, length = place
        element = array_of(rows.type).element
        native = type(element).parse(f"!warp.array<1 x {element}>")
        extent = self.builder.cast(length, INT32)
        return self.builder.array_at(native, address, [extent], None)

    def position(self, indexed, axis, index, node):
        """Index into the data for an index of a dimension."""
        self.context.at(node)
        bits = self.builder.struct_get(indexed, "indexed")
        bit = self.builder.constant(INT32, 1 << axis)
        chosen = self.builder.cast(self.builder.builtin("bit_and", [bits, bit])[0][0], BOOL)
        indices = self.builder.struct_get(indexed, f"indices{axis}")
        position = self.builder.cast(self.builder.load(indices, [index]), index.type)
        return self.builder.builtin("where", [chosen, position, index])[0][0]

    def extents(self, array, node):
        """Extents of an array or indexed array."""
        self.context.at(node)
        if has_rows(array.type):
            return self.extents(self.builder.struct_get(array, "rows"), node)
        axes = range(array_of(array.type).rank)
        if array.type.kind == "array":
            return tuple([self.builder.dim(array, axis) for axis in axes])
        indices = [self.builder.struct_get(array, f"indices{axis}") for axis in axes]
        return tuple([self.builder.dim(one, 0) for one in indices])

    def indexed_view(self, indexed, leading, node):
        """The indexed array of fewer dimensions that is left if the first have an index."""
        if has_rows(indexed.type):
            return self.row(indexed, leading[0], node)
        data, positions = self.resolved(indexed, leading, node)
        view = self.builder.view(data, positions)
        dtype = dtypes.dtype_of(view.type.element)
        native = dtypes.native_type(IndexedArrayType(dtype, view.type.rank))
        axes = range(len(leading), data.type.rank)
        rest = [self.builder.struct_get(indexed, f"indices{axis}") for axis in axes]
        bits = self.builder.struct_get(indexed, "indexed")
        shift = self.builder.constant(INT32, len(leading))
        bits = self.builder.builtin("rshift", [bits, shift])[0][0]
        return self.builder.struct_create(native, [view, *rest, bits])
