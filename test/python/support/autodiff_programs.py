"""Random differentiable programs, and dual numbers that run them in plain Python."""

import math

import numpy as np
from hypothesis import strategies as st

VARIABLES = ("a", "b", "c", "x", "y")
CARRIED = ("a", "b", "c")
DATA = 4


class Dual:
    """A float and its derivatives by every input."""

    def __init__(self, value, slope=0.0):
        self.value, self.slope = float(value), slope

    def __add__(self, other):
        return Dual(self.value + other.value, self.slope + other.slope)

    def __sub__(self, other):
        return Dual(self.value - other.value, self.slope - other.slope)

    def __mul__(self, other):
        slope = self.slope * other.value + self.value * other.slope
        return Dual(self.value * other.value, slope)

    def __truediv__(self, other):
        value = self.value / other.value
        return Dual(value, (self.slope - value * other.slope) / other.value)

    def __neg__(self):
        return Dual(-self.value, -self.slope)

    def __lt__(self, other):
        return self.value < other.value

    def __gt__(self, other):
        return self.value > other.value


class Functions:
    """The functions of `wp` that programs call, of dual numbers."""

    @staticmethod
    def sin(x):
        return Dual(math.sin(x.value), math.cos(x.value) * x.slope)

    @staticmethod
    def cos(x):
        return Dual(math.cos(x.value), -math.sin(x.value) * x.slope)

    @staticmethod
    def tanh(x):
        t = math.tanh(x.value)
        return Dual(t, (1.0 - t * t) * x.slope)

    @staticmethod
    def exp(x):
        e = math.exp(x.value)
        return Dual(e, e * x.slope)

    @staticmethod
    def sqrt(x):
        root = math.sqrt(x.value)
        return Dual(root, x.slope / (2.0 * root))

    @staticmethod
    def min(x, y):
        return x if x < y else y

    @staticmethod
    def max(x, y):
        return x if x > y else y


def inputs_of(x, y, data):
    """Dual numbers of two scalars and a list, each with a derivative of its own."""
    values = [x, y, *data]
    duals = [Dual(value, row) for value, row in zip(values, np.eye(len(values)))]
    return duals[0], duals[1], duals[2:]


FORMS = (
    "({0} + {1})",
    "({0} - {1})",
    "({0} * {1})",
    "({0} / (R(2.0) + {1} * {1}))",
    "wp.sin({0})",
    "wp.cos({0} * {1})",
    "wp.tanh({0} + {1})",
    "wp.exp(-{0} * {0})",
    "wp.sqrt(R(1.0) + {0} * {0})",
    "wp.min({0}, {1})",
    "wp.max({0}, R(0.3))",
    "(-{0})",
    "({0} if {2} else {1})",
)


@st.composite
def expressions(draw, depth=2, loops=0):
    if depth == 0 or draw(st.integers(0, 3)) == 0:
        leaves = [
            st.sampled_from(VARIABLES),
            st.integers(1, 30).map(lambda v: f"R({v / 16 - 1.03})"),
        ]
        leaves.append(st.integers(0, DATA - 1).map(lambda k: f"d[{k}]"))
        if loops:
            leaves.append(st.integers(0, loops - 1).map(lambda k: f"d[k{k} % 4]"))
        return draw(st.one_of(leaves))
    left, right = draw(expressions(depth - 1, loops)), draw(expressions(depth - 1, loops))
    return draw(st.sampled_from(FORMS)).format(left, right, draw(conditions(loops)))


@st.composite
def conditions(draw, loops=0):
    left, right = draw(expressions(0, loops)), draw(expressions(0, loops))
    offset = draw(st.integers(-4, 4)) * 0.1 + 0.0123
    return f"{left} {draw(st.sampled_from('<>'))} {right} + R({offset})"


@st.composite
def blocks(draw, depth, loops):
    """Lines of a block; `loops` is how many for loops enclose it."""
    lines = []
    for _ in range(draw(st.integers(1, 3))):
        kinds = ["assign"] * 3 + ["return"]
        if depth > 0:
            kinds += ["if", "for", "for", "while"]
        if loops > 0:
            kinds += ["break", "continue"]
        lines += draw(statements(draw(st.sampled_from(kinds)), depth, loops))
    return lines


@st.composite
def statements(draw, kind, depth, loops):
    """Lines of one statement of a kind."""
    if kind == "assign":
        name = draw(st.sampled_from(CARRIED))
        wrap = draw(st.sampled_from(("wp.sin({})", "wp.tanh({})", "R(0.5) * wp.cos({})")))
        value = wrap.format(draw(expressions(2, loops)))
        form = draw(st.sampled_from(("{0} = {1}", "{0} += R(0.25) * {1}", "{0}, b = b, {1}")))
        return [form.format(name, value)]
    condition = draw(conditions(loops))
    if kind == "return":
        return [f"if {condition}:", f"    return {draw(expressions(1, loops))}"]
    if kind in ("break", "continue"):
        return [f"if {condition}:", f"    {kind}"]
    if kind == "if":
        lines = [f"if {condition}:", *indented(draw(blocks(depth - 1, loops)))]
        if draw(st.booleans()):
            lines += ["else:", *indented(draw(blocks(depth - 1, loops)))]
        return lines
    if kind == "for":
        bounds = draw(st.sampled_from(("n", "3", "n - 1, -1, -1", "0, n, 2", "19")))
        return [f"for k{loops} in range({bounds}):", *indented(draw(blocks(depth - 1, loops + 1)))]
    counter = f"w{depth}{loops}"
    lines = [f"{counter} = int(0)", f"while {counter} < n and {condition}:", f"    {counter} += 1"]
    return lines + indented(draw(plain_blocks(depth - 1, loops)))


@st.composite
def plain_blocks(draw, depth, loops):
    """Lines of the body of a while loop."""
    return draw(blocks(depth, 0)) if loops == 0 else draw(blocks(0, loops))


def indented(lines):
    return ["    " + line for line in lines]


@st.composite
def programs(draw):
    """Source of a function of two floats, an array of floats and a bound."""
    start = ["a = x * y", "b = R(0.37)", "c = x - R(0.11)"]
    body = [*start, *draw(blocks(2, 0)), "return a + R(0.5) * b - c * x"]
    return "\n".join(["def program(x: R, y: R, d: D, n: int):", *indented(body)]) + "\n"
