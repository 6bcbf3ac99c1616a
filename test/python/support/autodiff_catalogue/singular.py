"""T3 to T15: points at which a derivative is infinite, not defined or cancels."""

import re

import numpy as np

import warp as wp

from .problem import printed, setting
from .registry import case
from .scalars import elementwise, pairwise


def counts(lines):
    """The numbers in what `report` printed: one line per place of a source file."""
    found = []
    for line in lines:
        if re.search(r"\.py:\d+", line):
            found += map(int, re.findall(r"(?<![\w.:])\d+(?![\w.:])", line))
    return found


def reported(p, make, expected):
    """Runs `make()` under the policy `report`: its gradient, and one singular point counted."""
    lines = []
    with setting(singular="report"), printed(lines):
        got = make()
    p.same(got, expected)
    p.holds(1 in counts(lines), f"no line counts one singular point: {lines}")


@case("T3", "a power has derivatives by base and exponent at base 0")
def power_at_zero(p):
    dx, dp = p.pullback(pairwise(p, wp.pow), 1, [p.array([0.0]), p.array([2.0])], [p.zeros(1)])
    p.same(dx, [0.0])
    p.same(dp, [0.0])


@case("T4", "a power of a negative base is differentiated by the base only")
def power_of_negative(p):
    R = p.real

    @wp.func
    def cube(x: R):
        return wp.pow(x, R(3.0))

    (got,) = p.pullback(elementwise(p, cube), 1, [p.array([-2.0])], [p.zeros(1)])
    p.close(got, [12.0])

    def both():
        p.dot = False
        p.pullback(pairwise(p, wp.pow), 1, [p.array([-2.0]), p.array([3.0])], [p.zeros(1)])
        wp.synchronize_device(p.device)

    p.refuses(both, "exponent")


@case("T5", "nothing times an infinite derivative is nothing")
def zero_times_root(p):
    R = p.real

    @wp.func
    def nothing(x: R):
        return R(0.0) * wp.sqrt(x)

    (got,) = p.pullback(elementwise(p, nothing), 1, [p.array([0.0])], [p.zeros(1)])
    p.same(got, [0.0])


@case("T6", "the root at 0 follows the policy")
def root_at_zero(p):
    def run():
        x = [p.array([0.0])]
        return p.pullback(elementwise(p, wp.sqrt), 1, x, [p.zeros(1)])[0]

    p.same(run(), [0.0])
    with setting(singular="strict"):
        p.same(run(), [np.inf])
    reported(p, run, [0.0])


@case("T7", "s log x at s = x = 0 has no derivative by x")
def zero_times_log(p):
    @wp.func
    def entropy(s: p.real, x: p.real):
        return s * wp.log(x)

    inputs = [p.array([0.0]), p.array([0.0])]
    _, dx = p.pullback(pairwise(p, entropy), 1, inputs, [p.zeros(1)])
    p.same(dx, [0.0])


@case("T8", "acos is exact next to 1, and pinned and counted at 1")
def arc_cosine(p):
    def run(x):
        return p.pullback(elementwise(p, wp.acos), 1, [p.array([x])], [p.zeros(1)])[0]

    x = 1.0 - 2.0**-24
    p.close(run(x), [-1.0 / np.sqrt(2.0**-24 * (1.0 + x))])
    reported(p, lambda: run(1.0), [0.0])


@case("T10", "tanh far out does not cancel")
def hyperbolic_tangent(p):
    (got,) = p.pullback(elementwise(p, wp.tanh), 1, [p.array([9.0])], [p.zeros(1)])
    e = np.exp(-18.0)
    p.near(got, 4.0 * e / (1.0 + e) ** 2, 1e-5)


@case("T15", "abs at both zeros has a derivative between -1 and 1, the same each time")
def absolute(p):
    def run():
        x = [p.array([0.0, -0.0, 2.0, -2.0])]
        return p.pullback(elementwise(p, wp.abs), 4, x, [p.zeros(4)])[0]

    got = run()
    p.holds(np.all(np.abs(got[:2]) <= 1.0), f"got {got[:2]}")
    p.same(got[2:], [1.0, -1.0])
    p.same(run(), got)
