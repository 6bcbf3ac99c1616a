"""Optimisers against NumPy in 64 bits, and L-BFGS on functions with known minima."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import warp as wp
from warp.optim import LBFGS, SGD, Adam

DTYPES = [wp.float16, wp.float32, wp.float64, wp.vec3, wp.vec2h, wp.mat22d, wp.quat]
TOLERANCE = {np.dtype("f2"): 2e-3, np.dtype("f4"): 2e-6, np.dtype("f8"): 1e-13}


def adam(x, gradients, lr, beta1, beta2, eps):
    m = v = np.zeros_like(x)
    for t, g in enumerate(gradients, 1):
        m = beta1 * m + (1 - beta1) * g
        v = beta2 * v + (1 - beta2) * g * g
        x = x - lr * (m / (1 - beta1**t)) / (np.sqrt(v / (1 - beta2**t)) + eps)
    return x


def sgd(x, gradients, lr, momentum, dampening, weight_decay, nesterov):
    b = None
    for g in gradients:
        g = g + weight_decay * x
        if momentum:
            b = g if b is None else momentum * b + (1 - dampening) * g
            g = g + momentum * b if nesterov else b
        x = x - lr * g
    return x


def check(make, reference, dtype, device, steps=5):
    """Runs an optimiser and its reference from the same point with the same gradients."""
    rng = np.random.default_rng(7)
    x = wp.zeros(11, dtype=dtype, device=device)
    x.assign(rng.normal(size=x.numpy().shape).astype(x.numpy().dtype))
    start = x.numpy().astype(float)
    gradients = [rng.normal(size=start.shape).astype(x.numpy().dtype) for _ in range(steps)]
    optimizer = make([x])
    for g in gradients:
        optimizer.step([wp.array(g, dtype=dtype, device=device)])
    tolerance = TOLERANCE[gradients[0].dtype]
    expected = reference(start, [g.astype(float) for g in gradients])
    np.testing.assert_allclose(x.numpy(), expected, rtol=tolerance, atol=tolerance)
    return optimizer


@pytest.mark.parametrize("dtype", DTYPES)
def test_adam_is_the_published_algorithm(device, dtype):
    made = check(
        lambda x: Adam(x, lr=0.05, betas=(0.8, 0.97), eps=1e-6),
        lambda x, g: adam(x, g, 0.05, 0.8, 0.97, 1e-6),
        dtype,
        device,
    )
    assert made.t == 5 and made.m[0].numpy().dtype.itemsize >= 4
    made.reset_internal_state()
    assert made.t == 0 and not made.v[0].numpy().any()


@pytest.mark.parametrize("dtype", DTYPES)
@settings(max_examples=6, deadline=None)
@given(
    momentum=st.sampled_from([0.0, 0.9]),
    dampening=st.floats(0.0, 1.0),
    weight_decay=st.floats(0.0, 0.5),
    nesterov=st.booleans(),
)
def test_sgd_is_the_published_algorithm(dtype, momentum, dampening, weight_decay, nesterov):
    values = (0.1, momentum, dampening, weight_decay, nesterov)
    check(lambda x: SGD(x, *values), lambda x, g: sgd(x, g, *values), dtype, "cpu")


def test_wide_gradients_strided_parameters_and_changed_lists(device):
    grid = wp.ones((4, 6), dtype=wp.float16, device=device)
    part = grid[:, 1:3]
    optimizer = SGD([part], lr=0.5)
    optimizer.step([wp.ones((4, 2), dtype=wp.float32, device=device)])
    assert grid.numpy()[0].tolist() == [1.0, 0.5, 0.5, 1.0, 1.0, 1.0]
    kept = optimizer.b[0]
    optimizer.set_params([part])
    assert optimizer.b[0] is kept
    optimizer.set_params([part, wp.zeros(3, dtype=float, device=device)])
    assert [b.shape for b in optimizer.b] == [(4, 2), (3,)]


def test_errors_of_gradients(device):
    x = wp.zeros(3, dtype=float, device=device)
    for optimizer in (Adam([x]), SGD([x])):
        with pytest.raises(TypeError, match="gradient dtype must match parameter dtype"):
            optimizer.step([wp.zeros(3, dtype=int, device=device)])
        with pytest.raises(ValueError, match=r"must match parameter shape \(3,\), got \(4,\)"):
            optimizer.step([wp.zeros(4, dtype=float, device=device)])
        with pytest.raises(ValueError, match="expects a list of 1 gradients, but got 2"):
            optimizer.step([x, x])
        with pytest.raises(TypeError, match="made of floating-point numbers, but got 'int32'"):
            optimizer.set_params([wp.zeros(3, dtype=int, device=device)])
        with pytest.raises(TypeError, match="expects a list of arrays, but got 'array'"):
            optimizer.set_params(x)
    with pytest.raises(RuntimeError, match="must be set before calling step"):
        Adam().step([x])


def problem(function, start, dtype=wp.float64, device="cpu"):
    """A parameter and a closure; `function` gives loss and gradient of a NumPy vector."""
    x = wp.array(np.asarray(start, float), dtype=dtype, device=device, requires_grad=True)

    def closure():
        loss, gradient = function(x.numpy().astype(float))
        x.grad.assign(gradient.astype(x.numpy().dtype))
        return loss

    return x, closure


def rosenbrock(x):
    a, b = x[:-1], x[1:]
    gradient = np.zeros_like(x)
    gradient[:-1] = -400.0 * a * (b - a * a) - 2.0 * (1.0 - a)
    gradient[1:] += 200.0 * (b - a * a)
    return float((100.0 * (b - a * a) ** 2 + (1.0 - a) ** 2).sum()), gradient


@pytest.mark.parametrize("n", [2, 64])
def test_lbfgs_finds_the_minimum_of_rosenbrock(device, n):
    x, closure = problem(rosenbrock, np.tile([-1.2, 1.0], n // 2), device=device)
    optimizer = LBFGS([x], max_iter=600, tolerance_grad=1e-9, tolerance_change=0.0)
    assert optimizer.step(closure) < 1e-17
    np.testing.assert_allclose(x.numpy(), 1.0, atol=1e-8)
    assert optimizer.evaluations < 1.5 * optimizer.iterations
    assert np.abs(x.grad.numpy() - rosenbrock(x.numpy())[1]).max() < 1e-12


@pytest.mark.parametrize("dtype, tolerance", [(wp.float64, 1e-8), (wp.float32, 2e-3)])
def test_lbfgs_solves_ill_conditioned_quadratics(device, dtype, tolerance):
    """Condition 1e6 in a rotated basis: x = A^-1 b."""
    rng = np.random.default_rng(3)
    q, _ = np.linalg.qr(rng.normal(size=(20, 20)))
    matrix = q @ np.diag(np.logspace(0, 6 if dtype is wp.float64 else 3, 20)) @ q.T
    solution = rng.normal(size=20)

    def quadratic(x):
        gradient = matrix @ (x - solution)
        return float(0.5 * (x - solution) @ gradient), gradient

    x, closure = problem(quadratic, np.zeros(20), dtype, device)
    settings = {"max_iter": 400, "tolerance_grad": 1e-9, "tolerance_change": 0.0}
    LBFGS([x], history_size=40, **settings).step(closure)
    np.testing.assert_allclose(x.numpy(), solution, atol=tolerance)


@pytest.mark.parametrize("line_search", ["strong_wolfe", None])
def test_lbfgs_steps_back_from_where_the_loss_is_not_finite(device, line_search):
    """Long steps lead to x < 0, where 10 x - log x is not a number; the minimum is at 0.1."""

    def barrier(x):
        with np.errstate(all="ignore"):
            return float((10.0 * x - np.log(x)).sum()), 10.0 - 1.0 / x

    x, closure = problem(barrier, [3.0, 0.5, 40.0], device=device)
    lr = 1e4 if line_search else 1.0
    optimizer = LBFGS([x], lr=lr, max_iter=100, line_search=line_search)
    optimizer.step(closure)
    assert (x.numpy() > 0.0).all() and optimizer.evaluations > optimizer.iterations + 1
    if line_search:
        np.testing.assert_allclose(x.numpy(), 0.1, rtol=1e-6)


def test_lbfgs_with_kernels_and_several_parameters(device):
    """A loss on the device, of a vector and a half-precision parameter, minimised step by step."""
    points = wp.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], dtype=wp.vec3, device=device)
    x = wp.zeros(2, dtype=wp.vec3, device=device, requires_grad=True)
    shift = wp.array([1.0], dtype=wp.float16, device=device, requires_grad=True)
    loss = wp.zeros(1, dtype=float, device=device)

    @wp.kernel
    def evaluate(
        points: wp.array(dtype=wp.vec3),
        x: wp.array(dtype=wp.vec3),
        shift: wp.array(dtype=wp.float16),
        dx: wp.array(dtype=wp.vec3),
        loss: wp.array(dtype=float),
    ):
        i = wp.tid()
        d = x[i] - points[i]
        dx[i] = 2.0 * d
        wp.atomic_add(loss, 0, wp.dot(d, d) + float(shift[0]) * float(shift[0]))

    def closure():
        loss.zero_()
        wp.launch(evaluate, 2, [points, x, shift, x.grad], [loss], device=device)
        shift.grad.assign((4.0 * shift.numpy().astype(float)).astype(shift.grad.numpy().dtype))
        return loss

    optimizer = LBFGS([x, shift], max_iter=1)
    losses = [optimizer.step(closure) for _ in range(8)]
    assert losses == sorted(losses, reverse=True) and losses[-1] < 1e-6
    np.testing.assert_allclose(x.numpy(), points.numpy(), atol=1e-4)


def test_errors_of_lbfgs(device):
    x = wp.zeros(2, dtype=float, device=device, requires_grad=True)
    for name, value in (("max_iter", 0), ("history_size", -1), ("lr", 0.0), ("line_search", "no")):
        with pytest.raises(ValueError, match=name):
            LBFGS([x], **{name: value})
    with pytest.raises(ValueError, match="parameter 1 has no gradient.*requires_grad=True"):
        LBFGS([x, wp.zeros(2, dtype=float, device=device)])
    with pytest.raises(ValueError, match="nothing to optimise"):
        LBFGS([])
    with pytest.raises(TypeError, match="expects the loss from the closure.*'NoneType'"):
        LBFGS([x]).step(lambda: None)
    with pytest.raises(ValueError, match=r"one loss from the closure, but got shape \(2,\)"):
        LBFGS([x]).step(lambda: x)
    with pytest.raises(wp.WarpError, match="the loss is nan"):
        LBFGS([x]).step(lambda: float("nan"))
