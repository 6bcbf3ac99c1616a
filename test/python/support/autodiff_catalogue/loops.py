"""T46 to T53, T60 to T65, T70, T73: sums, products and other counted loops.

Most kernels have four threads, each with a row of its own, and a bound known at run time only.
"""

import numpy as np

import warp as wp

from .problem import kernel, setting
from .registry import case

THREADS = 4


def products_of_others(x):
    """Per entry, the product of the other entries of its row."""
    n = x.shape[-1]
    return np.stack([np.prod(np.delete(x, k, axis=-1), axis=-1) for k in range(n)], axis=-1)


def product_kernel(p):
    """y[i] = Π x[i, k]."""
    R = p.real

    @kernel
    def product(x: wp.array2d(dtype=R), n: int, y: wp.array(dtype=R)):
        i = wp.tid()
        s = R(1.0)
        for k in range(n):
            s *= x[i, k]
        y[i] = s

    return product


@case("T46", "a sum needs no replay and no tape")
def summed(p):
    R = p.real

    @kernel
    def total(x: wp.array2d(dtype=R), n: int, y: wp.array(dtype=R)):
        i = wp.tid()
        s = R(0.0)
        for k in range(n):
            s += x[i, k]
        y[i] = s

    x, w = p.random(THREADS, 21), p.random(THREADS)
    (got,) = p.pullback(total, THREADS, [p.array(x), 21], [p.zeros(THREADS)], [w])
    p.same(got, np.broadcast_to(w[:, None], x.shape))
    p.metrics(total, tape_bytes=0, replay_loops=0)


@case("T47", "the gradient of a product is the product of the others")
def product(p):
    x, w = p.random(THREADS, 7), p.random(THREADS)
    (got,) = p.pullback(product_kernel(p), THREADS, [p.array(x), 7], [p.zeros(THREADS)], [w])
    p.close(got, w[:, None] * products_of_others(x))


@case("T48", "a product with one zero is differentiated without a division")
def product_with_zero(p):
    x = p.random(THREADS, 7)
    x[np.arange(THREADS), np.arange(THREADS)] = 0.0
    (got,) = p.pullback(product_kernel(p), THREADS, [p.array(x), 7], [p.zeros(THREADS)])
    p.close(got, products_of_others(x))


@case("T49", "a weighted mean divides after its loop")
def weighted_mean(p):
    R = p.real

    @kernel
    def mean(x: wp.array2d(dtype=R), w: wp.array2d(dtype=R), n: int, y: wp.array(dtype=R)):
        i = wp.tid()
        above = R(0.0)
        below = R(0.0)
        for k in range(n):
            above += w[i, k] * x[i, k]
            below += w[i, k]
        y[i] = above / below

    x, w = p.random(THREADS, 9), p.random(THREADS, 9)
    dx, dw = p.pullback(mean, THREADS, [p.array(x), p.array(w), 9], [p.zeros(THREADS)])
    below = w.sum(axis=1, keepdims=True)
    p.close(dx, w / below)
    p.close(dw, (x - (w * x).sum(axis=1, keepdims=True) / below) / below)


@case("T51", "a carried value is the final one after the loop")
def used_after(p):
    R = p.real

    @kernel
    def scaled(x: wp.array2d(dtype=R), b: wp.array(dtype=R), n: int, y: wp.array(dtype=R)):
        i = wp.tid()
        s = R(5.0)
        for k in range(n):
            s += x[i, k]
        y[i] = s * b[i]

    x, b = p.random(THREADS, 6), p.random(THREADS)
    dx, db = p.pullback(scaled, THREADS, [p.array(x), p.array(b), 6], [p.zeros(THREADS)])
    p.close(dx, np.broadcast_to(b[:, None], x.shape))
    p.close(db, 5.0 + x.sum(axis=1))


@case("T53", "ragged nested loops that carry a quaternion")
def quaternion_chain(p):
    angles = p.random(9, low=-1.0, high=1.0)

    def build(q):
        R, V = q.real, q.vec3

        @kernel
        def chain(
            x: wp.array(dtype=R), begin: wp.array(dtype=int), rows: int, y: wp.array(dtype=V)
        ):
            turn = wp.quaternion(R(0.0), R(0.0), R(0.0), R(1.0))
            for j in range(rows):
                axis = wp.normalize(V(R(1.0), R(j), R(-0.5)))
                for k in range(begin[j], begin[j + 1]):
                    turn = turn * wp.quat_from_axis_angle(axis, x[k])
            y[0] = wp.quat_rotate(turn, V(R(1.0), R(2.0), R(3.0)))

        begin = q.ints([0, 2, 2, 6, 9])
        return chain, 1, [q.array(angles), begin, 4], [q.zeros(1, q.vec3)]

    p.finite_differences(build)


