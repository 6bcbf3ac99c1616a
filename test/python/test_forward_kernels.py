"""Tangents of what kernels do: loops, branches, functions, atomics, memory of their own."""

import numpy as np
import pytest

import warp as wp


def push(kernel, inputs, tangents, output, device, dim=None):
    """The output of a launch and its tangent."""
    made = [wp.array(x, dtype=wp.float64, device=device) for x in inputs]
    along = [None if t is None else wp.array(t, dtype=wp.float64, device=device) for t in tangents]
    results = []

    def function(*arrays):
        result = wp.array(output, dtype=wp.float64, device=device)
        results.append(result)
        wp.launch(kernel, dim or arrays[0].size, [*arrays, result], device=device)
        return result

    tangent = wp.autograd.jvp(function, made, along)
    return results[0].numpy(), tangent.numpy()


@wp.kernel
def polynomial(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
    i = wp.tid()
    total = wp.float64(0.0)
    power = wp.float64(1.0)
    for k in range(i + 3):
        total += wp.float64(float(k + 1)) * power
        power *= x[i]
    y[i] = total


def test_loop_with_two_carried_values(device):
    x = np.array([0.5, -1.0, 2.0])
    value, tangent = push(polynomial, [x], [np.ones(3)], np.zeros(3), device)
    for i, at in enumerate(x):
        p = np.polynomial.Polynomial(np.arange(1.0, i + 4))
        assert value[i] == pytest.approx(p(at), rel=1e-14)
        assert tangent[i] == pytest.approx(p.deriv()(at), rel=1e-14)


@wp.func
def newton_step(x: wp.float64, a: wp.float64):
    return wp.float64(0.5) * (x + a / x)


@wp.kernel
def newton(a: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
    i = wp.tid()
    x = a[i]
    steps = wp.int32(0)
    while wp.abs(x * x - a[i]) > wp.float64(1e-14) * a[i]:
        x = newton_step(x, a[i])
        steps += 1
        if steps > 50:
            break
    y[i] = newton_step(x, a[i])


def test_while_with_break(device):
    a = np.array([2.0, 9.0, 0.01])
    value, tangent = push(newton, [a], [np.ones(3)], np.zeros(3), device)
    np.testing.assert_allclose(value, np.sqrt(a), rtol=1e-13)
    np.testing.assert_allclose(tangent, 0.5 / np.sqrt(a), rtol=1e-10)


@wp.kernel
def branches(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
    i = wp.tid()
    v = x[i]
    if v < wp.float64(0.0):
        y[i] = wp.exp(v)
    elif v < wp.float64(1.0):
        y[i] = wp.floor(v)
    else:
        v = v * v
        y[i] = v * v


def test_branches(device):
    x = np.array([-1.0, 0.5, 2.0])
    _, tangent = push(branches, [x], [np.full(3, 2.0)], np.zeros(3), device)
    np.testing.assert_allclose(tangent, [2 * np.exp(-1.0), 0.0, 64.0], rtol=1e-14)


@wp.kernel
def sums(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
    i = wp.tid()
    wp.atomic_add(y, 0, x[i] * x[i])
    wp.atomic_sub(y, 1, wp.sin(x[i]))


def test_atomic_sums(device):
    random = np.random.default_rng(3)
    x, v = random.uniform(-1, 1, (2, 1000))
    value, tangent = push(sums, [x], [v], np.zeros(2), device)
    np.testing.assert_allclose(value, [x @ x, -np.sin(x).sum()], rtol=1e-12)
    np.testing.assert_allclose(tangent, [2 * x @ v, -np.cos(x) @ v], rtol=1e-10, atol=1e-12)


@wp.kernel
def extremes(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
    for k in range(x.shape[0]):
        wp.atomic_max(y, 0, x[k])
        wp.atomic_min(y, 1, wp.float64(2.0) * x[k])


def test_atomic_extremes_of_one_thread(device):
    x, v = np.array([0.5, 3.0, -2.0, 1.0]), np.array([1.0, 10.0, 100.0, 1000.0])
    value, tangent = push(extremes, [x], [v], np.zeros(2), device, dim=1)
    np.testing.assert_array_equal(value, [3.0, -4.0])
    np.testing.assert_array_equal(tangent, [10.0, 200.0])
    with pytest.raises(wp.WarpError, match="one thread only"):
        push(extremes, [x], [v], np.zeros(2), device, dim=2)


def test_inactive_operand_has_no_twin(device):
    @wp.kernel
    def scale(a: wp.array(dtype=wp.float64), x: wp.array(dtype=wp.float64),
              y: wp.array(dtype=wp.float64)):  # fmt: skip
        i = wp.tid()
        y[i] = a[i] * x[i]

    a, x = np.array([2.0, 3.0]), np.array([5.0, 7.0])
    _, tangent = push(scale, [a, x], [None, np.array([1.0, 10.0])], np.zeros(2), device)
    np.testing.assert_array_equal(tangent, [2.0, 30.0])
