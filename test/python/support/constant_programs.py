"""Random programs whose variables start as constants of the module, and what Python makes of them.

A program is text with `@(...)` around what is assigned to a whole variable: kernels have values,
Python copies there.
"""

from hypothesis import strategies as st

import warp as wp
from frontend_programs import indented, remainder

mat23 = wp.types.matrix((2, 3), int)
VECTOR = wp.constant(wp.vec3i(3, 5, 7))
MATRIX = mat23(1, 2, 3, 4, 5, 6)


@wp.struct
class Inner:
    v: wp.vec3i
    m: mat23


@wp.struct
class Outer:
    a: int
    v: wp.vec3i
    inner: Inner


WHOLE = Outer()
WHOLE.a = 11
WHOLE.v = wp.vec3i(13, 17, 19)
WHOLE.inner.v = wp.vec3i(23, 29, 31)
WHOLE.inner.m = mat23(2, 4, 6, 8, 10, 12)

KERNEL = """
@wp.func
def rem(a: int, b: int):
    return a % b

@wp.func
def put(v: wp.ref[wp.vec3i], i: int, x: int):
    v[i] = x

@wp.func
def program(x: int, n: int):
{body}

@wp.kernel
def kernel(n: int, out: wp.array2d(dtype=int)):
    i = wp.tid()
{results}
"""
PLAIN = "def program(x, n):\n{body}\n"
START = ["v = @(VECTOR)", "w = @(v)", "m = @(MATRIX)", "s = @(WHOLE)", "t = @(s)"]
# Vectors of three integers, matrices, and numbers that a program can name and assign to.
VECTORS = ("v", "w", "s.v", "t.v", "s.inner.v", "t.inner.v")
MATRICES = ("m", "s.inner.m", "t.inner.m")
WHOLES = ("s", "t")


class Rows(list):
    """A matrix of Python: rows, which two indices go through."""

    def __getitem__(self, key):
        return (
            super().__getitem__(key[0])[key[1]] if type(key) is tuple else super().__getitem__(key)
        )

    def __setitem__(self, key, value):
        if type(key) is tuple:
            super().__getitem__(key[0])[key[1]] = value
        else:
            super().__setitem__(key, value)


class Record:
    def __init__(self, **fields):
        vars(self).update(fields)


def copied(value):
    """A value of Python for a value of kernels, which nothing else shares."""
    if isinstance(value, (int, list)):
        copy = value if isinstance(value, int) else type(value)(map(copied, value))
        return copy
    if isinstance(value, Record):
        return Record(**{name: copied(one) for name, one in vars(value).items()})
    if isinstance(value, mat23):
        return Rows([int(value[i, j]) for j in range(3)] for i in range(2))
    if isinstance(value, wp.vec3i):
        return [int(one) for one in value]
    return Record(**{name: copied(getattr(value, name)) for name in type(value)._wp_fields_})


def put(v, i, x):
    v[i] = x


NAMES = {"VECTOR": VECTOR, "MATRIX": MATRIX, "WHOLE": WHOLE, "Outer": Outer}
PLAIN_NAMES = {**NAMES, "copied": copied, "rem": remainder, "put": put}


@st.composite
def indices(draw, extent, loops):
    """The index of a component: known, a counter, or a value that a program computes."""
    forms = [
        str(draw(st.integers(0, extent - 1))),
        f"rem(abs({draw(numbers(0, loops))}), {extent})",
    ]
    if loops:
        forms += [f"rem(k{draw(st.integers(0, loops - 1))}, {extent})"] * 2
    return draw(st.sampled_from(forms))


@st.composite
def places(draw, loops):
    """A number that can be assigned to."""
    kind = draw(st.sampled_from(("vector", "vector", "matrix", "field")))
    if kind == "field":
        return f"{draw(st.sampled_from(WHOLES))}.a"
    if kind == "vector":
        return f"{draw(st.sampled_from(VECTORS))}[{draw(indices(3, loops))}]"
    row, column = draw(indices(2, loops)), draw(indices(3, loops))
    index = draw(st.sampled_from((f"[{row}, {column}]", f"[{row}][{column}]")))
    return draw(st.sampled_from(MATRICES)) + index


