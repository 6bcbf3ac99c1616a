"""Checks and compile-time values that kernels write, at Python scope."""

from __future__ import annotations

import math

from warp._src.types.composites import Composite, scalars_of
from warp._src.types.scalars import scalar_base, shown_name
from warp._src.types.vectors import Quaternion, Transformation


def expect_eq(a, b) -> None:
    """Prints both values if they differ."""
    _same_kind(a, b)
    if _numbers(a) != _numbers(b):
        _report("expect_eq", a, b)


def expect_neq(a, b) -> None:
    """Prints both values if they are equal."""
    _same_kind(a, b)
    if _numbers(a) == _numbers(b):
        _report("expect_neq", a, b)


def expect_near(a, b, tolerance=1e-6) -> None:
    """Prints both values unless all components differ by at most `tolerance`."""
    _same_kind(a, b)
    tolerance = getattr(tolerance, "value", tolerance)
    pairs = list(zip(_numbers(a), _numbers(b), strict=True))
    if all(x == y or abs(x - y) <= tolerance for x, y in pairs):
        return
    gaps = [abs(x - y) for x, y in pairs]
    gap = math.nan if any(map(math.isnan, gaps)) else max(gaps)
    label = "Max absolute" if isinstance(a, Composite) else "Absolute"
    print(
        f"Error, expect_near() failed with tolerance {tolerance:g}\n"
        f"    Expected: {_text(b)}\n    Actual: {_text(a)}\n    {label} difference: {gap:g}"
    )


def static(expr):
    """The value itself: Python computes all expressions when they run."""
    return expr


def _numbers(value):
    if isinstance(value, Composite):
        return list(scalars_of(value))
    return [getattr(value, "value", value)]


def _same_kind(a, b):
    plain = (bool, int, float, scalar_base)
    if isinstance(a, plain) and isinstance(b, plain):
        return
    if not isinstance(a, Composite) or len(_numbers(a)) != len(_numbers(b)):
        raise TypeError(
            f"expects two numbers or composites of one type to compare, but got "
            f"'{shown_name(type(a))}' and '{shown_name(type(b))}'"
        )


def _report(name, a, b):
    print(f"Error, {name}() failed:\n\t Expected: {_text(b)}\n\t Actual: {_text(a)}")


def _text(value) -> str:
    """A value as kernels print it."""
    texts = [str(n) if isinstance(n, (bool, int)) else f"{n:g}" for n in _numbers(value)]
    if not isinstance(value, Composite):
        return texts[0]
    if len(type(value)._shape_) == 2:
        columns = type(value)._shape_[1]
        rows = [texts[at : at + columns] for at in range(0, len(texts), columns)]
        return "\n".join(" ".join(row) + " " for row in rows)
    return " ".join(texts) + ("" if isinstance(value, (Quaternion, Transformation)) else " ")


CHECKS = {function.__name__: function for function in (expect_eq, expect_neq, expect_near, static)}
