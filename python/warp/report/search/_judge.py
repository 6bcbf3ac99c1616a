"""Judges numbers by mpmath's, and says what the problem itself lost."""

import dataclasses

import mpmath as mp
import numpy as np

from warp.report.search._matrices import MATRICES
from warp.report.search._numbers import dot, flatten, minus, scaled
from warp.report.search._operands import SPECIAL
from warp.report.search._references import KNOWN, REFERENCES
from warp.report.search._rotations import ROTATIONS

#: Formulas by builtin.
FORMULAS = REFERENCES | ROTATIONS | MATRICES

#: Builtins of unit quaternions, which say nothing of others: no such operands, and of gradients
#: only what is along the sphere.
UNIT = (
    *("quat_slerp", "quat_to_rpy"),
    *("quat_from_matrix", "transform_from_matrix", "transform_decompose"),
)
#: No correct digit: the error is at least this part of the number.
NO_DIGIT = 0.5
#: Next to the largest number of the same composite, so many rounding errors of it do not count.
BESIDE = 128


@dataclasses.dataclass
class Finding:
    """The worst number that one overload gave.

    Attributes:
        builtin, signature, dtype: the overload.
        part: 'value' or 'gradient'.
        verdict: 'good' if all numbers have a correct digit, 'condition' if those that do not
            differ as much for operands that differ by rounding errors, 'known' if they are
            lost by decision, 'defect' otherwise.
        error: largest relative error of a number that is not excused by its condition.
        lost: how many numbers have no correct digit, defects first.
        checked: how many numbers were compared.
        condition: of the problem at the worst number, relative change of the result over
            relative change of the operands.
        strategy, operands, got, exact: the worst number, as a reproducer.
    """

    builtin: str
    signature: str
    dtype: str
    part: str
    verdict: str = "good"
    error: float = 0.0
    lost: int = 0
    checked: int = 0
    condition: float = 0.0
    strategy: str = ""
    operands: list = dataclasses.field(default_factory=list)
    got: float = 0.0
    exact: float = 0.0

    def __str__(self):
        where = f"{self.verdict:9} {self.part:8} {self.dtype:7} {self.builtin}{self.signature}"
        text = f"{where}: error {self.error:.2g}, {self.lost} of {self.checked} without a digit"
        if self.verdict == "good":
            return text
        why = KNOWN[self.builtin, self.part] if self.verdict == "known" else self.strategy
        numbers = ", ".join(map(repr, self.operands))
        return (
            f"{text}; condition {self.condition:.2g}; {why}: ({numbers}) gives {self.got!r}, "
            f"exact {self.exact!r}"
        )


class NoReferenceError(Exception):
    """A formula has no finite real result there."""


