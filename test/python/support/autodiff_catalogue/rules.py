"""T20: each scalar function beside its derivative, differences and forward mode."""

from functools import partial

import numpy as np

import warp as wp

from .problem import kernel_of
from .registry import case
from .scalars import elementwise, pairwise

PI = np.pi
# Per function: lowest and highest operand, derivative in NumPy.
UNARY = {
    "sin": (-3.0, 3.0, np.cos),
    "cos": (-3.0, 3.0, lambda x: -np.sin(x)),
    "tan": (-1.2, 1.2, lambda x: 1.0 / np.cos(x) ** 2),
    "asin": (-0.8, 0.8, lambda x: 1.0 / np.sqrt(1.0 - x * x)),
    "acos": (-0.8, 0.8, lambda x: -1.0 / np.sqrt(1.0 - x * x)),
    "atan": (-3.0, 3.0, lambda x: 1.0 / (1.0 + x * x)),
    "sinh": (-2.0, 2.0, np.cosh),
    "cosh": (-2.0, 2.0, np.sinh),
    "tanh": (-2.0, 2.0, lambda x: 1.0 / np.cosh(x) ** 2),
    "exp": (-2.0, 2.0, np.exp),
    "log": (0.2, 3.0, lambda x: 1.0 / x),
    "log2": (0.2, 3.0, lambda x: 1.0 / (x * np.log(2.0))),
    "log10": (0.2, 3.0, lambda x: 1.0 / (x * np.log(10.0))),
    "sqrt": (0.2, 3.0, lambda x: 0.5 / np.sqrt(x)),
    "cbrt": (0.2, 3.0, lambda x: 1.0 / (3.0 * np.cbrt(x) ** 2)),
    "abs": (-3.0, -0.5, lambda x: -np.ones_like(x)),
    "neg": (-3.0, 3.0, lambda x: -np.ones_like(x)),
    "erf": (-2.0, 2.0, lambda x: 2.0 / np.sqrt(PI) * np.exp(-x * x)),
    "erfc": (-2.0, 2.0, lambda x: -2.0 / np.sqrt(PI) * np.exp(-x * x)),
    "degrees": (-3.0, 3.0, lambda x: np.full_like(x, 180.0 / PI)),
    "radians": (-3.0, 3.0, lambda x: np.full_like(x, PI / 180.0)),
    "frac": (1.1, 1.9, np.ones_like),
    "floor": (1.1, 1.9, np.zeros_like),
    "ceil": (1.1, 1.9, np.zeros_like),
    "trunc": (1.1, 1.9, np.zeros_like),
    "round": (1.1, 1.4, np.zeros_like),
    "rint": (1.1, 1.4, np.zeros_like),
    "sign": (0.5, 2.0, np.zeros_like),
    "step": (0.5, 2.0, np.zeros_like),
    # By differences only.
    "erfinv": (-0.8, 0.8, None),
    "erfcinv": (0.2, 1.8, None),
}
# Per function: derivatives by both operands; operands lie in 0.5 … 1.5 and 2 … 3.
BINARY = {
    "add": (lambda a, b: 1.0, lambda a, b: 1.0),
    "sub": (lambda a, b: 1.0, lambda a, b: -1.0),
    "mul": (lambda a, b: b, lambda a, b: a),
    "div": (lambda a, b: 1.0 / b, lambda a, b: -a / b**2),
    "pow": (lambda a, b: b * a ** (b - 1.0), lambda a, b: a**b * np.log(a)),
    "atan2": (lambda a, b: b / (a * a + b * b), lambda a, b: -a / (a * a + b * b)),
    "min": (lambda a, b: 1.0, lambda a, b: 0.0),
    "max": (lambda a, b: 0.0, lambda a, b: 1.0),
    "mod": (lambda a, b: 1.0, lambda a, b: -np.trunc(a / b)),
}


def check(p, name, make, operands, expected):
    """Against the table, and against differences of the function itself."""
    outputs = [p.zeros(len(operands[0]))]
    got = p.pullback(make(p), len(operands[0]), [p.array(v) for v in operands], outputs)
    for gradient, want in zip(got, expected):
        if want is not None:
            p.near(gradient, want, 64 * p.eps)

    def build(q):
        return make(q), 3, [q.array(v[:3]) for v in operands], [q.zeros(3)]

    p.finite_differences(build)


@case("T20", "the derivative of every scalar function")
def scalar_rules(p):
    failures = []

    def attempt(name, *arguments):
        try:
            check(p, name, *arguments)
        except Exception as problem:
            failures.append(f"{name}: {problem}")

    for name, (low, high, derivative) in UNARY.items():
        x = p.random(16, low=low, high=high)
        function = getattr(wp, name)
        expected = [derivative(x) if derivative else None]
        attempt(name, partial(elementwise, function=function), [x], expected)
    a, b = p.random(16), p.random(16, low=2.0, high=3.0)
    for name, derivatives in BINARY.items():
        function = getattr(wp, name)
        operands = [b, a] if name == "mod" else [a, b]
        expected = [derivative(*operands) for derivative in derivatives]
        attempt(name, partial(pairwise, function=function), operands, expected)
    attempt(
        "smoothstep", blend_of("smoothstep"), [a - 0.5, b, b - 0.6], smooth(a - 0.5, b, b - 0.6)
    )
    attempt("lerp", blend_of("lerp"), [a, b, a], [1.0 - a, a, b - a])
    p.holds(not failures, "; ".join(failures))


def blend_of(name):
    """From a problem to the kernel of a function with three operands."""
    function = getattr(wp, name)

    def make(p):
        R = p.real

        @kernel_of(function)
        def ternary(
            a: wp.array(dtype=R), b: wp.array(dtype=R), t: wp.array(dtype=R), y: wp.array(dtype=R)
        ):
            i = wp.tid()
            y[i] = function(a[i], b[i], t[i])

        return ternary

    return make


def smooth(low, high, x):
    """Derivatives of the cubic step by its edges and its operand."""
    width = high - low
    t = (x - low) / width
    slope = 6.0 * t * (1.0 - t)
    return [slope * (t - 1.0) / width, -slope * t / width, slope / width]
