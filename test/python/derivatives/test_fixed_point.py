"""`wp.fixed_point`: solutions, and their derivatives by the implicit function theorem."""

import numpy as np

import warp as wp
from derivative_programs import gradients, result, variable


@wp.func
def newton(x: float, a: float):
    return 0.5 * (x + a / x)


def test_fixed_point_is_differentiated_implicitly(device):
    """T59."""

    @wp.kernel
    def run(a: wp.array(dtype=float), out: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = wp.fixed_point(newton, 1.0, a[i])

    a, out = variable([2.0, 4.0, 9.0], device), result(3, device)
    gradients(run, 3, [a], [out], device=device)
    root = np.sqrt([2.0, 4.0, 9.0])
    np.testing.assert_allclose(out.numpy(), root, rtol=1e-6)
    np.testing.assert_allclose(a.grad.numpy(), 0.5 / root, rtol=1e-6)


def test_fixed_point_of_a_vector_with_array_parameters(device):
    """x = A tanh(x) + b contracts slowly: the adjoint is a linear solve, too."""

    @wp.func
    def step(x: wp.vec2d, a: wp.mat22d, b: wp.array(dtype=wp.vec2d), i: int):
        t = wp.vec2d(wp.tanh(x[0]), wp.tanh(x[1]))
        return a * t + b[i]

    @wp.kernel
    def run(a: wp.array(dtype=wp.mat22d), b: wp.array(dtype=wp.vec2d),
            out: wp.array(dtype=wp.vec2d)):  # fmt: skip
        i = wp.tid()
        out[i] = wp.fixed_point(step, wp.vec2d(), a[i], b, i)

    matrix = np.array([[0.5, 0.3], [-0.2, 0.6]])
    a = variable([matrix], device, wp.mat22d)
    b = variable([[0.3, -0.4]], device, wp.vec2d)
    out = result(1, device, wp.vec2d)
    gradients(run, 1, [a, b], [out], device=device)
    x = out.numpy()[0]
    np.testing.assert_allclose(matrix @ np.tanh(x) + [0.3, -0.4], x, rtol=1e-13)
    jacobian = matrix * (1.0 - np.tanh(x) ** 2)
    w = np.linalg.solve(np.eye(2) - jacobian.T, np.ones(2))
    np.testing.assert_allclose(b.grad.numpy()[0], w, rtol=1e-12)
    np.testing.assert_allclose(a.grad.numpy()[0], np.outer(w, np.tanh(x)), rtol=1e-12)
