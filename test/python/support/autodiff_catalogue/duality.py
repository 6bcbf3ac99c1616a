"""T108: forward and reverse mode agree on every case that asks for gradients of a launch."""

import contextlib

from .problem import Problem
from .registry import CASES, EXACT, case


@case("T108", "⟨Jv, w⟩ = ⟨v, Jᵀw⟩ for every launch of the cases before")
def duality(p):
    failures, tests = [], 0
    for item in sorted(CASES.values(), key=lambda item: item.order()):
        if item.order() >= 108 or item.verdict != EXACT or p.precision not in item.precisions:
            continue
        problem = Problem(p.precision, p.device, dot=True)
        # A case that fails for another reason says so itself.
        with contextlib.suppress(Exception):
            item.function(problem)
        failures += [f"{item.number}: {text}" for text in problem.dot_failures]
        tests += problem.dot_tests
    p.holds(not failures, f"{len(failures)} launches: " + "; ".join(failures))
    p.holds(tests > 0, "no launch was tested")