class Exact:
    """The reference of one builtin at rows of operands."""

    def __init__(self, name, kinds):
        self.formula, self.kinds = FORMULAS[name], kinds
        self.unit = name in UNIT

    def __call__(self, numbers):
        """Numbers of the result.

        Raises:
            NoReferenceError: there is none.
        """
        packed, rest = [], list(numbers)
        for kind in self.kinds:
            packed.append(kind.pack(rest[: kind.size]))
            rest = rest[kind.size :]
        try:
            found = [mp.mpmathify(x) for x in flatten(self.formula(*packed))]
        except (ValueError, ArithmeticError) as error:
            raise NoReferenceError from error
        if any(isinstance(x, mp.mpc) or not mp.isfinite(x) for x in found):
            raise NoReferenceError
        return found

    def gradient(self, numbers, seed):
        """Slopes of the seed's weighted sum by central differences; None at kinks."""
        largest = max(map(abs, numbers))
        slopes = []
        for i, x in enumerate(numbers):
            step = (abs(x) or largest or mp.mpf(1)) * mp.mpf(10) ** -30

            def at(offset, i=i, x=x):
                moved = [*numbers[:i], x + offset, *numbers[i + 1 :]]
                return mp.fsum(w * y for w, y in zip(seed, self(moved), strict=True))

            here = at(0)
            left, right = (here - at(-step)) / step, (at(step) - here) / step
            if abs(left - right) > mp.mpf(10) ** -12 * max(abs(left), abs(right)):
                return None
            slopes.append((at(step) - at(-step)) / (2 * step))
        return self.along(numbers, slopes) if self.unit else slopes

    def along(self, numbers, slopes):
        """Without the parts along quaternions."""
        found = []
        for kind in self.kinds:
            at = len(found)
            q, part = numbers[at : at + kind.size], slopes[at : at + kind.size]
            if kind.kind == "quat":
                part = minus(part, scaled(q, dot(part, q) / dot(q, q)))
            found += part
        return found

    def spread(self, function, numbers, unit, random):
        """Largest relative change, by component, over operands moved by a rounding error each."""
        found = function(numbers)
        changes = [mp.mpf(0)] * len(found)
        for _ in range(4):
            signs = random.choice([-1.0, 1.0], size=len(numbers))
            moved = [x * (1 + mp.mpf(s) * unit) for x, s in zip(numbers, signs, strict=True)]
            try:
                other = function(moved)
            except NoReferenceError:
                other = None
            if other is None:
                return [mp.inf] * len(found)
            changes = [max(c, abs(a - b)) for c, a, b in zip(changes, found, other, strict=True)]
        return [c / abs(x) if x else mp.inf for c, x in zip(changes, found, strict=True)]


class Judge:
    """Compares numbers with exact ones and keeps the worst."""

    def __init__(self, finding, random):
        self.finding, self.random = finding, random
        limits = np.finfo(finding.dtype)
        # Sums may pass the largest number on the way to what is near it.
        self.tiny, self.largest = float(limits.tiny), float(limits.max) / 16
        self.unit = mp.mpf(float(limits.eps)) / 2

    def scales(self, wanted, sizes):
        """The scale of errors of numbers; `sizes` says how many a composite has."""
        found = []
        for size in sizes:
            part = [abs(x) for x in wanted[len(found) : len(found) + size]]
            found += [max(x, BESIDE * self.unit * max(part)) for x in part]
        return found

    def is_lost(self, x, scale):
        """True if a number that is exactly zero is none, or large beside the others."""
        return not np.isfinite(x) or (scale > self.tiny and abs(x) > scale)

    def row(self, exact, function, sizes, numbers, got, strategy):
        """One row; `function` of the operands gives the exact numbers."""
        try:
            wanted = function(numbers)
        except NoReferenceError:
            return
        if wanted is None or any(abs(x) > self.largest for x in wanted):
            return
        found, spread = self.finding, None
        scales = self.scales(wanted, sizes)
        for place, (x, y) in enumerate(zip(got, wanted, strict=True)):
            if abs(y) < self.tiny and not (strategy == SPECIAL and self.is_lost(x, scales[place])):
                continue
            found.checked += 1
            isfinite = np.isfinite(x) and scales[place] > 0
            error = abs(mp.mpf(float(x)) - y) / scales[place] if isfinite else mp.inf
            if error < NO_DIGIT:
                if found.verdict == "good" and error > found.error:
                    self.keep("good", float(error), 0.0, strategy, numbers, x, y)
                continue
            if spread is None:
                spread = exact.spread(function, numbers, self.unit, self.random)
            condition = spread[place] / self.unit
            excused = spread[place] * 256 > NO_DIGIT and np.isfinite(x)
            other = "known" if (found.builtin, found.part) in KNOWN else "defect"
            verdict = "condition" if excused else other
            found.lost += 1
            if verdict == other or found.verdict != other:
                self.keep(verdict, float(error), float(condition), strategy, numbers, x, y)

    def keep(self, verdict, error, condition, strategy, numbers, got, exact):
        found = self.finding
        if verdict == found.verdict and error <= found.error:
            return
        found.verdict, found.error, found.condition = verdict, error, condition
        found.strategy, found.operands = strategy, [float(x) for x in numbers]
        found.got, found.exact = float(got), float(exact)
