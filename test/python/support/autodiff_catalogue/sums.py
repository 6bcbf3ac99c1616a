"""T93 to T98, T100: many threads that add to one element; atomics."""

import numpy as np

import warp as wp

from .problem import deterministic, gradient, kernel
from .registry import ERROR, case


def shared_factor(p):
    """y[i] = x[0] z[i]."""
    R = p.real

    @kernel
    def scale(x: wp.array(dtype=R), z: wp.array(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = x[0] * z[i]

    return scale


@case("T93", "an element that all threads read is reduced before it is added to")
def uniform(p):
    z, w = p.random(1000), p.random(1000)
    scale = shared_factor(p)
    inputs = [p.array([2.0]), p.array(z)]
    dx, dz = p.pullback(scale, 1000, inputs, [p.zeros(1000)], [w])
    p.close(dx, [(z * w).sum()], 64)
    p.close(dz, 2.0 * w)
    p.metrics(scale, atomics=lambda count: count <= 1, block_reductions=lambda count: count >= 1)


@case("T94", "an atomic sum hands its cotangent to every term")
def atomic_sum(p):
    R = p.real

    @kernel
    def total(x: wp.array(dtype=R), loss: wp.array(dtype=R)):
        i = wp.tid()
        wp.atomic_add(loss, 0, wp.sin(x[i]))

    x = p.random(100)
    p.close(p.pullback(total, 100, [p.array(x)], [p.zeros(1)], [3.0])[0], 3.0 * np.cos(x))


@case("T95", "the place that a counter gives is remembered")
def counted(p):
    R = p.real

    @kernel
    def append(x: wp.array(dtype=R), count: wp.array(dtype=int), y: wp.array(dtype=R)):
        i = wp.tid()
        j = wp.atomic_add(count, 0, 1)
        y[j] = wp.sqrt(x[i])

    x, w = p.rng.permutation(np.arange(1.0, 101.0)), p.random(100)
    given, y = p.array(x), p.zeros(100)
    with wp.Tape() as tape:
        p.launch(append, 100, [given, p.ints([0]), y])
    tape.backward(grads={y: p.seed(y, w)})
    place = np.empty(100, int)
    place[np.argsort(x)] = np.argsort(y.numpy())
    p.close(gradient(given), w[place] * 0.5 / np.sqrt(x))


@case("T97", "compare-and-swap on a path to the output is refused", verdict=ERROR)
def compare_and_swap(p):
    R = p.real

    @kernel
    def swap(x: wp.array(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        wp.atomic_cas(y, i, R(0.0), x[i])

    def run():
        p.pullback(swap, 4, [p.array(p.random(4))], [p.zeros(4)])

    p.refuses(run, "atomic_cas", "order")


@case("T98", "a million terms are added accurately, and alike in every run", ("float32",))
def million(p):
    n = 10**6
    z, w = p.random(n), p.random(n)
    scale = shared_factor(p)
    inputs, y = [p.array([2.0]), p.array(z, grad=False)], p.zeros(n)
    (got,) = p.pullback(scale, n, inputs, [y], [w])
    p.near(got, [(z * w).sum()], 1e-6)
    with deterministic():
        results = []
        for _ in range(20):
            inputs[0].grad.zero_()
            results += p.pullback(scale, n, inputs, [y], [w])
    for result in results:
        p.same(result, results[0])
    p.near(results[0], [(z * w).sum()], 1e-6)


@case("T100", "backward twice gives the same bits and leaves the seed alone")
def twice(p):
    R = p.real

    @kernel
    def waves(x: wp.array(dtype=R), where: wp.array(dtype=int), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = wp.sin(x[where[i]]) * x[where[i]]

    where = np.arange(64)[::-1]
    x, y = p.array(p.random(64)), p.zeros(64)
    with wp.Tape() as tape:
        p.launch(waves, 64, [x, p.ints(where)], [y])
    seed = p.seed(y, p.random(64))
    before = seed.numpy().copy()
    results = []
    for _ in range(2):
        tape.zero()
        tape.backward(grads={y: seed})
        results.append(gradient(x))
    p.same(results[0], results[1])
    p.same(seed.numpy(), before)
    p.holds(np.abs(results[0]).min() > 0.0, "a gradient is 0")
