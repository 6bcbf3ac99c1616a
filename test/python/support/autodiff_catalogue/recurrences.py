"""T54 to T59, T67 to T74: loops whose reversal needs values of earlier iterations."""

import math

import numpy as np

import warp as wp

from .problem import kernel
from .registry import case

# Around the sizes at which rings and stacks of checkpoints change.
EDGES = (0, 1, 2, 7, 8, 9, 15, 16, 17, 31, 32, 33, 63, 64, 65, 127, 128, 129, 1000)


def sine_kernel(p):
    """y[i] = sin applied n times to x[i]."""
    R = p.real

    @kernel
    def sines(x: wp.array(dtype=R), n: int, y: wp.array(dtype=R)):
        i = wp.tid()
        s = x[i]
        for _ in range(n):
            s = wp.sin(s)
        y[i] = s

    return sines


def sine_gradient(x, n):
    """Π cos x_k in float64."""
    product = 1.0
    for _ in range(n):
        product *= math.cos(x)
        x = math.sin(x)
    return product


@case("T54", "a function applied over and over")
def iterated(p):
    x = p.random(4)
    (got,) = p.pullback(sine_kernel(p), 4, [p.array(x), 12], [p.zeros(4)])
    p.close(got, [sine_gradient(v, 12) for v in x], 32)


@case("T55", "trip counts at the edges of rings and stacks, and a million")
def trip_counts(p):
    sines, x = sine_kernel(p), 1.0
    for n in EDGES:
        p.condition = max(1, n)
        (got,) = p.pullback(sines, 1, [p.array([x]), n], [p.zeros(1)])
        p.close(got, sine_gradient(x, n), 16 + 4 * n)
    n = p.condition = 10**6
    (got,) = p.pullback(sines, 1, [p.array([x]), n], [p.zeros(1)])
    p.close(got, sine_gradient(x, n), 2 * n)


@case("T57", "a loop that is left early has gradients up to there")
def left_early(p):
    R = p.real

    @kernel
    def prefix(x: wp.array2d(dtype=R), n: int, y: wp.array(dtype=R)):
        i = wp.tid()
        s = R(0.0)
        for k in range(n):
            s += x[i, k] * x[i, k]
            if s > R(1.0):
                break
        y[i] = s

    x = p.random(4, 9, low=0.2, high=0.8)
    (got,) = p.pullback(prefix, 4, [p.array(x), 9], [p.zeros(4)])
    before = np.cumsum(x * x, axis=1) - x * x
    p.close(got, np.where(before <= 1.0, 2.0 * x, 0.0))


@case("T58", "a while loop that halves")
def halving(p):
    R = p.real

    @kernel
    def halve(x: wp.array(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        s = x[i]
        while s > R(0.001):
            s *= R(0.5)
        y[i] = s

    x = np.array([1.0, 0.0005, 3.0, 100.0])
    (got,) = p.pullback(halve, 4, [p.array(x)], [p.zeros(4)])
    p.same(got, 0.5 ** np.maximum(0, np.ceil(np.log2(x / 0.001))))


@case("T59", "Newton's method, and the fixed point it looks for")
def newton(p):
    R = p.real
    tolerance = 4.0 * p.eps

    @kernel
    def iterate(a: wp.array(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        s = a[i]
        while wp.abs(s * s - a[i]) > R(tolerance) * a[i]:
            s = R(0.5) * (s + a[i] / s)
        y[i] = s

    a = np.array([2.0, 3.0, 0.5, 1.75])
    expected = 0.5 / np.sqrt(a)
    (got,) = p.pullback(iterate, 4, [p.array(a)], [p.zeros(4)])
    p.close(got, expected, 64)

    @wp.func
    def step(s: R, a: R):
        return R(0.5) * (s + a / s)

    @kernel
    def solve(a: wp.array(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = wp.fixed_point(step, R(1.0), a[i])

    (got,) = p.pullback(solve, 4, [p.array(a)], [p.zeros(4)])
    p.close(got, expected, 64)


@case("T67", "three loops in one another")
def triple(p):
    data = [p.random(7), p.random(5), p.random(3)]

    def build(q):
        R = q.real

        @kernel
        def nested(
            a: wp.array(dtype=R), b: wp.array(dtype=R), c: wp.array(dtype=R), y: wp.array(dtype=R)
        ):
            s = R(0.1)
            for i in range(a.shape[0]):
                for j in range(b.shape[0]):
                    for k in range(c.shape[0]):
                        s = wp.sin(s + a[i] * b[j] * c[k])
            y[0] = s

        return nested, 1, [q.array(v) for v in data], [q.zeros(1)]

    p.finite_differences(build)


@case("T68", "a loop in a branch in a loop")
def branch_between(p):
    data = p.random(6)

    def build(q):
        R = q.real

        @kernel
        def mixed(x: wp.array(dtype=R), n: int, y: wp.array(dtype=R)):
            i = wp.tid()
            s = x[i]
            for j in range(n):
                if s < x[j]:
                    for k in range(j):
                        s = s + R(0.3) * wp.sin(s * x[k])
                else:
                    s = s * R(0.5) + x[j] * s
            y[i] = s

        return mixed, 6, [q.array(data), 6], [q.zeros(6)]

    p.finite_differences(build)


@case("T69", "a carried random state gives the same samples backwards")
def random_state(p):
    R = p.real

    @kernel
    def sample(x: wp.array(dtype=R), n: int, y: wp.array(dtype=R)):
        i = wp.tid()
        state = wp.uint32(i + 7)
        s = R(0.0)
        for _ in range(n):
            state = state * wp.uint32(1664525) + wp.uint32(1013904223)
            u = R(wp.int32(state >> wp.uint32(24)))
            s += u * u * x[i]
        y[i] = s

    expected = np.zeros(4)
    for i in range(4):
        state = i + 7
        for _ in range(50):
            state = (state * 1664525 + 1013904223) % 2**32
            expected[i] += float(state >> 24) ** 2
    (got,) = p.pullback(sample, 4, [p.array(p.random(4)), 50], [p.zeros(4)])
    p.same(got, expected)


@case("T71", "a chaotic recurrence", precisions=("float64",))
def logistic(p):
    R = p.real

    @kernel
    def map_(x: wp.array(dtype=R), n: int, y: wp.array(dtype=R)):
        i = wp.tid()
        s = x[i]
        for _ in range(n):
            s = R(4.0) * s * (R(1.0) - s)
        y[i] = s

    for n, expected in ((10, -1211.521359), (20, 1342792.089)):
        p.condition = abs(expected)
        (got,) = p.pullback(map_, 1, [p.array([0.1]), n], [p.zeros(1)])
        p.near(got, expected, 1e-9)


@case("T74", "a loop that stores each value it carries")
def stored_carry(p):
    data = p.random(3)

    def build(q):
        R = q.real

        @kernel
        def series(x: wp.array(dtype=R), n: int, y: wp.array2d(dtype=R)):
            i = wp.tid()
            c = x[i]
            for k in range(n):
                y[i, k] = c
                c = wp.sin(c) * x[i] + R(0.25)

        return series, 3, [q.array(data), 10], [q.zeros((3, 10))]

    p.finite_differences(build)
