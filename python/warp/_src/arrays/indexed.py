"""`wp.indexedarray`: some elements of an array, chosen by arrays of indices.

Each dimension may have an array of indices; `a[i, j]` is then the element
`data[indices0[i], indices1[j]]` of the array behind it. To a kernel an indexed array is a struct of
these arrays and of an integer that says which dimensions have indices. The front end resolves
accesses to accesses of the fields (`frontend.indexed`), so compiler, derivatives and launches know
nothing of it: gradients go to the elements of `data.grad`, those that are chosen twice get both.
"""

from __future__ import annotations

import functools
import typing

from warp import _native
from warp._src import errors
from warp._src.argument_kinds import ARRAY, COUNT, DATA, INTEGER, VALUE
from warp._src.arguments import checked, forwarded
from warp._src.arrays import hooks
from warp._src.arrays.allocation import allocate, new_array
from warp._src.arrays.array import array
from warp._src.arrays.copies import assign, clone, copy
from warp._src.arrays.data import element_bytes
from warp._src.arrays.index_checks import check_indices_lie_in, checked_indices
from warp._src.arrays.observers import Observing
from warp._src.arrays.operators import ArrayArithmetic
from warp._src.devices import devices
from warp._src.types import annotations, dtypes, scalars
from warp._src.types.native import ArrayType, IndexedArrayType
from warp._src.types.structs import StructInstance, make_struct

if typing.TYPE_CHECKING:
    import numpy as np


class IndexedRecord(StructInstance):
    """Base of the structs that kernels know indexed arrays as."""

    @classmethod
    def _accepted(cls, value):
        if value is None:
            return cls()
        if isinstance(value, indexedarray):
            value = value.__ctype__()
        return super()._accepted(value)

    def _shown(self):
        if self.data is None:
            return None
        indices = [
            getattr(self, f"indices{axis}") if self.indexed >> axis & 1 else None
            for axis in range(self.data.ndim)
        ]
        return indexedarray(self.data, indices)

    def to(self, device):
        """Copy of the elements on another device, which all are of an array there."""
        shown = self._shown()
        moved = None if shown is None else shown.to(device)
        return self._accepted(indexedarray(moved) if isinstance(moved, array) else moved)


@functools.cache
def record_class(dtype, ndim):
    """The struct for indexed arrays of an element type and rank."""
    fields = {"data": ArrayType(dtype, ndim)}
    fields |= {f"indices{axis}": ArrayType(scalars.int32) for axis in range(ndim)}
    # Bit i: dimension i has indices.
    fields["indexed"] = scalars.int32
    annotation = IndexedArrayType(dtype, ndim)
    name = annotation.described()
    about = {"__module__": __name__, "__qualname__": name, "__doc__": "An indexed array."}
    made = make_struct(name, fields, IndexedRecord, about)
    # The type of a field, as programs see it.
    made._wp_annotation_ = annotation
    return made


IndexedArrayType.make_record = staticmethod(record_class)


