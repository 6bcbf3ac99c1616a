"""Forward mode: `jvp` and `hvp`."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def rosenbrock(x: wp.array(dtype=wp.float64), loss: wp.array(dtype=wp.float64)):
    i = wp.tid()
    one = wp.float64(1.0)
    a = x[i + 1] - x[i] * x[i]
    b = one - x[i]
    wp.atomic_add(loss, 0, wp.float64(100.0) * a * a + b * b)


@wp.kernel
def chain(x: wp.array(dtype=wp.float64), n: int, y: wp.array(dtype=wp.float64)):
    i = wp.tid()
    v = x[i]
    for _ in range(n):
        v = wp.sin(v) * x[i]
    y[i] = v


@wp.kernel
def halve(x: wp.array(dtype=wp.float16), y: wp.array(dtype=wp.float16)):
    i = wp.tid()
    y[i] = x[i] * x[i]


@wp.struct
class Body:
    mass: wp.float64
    position: wp.array(dtype=wp.float64)


@wp.kernel
def weigh(body: Body, y: wp.array(dtype=wp.float64)):
    i = wp.tid()
    y[i] = body.mass * body.position[i] * body.position[i]


def values(numbers, device, dtype=wp.float64):
    return wp.array(numbers, dtype=dtype, requires_grad=True, device=device)


def rosenbrock_of(x):
    loss = wp.zeros(1, dtype=wp.float64, requires_grad=True, device=x.device)
    wp.launch(rosenbrock, x.size - 1, [x, loss], device=x.device)
    return loss


def rosenbrock_hessian(x):
    n = len(x)
    h = np.zeros((n, n))
    for i in range(n - 1):
        h[i, i] += 1200 * x[i] ** 2 - 400 * x[i + 1] + 2
        h[i + 1, i + 1] += 200
        h[i, i + 1] -= 400 * x[i]
        h[i + 1, i] -= 400 * x[i]
    return h


def test_tangents_through_launches_copies_and_fills(device):
    x = values([0.5, 1.5, 2.5], device)
    v = values([1.0, 2.0, 3.0], device)

    def function(x):
        y = wp.zeros_like(x)
        wp.launch(chain, 3, [x, 7, y], device=device)
        z = wp.clone(y)
        z += x
        y[0] = 4.0
        return y, z, wp.zeros_like(x)

    tangents = wp.autograd.jvp(function, inputs=[x], tangents=[v])
    h = 1e-6
    ends = []
    for sign in (1, -1):
        shifted = values(x.numpy() + sign * h * v.numpy(), device)
        ends.append([one.numpy().copy() for one in function(shifted)])
    for tangent, up, down in zip(tangents, *ends):
        assert np.allclose(tangent.numpy(), (up - down) / (2 * h), rtol=1e-7, atol=1e-9)


def test_tangents_agree_with_adjoints(device):
    x, v = values([0.5, 1.5], device), values([1.0, -2.0], device)
    w = values([3.0, 4.0], device)

    def function(x):
        y = wp.zeros_like(x)
        wp.launch(chain, 2, [x, 20, y], device=device)
        return y

    tangent = wp.autograd.jvp(function, inputs=[x], tangents=[v]).numpy()
    with wp.Tape() as tape:
        y = function(x)
    tape.backward(grads={y: w})
    left, right = tangent @ w.numpy(), v.numpy() @ x.grad.numpy()
    assert abs(left - right) <= 1e-13 * abs(left)


def test_tangents_of_narrow_arrays_are_wide(device):
    x, v = values([3.0], device, wp.float16), values([1.0], device, wp.float32)

    def function(x):
        y = wp.zeros_like(x)
        wp.launch(halve, 1, [x, y], device=device)
        return y

    tangent = wp.autograd.jvp(function, inputs=[x], tangents=[v])
    assert tangent.dtype is wp.float32 and tangent.numpy()[0] == 6


def test_tangents_of_arrays_in_structs(device):
    x, v = values([3.0, 4.0], device), values([1.0, 10.0], device)

    def function(x):
        y = wp.zeros_like(x)
        wp.launch(weigh, 2, [Body(mass=2.0, position=x), y], device=device)
        return y

    tangent = wp.autograd.jvp(function, inputs=[x], tangents=[v])
    assert np.array_equal(tangent.numpy(), [12, 160])


def test_hessian_times_vector(device):
    rng = np.random.default_rng(1)
    numbers, direction = rng.normal(size=64), rng.normal(size=64)
    x, v = values(numbers, device), values(direction, device)
    x.grad.fill_(7.0)
    found = wp.autograd.hvp(rosenbrock_of, inputs=[x], vectors=[v]).numpy()
    assert np.allclose(found, rosenbrock_hessian(numbers) @ direction, rtol=1e-12)
    assert (x.grad.numpy() == 7).all()


def test_hessian_of_several_inputs(device):
    x, y = values([1.0, 2.0], device), values([3.0, 4.0], device)

    def function(x, y):
        z = x * x * y
        loss = wp.zeros(1, dtype=wp.float64, requires_grad=True, device=device)
        wp.launch(add_up, 2, [z, loss], device=device)
        return loss

    one = wp.ones(2, dtype=wp.float64, device=device)
    by_x, by_y = wp.autograd.hvp(function, inputs=[x, y], vectors=[one, None])
    assert np.allclose(by_x.numpy(), 2 * y.numpy())
    assert np.allclose(by_y.numpy(), 2 * x.numpy())


@wp.kernel
def add_up(z: wp.array(dtype=wp.float64), loss: wp.array(dtype=wp.float64)):
    wp.atomic_add(loss, 0, z[wp.tid()])


def test_hessian_with_a_broadcast_operand(device):
    x, y = values([2.0], device), values([1.0, 2.0, 3.0], device)

    def function(x, y):
        z = x * x * y * y
        loss = wp.zeros(1, dtype=wp.float64, requires_grad=True, device=device)
        wp.launch(add_up, 3, [z, loss], device=device)
        return loss

    one, none = wp.ones(1, dtype=wp.float64, device=device), None
    by_x, by_y = wp.autograd.hvp(function, inputs=[x, y], vectors=[one, none])
    assert np.allclose(by_x.numpy(), [28]) and np.allclose(by_y.numpy(), 8 * y.numpy())


def test_bad_directions(device):
    x = values([1.0, 2.0], device)
    with pytest.raises(ValueError, match=r"shape \(2,\)"):
        wp.autograd.jvp(lambda x: x, inputs=[x], tangents=[values([1.0], device)])
    with pytest.raises(ValueError, match="as many tangents"):
        wp.autograd.jvp(lambda x: x, inputs=[x], tangents=[])
    with pytest.raises(ValueError, match="one element"):
        wp.autograd.hvp(lambda x: x, inputs=[x], vectors=[x])
    constant = wp.zeros(2, dtype=float, device=device)
    with pytest.raises(RuntimeError, match="requires_grad"):
        wp.autograd.hvp(lambda x: x, inputs=[constant], vectors=[None])
