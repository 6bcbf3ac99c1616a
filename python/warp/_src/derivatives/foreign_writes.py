"""Rejects a backward pass through what another library wrote while the tape recorded.

The gradient of the new contents would be taken for that of the old ones, and what led from other
memory to them, such as a message of MPI, would be missing.
"""

from __future__ import annotations

from warp._src import errors
from warp._src.derivatives.tape_records import CopyRecord, FunctionRecord, LaunchRecord


def check(tape) -> None:
    """Looks at what others wrote, unless a function that the tape calls stands for it.

    Raises:
        WarpGradientError: they wrote to what records before had written and records after read.
    """
    records = tape.launches
    for loan in tape.foreign_writes:
        before, after = records[: loan.position], records[loan.position :]
        if _has_way_back(reversed(before), loan) or _has_way_back(after, loan):
            continue
        if any(_meets(one.written(), loan) for one in before) and _is_read(after, loan):
            raise errors.WarpGradientError(
                f"backward: another library wrote to {loan.array!r} while the tape recorded, and "
                "no gradient passes through that",
                hint="write with `wp.copy` or `assign`, or record the way back with "
                "`tape.record_func`",
                file=loan.event.file,
                line=loan.event.line,
            )


def _has_way_back(records, loan) -> bool:
    """True if the next record that knows the memory is a function of the user's."""
    known = next((one for one in records if _meets(one.arrays(), loan)), None)
    return isinstance(known, FunctionRecord)


def _is_read(records, loan) -> bool:
    for one in records:
        if _meets(_read(one), loan):
            return True
        if any(_contains(written, loan.array) for written in _overwritten(one)):
            return False
    return False


def _read(record) -> list:
    if isinstance(record, LaunchRecord):
        call = record.call
        pairs = zip(call.leaves, call.accesses, strict=False)
        # The result of an addition to contents depends on them, too.
        return [leaf for (_, leaf), use in pairs if (use[0] or use[2]) and leaf is not None]
    return [record.src] if isinstance(record, CopyRecord) else record.arrays()


def _overwritten(record) -> list:
    """The arrays that a record overwrites as a whole; a launch may leave parts as they are."""
    return [] if isinstance(record, (LaunchRecord, FunctionRecord)) else record.written()


def _meets(arrays, loan) -> bool:
    begin, end = span(loan.array)
    return any(begin < last and first < end for first, last in map(span, arrays))


def _contains(outer, inner) -> bool:
    (first, last), (begin, end) = span(outer), span(inner)
    return outer.is_contiguous and first <= begin and end <= last


def span(array) -> tuple[int, int]:
    begin = array.ptr or 0
    return begin, begin + array.capacity if array.size else begin
