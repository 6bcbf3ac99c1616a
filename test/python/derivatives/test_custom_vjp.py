"""Functions with a pullback and residuals, and `stop_gradient`."""

import numpy as np
import pytest

import warp as wp
from derivative_programs import gradients, result, variable


@wp.func
def forward_root(x: float):
    y = wp.sqrt(x)
    return y, y


@wp.func
def pullback_of_residual(y: float, cotangent: float):
    return 0.5 * cotangent / y


@wp.func
def pullback_of_all(x: float, y: float, cotangent: float):
    return 0.5 * cotangent * y / x


@pytest.mark.parametrize("pullback", [pullback_of_residual, pullback_of_all])
def test_custom_vjp_with_residuals_equals_the_automatic_derivative(device, pullback):
    """T105."""
    root = wp.custom_vjp(forward_root, pullback)

    @wp.kernel
    def run(x: wp.array(dtype=float), out: wp.array(dtype=float), other: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = root(x[i]) * x[i]
        other[i] = wp.sqrt(x[i]) * x[i]

    for position in (0, 1):
        x = variable([1.0, 4.0, 6.25], device)
        outputs = [result(3, device), result(3, device)]
        with wp.Tape() as tape:
            wp.launch(run, 3, [x, *outputs], device=device)
        tape.backward(grads={outputs[position]: wp.ones(3, dtype=float, device=device)})
        np.testing.assert_allclose(x.grad.numpy(), [1.5, 3.0, 3.75], rtol=1e-6)
    assert root(4.0) == 2.0


def test_custom_vjp_without_residuals(device):
    @wp.func
    def step(x: float, n: int):
        return wp.floor(x) * float(n)

    @wp.func
    def straight_through(x: float, n: int, cotangent: float):
        return float(n) * cotangent

    rounded = wp.custom_vjp(step, straight_through)

    @wp.kernel
    def run(x: wp.array(dtype=float), out: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = rounded(x[i], 3)

    x, out = variable([1.5], device), result(1, device)
    gradients(run, 1, [x], [out], device=device)
    assert out.numpy()[0] == 3.0 and x.grad.numpy()[0] == 3.0


def test_stop_gradient(device):
    """T106."""

    @wp.kernel
    def run(x: wp.array(dtype=float), out: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = x[i] * wp.stop_gradient(x[i])

    x = variable([3.0], device)
    gradients(run, 1, [x], [result(1, device)], device=device)
    assert x.grad.numpy()[0] == 3.0
