"""Functions named like operators go before them, as in NVIDIA Warp."""

import numpy as np
import pytest

import warp as wp


@wp.func
def mul(a: wp.vec2, b: wp.vec2) -> wp.vec2:
    """Product of complex numbers."""
    return wp.vec2(a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0])


@wp.func
def mod(a: int, b: int) -> int:
    """With the sign of the divisor; within itself `%` is the builtin."""
    return ((a % b) + b) % b


@wp.func
def sub(a: wp.vec3, b: float) -> wp.vec3:
    return wp.vec3(a[0] - b, a[1] - b, a[2] - b)


@wp.func
def neg(a: wp.vec2) -> wp.vec2:
    """Conjugate."""
    return wp.vec2(a[0], -a[1])


@wp.kernel
def products(x: wp.array[wp.vec2], y: wp.array[wp.vec2]):
    i = wp.tid()
    z = x[i]
    z *= x[i]
    y[i] = z * (-x[i]) * 2.0


@wp.kernel
def remainders(n: wp.array[int], out: wp.array[int]):
    i = wp.tid()
    out[i] = n[i] % 5
    out[i] %= 3


@wp.kernel
def shifts(x: wp.array[wp.vec3], by: float):
    x[wp.tid()] -= by


def test_numbers_and_vectors(device):
    x = np.array([1 + 2j, -3 + 0.5j])
    pairs = np.stack([x.real, x.imag], axis=1)
    given = wp.array(pairs, dtype=wp.vec2, device=device, requires_grad=True)
    found = wp.zeros(2, dtype=wp.vec2, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(products, 2, [given, found], device=device)
    expected = 2 * x * x * x.conj()
    np.testing.assert_allclose(
        found.numpy(), np.stack([expected.real, expected.imag], axis=1), rtol=1e-6
    )
    # The real part is 2 |x|^2 Re x.
    tape.backward(grads={found: wp.array([(1.0, 0.0)] * 2, dtype=wp.vec2, device=device)})
    square = np.abs(x) ** 2
    by_real, by_imaginary = 4 * x.real**2 + 2 * square, 4 * x.real * x.imag
    np.testing.assert_allclose(
        given.grad.numpy(), np.stack([by_real, by_imaginary], axis=1), rtol=1e-5
    )
    numbers = np.arange(-7, 8, dtype=np.int32)
    out = wp.zeros(15, dtype=int, device=device)
    wp.launch(remainders, 15, [wp.array(numbers, device=device), out], device=device)
    np.testing.assert_array_equal(out.numpy(), numbers % 5 % 3)


def test_updates_of_elements(device):
    x = wp.array([(1.0, 2.0, 3.0)], dtype=wp.vec3, device=device)
    wp.launch(shifts, 1, [x, 0.5], device=device)
    np.testing.assert_array_equal(x.numpy(), [[0.5, 1.5, 2.5]])


def test_operands_of_other_types_have_the_operator(device):
    @wp.kernel
    def plain(out: wp.array[float]):
        out[0] = -out[0] * 3.0 % 4.0 - 1.0

    out = wp.array([-3.0], dtype=float, device=device)
    wp.launch(plain, 1, [out], device=device)
    assert out.numpy()[0] == 0.0

    @wp.kernel
    def refused(x: wp.array[wp.vec3], out: wp.array[wp.vec3]):
        out[0] = x[0] * x[0]

    with pytest.raises(wp.WarpCodegenTypeError, match="no overload of '\\*'"):
        wp.launch(refused, 1, [wp.zeros(1, dtype=wp.vec3, device=device)] * 2, device=device)
