"""One backward pass over the records of a tape."""

from __future__ import annotations

import functools
import itertools

from warp import _native
from warp._src.arrays.array import array
from warp._src.arrays.kept import Images
from warp._src.arrays.observers import Observers, Observing, copy_elements, copy_layout
from warp._src.derivatives import cotangents, handles
from warp._src.derivatives.retained import Reading, shown_writes
from warp._src.derivatives.singular import OneReport
from warp._src.derivatives.tape_records import LaunchRecord
from warp._src.devices import devices
from warp._src.devices.graphs import _captures
from warp._src.types import dtypes

# The state of backward passes.
_numbers = itertools.count(1)


class BackwardPass:
    """Seeds gradients, runs the records in reverse and leaves the gradients to be read.

    The gradient of an array that records write has several readings in the course of the pass. In
    the end it is that with respect to what the array held before the first record; with
    `retain_grad` that with respect to what it held after the last one, put there at the very end so
    that the pass does not depend on who looks.

    Args:
        tape: whose records.
        seeds: by array the array to copy to its gradient, or None for ones.
        check_finite: whether to look for what is not finite after each record.
        first: whether the tape is the beginning of the computation, and not a part of it.
    """

    def __init__(self, tape, seeds: dict, check_finite: bool = False, first: bool = True):
        self.tape = tape
        self.seeds = seeds
        self.records = tape._records
        self.check_finite = check_finite
        self.first = first
        self.position = 0
        # The overwritten memory.
        self.images = Images(copy_elements)

    def run(self) -> None:
        """Does all of it."""
        with Observing(tape=None), OneReport():
            self._wait_for_streams()
            found = self._set_aside()
            for target, seed in self.seeds.items():
                if seed is None:
                    target.grad.fill_(1)
                else:
                    target.grad.assign(seed)
            retained = self._reverse()
            for grad, before in found:
                cotangents.add_into(grad, before)
            for reading in reversed(retained):
                reading.put_back()
            self._remember()

    def _reverse(self) -> list:
        shown = shown_writes(self.records)
        retained: list = []
        position = len(self.records)
        in_a_row = not (shown or self.check_finite or _captures or Observers.executor)
        number = next(_numbers)
        while position:
            if in_a_row and not handles.alive:
                position = _native.reverse_launches(self.records, position, number)
                if not position:
                    break
            position -= 1
            self.position = position
            record = self.records[position]
            retained.extend(map(Reading, shown.get(position, ())))
            if self.check_finite:
                from warp._src.derivatives.finite import reverse_checked

                reverse_checked(record, self)
            else:
                record.reverse(self)
        return retained

    # The owner of each record.

    @functools.cached_property
    def _first_use(self) -> dict:
        """Position of the first record that uses an allocation."""
        first: dict = {}
        for one, position, _ in _native.arrays_of_records(self.records, False):
            root = _root(one)
            first[root] = min(position, first.get(root, position))
        return first

    def seen_before(self, one: array) -> bool:
        """True if a record before the one that is being reversed uses the array's allocation."""
        if not self.first:
            return True
        return self._first_use.get(_root(one), self.position) < self.position

    # Several passes over one tape.

    def _set_aside(self) -> list:
        """Clears what the last pass has left in gradients of results; (gradient, contents).

        A gradient that the caller has written since is a seed and stays, and one that gets a seed
        is overwritten by that.
        """
        seeded = {id(one.grad) for one in self.seeds}
        kept: list = []
        for version in self.tape._left:
            grad = version.array
            if id(grad) in seeded or version.overwriter() is not None or _is_zero(grad):
                continue
            kept.append((grad, copy_layout(grad)))
            grad.zero_()
        return kept

    def _remember(self) -> None:
        """Notes the gradients of results as they are left, the largest first."""
        found: dict = {}
        for one, *_ in _native.arrays_of_records(self.records, True):
            if one.grad_in_use is not None:
                found[one.grad_ptr, one.size] = one.grad
        if len(found) > 1:
            found = dict(sorted(found.items(), key=lambda item: -item[0][1]))
        self.tape._left = [Observers.memory.observe(grad) for grad in found.values() if grad.size]
        self.tape._seeded = list(self.seeds)

    def _wait_for_streams(self) -> None:
        """Lets the current streams wait for those that the launches were queued on."""
        streams = {
            id(record.stream): record.stream
            for record in self.records
            if isinstance(record, LaunchRecord) and record.stream is not None
        }
        if _captures:
            return
        for stream in streams.values():
            devices.get_stream(stream.device).wait_stream(stream)


def _is_zero(grad) -> bool:
    """True if a gradient is known to be zero, where looking costs little."""
    if grad.device_index != devices.CPU or grad.pinned or _captures or dtypes.is_struct(grad.dtype):
        return False
    return not grad._host_view().any()


def _root(one) -> int:
    """Address of the array that a view was made of."""
    owner = one._owner
    while isinstance(owner, array):
        one, owner = owner, owner._owner
    return one.ptr or 0
