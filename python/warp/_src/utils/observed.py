"""Work that is neither a launch nor a copy, while tapes keep an eye on memory."""

from __future__ import annotations

from warp._src.arrays.observers import Observers, Place


def writing(what: str, *targets) -> None:
    """Says that memory is about to change: what tapes recorded of it before is no longer there.

    Args:
        what: name of the operation for messages.
        targets: the arrays that are written.

    Raises:
        ValueError: one of them is read-only.
    """
    for target in targets:
        target._check_writable(what)
    if Observers.active:
        for target in targets:
            Observers.memory.writing(target, Place(what))
