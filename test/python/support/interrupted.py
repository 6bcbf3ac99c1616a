"""Interrupts at chosen steps of the package's Python code."""

import functools
import opcode
import os
import random
import sys

from support.random_runs import seeds

import warp

# Instructions after which Python looks for signals.
_LOOKS = {"CALL", "CALL_FUNCTION_EX", "JUMP_BACKWARD"}
_PACKAGE = os.path.dirname(os.path.realpath(warp.__file__))


@functools.cache
def _is_ours(file) -> bool:
    return os.path.realpath(file).startswith(_PACKAGE)


class InterruptError(BaseException):
    """An interrupt from outside, as Ctrl-C sends it."""


class _Steps:
    """Counts the steps of the package where Python looks for signals, and raises at one of them:
    the first of a function, and those behind a call and a jump back."""

    def __init__(self, stop=None):
        self.count, self.stop = 0, stop
        self.last: dict = {}

    def __call__(self, frame, event, argument):
        if not _is_ours(frame.f_code.co_filename):
            return None
        frame.f_trace_opcodes = True
        if event == "call":
            self.last[id(frame)] = None
        if event == "call" or (event == "opcode" and self._is_behind_call(frame)):
            self.count += 1
            if self.count == self.stop:
                raise InterruptError
        return self

    def _is_behind_call(self, frame) -> bool:
        last, self.last[id(frame)] = self.last.get(id(frame)), frame.f_lasti
        return last is not None and opcode.opname[frame.f_code.co_code[last]] in _LOOKS


def _traced(steps, work) -> bool:
    """True if the work was interrupted."""
    before, found = sys.gettrace(), False
    for run in (lambda: sys.settrace(steps) or work(), lambda: sys.settrace(before)):
        try:
            run()
            # One in a finalizer is raised a little later.
            for _ in range(10):
                pass
        except InterruptError:
            found = True
    return found


def interrupted_everywhere(work, check, most=150) -> int:
    """Interrupts `work()` at `most` of its steps, all if there are no more, and calls `check(step)`
    after each.

    Returns:
        How often it was interrupted.
    """
    work()
    steps = _Steps()
    _traced(steps, work)
    chosen = set(range(1, steps.count + 1))
    if len(chosen) > most:
        choose = random.Random(steps.count)
        chosen = {s for _ in seeds(1) for s in choose.sample(range(1, steps.count + 1), most)}
    found = 0
    for step in sorted(chosen):
        found += _traced(_Steps(step), work)
        check(step)
    return found
