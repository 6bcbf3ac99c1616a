"""Random programs on two arrays of a thread that are indexed at run time."""

import random

HEAD = """    c = R(0.37)
    lim = R(0.8)
    s = R(0.0) + x
    q = int(q0)
"""
TAIL = """    r = s
    for z in range({0}):
        r += a[z] * R(z + 1)
    for z in range({1}):
        r += b[z] * R(2 * z + 1)
    return r
"""


class _Writer:
    """Writes statements; `depth` counts the loops around, with counters k0, k1, ..."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        self.sizes = {"a": self.random.choice([10, 16, 24, 40]), "b": self.random.choice([10, 16])}
        self.lines = []

    def element(self, depth):
        name = self.random.choice("ab")
        index = self.random.choice(["q", "p", "q + p", str(self.random.randrange(9))])
        if depth:
            k = f"k{self.random.randrange(depth)}"
            index = self.random.choice([k, f"q + {k}", f"3 * {k} + q", index])
        return f"{name}[({index}) % {self.sizes[name]}]"

    def number(self, depth):
        draw = self.random.random()
        if draw < 0.4:
            return self.element(depth)
        if draw < 0.65:
            return self.random.choice("sx")
        if draw < 0.9:
            operator = self.random.choice("*+")
            return f"({self.number(depth)} {operator} {self.number(depth)})"
        return f"wp.sin({self.number(depth)})"

    def block(self, indent, depth, budget):
        pad = "    " * indent
        for _ in range(self.random.randint(1, 3)):
            draw = self.random.random()
            if draw < 0.45 or budget <= 0:
                operator = self.random.choice(["=", "=", "+=", "*="])
                self.lines.append(f"{pad}{self.element(depth)} {operator} {self.number(depth)} * c")
            elif draw < 0.55:
                self.lines.append(f"{pad}s = {self.number(depth)} * c + s * c")
            elif draw < 0.75:
                count = self.random.choice(["2", "m", "m + 1", "20"])
                self.lines.append(f"{pad}for k{depth} in range({count}):")
                self.block(indent + 1, depth + 1, budget - 1)
                if self.random.random() < 0.3:
                    leave = self.random.choice(["break", "continue"])
                    self.lines.append(f"{pad}    if s > lim:\n{pad}        {leave}")
                    self.block(indent + 1, depth + 1, budget - 2)
            elif draw < 0.92:
                self.lines.append(f"{pad}if {self.number(depth)} > s:")
                self.block(indent + 1, depth, budget - 1)
                self.lines.append(f"{pad}else:")
                self.block(indent + 1, depth, budget - 1)
            else:
                self.lines.append(f"{pad}q = (q * 5 + 3 + p) % 97")


def make_program(seed):
    """Text of `def program(x, q0, m, p)`, and the sizes of its arrays `a` and `b`."""
    writer = _Writer(seed)
    for budget in (3, 2):
        writer.block(1, 0, budget)
    sizes = tuple(writer.sizes.values())
    return HEAD + "\n".join(writer.lines) + "\n" + TAIL.format(*sizes), sizes
