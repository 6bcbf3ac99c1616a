"""Random kernels whose threads update array elements of their own; dual numbers run them."""

import numpy as np
from hypothesis import strategies as st

from autodiff_programs import Dual, Functions, indented
from frontend_programs import define

THREADS = 3
SHAPES = {"x": (THREADS,), "d": (4,), "w": (THREADS,), "u": (THREADS, 4), "y": (THREADS,)}
WRITTEN = ("w", "u", "y")
_rng = np.random.default_rng(0)
START = {name: _rng.uniform(-1.0, 1.0, shape) for name, shape in SHAPES.items()}
WEIGHTS = {name: _rng.uniform(-1.0, 1.0, SHAPES[name]) for name in WRITTEN}
HEADER = "def program(x: A1, d: A1, w: A1, u: A2, y: A1, n: int):"
FORMS = (
    "({0} + {1})",
    "({0} * {1})",
    "wp.sin({0})",
    "wp.tanh({0} - {1})",
    "({0} / (R(2.0) + {1} * {1}))",
)


@st.composite
def values(draw, depth=2, counter=None):
    if depth == 0 or draw(st.integers(0, 3)) == 0:
        leaves = ["a", "b", "x[i]", "w[i]", "u[i, 0]", "u[i, 1]", "R(0.7)"]
        leaves += [f"u[i, {counter}]", f"d[{counter} % 4]"] if counter else []
        return draw(st.sampled_from(leaves))
    left, right = draw(values(depth - 1, counter)), draw(values(depth - 1, counter))
    return draw(st.sampled_from(FORMS)).format(left, right)


@st.composite
def conditions(draw, counter=None):
    left, right = draw(values(0, counter)), draw(values(0, counter))
    offset = draw(st.integers(-4, 4)) * 0.1 + 0.0123
    return f"{left} {draw(st.sampled_from('<>'))} {right} + R({offset})"


@st.composite
def stores(draw, counter=None):
    """A line that stores to an element or updates it."""
    targets = ["w[i]", "u[i, 0]", "u[i, 1]"] + ([f"u[i, {counter}]"] if counter else [])
    target = draw(st.sampled_from(targets))
    if draw(st.booleans()):
        wrap = draw(st.sampled_from(("wp.sin({})", "wp.tanh({})")))
        return f"{target} = {wrap.format(draw(values(2, counter)))}"
    operator = draw(st.sampled_from(("+=", "-=", "*=")))
    return f"{target} {operator} R(0.5) * wp.cos({draw(values(1, counter))})"


@st.composite
def blocks(draw, depth, counter=None):
    """Lines of a block, in a loop over `counter` if that is given."""
    lines = []
    for _ in range(draw(st.integers(1, 3))):
        kinds = ["let", "store", "store"] + (["if", "for"] if depth else [])
        kind = draw(st.sampled_from(kinds))
        if kind == "let":
            lines.append(f"{draw(st.sampled_from('ab'))} = wp.sin({draw(values(2, counter))})")
        elif kind == "store":
            lines.append(draw(stores(counter)))
        elif kind == "if":
            lines += [f"if {draw(conditions(counter))}:"]
            lines += indented(draw(blocks(depth - 1, counter)))
            if draw(st.booleans()):
                lines += ["else:", *indented(draw(blocks(depth - 1, counter)))]
        else:
            bounds = draw(st.sampled_from(("n", "3", "n - 1, -1, -1")))
            inner = indented(draw(blocks(depth - 1, f"k{depth}")))
            lines += [f"for k{depth} in range({bounds}):", *inner]
    return lines


@st.composite
def kernels(draw):
    """Source of a kernel that updates `w` and `u` and writes `y`."""
    start = ["i = wp.tid()", "a = R(0.3)", "b = x[i]"]
    end = draw(st.sampled_from(("w[i] = w[i] * a + b", "y[i] = a * b + w[i]")))
    return "\n".join([HEADER, *indented([*start, *draw(blocks(2)), end])]) + "\n"


def reference(source, n):
    """Contents afterwards, and gradients of their weighted sum by the contents before."""
    functions = type("Threads", (Functions,), {"tid": staticmethod(lambda: thread)})
    plain = define(source, wp=functions, R=Dual, A1=list, A2=list)["program"]
    ends = np.cumsum([0, *(data.size for data in START.values())])
    unit = np.eye(ends[-1])
    arrays = {}
    for (name, data), first in zip(START.items(), ends):
        duals = [Dual(v, unit[first + k]) for k, v in enumerate(data.ravel())]
        arrays[name] = np.array(duals, object).reshape(data.shape)
    for thread in range(THREADS):  # noqa: B007 (read by wp.tid)
        plain(*arrays.values(), n)
    total = sum(w * d.slope for o in WRITTEN for w, d in zip(WEIGHTS[o].ravel(), arrays[o].ravel()))
    parts = np.split(total, ends[1:-1])
    gradients = {name: part.reshape(SHAPES[name]) for name, part in zip(START, parts)}
    contents = {name: np.vectorize(lambda d: d.value)(arrays[name]) for name in WRITTEN}
    return contents, gradients
