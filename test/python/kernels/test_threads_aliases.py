"""Arrays that are one, or overlap, under several names: threads see their own writes in order.

A random thread touches elements that are its own whatever the name: through the plain array 2 i and
2 i + 1, through the others what is the same memory. So the result is defined, and is Python's.
"""

import random

import numpy as np
import pytest

from random_runs import seeds
from threads_launches import SIZES, Launches

# How the second array lies in the first; indices of it that belong to thread i.
VIEWS = {
    "same": (lambda x: x, ("i + i", "2 * i", "2 * i + 1", "i + i + 1", "i * 2", "1 + i + i")),
    "shifted": (lambda x: x[1:], ("i + i", "2 * i", "i * 2")),
    "every other": (lambda x: x[::2], ("i", "i + 0 * n")),
    "second half of pairs": (lambda x: x[1::2], ("i", "n - 1 - (n - 1 - i)")),
    "apart": (lambda x: x.copy(), ("i + i", "2 * i + 1", "i")),
}
OWN = VIEWS["same"][1]
LAYOUTS = [key for key in VIEWS if key != "apart"]
HEAD = """
@wp.kernel(module_options=OPTIONS)
def k(x: wp.array(dtype=wp.{0}), y: wp.array(dtype=wp.{0}), n: int):
    i = wp.tid()
    c = wp.{0}(1)
"""


class Program:
    """Source of a kernel whose threads read and write their elements through both names."""

    def __init__(self, seed, layout):
        self.random = random.Random(seed)
        self.kind = self.random.choice(("int32", "int32", "float32", "int64", "int8", "float64"))
        self.own = {"x": OWN, "y": VIEWS[layout][1]}
        if self.random.random() < 0.5:
            self.own = {
                name: [one for one in forms if "*" not in one or "i" == one]
                for name, forms in self.own.items()
            }
        self.lines: list = []
        depth = self.random.choice((0, 0, 1, 2))
        for _ in range(self.random.randint(3, 7)):
            self._statement("    ", depth)
        self.text = HEAD.format(self.kind) + "\n".join(self.lines) + "\n"

    def _element(self):
        name = self.random.choice("xy")
        return f"{name}[{self.random.choice(self.own[name])}]"

    def _statement(self, indent, depth):
        choice = self.random.choice
        form = choice(("store", "store", "load", "load", "sum", "if", "for"))
        if form == "if" and depth:
            self.lines.append(
                f"{indent}if {self._element()} > wp.{self.kind}({choice((-2, 0, 3))}):"
            )
        elif form == "for" and depth:
            self.lines.append(f"{indent}for j in range({choice(('3', '5', 'i % 4'))}):")
        elif form == "sum":
            self.lines.append(f"{indent}{self._element()} += wp.{self.kind}({choice((1, 2))})")
        elif form == "load":
            self.lines.append(f"{indent}c = {self._element()} {choice('+-')} {self._element()}")
        else:
            value = f"{choice(('c', self._element()))} {choice('+-')} {self._element()}"
            self.lines.append(f"{indent}{self._element()} = {value}")
        if form in ("if", "for") and depth:
            for _ in range(self.random.randint(1, 2)):
                self._statement(indent + "    ", depth - 1)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("seed", seeds(24))
def test_arrays_under_two_names(device, seed, layout):
    program = Program(seed, layout)
    launches = Launches(program.text, [f"wp.{program.kind}"] * 2)
    view = VIEWS[layout][0]
    for n in SIZES[1:]:
        values = np.random.default_rng(n).integers(-4, 5, 2 * n)
        host = {"x": values.astype(program.kind)}
        launches.check((n,), host, [n], device, lambda arrays: [arrays["x"], view(arrays["x"])])
