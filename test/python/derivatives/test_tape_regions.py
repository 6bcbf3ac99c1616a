"""Launches that write parts of arrays others have read: gradients agree with complex steps."""

import random

import numpy as np
import pytest

import warp as wp
from random_runs import seeds

ROWS, N = 6, 4
Real = wp.float64


@wp.kernel
def step(x: wp.array2d(dtype=Real), k: int):
    i = wp.tid()
    x[k + 1, i] = wp.sin(x[k, i]) * x[k, (i + 1) % x.shape[1]]


@wp.kernel
def window(x: wp.array2d(dtype=Real), k: int):
    i = wp.tid()
    s = Real(0.0)
    for j in range(1, 4):
        s += x[k - j, i] * x[k - j, i]
    x[k, i] = s


@wp.kernel
def ring(x: wp.array2d(dtype=Real), k: int, rows: int):
    i = wp.tid()
    x[(k + 1) % rows, i] = wp.cos(x[k % rows, i]) * x[(k + rows - 1) % rows, i]


@wp.kernel
def sweep(x: wp.array2d(dtype=Real), w: wp.array(dtype=Real), k: int):
    i = wp.tid()
    x[k, i] = x[k, i] * wp.sin(x[k, i]) + w[i]


@wp.kernel
def column(x: wp.array2d(dtype=Real), k: int):
    i = wp.tid()
    x[i, k + 1] = x[i, k] * x[i, k]


@wp.kernel
def between(src: wp.array2d(dtype=Real), dst: wp.array2d(dtype=Real), a: int, b: int):
    i = wp.tid()
    dst[b, i] += src[a, i] * src[a, i]


@wp.kernel
def relax(x: wp.array(dtype=Real), color: int):
    j = 2 * wp.tid() + color
    if j > 0 and j < x.shape[0] - 1:
        x[j] = x[j - 1] * x[j + 1] + Real(0.5)


@wp.kernel
def gather(x: wp.array(dtype=Real), pick: wp.array(dtype=int), y: wp.array(dtype=Real), k: int):
    y[k] = x[pick[k]] * x[pick[k + 1]]


@wp.kernel
def product(a: wp.array(dtype=Real), b: wp.array(dtype=Real)):
    i = wp.tid()
    b[i] = a[i] * a[i] - Real(0.3)


PICK = np.array([3, 0, 2, 3, 1, 2, 0], dtype=np.int32)


class Program:
    """Instructions on a matrix, for the tape and for NumPy."""

    KINDS = ("step", "window", "ring", "sweep", "column", "between", "relax", "gather")
    MORE = ("rows", "swap", "stride", "fill", "copy")

    def __init__(self, seed):
        chance = random.Random(seed)
        self.steps = []
        for _ in range(chance.randint(4, 14)):
            kind = chance.choice(self.KINDS + self.MORE)
            low = 3 if kind == "window" else 0
            k = chance.randrange(low, N - 1 if kind == "column" else ROWS - 1)
            other = chance.choice([row for row in range(ROWS) if row != k])
            self.steps.append((kind, k, other, chance.uniform(0.2, 1.0)))

    def on_tape(self, x, w, pick, device):
        def run(kernel, dim, *values):
            wp.launch(kernel, dim, list(values), device=device)

        for kind, k, other, value in self.steps:
            if kind in ("step", "window", "column"):
                kernel = {"step": step, "window": window, "column": column}[kind]
                run(kernel, ROWS if kind == "column" else N, x, k)
            elif kind == "ring":
                run(ring, N, x, k + other, ROWS)
            elif kind == "sweep":
                run(sweep, N, x, w, k)
            elif kind == "between":
                run(between, N, x, x, k, other)
            elif kind == "relax":
                run(relax, 2, x[k], k % 2)
            elif kind == "gather":
                run(gather, 1, x[k], pick, x[other], k % N)
            elif kind == "rows":
                run(product, N, x[k], x[other])
            elif kind == "swap":
                run(product, N, x[k], x[other])
                run(product, N, x[other], x[k])
            elif kind == "stride":
                run(product, N // 2, x[k, ::2], x[k, 1::2])
            elif kind == "fill":
                x[k].fill_(value)
            else:
                wp.copy(x[other], x[k])

    def in_numpy(self, x, w):
        for kind, k, other, value in self.steps:
            if kind == "step":
                x[k + 1] = np.sin(x[k]) * np.roll(x[k], -1)
            elif kind == "window":
                x[k] = (x[k - 3 : k] ** 2).sum(axis=0)
            elif kind == "ring":
                n = k + other
                x[(n + 1) % ROWS] = np.cos(x[n % ROWS]) * x[(n - 1) % ROWS]
            elif kind == "sweep":
                x[k] = x[k] * np.sin(x[k]) + w
            elif kind == "column":
                x[:, k + 1] = x[:, k] ** 2
            elif kind == "between":
                x[other] += x[k] ** 2
            elif kind == "relax":
                for j in range(k % 2, N, 2):
                    if 0 < j < N - 1:
                        x[k, j] = x[k, j - 1] * x[k, j + 1] + 0.5
            elif kind == "gather":
                a, b = PICK[k % N], PICK[k % N + 1]
                x[other, k % N] = x[k, a] * x[k, b]
            elif kind in ("rows", "swap"):
                x[other] = x[k] ** 2 - 0.3
                if kind == "swap":
                    x[k] = x[other] ** 2 - 0.3
            elif kind == "stride":
                x[k, 1::2] = x[k, ::2] ** 2 - 0.3
            elif kind == "fill":
                x[k] = value
            else:
                x[other] = x[k]


@pytest.mark.parametrize("seed", seeds(60))
def test_gradients_of_programs(seed, device):
    rng = np.random.default_rng(seed)
    start, weights = rng.uniform(0.2, 1.0, (ROWS, N)), rng.normal(size=(ROWS, N))
    offset = rng.uniform(0.0, 0.3, N)
    program = Program(seed)
    x = wp.array(start, dtype=Real, requires_grad=True, device=device)
    w = wp.array(offset, dtype=Real, requires_grad=True, device=device)
    with wp.Tape() as tape:
        x += 0.0
        program.on_tape(x, w, wp.array(PICK, dtype=int, device=device), device)
    end = start.astype(complex)
    program.in_numpy(end, offset)
    assert np.allclose(x.numpy(), end.real, rtol=1e-12)
    expected = np.zeros((ROWS, N))
    for place in np.ndindex(ROWS, N):
        shifted = start.astype(complex)
        shifted[place] += 1e-30j
        program.in_numpy(shifted, offset)
        expected[place] = (weights * shifted.imag).sum() / 1e-30
    now = x.numpy().copy()
    for _ in range(2):
        tape.zero()
        tape.backward(grads={x: wp.array(weights, dtype=Real, device=device)})
        assert np.allclose(x.grad.numpy(), expected, rtol=1e-10, atol=1e-12)
        assert np.array_equal(x.numpy(), now)
