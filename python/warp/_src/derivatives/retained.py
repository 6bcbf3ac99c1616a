"""Retained gradients - readings of a backward pass that `retain_grad` keeps.

Several arrays of a tape may share elements: an array, views of it, another shape of it. The
retained gradient of an element is that by its contents after the last record that writes it, by
whichever array, so each array that is written is read at its last record, and the readings are put
back in the order of those records.
"""

from __future__ import annotations

from warp import _native
from warp._src.arrays.gradients import ArrayGradients
from warp._src.derivatives.foreign_writes import span


def shown_writes(records) -> dict[int, list]:
    """Arrays whose gradients are read, by the position of the last record that writes them."""
    if not ArrayGradients.any_retained:
        return {}
    everything = _native.arrays_of_records(records, False)
    retained = [_with_span(one) for one, *_ in everything if one.retain_grad]
    shown: dict = {}
    for one, _, position in _native.arrays_of_records(records, True):
        if one.retain_grad:
            shown.setdefault(position, []).append(one)
        elif retained and one.requires_grad:
            shown.setdefault(position, []).extend(_shared(_with_span(one), retained))
    return shown


def _with_span(one) -> tuple:
    return (*span(one.grad), one)


def _shared(written, retained) -> list:
    """Arrays of those elements that one array writes and others retain, where one of the two is
    packed and holds all of the other."""
    begin, end, one = written
    shared = []
    for first, last, other in retained:
        if first <= begin and end <= last and other.grad.is_contiguous:
            return [one]
        if begin <= first and last <= end and one.grad.is_contiguous:
            shared.append(other)
    return shared
