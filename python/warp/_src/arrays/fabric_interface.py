"""The dictionary by which applications of Omniverse Fabric describe attributes."""

from __future__ import annotations

from warp._src.arrays.array import array
from warp._src.devices import devices
from warp._src.types import dtypes, scalars

_SCALARS = {
    "b": scalars.bool,
    **{f"i{size}": getattr(scalars, f"int{8 * size}") for size in (1, 2, 4, 8)},
    **{f"u{size}": getattr(scalars, f"uint{8 * size}") for size in (1, 2, 4, 8)},
    **{f"f{size}": getattr(scalars, f"float{8 * size}") for size in (2, 4, 8)},
}
_SIDES = {4: 2, 9: 3, 16: 4, 25: 5}
_QUATERNIONS = ("quat", "quaternion")


class Described:
    """The description of an attribute in a dictionary.

    Attributes:
        dtype, ndim: type of the numbers, and 2 if elements are arrays of them.
        buckets: address and number of elements of each bucket that has some.
    """

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
        self.attrib = attrib
        self.dtype, self.ndim = element_type(about["type"], attrib)
        self.counts = [int(count) for count in about["counts"]]
        if any(count < 0 for count in self.counts):
            raise ValueError(f"attribute '{attrib}' has a bucket of negative size")
        self.buckets = self._buckets(about["pointers"], "pointers")
        if self.ndim == 2:
            self.length_buckets = self._buckets(about.get("array_lengths", ()), "array_lengths")

    def _buckets(self, pointers, what):
        if len(pointers) != len(self.counts):
            raise ValueError(
                f"attribute '{self.attrib}' has {len(self.counts)} buckets, but {len(pointers)} "
                f"'{what}'"
            )
        pairs = zip(map(int, pointers), self.counts, strict=True)
        return [(start, count) for start, count in pairs if count]

    def memory(self):
        """The array from the lowest address to the highest, and the places of elements in it."""
        return self._spread(self.buckets, scalars.uint64 if self.ndim == 2 else self.dtype)

    def lengths(self):
        """The same of the numbers that say how long arrays are."""
        return self._spread(self.length_buckets, scalars.uint64)

    def _spread(self, buckets, dtype):
        import numpy

        size = dtypes.type_size_in_bytes(dtype)
        first = min([start for start, _ in buckets], default=0)
        places, extent = [], 0
        for start, count in buckets:
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
            return array(shape=(0,), dtype=dtype, device=self.device), indices
        return array(ptr=first, shape=(extent,), dtype=dtype, device=self.device), indices


def element_type(about, attrib):
    """The type of numbers that the "type" of an attribute describes, and 2 if elements are arrays
    of them, else 1.

    Raises:
        ValueError: it is malformed, or kernels have no such type.
    """
    if len(about) != 5:
        raise ValueError(
            f"type of '{attrib}' must contain five elements, got {len(about)}: {about!r}"
        )
    usable, code, count, depth, role = about
    if not usable or code not in _SCALARS or depth not in (0, 1):
        raise ValueError(f"kernels have no type for attribute '{attrib}': {about!r}")
    return _number(_SCALARS[code], count, role, attrib), depth + 1


def _number(scalar, count, role, attrib):
    if role in ("matrix", "transform", "frame"):
        if count not in _SIDES:
            raise ValueError(
                f"matrices of '{attrib}' must have a square element count, got {count}"
            )
        return dtypes.matrix((_SIDES[count], _SIDES[count]), scalar)
    if role in _QUATERNIONS:
        return dtypes.quaternion(scalar)
    return scalar if count == 1 else dtypes.vector(count, scalar)
