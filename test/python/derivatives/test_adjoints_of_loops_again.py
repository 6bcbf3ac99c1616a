"""A gradient within a kernel that is differentiated: the loop's values are kept once more."""

from __future__ import annotations

import numpy as np
import pytest

import warp as wp
from warp._src.errors import WarpCompileError


@wp.func
def product(x: wp.float64):
    t = wp.float64(1.0)
    for _ in range(8):
        t = t * wp.sin(t) + x * t
    return t


@wp.kernel
def scaled_slopes(x: wp.array[wp.float64], scale: wp.array[wp.float64], y: wp.array[wp.float64]):
    i = wp.tid()
    y[i] = wp.grad(product)(x[i]) * scale[i] * scale[i]


def slope(x):
    """The derivative of `product` by forward differentiation, in NumPy."""
    t, dt = np.ones_like(x), np.zeros_like(x)
    for _ in range(8):
        t, dt = t * np.sin(t) + x * t, dt * (np.sin(t) + t * np.cos(t) + x) + t
    return dt


def gradients(x_needs: bool):
    at, scale = np.array([0.1, 0.3]), np.array([2.0, 3.0])
    x = wp.array(at, dtype=wp.float64, requires_grad=x_needs)
    a = wp.array(scale, dtype=wp.float64, requires_grad=True)
    y = wp.zeros(2, dtype=wp.float64, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(scaled_slopes, dim=2, inputs=[x, a], outputs=[y])
    tape.backward(grads={y: wp.ones(2, dtype=wp.float64)})
    return a.grad.numpy(), 2.0 * scale * slope(at)


def test_factors_of_a_gradient():
    """The gradient by a factor needs the inner gradient again, whose loop reads what it kept."""
    found, expected = gradients(x_needs=False)
    np.testing.assert_allclose(found, expected, rtol=1e-13)


def test_adjoint_of_an_adjoint_is_an_error():
    """It has no gradient through the values that the inner adjoint keeps, and says so."""
    with pytest.raises(WarpCompileError, match="use 'wp.hessian' of the function"):
        gradients(x_needs=True)
