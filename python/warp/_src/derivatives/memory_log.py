"""Values that loops of a kernel have read from arrays that it overwrites, kept before its adjoint.

The compiler makes kernels that run a launch again, on copies of the arrays that it updates, made
before the launch (lib/Transforms/Autodiff/Loops/MemoryLog.cpp). The first one counts how often each
thread comes to each place and computes no more than that needs, the second one fills the log. The
log lasts as long as the adjoint runs. They also find out whether a thread has touched what another
one has written, where indices do not tell; the derivative would be wrong then.
"""

from __future__ import annotations

import itertools

from warp import _native
from warp._src import errors
from warp._src.arrays.create import zeros
from warp._src.arrays.observers import copy_layout
from warp._src.derivatives.global_tape import (
    ThreadTrips,
    allocate_tapes,
    counted_loops,
    join_stream,
)
from warp._src.devices import devices
from warp._src.types import dtypes, scalars


def record(made, call, values, initial, saved) -> dict[tuple[str, int], list]:
    """The hidden arguments that an adjoint has for its log, by kind and number of the loop.

    Args:
        made: the derivative.
        call: the launch, and `values` its arguments.
        initial: copies of arrays as they were before the launch, by number.
        saved: what the launch itself has kept.

    Raises:
        WarpGradientError: a graph is being captured, threads have met, or nobody has kept what
            the launch has overwritten.
        WarpMemoryError: there is not enough memory. Nothing has been changed then.
    """
    if _native.is_capturing(call.device):
        raise errors.WarpGradientError(
            f"launch('{call.kernel.key}', adjoint=True): what its loops have read is found by "
            "running it again, which cannot be done while a graph is being captured",
            hint="write to another array than the one that is read",
            file=call.event.file,
            line=call.event.line,
        )
    device = devices.by_index(call.device)
    loops = counted_loops(made.hidden_of_sizing)
    numbers = {one.leaf for one in made.hidden_of_recording if one.kind == "offsets"} - {*loops}
    trips, threads = ThreadTrips(call, loops), ThreadTrips(call, numbers)
    threads.number_threads()
    state = trips.found | threads.found
    for one in made.hidden_of_recording:
        if one.kind == "claims":
            state[one.kind, one.leaf] = [_zeros_for(one, call, device)]
    counters = Counters(made.hidden_of_recording, device)
    state |= counters.parts
    kept = initial, saved
    _run(made.sizing, made.hidden_of_sizing, made, call, values, kept, state)
    tapes = [one for one in made.hidden_of_recording if one.kind == "tape"]
    tapes = allocate_tapes(tapes, trips.add_up(), call)
    _run(made.recording, made.hidden_of_recording, made, call, values, kept, state | tapes)
    _check(made, call, counters)
    return trips.found | tapes


def _run(native, hidden, made, call, values, kept, state) -> None:
    """Runs the launch, or a part of it, again, on copies of what it updates."""
    initial, saved = kept
    copies = {
        ("preserved", one.leaf): [_copy_of(one, made, call, initial, native is made.sizing)]
        for one in hidden
        if one.kind == "preserved"
    }
    join_stream(call)
    given = made.hidden_values(call, initial, saved, state | copies, hidden)
    native.launch(call.dim, values, given, call.device, call.stream, call.block_dim or 0)


def _copy_of(one, made, call, initial, is_sizing):
    """A copy of an array as it was before the launch, or after it if that is as good.

    The check that elements are written before they are read works on CPUs alone, and compares two
    runs that write the same elements. So what the launch has left does not do where loops,
    conditions or indices depend on it: that is what a sizing run reads of an array.
    """
    found = call.leaves[one.leaf][1]
    if found is None or not found.size:
        return found
    contents = initial.get(one.leaf)
    if contents is None and (is_sizing or not (made.unrecorded and call.device == devices.CPU)):
        raise made.not_recorded(call, one)
    return copy_layout(found if contents is None else contents)


def _zeros_for(one, call, device):
    dtype = dtypes.dtype_of(one.type).dtype
    found = call.leaves[one.leaf][1]
    return None if found is None else zeros(found.shape, dtype, device)


class Counters:
    """The counters of a recording, which one copy reads.

    Attributes:
        parts: the arrays as hidden arguments, by kind and number of the array.
    """

    def __init__(self, hidden, device):
        self._found = [one for one in hidden if one.kind == "counters"]
        sizes = [len(one.places) or 1 for one in self._found]
        self._ends = list(itertools.accumulate(sizes))
        self._whole = zeros(sum(sizes), scalars.int32, device) if sizes else None
        self.parts = {
            ("counters", one.leaf): [self._whole[end - size : end]]
            for one, size, end in zip(self._found, sizes, self._ends, strict=True)
        }

    def read(self):
        """Each counter's hidden argument with its counts."""
        counts = self._whole.numpy().tolist() if self._found else []
        begin = 0
        for one, end in zip(self._found, self._ends, strict=True):
            yield one, counts[begin:end]
            begin = end


def _check(made, call, counters) -> None:
    """Rejects a launch in which a thread touched what another one wrote."""
    for one, counts in counters.read():
        if one.leaf >= 0 and any(counts):
            raise made.overwritten(call, one.leaf)
        for place, count in zip(one.places, counts, strict=False):
            if count:
                raise errors.WarpGradientError(
                    f"{place}: an element that is read or written here is written by another "
                    f"thread of the launch, too ({count} times), so that its gradient depends on "
                    "their order",
                    hint="split the kernel in two, or write to another array",
                    file=call.event.file,
                    line=call.event.line,
                )
