"""T75 to T82: arrays that one kernel reads and writes."""

import numpy as np

import warp as wp

from .loops import products_of_others
from .problem import gradient, kernel
from .registry import ERROR, case


def in_place(p, kernel, dim, arguments, seeds):
    """Backward of a launch that updates arrays: their gradients are seeds before it.

    Args:
        seeds: pairs of an array and its cotangent.
    """
    with wp.Tape() as tape:
        p.launch(kernel, dim, arguments)
    tape.backward(grads={item: p.seed(item, weights) for item, weights in seeds})


@case("T75", "an in-place difference")
def difference(p):
    R = p.real

    @kernel
    def subtract(a: wp.array(dtype=R), b: wp.array(dtype=R)):
        i = wp.tid()
        a[i] -= b[i]

    w = p.random(5)
    a, b = p.array(p.random(5)), p.array(p.random(5))
    in_place(p, subtract, 5, [a, b], [(a, w)])
    p.same(gradient(a), w)
    p.same(gradient(b), -w)


@case("T76", "an in-place product reads the value that it overwrites")
def multiplied(p):
    R = p.real

    @kernel
    def multiply(a: wp.array(dtype=R), b: wp.array(dtype=R)):
        i = wp.tid()
        a[i] *= b[i]

    start, factor, w = p.random(5), p.random(5), p.random(5)
    a, b = p.array(start), p.array(factor)
    in_place(p, multiply, 5, [a, b], [(a, w)])
    p.close(gradient(a), w * factor)
    p.close(gradient(b), w * start)


@case("T78", "only the last of two stores counts")
def stored_twice(p):
    R = p.real

    @kernel
    def store(x: wp.array(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = x[i]
        y[i] = R(2.0) * x[i]

    w = p.random(5)
    p.same(p.pullback(store, 5, [p.array(p.random(5))], [p.zeros(5)], [w])[0], 2.0 * w)


@case("T79", "a value that is stored and read again in one kernel")
def read_back(p):
    R = p.real

    @kernel
    def through(x: wp.array(dtype=R), y: wp.array(dtype=R), z: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = x[i]
        z[i] = y[i] * y[i]

    x, w = p.random(5), p.random(5)
    outputs = [p.zeros(5), p.zeros(5)]
    (got,) = p.pullback(through, 5, [p.array(x)], outputs, [0.0, w])
    p.close(got, 2.0 * x * w)


@case("T80", "an element replaced by its square")
def squared_in_place(p):
    R = p.real

    @kernel
    def replace(y: wp.array(dtype=R)):
        i = wp.tid()
        t = y[i]
        y[i] = t * t

    start, w = p.random(5), p.random(5)
    y = p.array(start)
    in_place(p, replace, 5, [y], [(y, w)])
    p.close(gradient(y), 2.0 * start * w)


@case("T81", "one thread that multiplies along an array")
def running_product(p):
    R = p.real

    @kernel
    def run(x: wp.array(dtype=R), n: int, q: wp.array(dtype=R)):
        for k in range(n):
            q[k + 1] = x[k] * q[k]

    x, weights = p.random(7), np.zeros(8)
    start = np.concatenate([[1.0], np.zeros(7)])
    weights[7] = 1.0
    given, chain = p.array(x), p.array(start)
    in_place(p, run, 1, [given, 7, chain], [(chain, weights)])
    p.close(gradient(given), products_of_others(x))


@case("T82", "threads that read what their neighbours write are refused", verdict=ERROR)
def neighbours(p):
    R = p.real

    @kernel
    def shift(x: wp.array(dtype=R), dt: R):
        i = wp.tid()
        ahead = x[i + 1]
        x[i] = x[i] + dt * ahead

    def run():
        x = p.array(p.random(6))
        in_place(p, shift, 5, [x, 0.5], [(x, 1.0)])

    p.refuses(run, "x", lines=2)
