"""Forward mode: tangents of arrays go the way of the arrays, since messages are linear.

An operation runs on the values, then on their tangents, both without the executor of forward mode.
A halo takes both in one message. On a tape the adjoints of tangents are recorded like those of
values, so second derivatives need nothing more.
"""

from __future__ import annotations

import warp as wp
from warp import _native
from warp._src.arrays.gradients import has_gradient
from warp._src.arrays.observers import Observers, Observing


class Along(_native.Scope):
    """A block in which plans are those of so many directions; ranks have to agree about them."""

    count = 0

    def __init__(self, count):
        self.wanted, self._before = count, None

    def _enter(self):
        self._before = Along.count
        Along.count = self.wanted

    def _restore(self):
        if self._before is not None:
            Along.count = self._before
        self._before = None


def described() -> str:
    """The mode that a plan is made in, for comparison and messages."""
    return f", in forward mode along {Along.count} direction(s)" if Along.count else ""


class Apart:
    """An exchange of values and tangents, which the executor of forward mode does not see."""

    def __init__(self, exchange, tape):
        self.exchange, self.tape = exchange, tape

    def run(self) -> None:
        """Sends and receives."""
        self.start()
        self.finish()

    def start(self) -> None:
        """Packs and begins to send."""
        with Observing(executor=None, tape=self.tape):
            self.exchange.start()

    def finish(self) -> None:
        """Waits, and unpacks."""
        with Observing(executor=None, tape=self.tape):
            self.exchange.finish()


def _tape():
    """The tape of this operation: one that records, or that of tangents."""
    return Observers.tape if Observers.tape is not None else Observers.executor.tape


def _twins(arrays) -> list:
    """For each direction the tangents of the arrays that have some."""
    state = Observers.executor
    if _tape() is not None:
        for one in arrays:
            if one.requires_grad:
                # A gradient is made when it is first asked for, and its tangents with it.
                assert one.grad is not None
    able = [one for one in arrays if has_gradient(one.dtype)]
    return [[state.twin(one, i) for one in able] for i in range(state.width if able else 0)]


def with_tangents(arrays, make) -> Apart:
    """The exchange that `make` gives for arrays and, behind them, their tangents."""
    state = Observers.executor
    state.access(arrays, arrays)
    twins = [one for row in _twins(arrays) for one in row]
    tape = _tape()
    with Observing(executor=None, tape=tape), Along(state.width):
        return Apart(make((*arrays, *twins)), tape)


def in_place(arrays, run, together=False):
    """Runs a linear operation that overwrites arrays, and the same on their tangents.

    Args:
        run: called with the arrays; gives what it gives for the values.
        together: one call for all.
    """
    state = Observers.executor
    state.access(arrays, arrays)
    twins = _twins(arrays)
    with Observing(executor=None, tape=_tape()), Along(state.width):
        if together:
            return run(*arrays, *(one for row in twins for one in row))
        found = run(*arrays)
        for row in twins:
            run(*row)
    return found


def produced(x, run):
    """Runs a linear operation that gives a new array, and the same on the tangents.

    Args:
        run: called with an array; gives the new one, or a tuple with it in front.
    """
    state = Observers.executor
    state.access([x], [])
    twins, tape = _twins([x]), _tape()
    with Observing(executor=None, tape=tape), Along(state.width):
        found = run(x)
        made = [run(row[0]) for row in twins]
    y = found[0] if isinstance(found, tuple) else found
    for i, one in enumerate(made):
        tangent = _twins([y])[i][0]
        with Observing(executor=None, tape=tape):
            wp.copy(tangent, one[0] if isinstance(one, tuple) else one)
    return found


def summed(arrays, run):
    """Runs a multilinear operation that gives a new array, whose adjoint is made of launches.

    Args:
        run: called with the arrays; for tangents once for each array, with it in its place.
    """
    state = Observers.executor
    state.access(arrays, [])
    twins = _twins(arrays)
    with Observing(executor=None, tape=_tape()), Along(state.width):
        found = run(*arrays)
    for i, row in enumerate(twins):
        # In a pass over a tape the launches of the adjoint bring tangents along.
        with Observing(executor=None, tape=state.tape), Along(state.width):
            total = None
            for k, tangent in enumerate(row):
                part = run(*arrays[:k], tangent, *arrays[k + 1 :])
                total = part if total is None else total + part
        target = _twins([found])[i][0]
        with Observing(executor=None, tape=state.tape):
            wp.copy(target, total)
    return found


def values_only(function):
    """Calls a function without tangents."""
    with Observing(executor=None):
        return function()
