"""Derivatives in the kernel cache, beside the translations of the kernels that they are of.

A derivative follows from the translation of its kernel and from what it was asked for, so its name
is made of the name of the one (`kernels.translations`) and of the other.
"""

from __future__ import annotations

import marshal
import typing
from _blake2 import blake2b

from warp import _native

_FACTS = ("needed", "one_thread", "notices", "metrics")
# Kernels that may come with a derivative, beside its own.
_PARTS = ("augmented", "counting", "sizing", "recording")
# Its lists of hidden arguments, and those of the parts.
_HIDDEN = ("hidden", "hidden_of_counting", "hidden_of_sizing", "hidden_of_recording")


class Hidden(typing.NamedTuple):
    """An argument that only a derivative has, as the compiler describes it."""

    kind: str
    leaf: int
    direction: int
    type: str
    places: list


class KeptDerivative:
    """The result of `differentiate`, with translations in place of modules."""

    def __init__(self, module, parts, facts, *hidden):
        self.module = module
        for part in _PARTS:
            setattr(self, part, parts.get(part))
        self.needed, self.one_thread, self.notices, self.metrics = facts
        for name, described in zip(_HIDDEN, hidden, strict=True):
            setattr(self, name, [Hidden(*one) for one in described])


def find(kernel, native, asked) -> tuple:
    """The name of a derivative, None if it has none; and the derivative, None if it is not there.

    Args:
        kernel: the kernel in Python.
        native: the native kernel that it is of.
        asked: all that was asked for; its text has to say what it is.
    """
    primal = kernel.names.get(native)
    if primal is None:
        return None, None
    name = _digest(primal, asked)
    known = _native.find_translation(name)
    if known is None:
        return name, None
    parts, facts, *hidden = marshal.loads(known.notes)
    found = {part: _native.find_translation(_digest(name, part)) for part in parts}
    if None in found.values():
        return name, None
    return name, KeptDerivative(known, found, facts, *hidden)


def keep(name, made, derivative) -> None:
    """Leaves a derivative for other processes.

    Args:
        made: what `differentiate` has returned.
        derivative: the native kernels that were made of it.
    """
    parts = {part: getattr(derivative, part) for part in _PARTS}
    parts = {part: native for part, native in parts.items() if native is not None}
    for part, native in parts.items():
        _native.store_translation(_digest(name, part), native, b"")
    described = [
        [tuple(getattr(one, field) for field in Hidden._fields) for one in hidden]
        for hidden in (getattr(made, name) for name in _HIDDEN)
    ]
    facts = tuple(getattr(made, fact) for fact in _FACTS)
    notes = marshal.dumps((tuple(parts), facts, *described))
    _native.store_translation(name, derivative.native, notes)


def _digest(*parts) -> str:
    return blake2b(repr(parts).encode(), digest_size=32).hexdigest()
