"""Functions with derivatives of their own, and derivatives of functions in kernels."""

import numpy as np
import pytest

import warp as wp


@wp.struct
class Pair:
    scale: float
    v: wp.vec3
    count: int


@wp.func
def several(x: float, y: float):
    return x * 3.0 + y / 3.0, y**2.5


@wp.func_grad(several)
def several_grad(x: float, y: float, adj_ret0: float, adj_ret1: float):
    if x > 0.0:
        wp.adjoint[x] += x * adj_ret0 * 42.0 + y * adj_ret1 * 10.0
    for _ in range(3):
        wp.adjoint[y] += y * adj_ret1


@wp.func
def several(p: Pair):  # noqa: F811  (an overload)
    return p.scale * wp.length(p.v)


@wp.func_grad(several)
def several_grad(p: Pair, adj_ret: float):  # noqa: F811
    wp.adjoint[p.scale] += 2.0 * adj_ret
    wp.adjoint[p.v][0] += 3.0 * adj_ret
    wp.adjoint[p].v.z += 4.0 * adj_ret


@wp.func
def fill(i: int, x: wp.array(dtype=float), y: wp.array(dtype=float)):
    y[i] = wp.sin(x[i])


@wp.func_grad(fill)
def fill_grad(i: int, x: wp.array(dtype=float), y: wp.array(dtype=float)):
    wp.adjoint[x][i] += 7.0 * wp.adjoint[y][i]


@wp.func
def next_index(counter: wp.array(dtype=int), kept: wp.array(dtype=int), i: int):
    kept[i] = wp.atomic_add(counter, 0, 1)
    return kept[i]


@wp.func_replay(next_index)
def kept_index(counter: wp.array(dtype=int), kept: wp.array(dtype=int), i: int):
    return kept[i]


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


@wp.func
def energy(x: wp.vec3, stiffness: float, kind: int):
    return 0.5 * stiffness * (wp.length(x) - 1.0) ** 2.0


@wp.func
def newton(x: float, a: float):
    return 0.5 * (x + a / x)


def gradients(kernel, n, inputs, outputs, device="cpu"):
    """Launches on a tape and goes backward with seeds of 1."""
    with wp.Tape() as tape:
        wp.launch(kernel, n, inputs, outputs, device=device)
    tape.backward(grads={o: wp.ones(o.shape, dtype=o.dtype, device=device) for o in outputs})


def variable(data, device, dtype=float):
    return wp.array(data, dtype=dtype, device=device, requires_grad=True)


def result(n, device, dtype=float):
    return wp.zeros(n, dtype=dtype, device=device, requires_grad=True)


def test_func_grad_in_branches_and_loops_of_several_results(device):
    @wp.kernel
    def run(x: wp.array(dtype=float), y: wp.array(dtype=float), a: wp.array(dtype=float),
            b: wp.array(dtype=float)):  # fmt: skip
        i = wp.tid()
        p, q = several(x[i], y[i])
        a[i] = p
        b[i] = q

    x, y = variable([1.0, -2.0], device), variable([10.0, 11.0], device)
    gradients(run, 2, [x, y], [result(2, device), result(2, device)], device=device)
    assert x.grad.numpy().tolist() == [142.0, 0.0]
    assert y.grad.numpy().tolist() == [30.0, 33.0]


