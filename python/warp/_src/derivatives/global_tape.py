"""Memory for loops that keep all of their iterations: the option `tape="global"`.

Before the adjoint, a kernel made from it is launched that only counts: it finds how many trips each
loop makes in each thread. A scan makes of those where in the tape of the loop the thread's part
begins. The host reads the totals and allocates the tapes, which last as long as the adjoint runs.
"""

from __future__ import annotations

import math

from warp import _native
from warp._src import errors
from warp._src.arrays.create import empty, zeros
from warp._src.devices import devices
from warp._src.devices.scoped import ScopedStream
from warp._src.types import dtypes, scalars

# A tape has rows of so many elements (lib/Transforms/Autodiff/GlobalTape.cpp).
ROW = 1 << 16


def allocate(made, call, values, known) -> dict[tuple[str, int], list]:
    """The hidden arguments that an adjoint has for its tapes, by kind and number of the loop.

    Args:
        made: the derivative.
        call: the launch, and `values` its arguments.
        known: function that gives the values of other hidden arguments, from a list of those.

    Raises:
        WarpGradientError: a graph is being captured.
        WarpMemoryError: there is not enough memory. Nothing has been changed then.
    """
    if _native.is_capturing(call.device):
        raise errors.WarpGradientError(
            f"launch('{call.kernel.key}', adjoint=True): how long its loops are is read from the "
            f"device, which cannot be done while a graph is being captured",
            hint="set the option `tape` of the kernel to 'checkpoints'",
            file=call.event.file,
            line=call.event.line,
        )
    found, totals = _count(made, call, values, known)
    # Logged loads are there already.
    logged = {one.leaf for one in made.hidden_of_recording if one.kind == "tape"}
    tapes = [one for one in made.hidden if one.kind == "tape" and one.leaf not in logged]
    return found | allocate_tapes(tapes, totals, call)


def allocate_tapes(tapes, totals, call) -> dict[tuple[str, int], list]:
    """Memory for hidden arguments that are tapes, by kind and number of the loop.

    Args:
        totals: by number of the loop, how many elements there are.
        call: the launch.

    Raises:
        WarpMemoryError: there is not enough memory. Nothing has been changed then.
    """
    found: dict[tuple[str, int], list] = {}
    needed = sum(totals[hidden.leaf] * _item_size(hidden) for hidden in tapes)
    trips = sum(totals.values())
    try:
        for hidden in tapes:
            made_for = found.setdefault(("tape", hidden.leaf), [])
            made_for.append(_empty(hidden, totals[hidden.leaf], call))
    except MemoryError as error:
        raise errors.WarpMemoryError(
            f"launch('{call.kernel.key}', adjoint=True): the tape of {trips} iterations "
            f"needs {needed} bytes on '{devices.by_index(call.device).alias}': {error}",
            hint="set the option `tape` of the kernel to 'checkpoints', or launch fewer threads "
            "at once",
            file=call.event.file,
            line=call.event.line,
        ) from error
    join_stream(call)
    return found


def join_stream(call) -> None:
    """Lets the launch's stream wait for that on which arrays are made."""
    if call.stream is not None:
        call.stream.wait_stream(devices.get_stream(call.stream.device))


def _count(made, call, values, known):
    """The arrays of trips and offsets by kind and loop, and per loop the trips of all threads."""
    trips = ThreadTrips(call, counted_loops(made.hidden_of_counting))
    join_stream(call)
    hidden = known(made.hidden_of_counting, trips.found)
    made.counting.launch(call.dim, values, hidden, call.device, call.stream, call.block_dim or 0)
    return trips.found, trips.add_up()


def counted_loops(hidden) -> list[int]:
    """Numbers of the loops that a kernel with these hidden arguments counts."""
    return [one.leaf for one in hidden if one.kind == "trips"]


class ThreadTrips:
    """The trips and the offset of each thread, per loop.

    Attributes:
        found: the arrays as hidden arguments, by kind and number of the loop.
    """

    def __init__(self, call, loops):
        extents = tuple(call.dim) if isinstance(call.dim, (tuple, list)) else (int(call.dim),)
        shape = extents + (1,) * (4 - len(extents))
        self._stream, self._pairs, self.found = call.stream, {}, {}
        count, device = math.prod(shape), devices.by_index(call.device)
        for loop in loops:
            # Behind the last thread a zero, whose offset is the sum.
            pair = zeros(count + 1, scalars.int64, device), empty(count + 1, scalars.int64, device)
            self._pairs[loop] = pair
            for kind, whole in zip(("trips", "offsets"), pair, strict=True):
                self.found[kind, loop] = [whole[:count].reshape(shape)]

    def add_up(self) -> dict[int, int]:
        """Makes offsets of trips; returns the trips of all threads, per loop."""
        with ScopedStream(self._stream):
            self._scan()
            return {loop: int(pair[1][-1:].numpy()[0]) for loop, pair in self._pairs.items()}

    def number_threads(self) -> None:
        """Makes the offsets 0, 1, ..., without a wait for the device."""
        with ScopedStream(self._stream):
            for trips, _ in self._pairs.values():
                trips.fill_(1)
            self._scan()

    def _scan(self) -> None:
        for trips, offsets in self._pairs.values():
            # `warp.utils` stands on this module.
            _native.scan_numbers(trips, offsets, "int64", 1, trips.size, False)


def _item_size(hidden) -> int:
    return dtypes.type_size_in_bytes(dtypes.dtype_of(hidden.type).dtype)


def _empty(hidden, count, call):
    shape = (1, count) if count <= ROW else (math.ceil(count / ROW), ROW)
    return empty(shape, dtypes.dtype_of(hidden.type).dtype, devices.by_index(call.device))
