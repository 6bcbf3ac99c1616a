"""Gradients of indexed arrays: they are those of the elements that were chosen."""

import numpy as np
import pytest

import warp as wp
from warp.extend import errors


@wp.struct
class Holder:
    a: wp.indexedarray(dtype=float)


@wp.struct
class Outer:
    inner: Holder


@wp.struct
class Body:
    mass: float
    velocity: wp.vec3


@wp.func
def squared(a: wp.indexedarray2d(dtype=float), i: int, j: int):
    return a[i, j] * a[i, j]


@wp.kernel
def square(x: wp.indexedarray(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i]


@wp.kernel
def spread(x: wp.array(dtype=float), y: wp.indexedarray(dtype=float)):
    i = wp.tid()
    y[i] = 3.0 * x[i]


def ints(values, device):
    return wp.array(values, dtype=int, device=device)


def floats(values, device):
    return wp.array(values, dtype=float, device=device, requires_grad=True)


def test_gradients_of_elements_chosen_several_times_add_up(device):
    values, w = np.linspace(-1.0, 2.0, 9), np.array([1.0, -2.0, 0.5, 3.0, 0.25])
    where = [7, 2, 2, 0, -7]
    x, y = floats(values, device), wp.zeros(5, dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(square, 5, [x[ints(where, device)]], [y], device=device)
    tape.backward(grads={y: wp.array(w, dtype=float, device=device)})
    expected = np.zeros(9)
    np.add.at(expected, where, 2.0 * values[where] * w)
    np.testing.assert_allclose(x.grad.numpy(), expected, rtol=1e-6)


def test_gradients_of_two_dimensions_rows_and_functions(device):
    @wp.kernel
    def combine(
        a: wp.indexedarray2d(dtype=float),
        b: wp.indexedarray2d(dtype=float),
        y: wp.array2d(dtype=float),
    ):
        i, j = wp.tid()
        row = b[i]
        y[i, j] = squared(a, i, j) * row[j]

    rng = np.random.default_rng(2)
    va, vb, w = rng.normal(size=(4, 5)), rng.normal(size=(6, 3)), rng.normal(size=(3, 3))
    rows, columns, others = [3, 0, 3], [1, 4, 1], [5, 5, 2]
    a, b = floats(va, device), floats(vb, device)
    y = wp.zeros((3, 3), dtype=float, device=device, requires_grad=True)
    inputs = [a[ints(rows, device), ints(columns, device)], b[ints(others, device)]]
    with wp.Tape() as tape:
        wp.launch(combine, (3, 3), inputs, [y], device=device)
    tape.backward(grads={y: wp.array(w, dtype=float, device=device)})
    chosen, factors = np.ix_(rows, columns), vb[others]
    ga, gb = np.zeros((4, 5)), np.zeros((6, 3))
    np.add.at(ga, chosen, 2.0 * va[chosen] * factors * w)
    np.add.at(gb, others, va[chosen] ** 2 * w)
    np.testing.assert_allclose(a.grad.numpy(), ga, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(b.grad.numpy(), gb, rtol=1e-5, atol=1e-6)


def test_gradients_of_stores_and_sums(device):
    @wp.kernel
    def add(x: wp.array(dtype=float), y: wp.indexedarray(dtype=float)):
        i = wp.tid()
        y[i] += x[i] * x[i]

    x, y = floats([1.0, 2.0, 3.0], device), floats(np.zeros(5), device)
    with wp.Tape() as tape:
        wp.launch(spread, 3, [x], [y[ints([4, 0, 2], device)]], device=device)
        wp.launch(add, 3, [x], [y[ints([1, 1, 0], device)]], device=device)
    np.testing.assert_array_equal(y.numpy(), [6 + 9, 1 + 4, 9, 0, 3])
    w = np.array([1.0, 10.0, 100.0, 1000.0, 10000.0])
    tape.backward(grads={y: wp.array(w, dtype=float, device=device)})
    # 3 w of where it is stored, and 2 x w of where it is added.
    expected = [3e4 + 2 * 10, 3 * 1 + 4 * 10, 3 * 100 + 6 * 1]
    np.testing.assert_allclose(x.grad.numpy(), expected, rtol=1e-6)


def test_gradients_of_updates_in_place(device):
    @wp.kernel
    def update(a: wp.indexedarray2d(dtype=float)):
        i, j = wp.tid()
        a[i, j] = a[i, j] * a[i, j]

    values, rows = np.arange(1.0, 13.0).reshape(4, 3), [3, 1]
    x = floats(values, device)
    with wp.Tape() as tape:
        wp.launch(update, (2, 3), [x[ints(rows, device)]], device=device)
    tape.backward(grads={x: wp.ones_like(x, requires_grad=False)})
    expected = np.ones((4, 3))
    expected[rows] = 2.0 * values[rows]
    np.testing.assert_array_equal(x.grad.numpy(), expected)


def test_gradients_through_structs_copies_and_fills(device):
    @wp.kernel
    def held(o: Outer, y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = o.inner.a[i] * o.inner.a[i]

    x = floats([1.0, 2.0, 3.0, 4.0], device)
    some = x[ints([3, 1, 1], device)]
    y = floats(np.zeros(3), device)
    z = floats(np.zeros(4), device)
    with wp.Tape() as tape:
        wp.launch(held, 3, [Outer(inner=Holder(a=some))], [y], device=device)
        cloned = wp.clone(some)
        z.assign(x)
        z[ints([0, 2, 3], device)] = cloned
        z[ints([2], device)] = 0.0
    np.testing.assert_array_equal(z.numpy(), [4, 2, 0, 2])
    seeds = {
        y: wp.array([1.0, 10.0, 100.0], dtype=float, device=device),
        z: wp.array([1000.0, 1e4, 1e5, 1e6], dtype=float, device=device),
    }
    tape.backward(grads=seeds)
    assert cloned.requires_grad
    # z is (x3, x1, 0, x1).
    np.testing.assert_allclose(x.grad.numpy(), [0, 440 + 1e4 + 1e6, 0, 8 + 1000], rtol=1e-6)


def test_gradients_of_elementwise_functions(device):
    x = floats([1.0, 2.0, 4.0], device)
    with wp.Tape() as tape:
        y = x[ints([2, 2, 0], device)] * 3.0
    seed = wp.array([1.0, 10.0, 100.0], dtype=float, device=device)
    tape.backward(grads={y: seed})
    np.testing.assert_array_equal(x.grad.numpy(), [300, 0, 33])


def test_tangents(device):
    def function(x):
        y = wp.zeros(3, dtype=float, device=device, requires_grad=True)
        wp.launch(square, 3, [x[ints([2, 0, 2], device)]], [y], device=device)
        return y

    x = floats([1.0, 2.0, 4.0], device)
    direction = wp.array([1.0, 10.0, 100.0], dtype=float, device=device)
    found = wp.autograd.jvp(function, inputs=[x], tangents=[direction])
    np.testing.assert_allclose(found.numpy(), [800, 2, 800], rtol=1e-6)


def test_adjoints_of_launches(device):
    x, y = floats([1.0, 2.0, 4.0], device), floats(np.zeros(3), device)
    some = x[ints([2, 0, 2], device)]
    other = wp.zeros(3, dtype=float, device=device)
    for given, target in (([], x.grad), ([other], other), ([some.over(other)], other)):
        target.zero_()
        y.grad.assign([1.0, 10.0, 100.0])
        wp.launch(square, 3, [some], [y], adj_inputs=given, adjoint=True, device=device)
        np.testing.assert_array_equal(target.numpy(), [20, 0, 808])


def test_gradients_that_come_later_and_of_16_bits(device):
    x, y = wp.zeros(4, dtype=float, device=device), floats(np.zeros(2), device)
    x.fill_(3.0)
    where = ints([3, 1], device)
    some = wp.indexedarray(x, [where])
    wp.launch(square, 2, [some], [y], device=device)
    assert some.grad is None
    some.requires_grad = True
    assert x.requires_grad
    half = wp.ones(3, dtype=wp.float16, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(square, 2, [some], [y], device=device)
        copied = wp.clone(half[ints([2, 2], device)])
    seed = wp.array([1.0, 10.0], dtype=float, device=device)
    tape.backward(grads={y: seed, copied: seed})
    np.testing.assert_array_equal(x.grad.numpy(), [0, 60, 0, 6])
    np.testing.assert_array_equal(some.grad.numpy(), [6, 60])
    np.testing.assert_array_equal(half.grad.numpy(), [0, 0, 11])


def test_gradients_of_structs_as_elements(device):
    @wp.kernel
    def momentum(b: wp.indexedarray(dtype=Body), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = b[i].mass * b[i].velocity[1]

    bodies = [Body(mass=2.0, velocity=(1, 3, 1)), Body(mass=5.0, velocity=(1, 7, 1))]
    b = wp.array(bodies, dtype=Body, device=device, requires_grad=True)
    y = floats(np.zeros(3), device)
    with wp.Tape() as tape:
        wp.launch(momentum, 3, [b[ints([1, 0, 1], device)]], [y], device=device)
    tape.backward(grads={y: wp.array([1.0, 1.0, 10.0], dtype=float, device=device)})
    got = b.grad.numpy()
    np.testing.assert_array_equal(got["mass"], [3, 77])
    np.testing.assert_array_equal(got["velocity"], [[0, 2, 0], [0, 55, 0]])


def test_seeds_are_of_the_array_behind(device):
    x, y = floats([1.0, 2.0], device), floats(np.zeros(3), device)
    some = y[ints([2, 2], device)]
    with wp.Tape() as tape:
        wp.launch(spread, 2, [x], [some], device=device)
    with pytest.raises(TypeError, match=r"(?s)keys of `grads`, but got indexedarray.*behind"):
        tape.backward(grads={some: wp.ones(2, dtype=float, device=device)})


def test_memory_has_versions(device):
    x, y = floats(np.arange(4.0), device), wp.zeros(2, device=device, requires_grad=True)
    where = ints([3, 1], device)
    seed = {y: wp.array([1.0, 1.0], dtype=float, device=device)}

    def recorded():
        with wp.Tape(preserve="never") as tape:
            wp.launch(square, 2, [x[where]], [y], device=device)
        return tape

    tape = recorded()
    x[ints([1], device)] = 7.0
    with pytest.raises(errors.WarpError, match=r"(?s)x\.data.*launch of 'copy1'"):
        tape.backward(grads=seed)
    tape = recorded()
    wp.launch(spread, 1, [y], [x[ints([3], device)]], device=device)
    with pytest.raises(errors.WarpError, match="launch of 'spread'"):
        tape.backward(grads=seed)
    tape = recorded()
    where.fill_(0)
    with pytest.raises(errors.WarpError, match=r"(?s)x\.indices0.*fill_"):
        tape.backward(grads=seed)
