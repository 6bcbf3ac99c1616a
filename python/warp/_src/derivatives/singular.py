"""Counting singular points: `wp.config.singular = "report"`, and second derivatives.

Each launch of an adjoint has counters, one per source line where a derivative may not exist. They
are read and printed, summed over launches, when a backward pass ends.
"""

from __future__ import annotations

from warp import _native

# The order of derivative that messages name: by default the first.
SINGULAR = "singular point met {times}, its derivative counts as 0"
REPEATED = (
    "singular values or eigenvalues that are the same met {times}; second derivatives by what "
    "turns their vectors are left out there"
)
# Lines, counters and messages of launches since the last report.
_pending: list = []
_depth = 0


def count_singular(made, values, message=SINGULAR) -> None:
    """Notes the counters among the hidden arguments of a launch that was queued."""
    for hidden, value in zip(made.hidden, values, strict=True):
        if hidden.kind == "counters":
            _pending.append((hidden.places, value, message))
    if not _depth:
        report()


class OneReport(_native.Scope):
    """A block of launches that are reported together, at its end."""

    _outer = None

    def _enter(self):
        global _depth
        self._outer = _depth
        _depth = self._outer + 1

    def _leave(self, *exception):
        global _depth
        _depth = self._outer
        if not _depth:
            report()

    def _restore(self):
        global _depth
        if self._outer is not None:
            _depth = self._outer
        self._outer = None


def report() -> None:
    """Prints a line for each place where singular points were met, and forgets them."""
    if not _pending:
        return
    found, totals = list(_pending), {}
    _pending.clear()
    for places, counters, message in found:
        for place, count in zip(places, counters.numpy().tolist(), strict=False):
            if count:
                totals[place, message] = totals.get((place, message), 0) + count
    for (place, message), count in totals.items():
        times = "1 time" if count == 1 else f"{count} times"
        print(f"{place}: {message.format(times=times)}", flush=True)
