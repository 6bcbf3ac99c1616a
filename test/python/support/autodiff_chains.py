"""Random kernels with loops that read what they wrote, by indices from arrays."""

import numpy as np
from hypothesis import strategies as st

from autodiff_programs import Dual, Functions, indented
from autodiff_updates import FORMS
from frontend_programs import define

THREADS, PART = 3, 4
_rng = np.random.default_rng(0)
# Elements of `v` that belong to a thread are not next to each other.
PLACES = _rng.permutation(THREADS * PART).reshape(THREADS, PART).astype(np.int32)
ORDER = np.array([2, 0, 3, 1, 0, 2], np.int32)
SHAPES = {"x": (THREADS,), "d": (4,), "v": (THREADS * PART,), "z": (THREADS * PART,)}
SHAPES |= {"u": (THREADS, PART), "y": (THREADS,)}
WRITTEN = ("v", "z", "u", "y")
START = {name: _rng.uniform(-1.0, 1.0, shape) for name, shape in SHAPES.items()}
WEIGHTS = {name: _rng.uniform(-1.0, 1.0, SHAPES[name]) for name in WRITTEN}
HEADER = """
def mix(v: A1, at: int, a: R):
    v[at] = wp.tanh(v[at] + a)
    return v[at] * a

def program(x: A1, d: A1, v: A1, z: A1, u: A2, y: A1, r: I2, o: I1, n: int):
"""


@st.composite
def elements(draw, counter=None):
    """An element of the thread."""
    column = st.sampled_from(["0", "1", "3"] + ([f"o[{counter}]", f"{counter} % 4"] * 3))
    column = draw(column if counter else st.sampled_from(["0", "1", "3"]))
    array = draw(st.sampled_from(("v[r[i, {}]]", "z[r[i, {}]]", "s[r[i, {}]]", "u[i, {}]")))
    return array.format(column)


@st.composite
def values(draw, depth=2, counter=None):
    if depth == 0 or draw(st.integers(0, 3)) == 0:
        leaf = draw(st.sampled_from(["a", "b", "x[i]", "R(0.7)", "d", "e", "e", "e", "e"]))
        if leaf == "d":
            return f"d[{counter} % 4]" if counter else "d[1]"
        return draw(elements(counter)) if leaf == "e" else leaf
    left, right = draw(values(depth - 1, counter)), draw(values(depth - 1, counter))
    return draw(st.sampled_from(FORMS)).format(left, right)


@st.composite
def conditions(draw, counter=None):
    left, right = draw(values(0, counter)), draw(values(0, counter))
    offset = draw(st.integers(-4, 4)) * 0.1 + 0.0123
    return f"{left} {draw(st.sampled_from('<>'))} {right} + R({offset})"


@st.composite
def stores(draw, counter=None):
    target = draw(elements(counter))
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
        kinds = ["let", "store", "store", "call", "choose"] + (
            ["if", "for", "while"] if depth else []
        )
        kind = draw(st.sampled_from(kinds))
        if kind == "let":
            lines.append(f"{draw(st.sampled_from('ab'))} = wp.sin({draw(values(2, counter))})")
        elif kind == "store":
            lines.append(draw(stores(counter)))
        elif kind == "choose":
            lines += [f"if {draw(conditions(counter))}:", "    s, t = t, s"]
        elif kind == "call":
            column = f"o[{counter}]" if counter else "2"
            lines.append(f"a = wp.sin(mix(v, r[i, {column}], {draw(values(1, counter))}))")
        elif kind == "if":
            lines += [f"if {draw(conditions(counter))}:"]
            lines += indented(draw(blocks(depth - 1, counter)))
            if draw(st.booleans()):
                lines += ["else:", *indented(draw(blocks(depth - 1, counter)))]
        elif kind == "for":
            bounds = draw(st.sampled_from(("n", "3", "n - 1, -1, -1")))
            inner = indented(draw(blocks(depth - 1, f"k{depth}")))
            lines += [f"for k{depth} in range({bounds}):", *inner]
        else:
            count = f"w{depth}"
            test = f"{count} < n and {draw(conditions(counter))}"
            inner = draw(blocks(depth - 1, count))
            lines += [f"{count} = int(0)", f"while {test}:"]
            lines += indented([*inner, f"{count} += 1"])
    return lines


@st.composite
def kernels(draw):
    """Source of a function and a kernel that updates `v` and `u` and writes `y`."""
    start = ["i = wp.tid()", "a = R(0.3)", "b = x[i]", "s = v", "t = z", "for k in range(n):"]
    start += indented([f"{draw(elements('k'))} = wp.sin({draw(values(2, 'k'))})"])
    end = draw(st.sampled_from(("u[i, 1] = u[i, 2] * a + b", "y[i] = a * b + u[i, 0]")))
    return HEADER + "\n".join(indented([*start, *draw(blocks(2)), end])) + "\n"


def reference(source, n):
    """Contents afterwards, and gradients of their weighted sum by the contents before."""
    functions = type("Threads", (Functions,), {"tid": staticmethod(lambda: thread)})
    plain = define(source, wp=functions, R=Dual, A1=list, A2=list, I1=list, I2=list, int=int)[
        "program"
    ]
    ends = np.cumsum([0, *(data.size for data in START.values())])
    unit = np.eye(ends[-1])
    arrays = {}
    for (name, data), first in zip(START.items(), ends):
        duals = [Dual(v, unit[first + k]) for k, v in enumerate(data.ravel())]
        arrays[name] = np.array(duals, object).reshape(data.shape)
    for thread in range(THREADS):  # noqa: B007 (read by wp.tid)
        plain(*arrays.values(), PLACES, ORDER, n)
    total = sum(w * d.slope for o in WRITTEN for w, d in zip(WEIGHTS[o].ravel(), arrays[o].ravel()))
    parts = np.split(total, ends[1:-1])
    gradients = {name: part.reshape(SHAPES[name]) for name, part in zip(START, parts)}
    contents = {name: np.vectorize(lambda d: d.value)(arrays[name]) for name in WRITTEN}
    return contents, gradients
