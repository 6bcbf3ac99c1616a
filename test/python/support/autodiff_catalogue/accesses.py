"""T87 to T92, T99 and T101: views, structs and indices of one element per thread."""

import numpy as np

import warp as wp

from .problem import gradient, kernel
from .registry import case


@case("T87", "rows, transposed and strided views")
def views(p):
    R = p.real

    @kernel
    def combine(
        a: wp.array2d(dtype=R),
        b: wp.array2d(dtype=R),
        c: wp.array(dtype=R),
        y: wp.array2d(dtype=R),
    ):
        i, j = wp.tid()
        y[i, j] = a[i][j] * b[i, j] * c[j]

    a, b, c, w = p.random(3, 4), p.random(4, 3), p.random(8), p.random(3, 4)
    rows, columns, line = p.array(a), p.array(b), p.array(c)
    inputs = [rows, columns.transpose(), line[::2]]
    y = p.zeros((3, 4))
    with wp.Tape() as tape:
        p.launch(combine, (3, 4), inputs, [y])
    tape.backward(grads={y: p.seed(y, w)})
    p.close(gradient(rows), w * b.T * c[::2])
    p.close(gradient(columns), (w * a * c[::2]).T)
    expected = np.zeros(8)
    expected[::2] = (w * a * b.T).sum(axis=0)
    p.close(gradient(line), expected)


@case("T88", "an indexed array scatters its gradient")
def indexed(p):
    R = p.real

    @kernel
    def squares(x: wp.indexedarray(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = x[i] * x[i]

    data, w, where = p.random(8), p.random(4), [6, 1, 1, 3]
    x, y = p.array(data), p.zeros(4)
    some = wp.indexedarray(x, [p.ints(where)])
    with wp.Tape() as tape:
        p.launch(squares, 4, [some], [y])
    tape.backward(grads={y: p.seed(y, w)})
    expected = np.zeros(8)
    np.add.at(expected, where, 2.0 * data[where] * w)
    p.close(gradient(x), expected)


@case("T89", "an array of structs, and a struct of arrays")
def structs(p):
    R, V = p.real, p.vec3

    @wp.struct
    class Body:
        mass: R
        position: V

    @wp.struct
    class Bodies:
        mass: wp.array(dtype=R)
        position: wp.array(dtype=V)

    @kernel
    def gather(bodies: wp.array(dtype=Body), y: wp.array(dtype=R)):
        i = wp.tid()
        b = bodies[i]
        y[i] = b.mass + b.position[1] + bodies[i].position[2]

    @kernel
    def spread(bodies: Bodies, y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = bodies.mass[i] + bodies.position[i][1] + bodies.position[i].z

    items = wp.zeros(3, dtype=Body, device=p.device, requires_grad=True)
    y = p.zeros(3)
    with wp.Tape() as tape:
        p.launch(gather, 3, [items], [y])
    tape.backward(grads={y: p.seed(y)})
    got = items.grad.numpy()
    p.same(got["mass"].ravel(), np.ones(3))
    p.same(np.reshape(got["position"], (3, 3)), [[0.0, 1.0, 1.0]] * 3)

    bodies = Bodies()
    bodies.mass, bodies.position = p.zeros(3), p.zeros(3, V)
    p.pullback(spread, 3, [bodies], [p.zeros(3)])
    p.same(gradient(bodies.mass), np.ones(3))
    p.same(gradient(bodies.position), [[0.0, 1.0, 1.0]] * 3)


@case("T90", "a struct that a function returns")
def returned_struct(p):
    R = p.real

    @wp.struct
    class Pair:
        first: R
        second: R

    @wp.func
    def double(x: R):
        made = Pair()
        made.first = R(2.0) * x
        made.second = x
        return made

    @kernel
    def through(x: wp.array(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        made = double(x[i])
        y[i] = made.first * made.first

    x = p.random(4)
    p.close(p.pullback(through, 4, [p.array(x)], [p.zeros(4)])[0], 8.0 * x)


@case("T91", "reads through an index array add up")
def gathered(p):
    R = p.real

    @kernel
    def gather(x: wp.array(dtype=R), where: wp.array(dtype=int), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = x[where[i]]

    where = [2, 0, 2, 2, 1, 0]
    (got,) = p.pullback(gather, 6, [p.array(p.random(4)), p.ints(where)], [p.zeros(6)])
    p.same(got, [2.0, 1.0, 3.0, 0.0])
    p.metrics(gather, atomics=lambda count: count >= 1)


@case("T92", "an element of its own per thread needs no atomics")
def element_wise(p):
    R = p.real

    @kernel
    def copies(x: wp.array(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = x[i]

    w = p.random(6)
    p.same(p.pullback(copies, 6, [p.array(p.random(6))], [p.zeros(6)], [w])[0], w)
    p.metrics(copies, atomics=0, block_reductions=0)


@case("T99", "threads that return at once leave nothing")
def padded(p):
    R = p.real

    @kernel
    def guarded(x: wp.array(dtype=R), n: int, y: wp.array(dtype=R)):
        i = wp.tid()
        if i >= n:
            return
        y[i] = x[i] * x[i]

    x, w = p.random(64), p.random(64)
    (got,) = p.pullback(guarded, 64, [p.array(x), 50], [p.zeros(64)], [w])
    p.same(got[50:], np.zeros(14))
    p.close(got[:50], 2.0 * x[:50] * w[:50])


@case("T101", "an input without a gradient costs nothing")
def inactive(p):
    R = p.real

    @kernel
    def products(x: wp.array(dtype=R), z: wp.array(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = x[i] * z[i]

    x, z = p.random(6), p.random(6)
    still = p.array(z, grad=False)
    (got,) = p.pullback(products, 6, [p.array(x), still], [p.zeros(6)])
    p.close(got, z)
    p.holds(still.grad is None, "the input without a gradient has got one")
    p.metrics(products, shadowed=2)
