"""`wp.fabricarray`: one attribute whose elements lie in several buffers, the buckets.

The buffers are described by a dictionary, as applications of Omniverse Fabric give it; any buffers
will do. An element's place is counted once, in elements from the first of all buffers, so to
kernels such an array is an indexed array over the memory from the lowest address to the highest.
That bounds what can be described: buckets have to lie within 2^31 elements and a whole number of
elements apart, as those of one pool of memory do.
"""

from __future__ import annotations

import typing

from warp._src.arrays.array import array
from warp._src.arrays.indexed import indexedarray
from warp._src.devices import devices
from warp._src.types import annotations, dtypes, scalars
from warp._src.types.native import IndexedArrayType

_SCALARS = {
    "b": scalars.bool,
    **{f"i{size}": getattr(scalars, f"int{8 * size}") for size in (1, 2, 4, 8)},
    **{f"u{size}": getattr(scalars, f"uint{8 * size}") for size in (1, 2, 4, 8)},
    **{f"f{size}": getattr(scalars, f"float{8 * size}") for size in (2, 4, 8)},
}
_SIDES = {4: 2, 9: 3, 16: 4, 25: 5}
_QUATERNIONS = ("quat", "quaternion")


class FabricArrayType(IndexedArrayType):
    """Type of an array in buckets: `dtype` and `ndim`, which is 2 where elements are arrays."""

    # What programs write, for messages.
    shown = "fabricarray"

    def __repr__(self):
        return f"{self.shown}(dtype={dtypes.type_repr(self.dtype)}, ndim={self.ndim})"

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
            in an element, depth of arrays, role), "pointers" (addresses) and "counts" (elements of
            each bucket). The caller keeps the memory alive; the array keeps the dictionary.
        attrib: name of the attribute.
        dtype, ndim: element type and number of dimensions, checked against the attribute.

    Without `data` the call gives an annotation: `wp.fabricarray(dtype=wp.vec3)`. One array of
    indices chooses elements: `a[indices]` is a `wp.indexedfabricarray`.

    Raises:
        ValueError: a field is missing or malformed, or buckets do not lie in one piece of memory.
        NotImplementedError: elements of the attribute are arrays themselves.
    """

    annotation = FabricArrayType

    def __new__(cls, data=None, attrib=None, dtype=None, ndim=None, **own):
        if data is None and not own and attrib is None and (dtype or ndim):
            return cls.annotation(typing.Any if dtype is None else dtype, ndim or 1)
        return object.__new__(cls)

    def __class_getitem__(cls, params):
        return annotations.from_subscript(params, 1, cls.annotation)

    def __init__(self, data=None, attrib=None, dtype=None, ndim=None):
        if data is None:
            raise ValueError(
                "expects `data` to make a fabric array; as an annotation write "
                "`wp.fabricarray(dtype=...)`"
            )
        self.source = data
        described = _described(data, attrib)
        if dtype not in (None, typing.Any) and not dtypes.types_equal(dtype, described.dtype):
            raise ValueError(
                f"expects elements of '{dtypes.type_repr(dtype)}', but those of '{attrib}' are "
                f"'{dtypes.type_repr(described.dtype)}'"
            )
        if ndim not in (None, 1):
            raise ValueError(f"expects {ndim} dimensions, but '{attrib}' has one")
        super().__init__(*described.memory())

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
        if ndim not in (None, 1):
            raise ValueError(f"expects {ndim} dimensions, but the fabric array has one")
        self.source = fa
        # Places of the chosen elements; the check of what `indices` is comes first.
        chosen = indexedarray(fa.indices[0], indices).contiguous()
        indexedarray.__init__(self, fa.data, chosen)


class _Arrays:
    """`wp.fabricarrayarray` and its like: annotations of attributes whose elements are arrays."""

    def __init__(self, name, annotation):
        self.__name__ = name
        self.annotation = annotation

    def __call__(self, data=None, *args, dtype=None, **kwargs):
        if data is None:
            return self.annotation(typing.Any if dtype is None else dtype, 2)
        raise _no_arrays(f"'wp.{self.__name__}'")

    def __getitem__(self, params):
        return annotations.from_subscript(params, 2, self.annotation)

    def __repr__(self):
        return f"warp.{self.__name__}"


fabricarrayarray = _Arrays("fabricarrayarray", FabricArrayType)
indexedfabricarrayarray = _Arrays("indexedfabricarrayarray", IndexedFabricArrayType)


def _no_arrays(what):
    return NotImplementedError(
        f"{what}: attributes whose elements are arrays are not there yet; make a `wp.array` of each"
    )


class _described:
    """What a dictionary says of an attribute."""

    def __init__(self, data, attrib):
        for _ in range(2):
            data = getattr(data, "__fabric_arrays_interface__", data)
        if not isinstance(data, dict):
            raise ValueError(f"expects a dictionary as `data`, but got '{type(data).__name__}'")
        if data.get("version") != 1:
            raise ValueError(f"expects version 1 of the interface, but got {data.get('version')!r}")
        about = data.get("attribs", {}).get(attrib)
        if about is None:
            raise ValueError(f"there is no attribute {attrib!r} in the interface")
        self.device = devices.get_device(data["device"])
        self.dtype = element_type(about["type"], attrib)
        self.buckets = [
            (int(start), int(count))
            for start, count in zip(about["pointers"], about["counts"], strict=True)
            if count
        ]
        if any(count < 0 for _, count in self.buckets):
            raise ValueError(f"attribute '{attrib}' has a bucket of negative size")
        self.attrib = attrib

    def memory(self):
        """The array from the lowest address to the highest, and the places of elements in it."""
        import numpy

        size = dtypes.type_size_in_bytes(self.dtype)
        first = min([start for start, _ in self.buckets], default=0)
        places, extent = [], 0
        for start, count in self.buckets:
            ahead, odd = divmod(start - first, size)
            if odd or ahead + count > 2**31 - 1:
                raise ValueError(
                    f"buckets of '{self.attrib}' have to lie within 2^31 elements and a whole "
                    f"number of elements apart, but one starts {start - first} bytes after the "
                    f"first, with elements of {size} bytes"
                )
            places.append(numpy.arange(ahead, ahead + count, dtype=numpy.int32))
            extent = max(extent, ahead + count)
        found = numpy.concatenate(places) if places else numpy.empty(0, numpy.int32)
        indices = array(found, dtype=scalars.int32, device=self.device)
        if not extent:
            return array(shape=(0,), dtype=self.dtype, device=self.device), indices
        whole = array(ptr=first, shape=(extent,), dtype=self.dtype, device=self.device)
        return whole, indices


def element_type(about, attrib):
    """The element type that the "type" of an attribute describes.

    Raises:
        ValueError: it is malformed, or kernels have no such type.
        NotImplementedError: elements are arrays.
    """
    if len(about) != 5:
        raise ValueError(
            f"type of '{attrib}' must contain five elements, got {len(about)}: {about!r}"
        )
    usable, code, count, depth, role = about
    if not usable or code not in _SCALARS:
        raise ValueError(f"kernels have no type for attribute '{attrib}': {about!r}")
    if depth:
        raise _no_arrays(f"attribute '{attrib}'")
    scalar = _SCALARS[code]
    if role in ("matrix", "transform", "frame"):
        if count not in _SIDES:
            raise ValueError(
                f"matrices of '{attrib}' must have a square element count, got {count}"
            )
        return dtypes.matrix((_SIDES[count], _SIDES[count]), scalar)
    if role in _QUATERNIONS:
        return dtypes.quaternion(scalar)
    return scalar if count == 1 else dtypes.vector(count, scalar)
