"""Second derivatives of what kernels do, against formulas."""

import numpy as np
import pytest

import warp as wp
from noise_values import STATE, noise

real = wp.float64
mat33 = wp.mat33d


def evaluate(kernel, threads, dtype=real):
    """A function of an array with one result, for `hvp` and `hessian`."""

    def function(x):
        loss = wp.zeros(1, dtype=real, requires_grad=True, device=x.device)
        wp.launch(kernel, threads, [x, loss], device=x.device)
        return loss

    return function


def hessian_of(kernel, numbers, device, threads=1, dtype=real):
    x = wp.array(numbers, dtype=dtype, requires_grad=True, device=device)
    found = wp.autograd.hessian(evaluate(kernel, threads), [x])[0, 0].numpy()
    return found.reshape(len(found), -1)


@wp.kernel
def product(x: wp.array(dtype=real), loss: wp.array(dtype=real)):
    p = real(1.0)
    for i in range(x.shape[0]):
        p *= x[i]
    loss[0] = p


def test_loop(device):
    """A product, one factor of which is zero."""
    x = np.array([2.0, -0.5, 0.0, 3.0, 1.5])
    expected = np.array([[0.0 if i == j else np.delete(x, [i, j]).prod() for j in range(5)]
                         for i in range(5)])  # fmt: skip
    np.testing.assert_allclose(hessian_of(product, x, device), expected, rtol=1e-14, atol=1e-15)


@wp.kernel
def sines(x: wp.array(dtype=real), loss: wp.array(dtype=real)):
    s = x[0]
    for _ in range(int(x[1])):
        s = wp.sin(s)
    loss[0] = s


@pytest.mark.parametrize("count", [0, 1, 31, 200])
def test_long_loop(device, count):
    """With checkpoints; s'' by the recurrence s'' = cos(s) s'' - sin(s) s'^2."""
    s, first, second = 0.7, 1.0, 0.0
    for _ in range(count):
        s, first, second = np.sin(s), np.cos(s) * first, np.cos(s) * second - np.sin(s) * first**2
    found = hessian_of(sines, [0.7, float(count)], device)
    assert found[0, 0] == pytest.approx(second, rel=1e-12, abs=1e-15)


@wp.kernel
def newton(x: wp.array(dtype=real), loss: wp.array(dtype=real)):
    y = x[0]
    steps = int(0)
    while wp.abs(y * y * y - x[0]) > real(1e-15) * x[0]:
        y = y - (y * y * y - x[0]) / (real(3.0) * y * y)
        steps += 1
        if steps == 60:
            break
    loss[0] = y


def test_while_with_break(device):
    found = hessian_of(newton, [5.0], device)
    assert found[0, 0] == pytest.approx(-2.0 / 9.0 * 5.0 ** (-5.0 / 3.0), rel=1e-8)


@wp.kernel
def pairs(x: wp.array(dtype=real), loss: wp.array(dtype=real)):
    i = wp.tid()
    for j in range(x.shape[0]):
        if j != i:
            wp.atomic_add(loss, 0, wp.exp(x[i]) * x[j] * x[j])


def test_atomic_sums(device):
    x = np.array([0.1, -0.4, 0.0, 0.8])
    e = np.exp(x)
    expected = 2 * (e[:, None] * x + x[:, None] * e)
    np.fill_diagonal(expected, e * ((x**2).sum() - x**2) + 2 * (e.sum() - e))
    found = hessian_of(pairs, x, device, threads=4)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@wp.func
def own_forward(x: real, y: real):
    e = wp.exp(x * y)
    return e, e


@wp.func
def own_pullback(x: real, y: real, e: real, g: real):
    return g * e * y, g * e * x


own = wp.custom_vjp(own_forward, own_pullback)


@wp.kernel
def use_own(x: wp.array(dtype=real), loss: wp.array(dtype=real)):
    e = own(x[0], x[1])
    loss[0] = e * e


def test_pullback_with_residuals(device):
    """The value that is used again and the residual both vary."""
    x, y = 0.3, -0.7
    e = np.exp(2 * x * y)
    expected = e * np.array([[4 * y * y, 2 + 4 * x * y], [2 + 4 * x * y, 4 * x * x]])
    np.testing.assert_allclose(hessian_of(use_own, [x, y], device), expected, rtol=1e-14)


@wp.kernel
def slope_of_own(x: wp.array(dtype=real), loss: wp.array(dtype=real)):
    by_x, by_y = wp.grad(own)(x[0], x[1])
    loss[0] = by_x