class indexedarray(ArrayArithmetic):
    """Elements of an array, chosen by an array of indices for each dimension.

    Args:
        data: the array behind it, which is not copied.
        indices: one-dimensional arrays of `int32` on the device of `data`, for the first
            dimensions in order, None for one that is not indexed; or the first of them alone.
            They may name elements several times; negative ones count from the end. Indices out of
            bounds are undefined behaviour, as in kernels, and an error in debug mode.
        dtype, ndim: element type and number of dimensions, checked against `data`.

    Without `data` the call gives an annotation: `wp.indexedarray(dtype=wp.vec3)`.

    Example:
        >>> import warp as wp
        >>> a = wp.array([0.0, 10.0, 20.0, 30.0], dtype=float, device="cpu")
        >>> some = wp.indexedarray(a, [wp.array([3, 1], dtype=int, device="cpu")])
        >>> print(some)
        [30. 10.]

    Raises:
        ValueError: `data` or an array of indices is none, or they do not fit together.
    """

    if typing.TYPE_CHECKING:  # Kernels read and write elements.

        def __getitem__(self, index: typing.Any) -> typing.Any: ...
        def __setitem__(self, index: typing.Any, value: typing.Any) -> None: ...

    _wp_array_ = True
    is_contiguous = False
    annotation = IndexedArrayType

    def __new__(cls, data=None, indices=None, dtype=None, ndim=None, **own):
        # A class derived from this one may take arguments of its own.
        if data is None and not own:
            if indices is not None:
                raise ValueError("expects `data` to make an indexed array")
            return IndexedArrayType(typing.Any if dtype is None else dtype, ndim or 1)
        return super().__new__(cls)

    def __class_getitem__(cls, params):
        return annotations.from_subscript(params, 1, IndexedArrayType)

    def __init__(self, data=None, indices=None, dtype=None, ndim=None):
        if not isinstance(data, array):
            raise ValueError(f"expects an array as `data`, but got '{type(data).__name__}'")
        if dtype is not None and not dtypes.types_equal(dtype, data.dtype):
            raise ValueError(
                f"expects `data` with elements of '{dtypes.type_repr(dtype)}', but got "
                f"'{dtypes.type_repr(data.dtype)}'"
            )
        if ndim is not None and ndim != data.ndim:
            raise ValueError(f"expects {ndim} dimensions, but got shape {data.shape}")
        self._choose(data, indices)

    def _choose(self, data, indices) -> None:
        self._indices = tuple(checked_indices(indices, data))
        self._data, self._record = data, None
        # Memory of an index at least, for the dimensions without.
        filled = [given for given in self._indices if given is not None and given.size]
        self._readable = filled[0] if filled else _one_element(scalars.int32, data, bytes(4))

    def __reduce__(self):
        return type(self), (self._data, self.indices[: self.ndim])

    @property
    def data(self) -> array:
        """The array behind; one of the same type and number of dimensions may take its place."""
        return self._data

    @data.setter
    def data(self, data):
        fits = isinstance(data, array) and dtypes.types_equal(data.dtype, self.dtype)
        if not fits or data.ndim != self.ndim:
            raise ValueError(
                f"expects an array of '{dtypes.type_repr(self.dtype)}' with {self.ndim} "
                f"dimensions as `data`, but got {data!r}"
            )
        check_indices_lie_in(data, self._indices)
        self._choose(data, self._indices[: self.ndim])

    @property
    def indices(self) -> list:
        """For each dimension its array of indices or None; can be set as in the constructor."""
        return [*self._indices]

    @indices.setter
    def indices(self, indices):
        check_indices_lie_in(self._data, checked_indices(indices, self._data))
        self._choose(self._data, indices)

    @property
    def shape(self) -> tuple[int, ...]:
        """Extents: numbers of indices, where there are some, and those of `data`."""
        pairs = zip(self._indices, self._data.shape, strict=False)
        return tuple([extent if given is None else given.size for given, extent in pairs])

    @property
    def size(self) -> int:
        """Number of elements."""
        count = 1
        for extent in self.shape:
            count *= extent
        return count

    @property
    def dtype(self):
        """Element type."""
        return self._data.dtype

    @property
    def ndim(self) -> int:
        """Number of dimensions, that of `data`."""
        return self._data.ndim

    @property
    def device(self):
        """The device of all arrays."""
        return self._data.device

    @property
    def device_index(self) -> int:
        """The device's number in the runtime, -1 for the CPU."""
        return self._data.device_index

    @property
    def item_size(self) -> int:
        """Bytes of an element."""
        return self._data.item_size

    @property
    def pinned(self) -> bool:
        """True if the memory is pinned, for copies to and from CUDA devices."""
        return self._data.pinned

    @property
    def requires_grad(self) -> bool:
        """True if derivatives are wanted; they are those of `data`."""
        return self._data.requires_grad

    @requires_grad.setter
    def requires_grad(self, value):
        self._data.requires_grad = value

    @property
    def grad(self):
        """The same elements of the gradient of `data`, or None."""
        return None if not self._data.requires_grad else self.over(self._data.grad)

    @checked(data=ARRAY)
    def over(self, data):
        """The same elements of another array."""
        return indexedarray(data, self._indices[: data.ndim])

    def __len__(self):
        return self.shape[0]

    def __bool__(self):
        return True

    def __repr__(self):
        return f"indexedarray(shape={self.shape}, dtype={dtypes.type_repr(self.dtype)})"

    def __str__(self):
        return str(self.numpy())

    def __ctype__(self):
        """The struct that kernels get."""
        known = (self._data.grad_ptr, self._data.ptr)
        if self._record is None or self._record[0] != known:
            record = record_class(self._data.dtype, self._data.ndim)()
            record.data = self._data
            for axis, given in enumerate(self._indices[: self._data.ndim]):
                if given is None:
                    given = self._stand_in(axis)
                else:
                    record.indexed |= 1 << axis
                setattr(record, f"indices{axis}", given)
            self._record = known, record
        return self._record[1]

    def _stand_in(self, axis) -> array:
        """The unused indices of a dimension that has none."""
        return self._readable._view(0, (self._data.shape[axis],), (0,))

    def _check_writable(self, what=None) -> None:
        self._data._check_writable(what)

    @checked(offset=INTEGER, count=COUNT)
    def part(self, offset, count, name):
        """Elements offset .. offset+count of one dimension; `name` is for messages.

        Raises:
            ValueError: the array has several dimensions.
        """
        if self.ndim != 1:
            raise errors.WarpShapeError(
                f"expects '{name}' to be one-dimensional to copy a part of it"
            )
        chosen = slice(offset, offset + count)
        if self._indices[0] is None:
            return self._data[chosen]
        return indexedarray(self._data, [self._indices[0][chosen]])

    def contiguous(self) -> array:
        """A packed copy of the elements."""
        return clone(self)

    def numpy(self) -> np.ndarray:
        """A copy of the elements as a NumPy array."""
        return self._read().numpy()

    def list(self) -> list:
        """All elements in row-major order, as Python numbers, composites or structs."""
        return self._read().list()

    def _read(self) -> array:
        """A packed copy that no tape records."""
        with Observing(tape=None):
            return clone(self, requires_grad=False)

    @checked()
    def to(self, device, requires_grad=None):
        """The indexed array itself if it is on `device`, else an array of its elements there."""
        if devices.resolve_index(device) == self.device_index:
            return self
        return clone(self, device=device, requires_grad=requires_grad)

    @checked(src=DATA)
    def assign(self, src) -> None:
        """Copies from an array, an indexed array, a NumPy array or lists of the same shape."""
        assign(self, src)

    def zero_(self) -> None:
        """Sets all bytes of the elements to zero."""
        self._fill(bytes(self.item_size))

    @checked(value=VALUE)
    def fill_(self, value) -> None:
        """Sets every element to `value`: a number, or what the element type can be made from.

        Raises:
            TypeError, ValueError: `value` is no element of the array's type.
        """
        self._fill(element_bytes(self.dtype, value))

    def fill(self, value) -> None:
        """`fill_` under NumPy's name."""
        self.fill_(value)

    def _fill(self, pattern) -> None:
        self._check_writable("fill_")
        if self.size:
            element = _one_element(self.dtype, self._data, pattern)
            copy(self, element._view(0, self.shape, (0,) * self.ndim))


