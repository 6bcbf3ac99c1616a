"""Retained gradients - readings of a backward pass that `retain_grad` keeps.

Several arrays of a tape may share elements: an array, views of it, another shape of it. The
retained gradient of an element is that by its contents after the last record that writes it, by
whichever array, so each array that is written is read at its last record, and the readings are put
back in the order of those records.
"""

from __future__ import annotations

from warp import _native
from warp._src.arrays.array import array
from warp._src.arrays.gradients import ArrayGradients
from warp._src.arrays.indexed import indexedarray
from warp._src.arrays.observers import copy_layout
from warp._src.derivatives.foreign_writes import span
from warp._src.types import dtypes, scalars

_WORDS = {2: scalars.uint16, 4: scalars.uint32, 8: scalars.uint64}


class Reading:
    """The gradient of an array, as it is when this is made."""

    def __init__(self, grad):
        self._grad, self._kept = grad, self._copy(grad)

    @staticmethod
    def _copy(grad):
        return copy_layout(grad) if isinstance(grad, array) else grad.contiguous()

    def put_back(self) -> None:
        """Sets the gradient to what it was then."""
        self._grad.assign(self._kept)


def shown_writes(records) -> dict[int, list]:
    """Gradients that are read, by the position of the last record that writes their arrays."""
    if not ArrayGradients.any_retained:
        return {}
    everything = _native.arrays_of_records(records, False)
    retained = [_with_span(one) for one, *_ in everything if one.retain_grad]
    shown: dict = {}
    for one, _, position in _native.arrays_of_records(records, True):
        if one.retain_grad:
            shown.setdefault(position, []).append(one.grad)
        elif retained and one.requires_grad:
            shown.setdefault(position, []).extend(_shared(_with_span(one), retained))
    return shown


def _with_span(one) -> tuple:
    return (*span(one.grad), one)


def _shared(written, retained) -> list:
    """Gradients of the elements that one array writes and others retain."""
    begin, end, one = written
    shared = []
    for first, last, other in retained:
        if first <= begin and end <= last and other.grad.is_contiguous:
            return [one.grad]
        if begin <= first and last <= end and one.grad.is_contiguous:
            shared.append(other.grad)
        elif begin < last and first < end:
            shared.extend(_intersection(one.grad, other.grad))
    return shared


def _intersection(one, other) -> list:
    """The numbers that two gradients share, where none of them holds all of the other."""
    import numpy

    size = min(map(_size_of_scalar, (one, other)))
    common = numpy.intersect1d(_places(one, size), _places(other, size))
    if not common.size:
        return []
    first = int(common[0])
    numbers = array(
        ptr=first,
        shape=(int(common[-1]) - first) // size + 1,
        dtype=_WORDS[size],
        device=one.device,
    )
    return [indexedarray(numbers, [array((common - first) // size, int, device=one.device)])]


def _size_of_scalar(grad) -> int:
    return dtypes.type_size_in_bytes(dtypes.type_scalar_type(grad.dtype))


def _places(grad, size):
    """Addresses of the words of so many bytes that a gradient is made of."""
    import numpy

    places = numpy.array(grad.ptr, dtype=numpy.int64)
    for extent, step in zip(grad.shape, grad.strides, strict=True):
        places = places[..., None] + numpy.arange(extent) * step
    words = dtypes.type_size_in_bytes(grad.dtype) // size
    return places[..., None] + numpy.arange(words) * size
