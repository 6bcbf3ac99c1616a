"""Search for operands at which builtins lose all digits: `python -m warp.report search`.

For every overload of the registry that has a reference, random and adversarial operands (nearly
parallel, nearly singular, repeated, subnormal, huge, not of unit length) go through the builtin and
through its adjoint, and are held against mpmath. A number without a correct digit is a defect,
unless operands that differ by rounding errors have results that differ as much: then the problem
itself is ill-conditioned there, which the report says with the condition number.

`search` yields the findings; `FORMULAS` has the references by builtin and `STRATEGIES` the kinds of
operands. They need the package mpmath, and are imported when they are asked for.
"""

_NAMES = ("FORMULAS", "SPECIAL", "STRATEGIES", "overloads", "search", "without_reference")


def __getattr__(name):
    if name not in _NAMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    from warp.report.search import _search

    return getattr(_search, name)
