"""Makes kernels from source text, and random programs for the front end's property test."""

import itertools
import linecache

from hypothesis import strategies as st

import warp as wp

_count = itertools.count()


def define(source, **names):
    """Runs source text as a module whose lines the front end can read; gives its names."""
    path = f"<program {next(_count)}>"
    lines = source.splitlines(keepends=True)
    linecache.cache[path] = (len(source), None, lines, path)
    space = {"__name__": "frontend_program", "wp": wp, **names}
    exec(compile(source, path, "exec"), space)
    return space


def remainder(a, b):
    """The remainder that kernels give: it has the sign of the dividend."""
    quotient = abs(a) // abs(b)
    return a - b * (quotient if (a < 0) == (b < 0) else -quotient)


RANGES = ("3", "1, 6, 2", "5, 0, -2", "n", "n, -1, -1", "2, n, s")
VARIABLES = ("a", "b", "c", "x", "y")


@st.composite
def expressions(draw, depth=2):
    if depth == 0 or draw(st.integers(0, 3)) == 0:
        return draw(st.one_of(st.sampled_from(VARIABLES), st.integers(-9, 9).map(str)))
    left, right = draw(expressions(depth - 1)), draw(expressions(depth - 1))
    form = draw(
        st.sampled_from(
            (
                "({0} + {1})",
                "({0} - {1})",
                "({0} * {1})",
                "rem({0}, 7)",
                "min({0}, {1})",
                "max({0}, {1})",
                "(-{0})",
                "({0} if {2} else {1})",
                "({0} // 3)",
                "({0} & {1})",
                "({0} ^ {1})",
                "abs({0})",
            )
        )
    )
    return form.format(left, right, draw(conditions(depth - 1)))


@st.composite
def conditions(draw, depth=1):
    left, right = draw(expressions(max(depth - 1, 0))), draw(expressions(max(depth - 1, 0)))
    compare = f"{left} {draw(st.sampled_from(('<', '<=', '>', '>=', '==', '!=')))} {right}"
    if depth <= 0:
        return compare
    form = draw(st.sampled_from(("{0}", "({0} and {1})", "({0} or {1})", "not ({0})", "-5 < {0}")))
    if form == "-5 < {0}":
        return form.format(compare.replace("==", "<").replace("!=", "<"))
    return form.format(compare, draw(conditions(depth - 1)))


def assign(draw):
    name = draw(st.sampled_from(VARIABLES))
    form = draw(st.sampled_from(("{0} = rem({1}, 1009)", "{0} += {1} % 5", "{0}, c = c, {1}")))
    return [form.format(name, f"rem({draw(expressions())}, 1009)").replace(" % 5", "")]


@st.composite
def blocks(draw, depth, loops):
    """Lines of a block; `loops` is how many loops enclose it."""
    lines = []
    for _ in range(draw(st.integers(1, 3))):
        kinds = ["assign"] * 3 + ["return"]
        if depth > 0:
            kinds += ["if", "if", "for", "while"]
        if loops > 0:
            kinds += ["break", "continue"]
        kind = draw(st.sampled_from(kinds))
        if kind == "assign":
            lines += assign(draw)
        elif kind == "return":
            lines += [f"if {draw(conditions())}:", f"    return {draw(expressions(1))}"]
        elif kind in ("break", "continue"):
            lines += [f"if {draw(conditions())}:", f"    {kind}"]
        elif kind == "if":
            lines += [f"if {draw(conditions())}:", *indented(draw(blocks(depth - 1, loops)))]
            if draw(st.booleans()):
                lines += [f"elif {draw(conditions())}:", *indented(draw(blocks(depth - 1, loops)))]
            if draw(st.booleans()):
                lines += ["else:", *indented(draw(blocks(depth - 1, loops)))]
        elif kind == "for":
            bounds = draw(st.sampled_from(RANGES))
            counter = f"k{loops}"
            lines += [f"for {counter} in range({bounds}):", f"    a = rem(a + {counter}, 1009)"]
            lines += indented(draw(blocks(depth - 1, loops + 1)))
        else:
            counter = f"w{depth}{loops}"
            lines += [f"{counter} = int(0)", f"while {counter} < 4 and {draw(conditions())}:"]
            lines += [f"    {counter} += 1", *indented(draw(blocks(depth - 1, loops + 1)))]
    return lines


def indented(lines):
    return ["    " + line for line in lines]


@st.composite
def programs(draw):
    """Source of a function of five integers with random control flow."""
    start = ["a = int(1)", "b = int(2)", "c = x + 3"]
    body = [*start, *draw(blocks(2, 0)), "return a + b * 3 + c * 5"]
    return "def program(x: int, y: int, n: int, s: int):\n" + "\n".join(indented(body)) + "\n"


def run(kernel, *inputs, n=1, size=16, dtype=float):
    """Launches a kernel whose last parameter is its output; gives the output as a list."""
    out = wp.zeros(size, dtype=dtype, device="cpu")
    wp.launch(kernel, n, [*inputs, out], device="cpu")
    return out.numpy().tolist()
