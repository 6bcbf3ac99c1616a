"""Reading on the host what a graph that is being captured is going to write.

Captured work runs when the graph is launched. Other work that runs while it is captured, on the
host or by another library, finds the contents from before. On a CUDA device all reading is an error
then; on the CPU that of memory which captured work writes is.
"""

from __future__ import annotations

import threading

from warp import _native
from warp._src import errors
from warp._src.arrays.hooks import captures
from warp._src.kernels.call import leaves_of


def check_settled(array) -> None:
    """Rejects reading an array on the CPU that captured work of this thread writes.

    Raises:
        WarpError: there is such work.
    """
    capture = captures.get(threading.get_ident())
    if capture is None or not array.size:
        return
    begin, end = _span(array)
    for other in _written(capture.held):
        first, last = _span(other)
        if first < end and begin < last:
            raise errors.WarpError(
                "cannot read an array on 'cpu' that is written by work which is being captured: "
                "the work runs when the graph is launched, and the array holds what it held "
                "before, read it after `wp.capture_launch`, or capture in two parts"
            )


def _span(array) -> tuple[int, int]:
    begin = array.ptr or 0
    return begin, begin + array.capacity


def _written(held) -> list:
    """The arrays on the CPU that captured work may write, of what a capture holds."""
    found, position = [], 0
    while position < len(held):
        one = held[position]
        position += 1
        if isinstance(one, _native.Kernel):
            values, position = _arguments(held, position, len(one.parameters))
            leaves = leaves_of(one.parameters, values)
            found += [
                array for array, changes in zip(leaves, _changes(one), strict=False) if changes
            ]
        elif isinstance(one, _native.Array):
            found.append(("", one))
    return [one for _, one in found if one is not None and one.size]


def _arguments(held, position, count) -> tuple[list, int]:
    """The arguments of a launch from a position on, and the position behind them.

    A struct is followed by the tuple of its arrays.
    """
    values: list = []
    for _ in range(count):
        values.append(held[position])
        has_fields = hasattr(held[position], "_wp_fields_") and not isinstance(held[position], type)
        position += 2 if has_fields else 1
    return values, position


def _changes(kernel):
    """True if a kernel writes an array, or adds to it, for each array among its arguments."""
    try:
        return [access[1] or access[2] for access in kernel.accesses]
    except RuntimeError:
        # Saved code without source.
        return [True] * 1024
