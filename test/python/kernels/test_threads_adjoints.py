"""Adjoints of threads that diverge: the same bits in every mode, and central differences.

A thread reads and writes its own elements only, so one difference of all inputs at once gives the
derivative of each thread; Python computes it in 64 bits (threads_reference.py).
"""

import random

import numpy as np
import pytest

import threads_reference as reference
import warp as wp
from random_runs import seeds
from threads_launches import bits, compile_program, modes_on

SIZES = (1, 15, 16, 17, 65, 300)
STEP = 1e-6
HEAD = """
@wp.kernel(module_options=OPTIONS)
def k(x: wp.array(dtype=wp.{0}), z: wp.array(dtype=wp.{0}), m: wp.array(dtype=int),
      y: wp.array(dtype=wp.{0}), u: wp.array(dtype=wp.{0})):
    i = wp.tid()
    a = x[i]
    b = z[i]
    c = wp.{0}(0.5)
"""


class Program:
    """Source of a kernel with branches, short loops, early returns and repeated stores."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        self.kind = self.random.choice(("float64", "float64", "float32"))
        self.lines: list = []
        # Short programs are what LLVM's vectorisers take, too.
        short = self.random.random() < 0.6
        self.may_loop, self.in_loop = not short, False
        for _ in range(self.random.randint(1, 2) if short else self.random.randint(2, 5)):
            self._statement("    ", self.random.choice((1, 2)))
        if not short or self.random.random() < 0.5:
            self.lines.append(f"    y[i] = {self._value(1)}")
        self.text = HEAD.format(self.kind) + "\n".join(self.lines) + "\n"

    def _literal(self, *choices):
        return f"wp.{self.kind}({self.random.choice(choices)})"

    def _value(self, depth):
        choice = self.random.choice
        if depth == 0 or self.random.random() < 0.2:
            return choice(("a", "b", "c", "a", "b", "x[i]", "z[i]", self._literal(0.5, 2.0, -1.5)))
        one, other = self._value(depth - 1), self._value(depth - 1)
        forms = ("({0} + {1})", "({0} - {1})", "({0} * {1})", "({0} / (wp.abs({1}) + {2}))")
        forms += ("wp.sqrt(wp.abs({0}) + {2})", "({0} if a < {2} else {1})", "wp.min({0}, {1})")
        return choice(forms).format(one, other, self._literal(0.5, 0.75))

    def _condition(self):
        choice = self.random.choice
        number = f"{choice('abc')} {choice('<>')} {self._literal(-0.6, -0.1, 0.2, 0.7)}"
        return choice((number, number, "m[i] > 3", "i % 3 != 0", f"m[i] < 6 and {number}"))

    def _statement(self, indent, depth):
        choice = self.random.choice
        form = choice(("set", "set", "store", "store", "if", "if", "for", "leave"))
        if form == "leave":
            store = f"{choice('yu')}[i] = {self._value(1)}"
            leave = choice(("break", "continue")) if self.in_loop else "return"
            self.lines += [f"{indent}if {self._condition()}:"]
            self.lines += [f"{indent}    {store}", f"{indent}    {leave}"]
        elif form == "if" and depth:
            self.lines.append(f"{indent}if {self._condition()}:")
            self._block(indent, depth)
            if self.random.random() < 0.5:
                self.lines.append(f"{indent}else:")
                self._block(indent, depth)
        elif form == "for" and depth and self.may_loop and not self.in_loop:
            self.lines.append(f"{indent}for j in range({choice(('2', 'm[i] % 4', '3'))}):")
            self.in_loop = True
            self._block(indent, depth)
            self.in_loop = False
        elif form == "store":
            self.lines.append(f"{indent}{choice('yu')}[i] = {self._value(2)}")
        else:
            self.lines.append(f"{indent}{choice('abc')} = {self._value(2)}")

    def _block(self, indent, depth):
        for _ in range(self.random.randint(1, 2)):
            self._statement(indent + "    ", depth - 1)


def fill(kind, n):
    """Inputs, and seeds of the outputs."""
    random = np.random.default_rng(n)
    x, z, *seeds = random.uniform(-1.0, 1.0, (4, n)).astype(kind)
    return x, z, random.integers(0, 9, n).astype(np.int32), seeds


def gradients(space, kind, n, device):
    """The gradients of x, z, and of the former values of y and u."""
    x, z, m, seeds = fill(kind, n)
    element = getattr(wp, kind)
    x, z = (wp.array(one, dtype=element, device=device, requires_grad=True) for one in (x, z))
    y, u = (wp.zeros(n, dtype=element, device=device, requires_grad=True) for _ in range(2))
    for out, seed in zip((y, u), seeds, strict=True):
        out.grad.assign(seed)
    inputs = [x, z, wp.array(m, dtype=int, device=device), y, u]
    grads = [x.grad, z.grad, None, y.grad, u.grad]
    wp.launch(space["k"], n, inputs, device=device)
    wp.launch(space["k"], n, inputs, adj_inputs=grads, adjoint=True, device=device)
    return [one.grad.numpy() for one in (x, z, y, u)]


def differences(text, n):
    """Central differences of the same, in 64 bits."""
    names = reference.load(text)
    x, z, m, seeds = fill("float64", n)
    found = []
    for which in range(4):
        sums = []
        for sign in (1, -1):
            host = [x.copy(), z.copy(), np.zeros(n), np.zeros(n)]
            host[which] += sign * STEP
            arrays = [reference.Array(one, reference.KINDS["float64"]) for one in host]
            arrays.insert(2, reference.Array(m, reference.INTEGER))
            reference.launch(names["k"], n, arrays)
            sums.append(host[2] * seeds[0] + host[3] * seeds[1])
        found.append((sums[0] - sums[1]) / (2 * STEP))
    return found


@pytest.mark.parametrize("seed", seeds(200))
def test_adjoints_of_threads_that_diverge(device, seed):
    program = Program(seed)
    modes = modes_on(device).items()
    spaces = {mode: compile_program(program.text, options) for mode, options in modes}
    for n in SIZES:
        found = {mode: gradients(one, program.kind, n, device) for mode, one in spaces.items()}
        for mode, values in found.items():
            for name, value, want in zip("xzyu", values, found["debug"], strict=True):
                message = f"{name}.grad in {mode} mode with {n} threads of\n{program.text}"
                np.testing.assert_array_equal(bits(value), bits(want), err_msg=message)
        if program.kind == "float64":
            for name, value, want in zip(
                "xzyu", found["normal"], differences(program.text, n), strict=True
            ):
                message = f"{name}.grad with {n} threads of\n{program.text}"
                np.testing.assert_allclose(value, want, 1e-5, 1e-6, err_msg=message)
