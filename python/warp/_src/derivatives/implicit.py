"""Implicit differentiation - derivatives of a residual at the solution, not at the first guess.

A program computes a residual r(p) of a first guess on a tape, solves r(p) = 0 without the tape,
which overwrites p, and records the adjoint of the solution by `Tape.record_func`, with r and p.
Launches that have read p are then differentiated at the solution.
"""

from __future__ import annotations

from warp._src.derivatives.foreign_writes import span
from warp._src.derivatives.tape_records import FunctionRecord, LaunchRecord


class Solutions:
    """Finds the solutions that functions on a tape name."""

    def __init__(self):
        self._position, self._named = 0, set()

    def take(self, records, named, by) -> None:
        """Lets records before a function take solutions for what they have read.

        An array is a solution if launches since the function before have read it, it was
        overwritten without the tape, and no record has written or named it, so that what they have
        read was a guess; and if another array that the function names was written by a record.

        Args:
            records: those before the function.
            named: the arrays of the function.
            by: the event of the function.
        """
        found = [one for one in named if one.size and one.ptr not in self._named]
        recent = records[self._position :]
        self._position = len(records) + 1
        self._named.update(one.ptr for one in named)
        if not found:
            return
        known = [span(one) for record in recent for one in _known(record)]
        found = [one for one in map(span, found) if not _meets(one, known)]
        if not found or not any(_meets(span(one), known) for one in named):
            return
        for record in recent:
            if isinstance(record, LaunchRecord) and record.versions is not None:
                for (_, leaf), version in zip(record.call.leaves, record.versions, strict=True):
                    if version is not None and version.changed and _meets(span(leaf), found):
                        version.adopt(by)


def _known(record) -> list:
    return record.arrays() if isinstance(record, FunctionRecord) else record.written()


def _meets(one, others) -> bool:
    return any(one[0] < last and first < one[1] for first, last in others)
