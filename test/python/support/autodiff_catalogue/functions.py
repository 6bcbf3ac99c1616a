"""T103 to T111: several results, derivatives of one's own, second derivatives."""

import numpy as np

import warp as wp

from .problem import gradient, kernel, only
from .registry import case
from .scalars import elementwise


@case("T103", "one of two results of a function is seeded")
def two_results(p):
    R = p.real

    @wp.func
    def both(x: R):
        return wp.sin(x), x * x

    @kernel
    def split(x: wp.array(dtype=R), a: wp.array(dtype=R), b: wp.array(dtype=R)):
        i = wp.tid()
        first, second = both(x[i])
        a[i] = first
        b[i] = second

    x = p.random(4)
    for seeds, expected in (([1.0, 0.0], np.cos(x)), ([0.0, 1.0], 2.0 * x)):
        (got,) = p.pullback(split, 4, [p.array(x)], [p.zeros(4), p.zeros(4)], seeds)
        p.close(got, expected)


@case("T104", "a derivative of one's own is used two calls deep")
def nested_custom(p):
    R = p.real

    @wp.func
    def root(x: R):
        return wp.sqrt(x)

    @wp.func_grad(root)
    def adjoint_root(x: R, cotangent: R):
        wp.adjoint[x] += R(10.0) * cotangent

    @wp.func
    def middle(x: R):
        return root(x * x)

    @wp.func
    def outer(x: R):
        return middle(x) + x

    # The given derivative is not the one that forward mode finds.
    p.dot = False
    x = p.random(4)
    (got,) = p.pullback(elementwise(p, outer), 4, [p.array(x)], [p.zeros(4)])
    p.close(got, 20.0 * x + 1.0)


@case("T105", "a derivative of one's own reads what the function saved")
def residuals(p):
    R = p.real

    @wp.func
    def plain(x: R):
        return wp.exp(x) * x

    @wp.func
    def saving(x: R):
        e = wp.exp(x)
        return e * x, e

    @wp.func
    def pullback(x: R, e: R, cotangent: R):
        return cotangent * e * x + cotangent * e

    x, w = p.random(4), p.random(4)
    results = []
    for function in (plain, wp.custom_vjp(saving, pullback)):
        results += p.pullback(elementwise(p, function), 4, [p.array(x)], [p.zeros(4)], [w])
    p.close(results[1], w * np.exp(x) * (x + 1.0))
    p.close(results[1], results[0], 2)


@case("T106", "stop_gradient counts as a constant")
def stopped(p):
    @wp.func
    def scaled(x: p.real):
        return wp.stop_gradient(x) * x

    x = p.random(4)
    p.same(p.pullback(elementwise(p, scaled), 4, [p.array(x)], [p.zeros(4)])[0], x)


@case("T109", "the Hessian of Rosenbrock's function times a vector")
def rosenbrock(p):
    R, n = p.real, 64

    @kernel
    def valley(x: wp.array(dtype=R), loss: wp.array(dtype=R)):
        i = wp.tid()
        a = x[i + 1] - x[i] * x[i]
        b = R(1.0) - x[i]
        wp.atomic_add(loss, 0, R(100.0) * a * a + b * b)

    def function(x):
        loss = p.zeros(1)
        p.launch(valley, n - 1, [x], [loss])
        return loss

    x, v = p.random(n), p.random(n)
    hessian = np.zeros((n, n))
    for i in range(n - 1):
        hessian[i, i] += 1200.0 * x[i] ** 2 - 400.0 * x[i + 1] + 2.0
        hessian[i + 1, i + 1] += 200.0
        hessian[i, i + 1] -= 400.0 * x[i]
        hessian[i + 1, i] -= 400.0 * x[i]
    got = wp.autograd.hvp(function, [p.array(x)], [p.array(v, grad=False)])
    p.close(only(got).numpy(), hessian @ v, 32)


@case("T110", "the Hessian of a spring's energy, in a kernel")
def spring_hessian(p):
    R, V, M = p.real, p.vec3, p.mat33

    @wp.func
    def energy(x: V):
        stretch = wp.length(x) - R(1.5)
        return R(2.0) * stretch * stretch

    hessian = wp.hessian(energy)

    @kernel
    def stiffness(x: wp.array(dtype=V), y: wp.array(dtype=M)):
        i = wp.tid()
        y[i] = hessian(x[i])

    x, made = p.random(4, 3), p.zeros(4, M)
    p.launch(stiffness, 4, [p.array(x, V)], [made])
    size = np.linalg.norm(x, axis=1)[:, None, None]
    n = x[:, :, None] / size
    along = n @ n.transpose(0, 2, 1)
    expected = 4.0 * (along + (1.0 - 1.5 / size) * (np.eye(3) - along))
    p.close(made.numpy(), expected, 32)


@case("T111", "reverse mode over forward mode gives the second derivative")
def reverse_over_forward(p):
    R = p.real

    @wp.func
    def wave(x: R):
        return wp.sin(wp.exp(x))

    waves = elementwise(p, wave)

    def function(x):
        y = p.zeros(4)
        p.launch(waves, 4, [x], [y])
        return y

    data = p.random(4, low=0.1, high=1.0)
    x, v = p.array(data), p.array(np.ones(4))
    with wp.Tape() as tape:
        tangent = only(wp.autograd.jvp(function, [x], [v]))
    tape.backward(grads={tangent: p.seed(tangent)})
    e = np.exp(data)
    p.close(gradient(x), e * np.cos(e) - e * e * np.sin(e), 32)
    p.close(gradient(v), e * np.cos(e), 32)
