"""Gradients and Hessians of functions, called in kernels."""

import numpy as np

import warp as wp
from derivative_programs import gradients, result, variable


@wp.func
def energy(x: wp.vec3, stiffness: float, kind: int):
    return 0.5 * stiffness * (wp.length(x) - 1.0) ** 2.0


def test_grad_gives_a_cotangent_per_argument(device):
    @wp.kernel
    def run(x: wp.array(dtype=wp.vec3), g: wp.array(dtype=wp.vec3), h: wp.array(dtype=float)):
        i = wp.tid()
        dx, dk, dn = wp.grad(energy)(x[i], 3.0, 2)
        g[i] = dx
        h[i] = dk + float(dn)

    x = wp.array([[3.0, 0.0, 4.0]], dtype=wp.vec3, device=device)
    g, h = wp.zeros(1, dtype=wp.vec3, device=device), wp.zeros(1, dtype=float, device=device)
    wp.launch(run, 1, [x, g, h], device=device)
    np.testing.assert_allclose(g.numpy()[0], 3.0 * 4.0 * np.array([0.6, 0.0, 0.8]), rtol=1e-6)
    np.testing.assert_allclose(h.numpy(), 8.0, rtol=1e-6)


def test_grad_of_builtins_branches_and_loops(device):
    @wp.func
    def power(x: float, n: int):
        y = float(1.0)
        for _ in range(n):
            y = y * x
        if y < 0.0:
            y = -y
        return y

    df = wp.grad(power)

    @wp.kernel
    def run(x: wp.array(dtype=float), n: int, out: wp.array2d(dtype=float)):
        i = wp.tid()
        out[i, 0], _ = df(x[i], n)
        out[i, 1], out[i, 2] = wp.grad(wp.atan2)(x[i], 2.0)

    x = wp.array([2.0, -1.5], dtype=float, device=device)
    out = wp.zeros((2, 3), dtype=float, device=device)
    wp.launch(run, 2, [x, 5, out], device=device)
    v = x.numpy().astype(float)
    expected = np.stack([5 * v**4 * np.sign(v), 2 / (v * v + 4), -v / (v * v + 4)], axis=1)
    np.testing.assert_allclose(out.numpy(), expected, rtol=1e-5)


def test_gradients_of_gradients_flow(device):
    """The derivative of a force is the stiffness: reverse over reverse."""

    @wp.kernel
    def run(x: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
        i = wp.tid()
        dx, _dk, _dn = wp.grad(energy)(x[i], 3.0, 2)
        out[i] = dx[0]

    x = variable([[3.0, 0.0, 4.0]], device, wp.vec3)
    gradients(run, 1, [x], [result(1, device)], device=device)
    np.testing.assert_allclose(x.grad.numpy()[0], spring_hessian([3.0, 0.0, 4.0])[0], rtol=1e-5)


def spring_hessian(x):
    """The gradient of 1.5 (|x| - 1)^2."""
    x = np.asarray(x)
    r = np.linalg.norm(x)
    n = np.outer(x, x) / r**2
    return 3.0 * (n + (1.0 - 1.0 / r) * (np.eye(3) - n))


def test_hessian_of_a_spring(device):
    """T110."""

    @wp.kernel
    def run(x: wp.array(dtype=wp.vec3), out: wp.array(dtype=wp.mat33)):
        i = wp.tid()
        out[i] = wp.hessian(energy)(x[i], 3.0, 2)

    points = np.array([[3.0, 0.0, 4.0], [0.5, -0.2, 0.1]], np.float32)
    x = wp.array(points, dtype=wp.vec3, device=device)
    out = wp.zeros(2, dtype=wp.mat33, device=device)
    wp.launch(run, 2, [x, out], device=device)
    expected = [spring_hessian(p.astype(float)) for p in points]
    np.testing.assert_allclose(out.numpy(), expected, rtol=2e-5, atol=2e-5)


def test_second_derivative_of_a_scalar(device):
    """T111."""

    @wp.func
    def wave(x: wp.float64):
        return wp.sin(wp.exp(x))

    @wp.kernel
    def run(x: wp.array(dtype=wp.float64), out: wp.array(dtype=wp.float64)):
        i = wp.tid()
        out[i] = wp.hessian(wave)(x[i])

    v = np.linspace(-1.0, 1.5, 7)
    x = wp.array(v, dtype=wp.float64, device=device)
    out = wp.zeros(7, dtype=wp.float64, device=device)
    wp.launch(run, 7, [x, out], device=device)
    e = np.exp(v)
    np.testing.assert_allclose(out.numpy(), e * np.cos(e) - e * e * np.sin(e), rtol=1e-12)


def test_second_derivatives_through_loops(device):
    """The gradient of a polynomial by Horner's scheme, and of a loop that ends by a condition."""

    @wp.func
    def polynomial(x: wp.float64, n: int):
        y = wp.float64(1.0)
        for _ in range(n):
            y = y * x + wp.float64(1.0)
        return y

    @wp.func
    def halved(x: wp.float64):
        y = x * x
        while y > wp.float64(1.0):
            y = wp.float64(0.5) * y
        return y

    @wp.kernel
    def run(x: wp.array(dtype=wp.float64), n: int, out: wp.array2d(dtype=wp.float64)):
        i = wp.tid()
        out[i, 0], _n = wp.grad(polynomial)(x[i], n)
        out[i, 1] = wp.hessian(polynomial)(x[i], n)
        out[i, 2] = wp.hessian(halved)(x[i])

    v = np.array([0.5, 1.5, 3.0])
    x = wp.array(v, dtype=wp.float64, device=device)
    out = wp.zeros((3, 3), dtype=wp.float64, device=device)
    wp.launch(run, 3, [x, 40, out], device=device)
    p = np.polynomial.Polynomial(np.ones(41))
    expected = np.stack([p.deriv()(v), p.deriv(2)(v), [2.0, 0.5, 0.125]], axis=1)
    np.testing.assert_allclose(out.numpy(), expected, rtol=1e-12)
