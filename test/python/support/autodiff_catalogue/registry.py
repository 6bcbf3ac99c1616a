"""The list of cases, and what becomes of one."""

import re
from dataclasses import dataclass

CASES = {}
# Cases without code, because their subject does not exist yet, with what is missing.
ABSENT = {
    "T116": "tiles",
    "T117": "meshes, textures and volumes",
}
EXACT, ERROR, FAILED = "exact", "error", "failed"


class Mismatch(AssertionError):
    """A gradient, a value or a message that is not the expected one."""


@dataclass
class Case:
    """One numbered case: a function of a `Problem`, and how it is judged.

    Attributes:
        number: as in the catalogue, for example "T47".
        claim: one sentence.
        function: raises `Mismatch`, or whatever the package raises.
        precisions: names of the scalar types it is run in.
        verdict: what passing means, `EXACT` or `ERROR`.
    """

    number: str
    claim: str
    function: object
    precisions: tuple
    verdict: str

    def order(self):
        return int(self.number[1:])


def case(number, claim, precisions=("float32", "float64"), verdict=EXACT):
    """Decorator that enters a function into the list."""

    def enter(function):
        if number in CASES:
            raise ValueError(f"case '{number}' is there twice")
        CASES[number] = Case(number, claim, function, precisions, verdict)
        return function

    return enter


def located(message, lines=1):
    """True if a message names at least so many places of a source file."""
    return len(set(re.findall(r"\w+\.py:\d+", str(message)))) >= lines