def test_func_grad_of_a_struct_chooses_the_overload(device):
    @wp.kernel
    def run(p: wp.array(dtype=Pair), out: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = several(p[i])

    pair = Pair()
    pair.scale, pair.v = 2.0, wp.vec3(3.0, 0.0, 4.0)
    p, out = variable([pair], device, Pair), result(1, device)
    gradients(run, 1, [p], [out], device=device)
    assert out.numpy()[0] == 10.0
    scale, v, _ = p.grad.numpy()[0]
    assert scale == 2.0 and v.tolist() == [3.0, 0.0, 4.0]


@wp.kernel
def run_fill(x: wp.array(dtype=float), y: wp.array(dtype=float), a: wp.array(dtype=float),
             b: wp.array(dtype=float)):  # fmt: skip
    i = wp.tid()
    fill(i, x, y)
    b[i] = 2.0 * a[i]


@pytest.mark.parametrize("active", ["x y", "x", "y", ""])
def test_func_grad_of_arrays_of_which_some_have_gradients(device, active):
    x = wp.array([1.0, 2.0], dtype=float, device=device, requires_grad="x" in active)
    y = wp.zeros(2, dtype=float, device=device, requires_grad="y" in active)
    a, b = variable([1.0, 2.0], device), result(2, device)
    outputs = [y, a, b] if y.requires_grad else [b]
    with wp.Tape() as tape:
        wp.launch(run_fill, 2, [x, y, a, b], device=device)
    tape.backward(grads={o: wp.ones(2, dtype=float, device=device) for o in outputs})
    assert (a.grad.numpy() >= 2.0).all()
    if active == "x y":
        assert x.grad.numpy().tolist() == [7.0, 7.0]


def test_func_grad_of_rows(device):
    """The gradient of a view is the view of the gradient."""

    @wp.kernel
    def run(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
        i, j = wp.tid()
        fill(j, x[i], y[i])

    x = variable(np.arange(6).reshape(2, 3), device)
    gradients(run, (2, 3), [x], [result((2, 3), device)], device=device)
    assert (x.grad.numpy() == 7.0).all()


def test_func_grad_nested_two_deep(device):
    """T104: the derivative belongs to the function wherever it is called."""

    @wp.func
    def inner(x: float):
        return x * x

    @wp.func_grad(inner)
    def inner_grad(x: float, adj_ret: float):
        wp.adjoint[x] += 100.0 * adj_ret * inner(x)

    @wp.func
    def outer(x: float):
        return 3.0 * inner(x)

    @wp.kernel
    def run(x: wp.array(dtype=float), out: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = outer(x[i]) + 1.0

    x, out = variable([2.0], device), result(1, device)
    gradients(run, 1, [x], [out], device=device)
    assert out.numpy()[0] == 13.0 and x.grad.numpy()[0] == 1200.0


def test_func_replay_of_a_counter(device):
    @wp.kernel
    def run(x: wp.array(dtype=float), counter: wp.array(dtype=int), kept: wp.array(dtype=int),
            out: wp.array(dtype=float)):  # fmt: skip
        i = wp.tid()
        j = next_index(counter, kept, i)
        out[j] = x[i] ** 2.0

    n = 128
    x, out = variable(np.arange(n), device), result(n, device)
    counter, kept = (wp.zeros(size, dtype=int, device=device) for size in (1, n))
    gradients(run, n, [x, counter, kept], [out], device=device)
    np.testing.assert_allclose(x.grad.numpy(), 2.0 * np.arange(n))
    assert counter.numpy()[0] == n


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


def test_grad_of_a_function_with_its_own_derivative_and_structs(device):
    @wp.kernel
    def run(p: Pair, out: wp.array(dtype=float)):
        d = wp.grad(several)(p)
        out[0] = d.scale
        out[1] = d.v[0]
        out[2] = float(d.count)

    pair = Pair()
    pair.scale, pair.v, pair.count = 2.0, wp.vec3(1.0, 1.0, 1.0), 5
    out = wp.zeros(3, dtype=float, device=device)
    wp.launch(run, 1, [pair, out], device=device)
    assert out.numpy().tolist() == [2.0, 3.0, 0.0]


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
    """Of 1.5 (|x| - 1)^2."""
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


def test_primal_code_does_not_depend_on_derivatives():
    def make(custom):
        @wp.func
        def f(x: float):
            return wp.sin(x)

        if custom:

            @wp.func_grad(f)
            def f_grad(x: float, adj_ret: float):
                wp.adjoint[x] += adj_ret

        @wp.kernel
        def run(x: wp.array(dtype=float), out: wp.array(dtype=float)):
            i = wp.tid()
            out[i] = f(x[i])

        return run

    assert make(True).ir("llvm") == make(False).ir("llvm")
