"""`wp.fabricarray`: one attribute whose elements lie in several buffers, the buckets.

Elements may be arrays themselves (`fabric_rows`): what lies in the buckets are then their addresses
and, beside these, their lengths.

The buffers are described by a dictionary, as applications of Omniverse Fabric give it; any buffers
will do. An element's place is counted once, in elements from the first of all buffers, so to
kernels such an array is an indexed array over the memory from the lowest address to the highest.
That bounds what can be described: buckets have to lie within 2^31 elements and a whole number of
elements apart, as those of one pool of memory do.
"""

from __future__ import annotations

import typing

from warp._src.arguments import forwarded
from warp._src.arrays.array import array
from warp._src.arrays.fabric_interface import Described
from warp._src.arrays.fabric_rows import record_of, rows_record
from warp._src.arrays.indexed import indexedarray
from warp._src.types import annotations, dtypes
from warp._src.types.native import IndexedArrayType


class FabricArrayType(IndexedArrayType):
    """Type of an array in buckets: `dtype` and `ndim`, which is 2 where elements are arrays."""

    shown = "fabricarray"

    def described(self):
        return f"{self.shown}(dtype={dtypes.type_repr(self.dtype)}, ndim={self.ndim})"

    @property
    def record(self):
        """The struct that kernels know it as."""
        return rows_record(self.dtype) if self.ndim == 2 else super().record

    def __call__(self, *args, **kwargs):
        raise TypeError(f"'{self!r}' is an annotation, use `wp.fabricarray(data, attrib)`")


class IndexedFabricArrayType(FabricArrayType):
    """Type of chosen elements of an array in buckets."""

    shown = "indexedfabricarray"


class fabricarray(indexedarray):
    """An attribute of Fabric: elements in several buffers, which are not copied.

    Args:
        data: dictionary of the fields "version" (1), "device" and "attribs". The last gives, by
            name, a dictionary of "type" (usable, code of the scalar such as "f4", number of scalars
            in an element, depth of arrays, role), "pointers" (addresses), "counts" (elements of
            each bucket) and, at depth 1, "array_lengths" (addresses of the lengths of each bucket's
            arrays, as those in the buckets of `uint64`). The caller keeps the memory alive; the
            array keeps the dictionary.
        attrib: name of the attribute.
        dtype, ndim: element type and number of dimensions, checked against the attribute.

    Without `data` the call gives an annotation: `wp.fabricarray(dtype=wp.vec3)`. One array of
    indices chooses elements: `a[indices]` is a `wp.indexedfabricarray`.

    Raises:
        ValueError: a field is missing or malformed, or buckets do not lie in one piece of memory.
    """

    annotation = FabricArrayType

    def __new__(cls, data=None, attrib=None, dtype=None, ndim=None, **own):
        if data is None and not own and attrib is None and (dtype or ndim):
            return cls.annotation(typing.Any if dtype is None else dtype, ndim or 1)
        return object.__new__(cls)

    # Nothing is freed: the caller keeps the memory. Python would lose an interrupt in a function.
    __del__ = object.__init__

    def __class_getitem__(cls, params):
        return annotations.from_subscript(params, 1, cls.annotation)

    def __init__(self, data=None, attrib=None, dtype=None, ndim=None):
        if data is None:
            raise ValueError(
                "expects `data` to make a fabric array; as an annotation write "
                "`wp.fabricarray(dtype=...)`"
            )
        self.source = data
        described = Described(data, attrib)
        if dtype not in (None, typing.Any) and not dtypes.types_equal(dtype, described.dtype):
            raise ValueError(
                f"expects elements of '{dtypes.type_repr(dtype)}', but those of '{attrib}' are "
                f"'{dtypes.type_repr(described.dtype)}'"
            )
        if ndim not in (None, typing.Any, described.ndim):
            raise ValueError(
                f"expects {ndim} dimension(s), but '{attrib}' has {described.ndim} dimension(s)"
            )
        super().__init__(*described.memory())
        if described.ndim == 2:
            self._of_rows(described.dtype, indexedarray(*described.lengths()))

    # For arrays, the type of their elements and how many there are of each.
    _row_dtype = None
    _lengths = None

    def _of_rows(self, dtype, lengths):
        """Makes the elements, which are addresses, arrays."""
        if lengths.shape != self.shape:
            raise ValueError(
                f"expects as many lengths as arrays, but got {lengths.size} and {self.size}"
            )
        self._row_dtype, self._lengths = dtype, lengths

    @property
    def dtype(self):
        """Element type, that of the elements of arrays where elements are arrays."""
        return self._row_dtype or self.data.dtype

    @property
    def ndim(self) -> int:
        """Number of dimensions: 2 where elements are arrays."""
        return 2 if self._row_dtype else 1

    @property
    def rows_record(self):
        """The struct that kernels get where elements are arrays."""
        return record_of(self._row_dtype, self, self._lengths)

    def __ctype__(self):
        return self.rows_record if self._row_dtype else super().__ctype__()

    def _read(self):
        self._check_numbers("read")
        return super()._read()

    def _fill(self, pattern):
        self._check_numbers("set")
        super()._fill(pattern)

    def __str__(self):
        return repr(self) if self._row_dtype else super().__str__()

    def _check_numbers(self, what):
        if self._row_dtype:
            raise TypeError(
                f"{self!r} has arrays as elements; they are {what} in kernels: `a[i][j]`"
            )

    def __getitem__(self, key):
        if not isinstance(key, array):
            raise KeyError(
                f"expects one array of indices, but got '{type(key).__name__}'; elements are read "
                "in kernels and by `numpy()`"
            )
        return indexedfabricarray(self, key)

    def over(self, data):
        """The same elements of another array; it lies in one piece."""
        return indexedarray(data, self.indices[: data.ndim])

    def __repr__(self):
        name = type(self).__name__
        return f"{name}(shape={self.shape}, dtype={dtypes.type_repr(self.dtype)})"


