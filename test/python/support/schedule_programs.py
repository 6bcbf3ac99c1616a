"""Random kernels with loops over pairs, guards, sums into arrays and elements of several sizes.

The compiler schedules such code in many ways: sums are combined over threads, loops rotated,
elements staged, updates deferred. None of that happens in debug mode, which runs what was written.
"""

import random

import warp as wp

INDENT = "    "


class Program:
    """Source and types of one kernel `k(x, y, g, h, s, n, m)`, launched with n threads.

    Args:
        seed: what the choices follow from.

    Attributes:
        text: the source.
        real: scalar type.
        shape: of an element: a number, a vector or a matrix.
    """

    def __init__(self, seed):
        self.random = random.Random(seed)
        self.real = self.random.choice([wp.float64, wp.float64, wp.float32])
        self.shape = self.random.choice([(), (), (3,), (3, 3)])
        self.lines: list = []
        self.depth = 1
        self._write()
        self.text = "\n".join(self.lines) + "\n"

    @property
    def element(self):
        if len(self.shape) == 2:
            return wp.types.matrix(self.shape, self.real)
        return wp.types.vector(3, self.real) if self.shape else self.real

    def _add(self, line):
        self.lines.append(INDENT * self.depth + line)

    def _component(self, name):
        """A number of an element."""
        indices = ", ".join(str(self.random.randrange(extent)) for extent in self.shape)
        return f"{name}[{indices}]" if indices else name

    def _write(self):
        choice = self.random.choice
        self.lines += [
            "@wp.kernel(module='unique')",
            "def k(x: wp.array(dtype=E), y: wp.array(dtype=E), g: wp.array(dtype=E),",
            "      h: wp.array(dtype=E), s: wp.array(dtype=S), n: int, m: int):",
        ]
        self._add("i = wp.tid()")
        if self.random.random() < 0.4:
            self._add(f"if i >= n - {choice([0, 1, 5])}:")
            self._add(INDENT + "return")
        place = choice(["i", "i", "i", "i + 1", "n - 1 - i"])
        if place == "i + 1":
            self._add("if i + 1 < n:")
            self.depth += 1
        self._add(f"a = x[{place}]")
        self._add("total = S(0.0)")
        self._write_loop()
        self._add(choice(["g[i] = a * total", "g[i] = a + a * total", "g[i] = g[i] * total"]))
        if self.random.random() < 0.5:
            self._add("wp.atomic_add(s, 0, total)")

    def _write_loop(self):
        choice = self.random.choice
        begin = choice(["0", "0", "1", "i % 3"])
        end = choice(["m", "m", "m - 1", "7", "wp.min(i + 3, m)"])
        self._add(f"for j in range({begin}, {end}):")
        self.depth += 1
        self._add("b = y[j]")
        a, b = self._component("a"), self._component("b")
        value = choice([f"{a} * {b}", f"wp.sin({a} + {b})", f"{b} * S(0.5) + {a} * {a}"])
        self._add(f"v = {value}")
        guarded = self.random.random() < 0.3
        if guarded:
            self._add(f"if {choice(['i != j', 'v > S(0.0)', 'j % 3 != 0', '(i + j) % 2 == 0'])}:")
            self.depth += 1
        where = choice(["j", "j", "j", "0", "j // 2", "(j * 7) % m", "i"])
        what = choice(["b * v", "a * v", "(a + b) * v"])
        self._add(f"wp.atomic_{choice(['add', 'add', 'sub'])}(h, {where}, {what})")
        self.depth -= guarded
        last = choice(["v * " + self._component("b"), "total * S(0.5) + v", None])
        if last:
            self._add(f"total = {'total + ' if last.startswith('v') else ''}{last}")
        self.depth -= 1