def test_gradient_of_a_gradient_with_residuals(device):
    """In reverse mode a residual varies, too; in forward mode over it, twice."""
    x, y = 0.3, -0.7
    e = np.exp(x * y)
    array = wp.array([x, y], dtype=real, requires_grad=True, device=device)
    function = evaluate(slope_of_own, 1)
    with wp.Tape() as tape:
        loss = function(array)
    tape.backward(loss)
    np.testing.assert_allclose(array.grad.numpy(), [y * y * e, (1 + x * y) * e], rtol=1e-14)
    expected = e * np.array([[y**3, y * (2 + x * y)], [y * (2 + x * y), x * (2 + x * y)]])
    found = hessian_of(slope_of_own, [x, y], device)
    np.testing.assert_allclose(found, expected, rtol=1e-13)


@wp.kernel
def exp_times(x: wp.array(dtype=real), loss: wp.array(dtype=real)):
    loss[0] = wp.exp(x[0]) * x[1] + wp.sinh(x[2]) * x[1] + wp.cosh(x[3]) * x[1]


@wp.kernel
def power_times(x: wp.array(dtype=real), loss: wp.array(dtype=real)):
    loss[0] = wp.pow(x[0], x[2]) * x[1] + wp.expm1(x[3]) * x[1]


def test_second_derivative_where_the_cotangent_is_zero(device):
    """The factor beside a function is zero, the mixed derivative is not."""
    a, b, c = 0.6, 0.4, -0.3
    expected = np.zeros((4, 4))
    expected[1] = expected[:, 1] = [np.exp(a), 0.0, np.cosh(b), np.sinh(c)]
    found = hessian_of(exp_times, [a, 0.0, b, c], device)
    np.testing.assert_allclose(found, expected, rtol=1e-14)
    expected[1] = expected[:, 1] = [b * a ** (b - 1), 0.0, a**b * np.log(a), np.exp(c)]
    found = hessian_of(power_times, [a, 0.0, b, c], device)
    np.testing.assert_allclose(found, expected, rtol=1e-13)


@wp.kernel
def strain(x: wp.array(dtype=mat33), loss: wp.array(dtype=real)):
    u, s, v = wp.svd3(x[0])
    e = x[0] - u * wp.transpose(v)
    loss[0] = wp.ddot(e, e)


@wp.kernel
def polar_strain(x: wp.array(dtype=mat33), loss: wp.array(dtype=real)):
    r, s = wp.polar(x[0])
    e = x[0] - r
    loss[0] = wp.ddot(e, e)


def turns_of_rotation(x):
    """The Hessian of |F - R|^2 at F = diag(x): 2 I less what the three turns take."""
    expected = 2.0 * np.eye(9)
    for i, j in [(0, 1), (0, 2), (1, 2)]:
        turn = np.zeros(9)
        turn[3 * i + j], turn[3 * j + i] = 1.0, -1.0
        expected -= 2.0 / (x[i] + x[j]) * np.outer(turn, turn)
    return expected


@pytest.mark.parametrize("stretch", [(3.0, 2.0, 1.0), (1.2, 1.0, 0.9)])
def test_rotation_by_singular_vectors(device, stretch):
    """The gradient's part for a turn is zero here, its derivative is not."""
    found = hessian_of(strain, [np.diag(stretch)], device, dtype=mat33)
    np.testing.assert_allclose(found, turns_of_rotation(stretch), rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("stretch", [(1.0, 1.0, 1.0), (2.0, 2.0, 1.0), (3.0, 2.0, 1.0)])
def test_rotation_by_polar_decomposition(device, stretch):
    """Singular values may repeat."""
    found = hessian_of(polar_strain, [np.diag(stretch)], device, dtype=mat33)
    np.testing.assert_allclose(found, turns_of_rotation(stretch), rtol=1e-12, atol=1e-13)


@wp.kernel
def periodic(x: wp.array(dtype=wp.vec3), loss: wp.array(dtype=float)):
    loss[0] = wp.pnoise(wp.uint32(wp.static(STATE)), x[0], 2, 3, 4)


def test_periodic_noise(device):
    """Against second differences of the definition in float64."""
    start = np.array([0.296875, 1.625, 2.8125])

    def function(x):
        loss = wp.zeros(1, dtype=float, requires_grad=True, device=device)
        wp.launch(periodic, 1, [x, loss], device=device)
        return loss

    x = wp.array(start[None], dtype=wp.vec3, requires_grad=True, device=device)
    found = wp.autograd.hessian(function, [x])[0, 0].numpy().reshape(3, 3)
    steps = 1e-4 * np.eye(3)
    expected = np.empty((3, 3))
    for i, j in np.ndindex(3, 3):
        corners = [start + a * steps[i] + b * steps[j] for a in (1, -1) for b in (1, -1)]
        values = noise(np.array(corners), np.array([2, 3, 4]))
        expected[i, j] = values @ [1.0, -1.0, -1.0, 1.0] / 4e-8
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)