@case("T60", "an index carried through the loop counts visits")
def linked_list(p):
    R = p.real

    @kernel
    def walk(a: wp.array(dtype=R), following: wp.array(dtype=int), n: int, y: wp.array(dtype=R)):
        k = wp.tid()
        s = R(0.0)
        for _ in range(n):
            k = following[k]
            s += a[k]
        y[wp.tid()] = s

    following = np.array([3, 0, 1, 2, 5, 4])
    count, k = np.zeros(6), np.arange(6)
    for _ in range(7):
        k = following[k]
        np.add.at(count, k, 1.0)
    inputs = [p.array(p.random(6)), p.ints(following), 7]
    p.same(p.pullback(walk, 6, inputs, [p.zeros(6)])[0], count)


@case("T61", "two carried values that change places")
def fibonacci(p):
    R = p.real

    @kernel
    def sequence(x: wp.array(dtype=R), z: wp.array(dtype=R), n: int, y: wp.array(dtype=R)):
        i = wp.tid()
        a = x[i]
        b = z[i]
        for _ in range(n):
            t = a + b
            a = b
            b = t
        y[i] = a

    inputs = [p.array(p.random(3)), p.array(p.random(3)), 20]
    dx, dz = p.pullback(sequence, 3, inputs, [p.zeros(3)])
    p.same(dx, [4181.0] * 3)
    p.same(dz, [6765.0] * 3)


@case("T63", "each thread has a bound of its own")
def ragged(p):
    data = p.random(5)

    def build(q):
        R = q.real

        @kernel
        def iterate(x: wp.array(dtype=R), n: wp.array(dtype=int), y: wp.array(dtype=R)):
            i = wp.tid()
            s = x[i]
            for _ in range(n[i]):
                s = wp.sin(s) * x[i] + R(0.5)
            y[i] = s

        return iterate, 5, [q.array(data), q.ints([0, 1, 4, 9, 40])], [q.zeros(5)]

    p.finite_differences(build)


@case("T64", "steps of -2, and of 3 that do not divide the range")
def stepped(p):
    R = p.real

    @kernel
    def strides(x: wp.array(dtype=R), n: int, y: wp.array(dtype=R)):
        i = wp.tid()
        s = R(0.0)
        for k in range(n, 0, -2):
            s += x[k] * x[k]
        for k in range(0, n, 3):
            s *= x[k]
        y[i] = s

    x, n = p.random(12), 11
    (got,) = p.pullback(strides, 1, [p.array(x), n], [p.zeros(1)])
    down, up = np.arange(n, 0, -2), np.arange(0, n, 3)
    expected = np.zeros(12)
    expected[down] += 2.0 * x[down] * np.prod(x[up])
    expected[up] += (x[down] ** 2).sum() * products_of_others(x[up])
    p.close(got, expected)


@case("T65", "the iteration number as a factor")
def numbered(p):
    R = p.real

    @kernel
    def weigh(x: wp.array(dtype=R), n: int, y: wp.array(dtype=R)):
        i = wp.tid()
        s = R(0.0)
        for k in range(n):
            s += R(k) * x[i]
        y[i] = s

    (got,) = p.pullback(weigh, THREADS, [p.array(p.random(THREADS)), 30], [p.zeros(THREADS)])
    p.same(got, [435.0] * THREADS)


@case("T70", "constant bounds at and above the unrolling limit, and without unrolling")
def unrolled(p):
    R = p.real

    @kernel
    def seventeen(x: wp.array2d(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        s = R(1.0)
        for k in range(17):
            s *= x[i, k]
        y[i] = s

    @kernel
    def sixteen(x: wp.array2d(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        s = R(1.0)
        for k in range(16):
            s *= x[i, k]
        y[i] = s

    def check(which, n):
        x = p.random(THREADS, n)
        (got,) = p.pullback(which, THREADS, [p.array(x)], [p.zeros(THREADS)])
        p.close(got, products_of_others(x), 32)

    check(seventeen, 17)
    check(sixteen, 16)
    with setting(max_unroll=0):

        @kernel
        def rolled(x: wp.array2d(dtype=R), y: wp.array(dtype=R)):
            i = wp.tid()
            s = R(1.0)
            for k in range(16):
                s *= x[i, k]
            y[i] = s

        check(rolled, 16)


@case("T73", "a running maximum hands its gradient to the winner")
def running_maximum(p):
    R = p.real

    @kernel
    def largest(x: wp.array2d(dtype=R), n: int, y: wp.array(dtype=R), z: wp.array(dtype=R)):
        i = wp.tid()
        best = x[i, 0]
        where = int(0)
        for k in range(1, n):
            if x[i, k] > best:
                best = x[i, k]
                where = k
        y[i] = best
        z[i] = R(2.0) * x[i, where]

    x, w = p.random(THREADS, 8), p.random(2, THREADS)
    outputs = [p.zeros(THREADS), p.zeros(THREADS)]
    (got,) = p.pullback(largest, THREADS, [p.array(x), 8], outputs, list(w))
    expected = np.zeros_like(x)
    expected[np.arange(THREADS), x.argmax(axis=1)] = w[0] + 2.0 * w[1]
    p.close(got, expected)
