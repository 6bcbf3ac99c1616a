"""Random programs of launches, copies and fills: gradients agree with complex steps in NumPy."""

import random

import numpy as np
import pytest

import warp as wp
from random_runs import seeds

N, ARRAYS = 5, 4
Real = wp.float64


@wp.kernel
def multiply(a: wp.array(dtype=Real), b: wp.array(dtype=Real), c: wp.array(dtype=Real)):
    i = wp.tid()
    c[i] = a[i] * b[i]


@wp.kernel
def bend(a: wp.array(dtype=Real), b: wp.array(dtype=Real)):
    i = wp.tid()
    a[i] = wp.sin(a[i]) + a[i] * b[i]


@wp.kernel
def collect(a: wp.array(dtype=Real), b: wp.array(dtype=Real)):
    i = wp.tid()
    wp.atomic_add(b, (i * 2) % b.shape[0], a[i] * a[i])


@wp.kernel
def turn(a: wp.array(dtype=Real), b: wp.array(dtype=Real)):
    i = wp.tid()
    b[b.shape[0] - 1 - i] += wp.cos(a[i])


class Program:
    """Instructions on a few arrays, for the tape and for NumPy."""

    def __init__(self, seed):
        chance = random.Random(seed)
        self.steps = []
        for _ in range(chance.randint(3, 12)):
            which = chance.sample(range(ARRAYS), 3)
            low = chance.randrange(0, N - 1)
            high = chance.randrange(low + 1, N + 1)
            kind = chance.choice(
                ["multiply", "bend", "collect", "turn", "copy", "fill", "operator"]
            )
            self.steps.append((kind, which, low, high, chance.uniform(-1, 1)))

    def on_tape(self, arrays, device):
        for kind, which, low, high, value in self.steps:
            a, b, c = (arrays[k][low:high] for k in which)
            size = high - low
            if kind == "multiply":
                wp.launch(multiply, size, [a, b, c], device=device)
            elif kind == "bend":
                wp.launch(bend, size, [a, b], device=device)
            elif kind == "collect":
                wp.launch(collect, size, [a, arrays[which[1]]], device=device)
            elif kind == "turn":
                wp.launch(turn, size, [a, arrays[which[1]]], device=device)
            elif kind == "copy":
                wp.copy(arrays[which[1]], arrays[which[0]], N - size, low, size)
            elif kind == "fill":
                a.fill_(value)
            else:
                a *= b
                a += 0.5

    def in_numpy(self, arrays):
        for kind, which, low, high, value in self.steps:
            a, b, c = (arrays[k][low:high] for k in which)
            size, whole = high - low, arrays[which[1]]
            if kind == "multiply":
                c[:] = a * b
            elif kind == "bend":
                a[:] = np.sin(a) + a * b
            elif kind == "collect":
                np.add.at(whole, np.arange(size) * 2 % N, a * a)
            elif kind == "turn":
                whole[::-1][:size] += np.cos(a)
            elif kind == "copy":
                whole[N - size :] = a
            elif kind == "fill":
                a[:] = value
            else:
                a *= b
                a += 0.5


@pytest.mark.parametrize("seed", seeds(30))
def test_gradients_of_programs(seed, device):
    rng = np.random.default_rng(seed)
    start, weights = rng.uniform(0.2, 1.2, (ARRAYS, N)), rng.normal(size=(ARRAYS, N))
    program = Program(seed)
    arrays = [wp.array(row, dtype=Real, requires_grad=True, device=device) for row in start]
    with wp.Tape(preserve="auto") as tape:
        for one in arrays:
            one += 0.0
        program.on_tape(arrays, device)
    end = start.astype(complex)
    program.in_numpy(end)
    assert np.allclose([one.numpy() for one in arrays], end.real, rtol=1e-13)
    seeds = [wp.array(row, dtype=Real, device=device) for row in weights]
    expected = np.zeros((ARRAYS, N))
    for place in np.ndindex(ARRAYS, N):
        shifted = start.astype(complex)
        shifted[place] += 1e-30j
        program.in_numpy(shifted)
        expected[place] = (weights * shifted.imag).sum() / 1e-30
    for _ in range(2):
        tape.zero()
        tape.backward(grads=dict(zip(arrays, seeds)))
        found = np.array([one.grad.numpy() for one in arrays])
        assert np.allclose(found, expected, rtol=1e-11, atol=1e-12)


@wp.kernel
def weigh(a: wp.array(dtype=Real), w: wp.array(dtype=Real), loss: wp.array(dtype=Real)):
    i = wp.tid()
    wp.atomic_add(loss, 0, a[i] * w[i])


@pytest.mark.parametrize("seed", seeds(12))
def test_tangents_of_programs(seed, device):
    rng = np.random.default_rng(seed)
    start, direction = rng.uniform(0.2, 1.2, (ARRAYS, N)), rng.normal(size=(ARRAYS, N))
    weights = rng.normal(size=(ARRAYS, N))
    program = Program(seed)

    def made(numbers):
        return [wp.array(row, dtype=Real, requires_grad=True, device=device) for row in numbers]

    def results(*arrays):
        copies = [wp.clone(one) for one in arrays]
        program.on_tape(copies, device)
        return copies

    def loss(*arrays):
        total = wp.zeros(1, dtype=Real, requires_grad=True, device=device)
        for one, w in zip(results(*arrays), made(weights)):
            wp.launch(weigh, N, [one, w, total], device=device)
        return total

    found = wp.autograd.jvp(results, made(start), made(direction))
    end = start + 1e-30j * direction
    program.in_numpy(end)
    tangents = np.array([one.numpy() for one in found])
    assert np.allclose(tangents, end.imag / 1e-30, rtol=1e-12, atol=1e-13)

    def gradient(numbers):
        arrays = made(numbers)
        with wp.Tape(preserve="auto") as tape:
            total = loss(*arrays)
        tape.backward(total)
        return np.array([one.grad.numpy() for one in arrays])

    found = wp.autograd.hvp(loss, made(start), made(direction))
    second = np.array([one.numpy() for one in found])
    h = 1e-5
    expected = (gradient(start + h * direction) - gradient(start - h * direction)) / (2 * h)
    assert np.allclose(second, expected, rtol=1e-6, atol=1e-6)
