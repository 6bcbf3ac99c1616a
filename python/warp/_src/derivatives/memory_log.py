"""Values that loops of a kernel have read from arrays that it overwrites, kept before its adjoint.

The compiler makes a kernel that runs a launch again, on copies of the arrays that it updates, made
before the launch (lib/Transforms/Autodiff/Loops/MemoryLog.cpp). It runs twice: first it counts how
often each thread comes to each place, then it fills the log. The log lasts as long as the adjoint
runs. The kernel also finds out whether a thread has touched what another one has written, where
indices do not tell; the derivative would be wrong then.
"""

from __future__ import annotations

from warp import _native
from warp._src import errors
from warp._src.arrays.create import zeros
from warp._src.arrays.observers import copy_layout
from warp._src.derivatives.global_tape import allocate_tapes, join_stream, thread_arrays
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
        WarpGradientError: a graph is being captured, or threads have met.
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
    hidden = made.hidden_of_recording
    sites = 1 + max(one.leaf for one in hidden if one.kind == "trips")
    found = thread_arrays(call, sites)
    totals = zeros(sites, scalars.int64, device)
    state = {
        (one.kind, one.leaf): [_zeros_for(one, call, device)]
        for one in hidden
        if one.kind in ("claims", "counters")
    }
    state |= found | {("totals", -1): [totals]}
    no_tape = {one.leaf: [] for one in hidden if one.kind == "tape"}
    for one in hidden:
        if one.kind == "tape":
            no_tape[one.leaf].append(zeros((1, 1), dtypes.dtype_of(one.type).dtype, device))
    tapes = {("tape", leaf): made_for for leaf, made_for in no_tape.items()}
    _run(made, call, values, (initial, saved), state | tapes)
    counts = totals.numpy().tolist()
    tapes = allocate_tapes([one for one in hidden if one.kind == "tape"], counts, call)
    _run(made, call, values, (initial, saved), state | tapes)
    _check(made, call, state)
    return found | tapes


def _run(made, call, values, kept, state) -> None:
    """Runs the launch again, on copies of what it updates."""
    initial, saved = kept
    copies = {
        ("preserved", one.leaf): [_copy_of(one, made, call, initial)]
        for one in made.hidden_of_recording
        if one.kind == "preserved"
    }
    join_stream(call)
    hidden = made.hidden_values(call, initial, saved, state | copies, made.hidden_of_recording)
    made.recording.launch(call.dim, values, hidden, call.device, call.stream, call.block_dim or 0)


def _copy_of(one, made, call, initial):
    found = call.leaves[one.leaf][1]
    if found is None or not found.size:
        return found
    contents = initial.get(one.leaf)
    if contents is None:
        raise made.not_recorded(call, one)
    return copy_layout(contents)


def _zeros_for(one, call, device):
    dtype = dtypes.dtype_of(one.type).dtype
    if one.kind == "counters":
        return zeros(len(one.places) or 1, dtype, device)
    found = call.leaves[one.leaf][1]
    return None if found is None else zeros(found.shape, dtype, device)


def _check(made, call, state) -> None:
    """Rejects a launch in which a thread touched what another one wrote."""
    for one in made.hidden_of_recording:
        if one.kind != "counters":
            continue
        counts = state["counters", one.leaf][0].numpy().tolist()
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
