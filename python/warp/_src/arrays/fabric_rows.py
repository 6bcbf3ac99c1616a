"""Attributes of Fabric whose elements are arrays, as kernels know them.

To a kernel such an attribute is a struct of two arrays in buckets: addresses of the rows, and how
many elements each has. The front end makes an array of both where a row is asked for
(`frontend.indexed`), so what the application puts there later is seen by the next launch.
"""

from __future__ import annotations

import functools

from warp._src.arrays.indexed import indexedarray
from warp._src.types import dtypes, scalars
from warp._src.types.native import ArrayType, IndexedArrayType
from warp._src.types.structs import StructInstance, make_struct


class RowsRecord(StructInstance):
    """Base of the structs that kernels know arrays of rows as."""

    @classmethod
    def _accepted(cls, value):
        if value is None:
            return cls()
        return super()._accepted(getattr(value, "rows_record", value))


@functools.cache
def rows_record(dtype):
    """The struct for rows of elements of a type."""
    addresses = IndexedArrayType(scalars.uint64).record
    # No rows lie in `data`: it says what their elements are.
    fields = {"data": ArrayType(dtype, 2), "rows": addresses, "lengths": addresses}
    name = f"fabricarrayarray(dtype={dtypes.type_repr(dtype)})"
    about = {"__module__": __name__, "__qualname__": name, "__doc__": "Rows in buckets."}
    return make_struct(name, fields, RowsRecord, about)


def record_of(dtype, addresses, lengths):
    """The struct of rows at addresses, with their lengths: arrays of `uint64` in buckets."""
    record = rows_record(dtype)()
    record.rows, record.lengths = (
        indexedarray(one.data, one.indices[:1]) for one in (addresses, lengths)
    )
    return record