class indexedfabricarray(fabricarray):
    """Elements of an array in buckets, chosen by an array of indices.

    Args:
        fa: the `wp.fabricarray`.
        indices: one-dimensional array of `int32` on its device.
        dtype, ndim: element type and number of dimensions, checked against `fa`.

    Raises:
        ValueError: `fa` is no such array, or the indices do not fit.
    """

    annotation = IndexedFabricArrayType

    def __new__(cls, fa=None, indices=None, dtype=None, ndim=None, **own):
        return super().__new__(cls, fa, indices, dtype, ndim, **own)

    def __init__(self, fa=None, indices=None, dtype=None, ndim=None):
        if not isinstance(fa, fabricarray):
            raise ValueError(f"expects a fabric array, but got '{type(fa).__name__}'")
        if dtype not in (None, typing.Any) and not dtypes.types_equal(dtype, fa.dtype):
            raise ValueError(
                f"expects elements of '{dtypes.type_repr(dtype)}', but got "
                f"'{dtypes.type_repr(fa.dtype)}'"
            )
        if ndim not in (None, typing.Any, fa.ndim):
            raise ValueError(
                f"expects {ndim} dimension(s), but the fabric array has {fa.ndim} dimension(s)"
            )
        self.source = fa
        # Places of the chosen elements; the check of what `indices` is comes first.
        chosen = indexedarray(fa.indices[0], indices).contiguous()
        indexedarray.__init__(self, fa.data, chosen)
        if fa._row_dtype:
            chosen = indexedarray(fa._lengths.indices[0], indices).contiguous()
            self._of_rows(fa._row_dtype, indexedarray(fa._lengths.data, chosen))


class _Arrays:
    """`wp.fabricarrayarray` and its like: fabric arrays whose elements are arrays."""

    def __init__(self, made):
        self.__name__ = f"{made.__name__}array"
        self.made = made
        self.annotation = made.annotation

    def __call__(self, *args, **kwargs):
        return forwarded(self.made, *args, **{"ndim": 2, **kwargs})

    def __getitem__(self, params):
        return annotations.from_subscript(params, 2, self.annotation)

    def __repr__(self):
        return f"warp.{self.__name__}"


fabricarrayarray = _Arrays(fabricarray)
indexedfabricarrayarray = _Arrays(indexedfabricarray)