def _one_element(dtype, neighbour, pattern) -> array:
    """An array of one element with these bytes, on the device of another array."""
    element = new_array(array)
    allocate(element, (1,), dtype, neighbour.device_index)
    _native.fill_array(element, pattern)
    return element


def select(source, key) -> indexedarray:
    """The value of `source[key]` if there are arrays in the key."""
    keys = source._keys(key)
    data = source[tuple([slice(None) if isinstance(one, array) else one for one in keys])]
    # Dimensions with one index are gone.
    left = [one for one in keys if isinstance(one, (slice, array))]
    return indexedarray(data, [one if isinstance(one, array) else None for one in left])


hooks.select = select


class RankedIndexedArray:
    """`wp.indexedarray2d` and its like: `wp.indexedarray` with a number of dimensions."""

    def __init__(self, ndim):
        self.ndim = ndim
        self.__name__ = f"indexedarray{ndim}d"

    def __call__(self, *args, **kwargs):
        kwargs.setdefault("ndim", self.ndim)
        return forwarded(indexedarray, *args, **kwargs)

    def __getitem__(self, params):
        return annotations.from_subscript(params, self.ndim, IndexedArrayType)

    def __instancecheck__(self, value):
        return isinstance(value, indexedarray) and value.ndim == self.ndim

    def __repr__(self):
        return f"warp.{self.__name__}"


indexedarray1d = RankedIndexedArray(1)
indexedarray2d = RankedIndexedArray(2)
indexedarray3d = RankedIndexedArray(3)
indexedarray4d = RankedIndexedArray(4)
