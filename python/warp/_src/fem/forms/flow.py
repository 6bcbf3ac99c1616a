"""Flow analysis of a form's IR - what its values depend on, which vanish, equal, their degrees.

The IR of one thread has scalars alone. Each value gets the names of the arguments that it depends
on, whether it is zero whatever the arguments are (a product with 0 is), for which groups of
arguments it vanishes when they are zero, its polynomial degree in reference coordinates, and its
value for random arguments modulo a prime: values with the same one are equal as rational functions.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from fractions import Fraction
from hashlib import blake2b

_NAME = re.compile(r"%[\w$.-]+(?:#\d+)?")
_CARRIED = re.compile(r"(%[\w$.-]+) = (%[\w$.-]+(?:#\d+)?)")
_RESULTS = re.compile(r"^((?:%[\w$.-]+(?::\d+)?(?:, )?)+) = (.*)$")
_PASSING = frozenset(("arith.extf", "arith.truncf"))
# Joins of a loop until its carried values are stable; each adds to finite sets. A degree that
# grows so many times in a row is not known.
_MOST_ROUNDS, _MOST_GROWTH = 40, 8
UNKNOWN = 10**6
PRIME = 2**61 - 1


def mixed(*parts) -> int:
    """A number that stands for a function of numbers."""
    digest = blake2b(repr(parts).encode(), digest_size=8).digest()
    return int.from_bytes(digest, "little") % PRIME


def _modular(text: str) -> int:
    """A decimal number modulo the prime."""
    try:
        ratio = Fraction(text)
    except ValueError:
        return mixed(text)
    return ratio.numerator * pow(ratio.denominator, -1, PRIME) % PRIME


@dataclass(frozen=True)
class Flow:
    """Facts of a value.

    Attributes:
        on: groups of arguments that it depends on.
        is_zero: it is 0 for all arguments.
        vanishes: groups that make it 0 when all their arguments are 0.
        degree: polynomial degree, `UNKNOWN` if it is no polynomial.
        number: the value for random arguments.
        is_nan_test: it is true only where another value is no number.
    """

    on: frozenset = frozenset()
    is_zero: bool = False
    vanishes: frozenset = frozenset()
    degree: int = 0
    number: int = 0
    is_nan_test: bool = False

    @property
    def kind(self) -> tuple:
        """The facts without the number."""
        return self.on, self.is_zero, self.vanishes, self.degree


ZERO = Flow(is_zero=True)


def joined(first: Flow, second: Flow, sign: int = 1) -> Flow:
    """Facts of a sum, or of a value that is one or the other."""
    number = (first.number + sign * second.number) % PRIME
    if first.is_zero:
        return replace(second, number=number)
    if second.is_zero:
        return first
    return Flow(
        first.on | second.on,
        False,
        first.vanishes & second.vanishes,
        max(first.degree, second.degree),
        number,
    )


def _product(first, second):
    if first.is_zero or second.is_zero:
        return ZERO
    degree = min(first.degree + second.degree, UNKNOWN)
    number = first.number * second.number % PRIME
    return Flow(first.on | second.on, False, first.vanishes | second.vanishes, degree, number)


def _opaque(operands, kind=""):
    """Facts of a function of operands that is no polynomial of them.

    It counts as one that vanishes with its arguments, so that nothing is said of what is not known.
    """
    on = frozenset().union(*(one.on for one in operands)) if operands else frozenset()
    degree = 0 if all(one.degree == 0 for one in operands) else UNKNOWN
    return Flow(on, False, on, degree, mixed(kind, *(one.number for one in operands)))


def _chosen(condition, first, second):
    """Facts of a value that a condition chooses."""
    made = joined(first, second)
    if made.is_zero:
        return made
    degree = made.degree if condition.degree == 0 else UNKNOWN
    number = mixed("chosen", condition.number, first.number, second.number)
    return Flow(made.on | condition.on, False, made.vanishes, degree, number)


def _placed(value, place):
    """Facts of an element of memory, or of a value that is there or not."""
    if value.is_zero:
        return value
    degree = value.degree if place.degree == 0 else UNKNOWN
    number = mixed("place", value.number, place.number)
    return Flow(value.on | place.on, False, value.vanishes, degree, number)


class FlowAnalysis:
    """The facts of the values of a function.

    Args:
        text: IR of a thread. arguments: facts of the arguments, in order.

    Attributes:
        stored: facts of what is stored, by the constant index of the element.
    """

    def __init__(self, text: str, arguments: list):
        lines = [line.strip() for line in text.splitlines()]
        begin = next(i for i, line in enumerate(lines) if line.startswith("func.func"))
        self.lines = lines[begin + 1 :]
        self.values = {
            f"%arg{i}": replace(facts, number=mixed("argument", i))
            for i, facts in enumerate(arguments)
        }
        self.integers: dict = {}
        self.stored: dict = {}
        self._loops: dict = {}
        self._kept: dict = {}
        self._choices: list = []
        self._block(0)

    def _of(self, names) -> list:
        return [self.values.get(name) or Flow(number=mixed(name)) for name in names]

    def _block(self, at) -> tuple:
        """Goes through a region from a line on; gives the line after it and what it yields."""
        yielded = []
        while at < len(self.lines):
            line = self.lines[at]
            at += 1
            if line.startswith("}"):
                return at, yielded, line
            if line.startswith("scf.yield"):
                yielded = self._of(_NAME.findall(line.partition(" : ")[0]))
            elif " {" in line and line.endswith("{"):
                at = self._region(line, at)
            elif line.startswith("warp.store"):
                self._store(line)
            elif line.startswith("warp.scratch_store"):
                self._keep(*_NAME.findall(line)[:3])
            else:
                self._operation(line)
        return at, yielded, "}"

    def _results(self, line):
        """Names of results, and the operation."""
        found = _RESULTS.match(line)
        if not found:
            return [], line
        names = []
        for part in found[1].split(", "):
            name, _, count = part.partition(":")
            names += [f"{name}#{i}" for i in range(int(count))] if count else [name]
        return names, found[2]

    def _operation(self, line):
        names, rest = self._results(line)
        if not names:
            return
        kind = rest.split(" ", 1)[0].split("(")[0]
        if kind == "arith.constant":
            value = rest.split(" ")[1]
            is_zero = value in ("0.000000e+00", "-0.000000e+00")
            self.values[names[0]] = ZERO if is_zero else Flow(number=_modular(value))
            if re.fullmatch(r"-?\d+", value):
                self.integers[names[0]] = int(value)
            return
        if kind.startswith("memref.") or "alloca" in kind:
            # Values pass through memory of the thread.
            raise NotImplementedError(kind)
        if kind == "warp.scratch":
            self.values.setdefault(names[0], ZERO)
            return
        operands = self._of(_NAME.findall(rest.partition(" : ")[0]))
        made = self._apply(kind, operands, rest)
        self.values[names[0]] = made
        if len(names) > 1:
            # The results of one operation differ.
            for place, name in enumerate(names):
                self.values[name] = replace(made, number=mixed(place, made.number))

    @staticmethod
    def _apply(kind, operands, text):
        if kind == "arith.mulf":
            return _product(*operands)
        if kind in ("arith.addf", "arith.subf"):
            return joined(*operands, 1 if kind == "arith.addf" else -1)
        if kind == "arith.divf":
            above, below = operands
            if above.is_zero:
                return ZERO
            degree = above.degree if below.degree == 0 else UNKNOWN
            number = above.number * pow(below.number or 1, -1, PRIME) % PRIME
            return Flow(above.on | below.on, False, above.vanishes, degree, number)
        if kind == "arith.negf":
            return replace(operands[0], number=-operands[0].number % PRIME)
        if kind in _PASSING:
            return operands[0]
        if kind == "math.fma":
            return joined(_product(*operands[:2]), operands[2])
        if kind == "warp.scratch_load":
            return _placed(*operands)
        if kind == "arith.select":
            # Derivatives put 0 in place of products of 0 with what is no number.
            if operands[0].is_nan_test and operands[1].is_zero:
                return operands[2]
            return _chosen(*operands)
        if kind == "arith.cmpf" and " une, " in text:
            first, second = _NAME.findall(text.partition(" : ")[0])[:2]
            if first == second:
                return Flow(number=mixed("no number"), is_nan_test=True)
        tests = [one.is_nan_test for one in operands]
        if (kind == "arith.ori" and all(tests)) or (kind == "arith.andi" and any(tests)):
            return Flow(number=mixed("no number"), is_nan_test=True)
        return _opaque(operands, re.sub(r"%[\w$.#-]+", "", text))

    def _store(self, line):
        values = re.match(r"warp\.store\w*\(?([^)\[]*)\)?, %[\w$.-]+\[(%[\w$.-]+)\]", line)
        index = self.integers.get(values[2]) if values else None
        if index is not None:
            self.stored[index] = self._of(_NAME.findall(values[1]))[0]

    def _keep(self, value, memory, index):
        """Takes a store to memory of the thread, all of whose elements have the same facts."""
        value, held, index = self._of((value, memory, index))
        made = _placed(value, index)
        for choice in self._choices:
            made = _placed(made, choice)
        number = mixed("stored", held.number, made.number)
        self.values[memory] = replace(joined(held, made), number=number)

    def _region(self, line, at):
        names, rest = self._results(line)
        if rest.startswith("scf.if"):
            condition = self._of(_NAME.findall(rest.partition(" ->")[0]))[0]
            self._choices.append(condition)
            at, first, last = self._block(at)
            second = [Flow()] * len(first)
            if "else" in last:
                at, second, _ = self._block(at)
            self._choices.pop()
            for name, one, other in zip(names, first, second, strict=False):
                self.values[name] = _chosen(condition, one, other)
            return at
        if rest.startswith("scf.for"):
            return self._loop(names, rest, at)
        raise NotImplementedError(rest.split(" ")[0])

    def _outside(self, rest, at) -> tuple:
        """Names of all that a loop reads from outside, and of memory that it stores to; regions
        beside it reuse names of its own."""
        if at not in self._loops:
            depth, line, used, own, kept = 1, rest, set(), set(), set()
            for end in range(at, len(self.lines) + 1):
                names, operation = self._results(line)
                head, _, carried = operation.partition("iter_args(")
                own.update(names)
                if operation.startswith("scf.for"):
                    own.update(_NAME.findall(head)[:1])
                    own.update(pair[0] for pair in _CARRIED.findall(carried))
                used.update(_NAME.findall(operation))
                if operation.startswith("warp.scratch_store"):
                    kept.add(_NAME.findall(operation)[1])
                depth += line.endswith("{") - line.startswith("}") if end > at else 0
                if depth == 0 or end == len(self.lines):
                    break
                line = self.lines[end]
            self._loops[at] = sorted(used - own), sorted(kept)
        return self._loops[at]

    def _loop(self, names, rest, at):
        """The facts of a loop's results; as before if the loop reads the same facts."""
        used, memory = self._outside(rest, at)
        key, kept = (*self._of(used), *self._choices), self._kept.get(at)
        if kept is None or kept[0] != key:
            end = self._find_loop(names, memory, rest, at)
            kept = self._kept[at] = key, self._of((*names, *memory)), end
        self.values.update(zip((*names, *memory), kept[1], strict=True))
        return kept[2]

    def _find_loop(self, names, memory, rest, at):
        head, _, carried = rest.partition("iter_args(")
        index, *bounds = _NAME.findall(head)
        limits = _opaque(self._of(bounds))
        self.values[index] = Flow(limits.on, False, frozenset(), 0, mixed(index, limits.number))
        pairs = _CARRIED.findall(carried.partition(") ->")[0])
        state = self._of(initial for _, initial in pairs)
        state += [self.values.get(name, ZERO) for name in memory]
        growth, count = [0] * len(state), len(pairs)
        self._choices.append(limits)
        for _ in range(_MOST_ROUNDS):
            for name, facts in zip((*(name for name, _ in pairs), *memory), state, strict=True):
                self.values[name] = facts
            end, found, _ = self._block(at)
            after = [joined(one, other) for one, other in zip(state, found, strict=False)]
            after += self._of(memory)
            if [one.kind for one in after] == [one.kind for one in state]:
                state = after
                break
            for place, (one, other) in enumerate(zip(state, after, strict=True)):
                growth[place] = growth[place] + 1 if other.degree > one.degree else 0
                if growth[place] == _MOST_GROWTH:
                    after[place] = replace(other, degree=UNKNOWN)
            state = after
        else:
            state = [replace(one, degree=UNKNOWN) for one in state]
        self._choices.pop()
        self.values.update(zip(memory, state[count:], strict=True))
        for name, facts in zip(names, state[:count], strict=True):
            on = facts.on if facts.is_zero else facts.on | limits.on
            number = 0 if facts.is_zero else mixed("loop", facts.number, limits.number)
            self.values[name] = replace(facts, on=on, number=number)
        return end
