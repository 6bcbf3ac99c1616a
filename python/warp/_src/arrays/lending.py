"""Writes of other libraries to arrays on the CPU while a tape records.

A tape does not see it. Memory that it knows and that others get to see is looked at again before
the next operation of ours, which tells whether they wrote there, and between which records.
"""

from __future__ import annotations

import typing
import zlib

from warp._src.arrays.versions import Event, event

lent: list = []
"""The memory that others have seen since our last operation."""


class Loan(typing.NamedTuple):
    """Memory that others have seen.

    Attributes:
        tape: the tape that records.
        position: the number of records that it had.
        array: has the memory.
        event: where others got it.
        checksum: of its contents then.
    """

    tape: typing.Any
    position: int
    array: typing.Any
    event: Event
    checksum: int


def lend(array, tape) -> None:
    """Notes that others get to see an array, if the tape could lose a gradient by it."""
    records = getattr(tape, "launches", None)
    if records and array.requires_grad and array.size:
        where = event("writing by another library")
        lent.append(Loan(tape, len(records), array, where, _checksum(array)))


def settle() -> None:
    """Called before an operation of ours: tells tapes what others wrote."""
    for loan in lent:
        if _checksum(loan.array) != loan.checksum:
            loan.tape.foreign_writes.append(loan)
    lent.clear()


def _checksum(array) -> int:
    import numpy

    contents = numpy.ascontiguousarray(array._host_view()).reshape(-1)
    return zlib.crc32(contents.view(numpy.uint8))
