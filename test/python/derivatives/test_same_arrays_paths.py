"""Gradients of launches that get one array twice, by all the ways to ask for them."""

import numpy as np
import pytest

import warp as wp
from warp.extend import errors

N = 5
R = wp.float64
X = np.random.default_rng(0).uniform(0.5, 1.5, N)


@wp.struct
class Inner:
    a: wp.array(dtype=R)
    k: R


@wp.struct
class Outer:
    inner: Inner
    b: wp.array(dtype=R)


@wp.func
def store_square(a: wp.array(dtype=R), b: wp.array(dtype=R), i: int, k: R):
    v = a[i]
    b[i] = v * v * k


@wp.kernel
def of_struct(s: Outer, y: wp.array(dtype=R), z: wp.array(dtype=R)):
    i = wp.tid()
    z[i] = s.inner.a[i] * s.b[i]
    store_square(s.inner.a, y, i, s.inner.k)


@wp.kernel
def powers(x: wp.array(dtype=R), square: wp.array(dtype=R), cube: wp.array(dtype=R)):
    i = wp.tid()
    v = x[i]
    cube[i] = v * v * v
    square[i] = v * v


@wp.kernel
def powers_of_half(
    x: wp.array(dtype=wp.float16), y: wp.array(dtype=wp.float16), z: wp.array(dtype=wp.float16)
):
    i = wp.tid()
    v = x[i]
    z[i] = v * v * v
    y[i] = v * v


@wp.kernel
def of_chosen(x: wp.indexedarray(dtype=R), y: wp.indexedarray(dtype=R), z: wp.array(dtype=R)):
    i = wp.tid()
    v = x[i]
    z[i] = v * v * v
    y[i] = v * v


@wp.kernel
def linear(x: wp.array(dtype=R), y: wp.array(dtype=R)):
    i = wp.tid()
    y[i] = R(3.0) * x[i]


@wp.kernel
def damped_square(x: wp.array(dtype=R), y: wp.array(dtype=R)):
    i = wp.tid()
    y[i] = R(0.9) * x[i] * x[i]


@wp.kernel
def total(x: wp.array(dtype=R), y: wp.array(dtype=R)):
    wp.atomic_add(y, 0, x[wp.tid()])


def real(values, device):
    return wp.array(values, dtype=R, requires_grad=True, device=device)


def check(found, expected):
    np.testing.assert_allclose(found.numpy(), expected, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("count", [2, 3])
def test_in_structs_and_functions(device, count):
    x, z, other = real(X, device), real(np.zeros(N), device), real(np.full(N, 2.0), device)
    s = Outer()
    s.inner.a, s.inner.k = x, 3.0
    s.b = x if count == 3 else other
    with wp.Tape() as tape:
        wp.launch(of_struct, N, [s, x, z], device=device)
    tape.backward(grads={z: real(np.ones(N), device), x: real(np.full(N, 2.0), device)})
    check(x.grad, (2.0 * X if count == 3 else 2.0) + 12.0 * X)
    if count == 2:
        check(other.grad, X)


def test_indexed(device):
    """Elements that the indices do not name keep their gradients."""
    x, z = real(X, device), real(np.zeros(3), device)
    some = wp.indexedarray(x, [wp.array([3, 1, 0], dtype=int, device=device)])
    with wp.Tape() as tape:
        wp.launch(of_chosen, 3, [some, some, z], device=device)
    tape.backward(grads={z: real(np.ones(3), device), x: real(np.full(N, 2.0), device)})
    expected = np.full(N, 2.0)
    expected[[3, 1, 0]] = (3.0 * X**2 + 4.0 * X)[[3, 1, 0]]
    check(x.grad, expected)


@pytest.mark.parametrize("preserve", ["never", "auto"])
def test_several_launches_then_zeros(device, preserve):
    x, z, w = real(X, device), real(np.zeros(N), device), real(np.zeros(N), device)
    with wp.Tape(preserve=preserve) as tape:
        wp.launch(powers, N, [x, x, z], device=device)
        wp.launch(powers, N, [x, x, w], device=device)
        x.zero_()
    tape.backward(grads={z: real(np.ones(N), device), w: real(np.ones(N), device)})
    check(x.grad, 3.0 * X**2 + 6.0 * X**5)


def test_narrow_gradients(device):
    values = np.array([1.0, 1.25, 0.5], np.float16)
    x = wp.array(values, dtype=wp.float16, requires_grad=True, device=device)
    z = wp.zeros_like(x, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(powers_of_half, 3, [x, x, z], device=device)
    seeds = [wp.array(np.full(3, s), dtype=wp.float16, device=device) for s in (1.0, 2.0)]
    tape.backward(grads={z: seeds[0], x: seeds[1]})
    assert np.array_equal(x.grad.numpy(), 3.0 * values**2 + 4.0 * values)


def test_checkpoints(device):
    x = real(X, device)
    with wp.Tape() as tape:
        wp.autograd.checkpoint(
            lambda i: wp.launch(damped_square, N, [x, x], device=device), 4, state=[x], snapshots=2
        )
    tape.backward(grads={x: real(np.ones(N), device)})
    value, slope = X.copy(), np.ones(N)
    for _ in range(4):
        slope, value = slope * 1.8 * value, 0.9 * value**2
    check(x, value)
    check(x.grad, slope)


def test_in_a_graph(device):
    x, z, start = real(X, device), real(np.zeros(N), device), real(X, device)
    seeds = {z: real(np.ones(N), device), x: real(np.full(N, 2.0), device)}
    wp.launch(powers, N, [x, x, z], device=device)
    with wp.ScopedCapture(device) as capture:
        wp.copy(x, start)
        with wp.Tape() as tape:
            wp.launch(powers, N, [x, x, z], device=device)
        x.grad.zero_()
        z.grad.zero_()
        tape.backward(grads=seeds)
    for _ in range(2):
        wp.capture_launch(capture.graph)
        check(x.grad, 3.0 * X**2 + 4.0 * X)


def powers_in_place(x):
    y, z = wp.clone(x), wp.zeros_like(x, requires_grad=True)
    wp.launch(powers, N, [y, y, z], device=x.device)
    return z, y


def total_of_cubes(x):
    z, sum_of = powers_in_place(x)[0], wp.zeros(1, dtype=R, device=x.device, requires_grad=True)
    wp.launch(total, N, [z, sum_of], device=x.device)
    return sum_of


def test_forward_mode(device):
    cubes, squares = wp.autograd.jvp(powers_in_place, [real(X, device)], [real(np.ones(N), device)])
    check(cubes, 3.0 * X**2)
    check(squares, 2.0 * X)


def test_second_derivatives(device):
    found = wp.autograd.hvp(total_of_cubes, [real(X, device)], [real(np.ones(N), device)])
    check(found, 6.0 * X)


@pytest.mark.parametrize("mode", ["reverse", "forward"])
def test_jacobian(device, mode):
    found = wp.autograd.jacobian(powers_in_place, inputs=[real(X, device)], mode=mode)
    for output, slope in ((0, 3.0 * X**2), (1, 2.0 * X)):
        check(found[0, output], np.diag(slope))


def test_without_a_tape(device):
    """An adjoint that needs nothing that was overwritten runs; another one says what it lacks."""
    x = real(X, device)
    x.grad.fill_(1.0)
    wp.launch(linear, N, [x], [x], device=device, adjoint=True)
    check(x.grad, np.full(N, 3.0))
    z = real(np.zeros(N), device)
    with pytest.raises(errors.WarpGradientError, match="'x' as it was before the launch"):
        wp.launch(powers, N, [x], [x, z], device=device, adjoint=True)
