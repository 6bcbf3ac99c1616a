"""`retain_grad` where several arrays of a tape share elements."""

import numpy as np
import pytest

import warp as wp

N = 5
X = np.array([0.3, -1.2, 0.8, 1.7, -0.4])
W = np.array([1.5, -0.7, 2.0, 0.4, -1.1])


@wp.kernel
def square(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
    i = wp.tid()
    y[i] = wp.float64(3.0) * x[i] * x[i]


@wp.kernel
def take_sine(y: wp.array(dtype=wp.float64)):
    i = wp.tid()
    y[i] = wp.sin(y[i])


@wp.kernel
def add_up(
    y: wp.array(dtype=wp.float64),
    w: wp.array(dtype=wp.float64),
    loss: wp.array(dtype=wp.float64),
):
    i = wp.tid()
    wp.atomic_add(loss, 0, w[i] * y[i] * y[i])


@wp.kernel
def double_vectors(v: wp.array(dtype=wp.vec3d)):
    i = wp.tid()
    v[i] = v[i] * wp.float64(2.0)


class Case:
    """x -> y = 3 x^2, parts of which become sin(y) -> loss = sum of w y^2."""

    def __init__(self, device, size=N):
        self.x = wp.array(X, requires_grad=True, device=device)
        self.y = wp.zeros(size, dtype=wp.float64, requires_grad=True, device=device)
        self.weights = np.tile(W, size // N)
        self.w = wp.array(self.weights, device=device)
        self.loss = wp.zeros(1, dtype=wp.float64, requires_grad=True, device=device)
        self.device = device

    def launch(self, kernel, *arrays):
        wp.launch(kernel, arrays[0].size, list(arrays), device=self.device)

    def add_up(self):
        self.launch(add_up, self.y, self.w, self.loss)


def expected(y):
    """The derivative of the sum by its terms."""
    return 2 * W * y


def test_a_part_is_written_again(device):
    case = Case(device)
    case.y.retain_grad = True
    with wp.Tape() as tape:
        case.launch(square, case.x, case.y)
        case.launch(take_sine, case.y[1:3])
        case.add_up()
    tape.backward(case.loss)
    y = 3 * X * X
    y[1:3] = np.sin(y[1:3])
    np.testing.assert_allclose(case.y.grad.numpy(), expected(y), rtol=1e-12)


def test_reads_between_two_writes_count_for_what_they_read(device):
    case = Case(device)
    case.y.retain_grad = True
    with wp.Tape() as tape:
        case.launch(square, case.x, case.y)
        case.add_up()
        case.launch(take_sine, case.y[1:3])
        case.add_up()
    tape.backward(case.loss)
    y = 3 * X * X
    last = 2 * expected(y)
    last[1:3] = expected(np.sin(y))[1:3]
    np.testing.assert_allclose(case.y.grad.numpy(), last, rtol=1e-12)
    first = 2 * expected(y)
    first[1:3] = (expected(y) + expected(np.sin(y)) * np.cos(y))[1:3]
    np.testing.assert_allclose(case.x.grad.numpy(), first * 6 * X, rtol=1e-12)


def test_another_shape_writes_last(device):
    case = Case(device)
    case.y.retain_grad = True
    again = case.y.reshape(N)
    with wp.Tape() as tape:
        case.launch(square, case.x, case.y)
        case.launch(take_sine, again)
        case.add_up()
    tape.backward(case.loss)
    np.testing.assert_allclose(case.y.grad.numpy(), expected(np.sin(3 * X * X)), rtol=1e-12)


def test_the_array_of_a_view_is_written_last(device):
    case = Case(device, 2 * N)
    part = case.y[::2]
    part.retain_grad = True
    with wp.Tape() as tape:
        case.launch(square, case.x, part)
        case.launch(take_sine, case.y)
        case.add_up()
    tape.backward(case.loss)
    y = np.sin(3 * X * X)
    np.testing.assert_allclose(part.grad.numpy(), 2 * case.weights[::2] * y, rtol=1e-12)


@pytest.mark.parametrize("part", [slice(1, 5), slice(0, 9, 3), slice(1, 10, 2), slice(4, 5)])
def test_some_elements_of_a_view_are_written_last(part, device):
    """Neither array holds all of the other; elements that nothing retains keep no reading."""
    case = Case(device, 2 * N)
    kept, later = case.y[::2], case.y[part]
    kept.retain_grad = True
    with wp.Tape() as tape:
        case.launch(square, case.x, kept)
        case.launch(take_sine, later)
        case.add_up()
    tape.backward(case.loss)
    y = np.zeros(2 * N)
    y[::2] = 3 * X * X
    slope = np.ones(2 * N)
    slope[part] = np.cos(y[part])
    y[part] = np.sin(y[part])
    np.testing.assert_allclose(kept.grad.numpy(), (2 * case.weights * y)[::2], rtol=1e-12)
    by_x = (2 * case.weights * y * slope)[::2] * 6 * X
    np.testing.assert_allclose(case.x.grad.numpy(), by_x, rtol=1e-12)
    assert not case.y.grad.numpy()[1::2].any()


def test_numbers_of_vectors_are_retained_beside_others(device):
    """A strided column of numbers that are components of a strided array of vectors."""
    numbers = np.arange(1.0, 19.0).reshape(6, 3)
    y = wp.array(numbers, dtype=wp.float64, requires_grad=True, device=device)
    kept, later = y[:, 1], y.view(wp.vec3d).flatten()[1:5]
    kept.retain_grad = True
    loss = wp.zeros(1, dtype=wp.float64, requires_grad=True, device=device)
    x = wp.array(numbers[:, 0], dtype=wp.float64, requires_grad=True, device=device)
    weights = wp.array(np.arange(18.0), dtype=wp.float64, device=device)
    with wp.Tape() as tape:
        wp.launch(square, 6, [x, kept], device=device)
        wp.launch(double_vectors, 4, [later], device=device)
        wp.launch(add_up, 18, [y.flatten(), weights, loss], device=device)
    tape.backward(loss)
    values = numbers.copy()
    values[:, 1] = 3 * numbers[:, 0] ** 2
    values[1:5] *= 2
    by_y = 2 * np.arange(18.0).reshape(6, 3) * values
    np.testing.assert_allclose(kept.grad.numpy(), by_y[:, 1], rtol=1e-12)


@pytest.mark.parametrize("times", [1, 2])
def test_the_flag_is_set_after_the_tape(device, times):
    case = Case(device)
    whole = case.y[:]
    with wp.Tape() as tape:
        case.launch(square, case.x, whole)
        case.add_up()
    case.y.retain_grad = True
    for _ in range(times):
        tape.backward(case.loss)
    np.testing.assert_allclose(case.y.grad.numpy(), expected(3 * X * X), rtol=1e-12)
