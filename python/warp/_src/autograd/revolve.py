"""Checkpoint schedules: which states of a long computation to keep for its reverse pass.

Binomial checkpointing: with c copies, a sequence of up to C(c + r, c) steps is reversed so that no
step runs forward more than r times besides the run that is recorded (Griewank and Walther,
Algorithm 799: Revolve, ACM TOMS 26(1), 2000).
"""

from __future__ import annotations

import math
from collections.abc import Callable


def split(length: int, copies: int) -> int:
    """Steps to advance before the next copy, for a sequence whose start is one of the copies."""
    repetitions = 0
    while math.comb(copies + repetitions, copies) < length:
        repetitions += 1

    def most(slots: int, runs: int) -> int:
        return math.comb(slots + runs, slots) if runs >= 0 else 0

    low = max(1, most(copies, repetitions - 2), length - most(copies - 1, repetitions))
    high = min(most(copies, repetitions - 1), length - most(copies - 1, repetitions - 1))
    return max(1, min(low, high, length - 1))


def first_sweep(steps: int, copies: int) -> list[tuple[int, int]]:
    """Steps before which the first sweep keeps a copy, with the copies left from there on."""
    kept, start = [(0, copies)], 0
    while copies > 1 and steps - start > 1:
        start += split(steps - start, copies)
        copies -= 1
        kept.append((start, copies))
    return kept


class Reversal:
    """Runs a sequence of steps backwards.

    Args:
        keep: called with a step; copies the state before it.
        restore: called with a step; brings that state back.
        drop: called with a step; the copy is not needed any more.
        advance: called with a step; runs it.
        reverse: called with a step whose state is there; runs it and its derivative.
    """

    def __init__(
        self,
        keep: Callable[[int], None],
        restore: Callable[[int], None],
        drop: Callable[[int], None],
        advance: Callable[[int], None],
        reverse: Callable[[int], None],
    ):
        self.keep, self.restore, self.drop = keep, restore, drop
        self.advance, self.reverse = advance, reverse

    def run(self, steps: int, kept: list[tuple[int, int]]) -> None:
        """Reverses all steps after a first sweep that kept copies."""
        end = steps
        for start, copies in reversed(kept):
            self._part(start, end, copies)
            self.drop(start)
            end = start

    def _part(self, start: int, end: int, copies: int) -> None:
        """Reverses the steps start .. end-1; the state before `start` is one of the copies."""
        while end - start > 1 and copies > 1:
            middle = start + split(end - start, copies)
            self._move(start, middle)
            self.keep(middle)
            self._part(middle, end, copies - 1)
            self.drop(middle)
            end = middle
        for step in range(end - 1, start - 1, -1):
            self._move(start, step)
            self.reverse(step)

    def _move(self, start: int, step: int) -> None:
        self.restore(start)
        for between in range(start, step):
            self.advance(between)
