"""The catalogue of gradients: numbered cases, each with an expected value of its own.

`check_case` runs one under whichever package is imported as `warp`; `python -m autodiff_catalogue`
runs many and prints a line of JSON for each. The cases are in files by topic.
"""

from . import (  # noqa: F401
    accesses,
    duality,
    functions,
    horizons,
    loops,
    recurrences,
    rotations,
    rules,
    scalars,
    singular,
    sums,
    updates,
    vectors,
    versions,
)
from .problem import Problem
from .registry import ABSENT, CASES, ERROR, EXACT, FAILED


def check_case(number, precision, device):
    """Runs a case; raises what it raises."""
    CASES[number].function(Problem(precision, device))


def runs():
    """Every (number, precision), in the order of the numbers."""
    cases = sorted(CASES.values(), key=lambda item: item.order())
    return [(item.number, precision) for item in cases for precision in item.precisions]