@st.composite
def numbers(draw, depth=1, loops=0):
    if depth == 0:
        simple = ["x", "n", "v[1]", "s.a", "t.inner.v[0]", "m[1, 2]", "s.inner.m[0][1]"]
        simple += [f"k{loop}" for loop in range(loops)] + [str(draw(st.integers(-9, 9)))]
        return draw(st.sampled_from(simple))
    left, right = draw(places(loops)), draw(numbers(depth - 1, loops))
    form = draw(st.sampled_from(("({0} + {1})", "({0} * {1})", "({0} - {1})", "max({0}, {1})")))
    return f"rem({form.format(left, right)}, 1009)"


@st.composite
def writes(draw, loops):
    kind = draw(st.sampled_from(("set", "set", "add", "add", "whole", "put", "swap")))
    if kind == "set":
        return f"{draw(places(loops))} = {draw(numbers(1, loops))}"
    if kind == "add":
        return f"{draw(places(loops))} += {draw(numbers(0, loops))}"
    if kind == "put":
        index = draw(indices(3, loops))
        return f"put({draw(st.sampled_from(VECTORS))}, {index}, {draw(numbers(1, loops))})"
    if kind == "swap":
        return f"{draw(places(loops))}, {draw(places(0))} = {draw(numbers(0, loops))}, x"
    group, more = draw(
        st.sampled_from(((VECTORS, "VECTOR"), (MATRICES, "MATRIX"), (WHOLES, "WHOLE")))
    )
    return f"{draw(st.sampled_from(group))} = @({draw(st.sampled_from((*group, more)))})"


@st.composite
def blocks(draw, depth, loops):
    lines = []
    for _ in range(draw(st.integers(1, 3))):
        kinds = ["write"] * 4
        if depth > 0:
            kinds += ["if", "for", "for", "while"]
        if loops > 0:
            kinds += ["break", "continue"]
        kind = draw(st.sampled_from(kinds))
        test = f"{draw(numbers(1, loops))} > {draw(numbers(0, loops))}"
        if kind == "write":
            lines.append(draw(writes(loops)))
        elif kind in ("break", "continue"):
            lines += [f"if {test}:", f"    {kind}"]
        elif kind == "if":
            lines += [f"if {test}:", *indented(draw(blocks(depth - 1, loops)))]
            if draw(st.booleans()):
                lines += ["else:", *indented(draw(blocks(depth - 1, loops)))]
        elif kind == "for":
            bounds = draw(st.sampled_from(("2", "n", "1, 4", "n, 0, -1")))
            lines += [f"for k{loops} in range({bounds}):"]
            lines += indented(draw(blocks(depth - 1, loops + 1)))
        else:
            lines += [f"k{loops} = int(0)", f"while k{loops} < 3 and {test}:"]
            lines += [f"    k{loops} += 1", *indented(draw(blocks(depth - 1, loops + 1)))]
    return lines


@st.composite
def programs(draw):
    """Text of a function that returns a record of all that it has written."""
    body = [*START, *draw(blocks(2, 0))]
    body += ["v += w", "s.v += v", "s.inner.v += t.v", "s.inner.m += m", "s.a += t.a", "return s"]
    return "\n".join(indented(body))


def sources(text):
    """Source of a kernel, and of a function of Python."""
    results = [f"out[i, {k}] = r.{place}" for k, place in enumerate(PLACES)]
    results = "\n".join(indented(["r = program(i - 2, n)", *results]))
    plain = text.replace("@(", "copied(")
    for line in ("v += w", "s.v += v", "s.inner.v += t.v"):
        into, other = line.split(" += ")
        plain = plain.replace(line, f"{into} = [a + b for a, b in zip({into}, {other})]")
    rows = "[[a + b for a, b in zip(*rows)] for rows in zip(s.inner.m, m)]"
    plain = plain.replace("s.inner.m += m", f"s.inner.m = {rows}")
    return KERNEL.format(body=text.replace("@(", "("), results=results), PLAIN.format(body=plain)


PLACES = [
    "a",
    *(f"{vector}[{i}]" for vector in ("v", "inner.v") for i in range(3)),
    *(f"inner.m[{i}][{j}]" for i in range(2) for j in range(3)),
]
