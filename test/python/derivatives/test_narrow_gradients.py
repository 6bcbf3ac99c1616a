"""Gradients of arrays with elements of 16 bits: of that type, summed wide and rounded once."""

import numpy as np
import pytest

import warp as wp

NARROW = [wp.float16, wp.bfloat16]


def rounded(values, dtype):
    """Numbers in float64, rounded once to a type, as float64."""
    values = np.asarray(values, np.float64)
    if dtype is wp.float16:
        return values.astype(np.float16).astype(np.float64)
    # Eight bits of precision, ties to even; no bfloat16 of these tests is subnormal.
    mantissa, exponent = np.frexp(values)
    return np.ldexp(np.round(mantissa * 256.0) / 256.0, exponent)


def numbers(a):
    """The contents of an array, as float64."""
    scalar = wp.types.type_scalar_type(a.dtype)
    if scalar is wp.bfloat16:
        shape = a.shape + getattr(a.dtype, "_shape_", ())
        found = a.numpy().view(np.uint16).astype(np.uint32) << 16
        return found.view(np.float32).astype(np.float64).reshape(shape)
    return a.numpy().astype(np.float64)


def make_dot(dtype):
    @wp.kernel(module="unique")
    def dot(x: wp.array(dtype=dtype), w: wp.array(dtype=dtype), y: wp.array(dtype=dtype)):
        i = wp.tid()
        y[i] = w[0] * x[i] * x[i]

    return dot


@pytest.mark.parametrize("dtype", NARROW)
def test_sums_of_a_launch_are_rounded_once(device, dtype):
    """Each of 5000 terms is lost beside the sum of the others in 16 bits."""
    n = 5000
    values = rounded(np.random.default_rng(3).uniform(0.5, 1.0, n), dtype)
    x = wp.array(values.tolist(), dtype=dtype, device=device, requires_grad=True)
    w = wp.full(1, 1.0, dtype=dtype, device=device, requires_grad=True)
    y = wp.zeros(n, dtype=dtype, device=device, requires_grad=True)
    assert w.grad.dtype is dtype and w.grad.strides == w.strides
    with wp.Tape() as tape:
        wp.launch(make_dot(dtype), n, [x, w, y], device=device)
    tape.backward(grads={y: wp.ones(n, dtype=dtype, device=device)})
    # In kernels, products of two numbers of 16 bits have 16.
    products = rounded(values * values, dtype)
    exact = products.sum()
    assert abs(numbers(w.grad)[0] - exact) <= abs(exact) * (
        2**-8 if dtype is wp.bfloat16 else 2**-11
    )
    first = numbers(w.grad)[0]
    tape.backward(grads={y: wp.ones(n, dtype=dtype, device=device)})
    assert abs(numbers(w.grad)[0] - (first + exact)) <= 2.1 * exact * (
        2**-8 if dtype is wp.bfloat16 else 2**-11
    )
    tape.zero()
    assert numbers(w.grad)[0] == 0 and not numbers(x.grad).any()


@pytest.mark.parametrize("dtype", NARROW)
def test_small_gradients_are_rounded(device, dtype):
    """A gradient below what its type holds is zero in it, and not with 32 bits."""
    given = {} if dtype is wp.bfloat16 else {"grad_dtype": wp.float32}
    x = wp.full(3, 1e-4, dtype=dtype, device=device, requires_grad=True, **given)
    w = wp.full(1, 1e-4, dtype=dtype, device=device, requires_grad=True)
    y = wp.zeros(3, dtype=dtype, device=device, requires_grad=True)
    y.grad.fill_(1.0)
    wp.launch(make_dot(dtype), 3, [x, w], [y], device=device, adjoint=True)
    np.testing.assert_allclose(numbers(x.grad), 2e-8, rtol=0.02)
    assert x.grad.dtype is (dtype if dtype is wp.bfloat16 else wp.float32)


def test_wide_gradients(device):
    x = wp.ones(4, dtype=wp.float16, device=device, requires_grad=True, grad_dtype=wp.float32)
    assert x.grad.dtype is wp.float32 and x.grad.strides == (4,)
    assert x[::2].grad.strides == (8,)
    assert wp.zeros_like(x).grad.dtype is wp.float32
    assert wp.clone(x).grad.dtype is wp.float32
    vectors = wp.zeros(2, dtype=wp.vec3h, device=device, requires_grad=True, grad_dtype=wp.vec3)
    assert vectors.grad.dtype is wp.vec3
    assert vectors.view(wp.float16).grad.dtype is wp.float32
    plain = wp.zeros(2, dtype=wp.vec3h, device=device, requires_grad=True, grad_dtype=wp.float16)
    assert plain.grad.dtype is wp.vec3h
    assert plain.view(wp.float16).grad.shape == (2, 3)
    assert plain.view(wp.float16).grad.dtype is wp.float16
    assert not plain.view(wp.types.vector(3, wp.int16)).requires_grad
    plain.grad = wp.zeros(2, dtype=wp.vec3, device=device)
    assert plain.grad.dtype is wp.vec3
    with pytest.raises(TypeError, match="expects 'float16' or 'float32' as `grad_dtype`"):
        wp.zeros(2, dtype=wp.float16, device=device, grad_dtype=wp.float64)
    with pytest.raises(ValueError, match="gradient of 'float16' or 'float32' for an array"):
        x.grad = wp.zeros(4, dtype=wp.float64, device=device)


@pytest.mark.parametrize("dtype", [wp.vec3h, wp.mat22h, wp.quath, wp.transformh])
def test_composites_with_gaps(device, dtype):
    """Elements of 16-bit components, every other one, in two dimensions."""

    @wp.kernel(module="unique")
    def scale(x: wp.array2d(dtype=dtype), y: wp.array2d(dtype=dtype)):
        i, j = wp.tid()
        y[i, j] = wp.float16(3.0) * x[i, j]

    x = wp.zeros((6, 4), dtype=dtype, device=device, requires_grad=True)
    x.grad.fill_(1.0)
    y = wp.zeros((2, 3), dtype=dtype, device=device, requires_grad=True)
    part = x[::2, 1:4:2].transpose()
    with wp.Tape() as tape:
        wp.launch(scale, (2, 3), [part, y], device=device)
    seed = wp.zeros_like(y, requires_grad=False)
    seed.fill_(0.5)
    tape.backward(grads={y: seed})
    expected = np.ones((6, 4))
    expected[::2, 1:4:2] += 1.5
    found = numbers(x.grad).reshape(6, 4, -1)
    np.testing.assert_array_equal(found, np.broadcast_to(expected[..., None], found.shape))


@wp.struct
class Pair:
    a: wp.array(dtype=wp.float16)
    b: wp.array(dtype=wp.float16)


@wp.kernel
def product(p: Pair, y: wp.array(dtype=wp.float16)):
    i = wp.tid()
    y[i] = p.a[i] * p.b[i]


def test_arguments_that_share_memory_share_the_sum(device):
    """Each element is an argument's twice, once by each field."""
    x = wp.array([1.0, 2.0, 3.0, 4.0, 5.0], dtype=wp.float16, device=device, requires_grad=True)
    y = wp.zeros(4, dtype=wp.float16, device=device, requires_grad=True)
    pair = Pair()
    pair.a, pair.b = x[:4], x[1:]
    with wp.Tape() as tape:
        wp.launch(product, 4, [pair, y], device=device)
    tape.backward(grads={y: wp.ones(4, dtype=wp.float16, device=device)})
    np.testing.assert_array_equal(x.grad.numpy(), [2, 4, 6, 8, 4])


@wp.kernel
def fourth(x: wp.array(dtype=wp.float16), y: wp.array(dtype=wp.float16)):
    i = wp.tid()
    y[i] = x[i] * x[i] * x[i] * x[i]


def test_captured_backward_passes_add_up(device):
    x = wp.full(8, 0.5, dtype=wp.float16, device=device, requires_grad=True)
    y = wp.zeros(8, dtype=wp.float16, device=device, requires_grad=True)
    seed = wp.ones(8, dtype=wp.float16, device=device)
    wp.load_module(device=device)
    with wp.Tape() as tape:
        wp.launch(fourth, 8, [x, y], device=device)
    tape.backward(grads={y: seed})
    tape.zero()
    with wp.ScopedCapture(device) as capture:
        y.grad.assign(seed)
        wp.launch(fourth, 8, [x], [y], adj_inputs=[x.grad], adjoint=True, device=device)
    tape.zero()
    for count in (1, 2, 3):
        wp.capture_launch(capture.graph)
        np.testing.assert_array_equal(x.grad.numpy(), 0.5 * count)


def test_named_gradients_are_written(device):
    x, y = (wp.full(4, 0.5, dtype=wp.float16, device=device) for _ in range(2))
    given, seed = wp.zeros_like(x), wp.ones_like(x)
    wp.launch(fourth, 4, [x], [y], [given], [seed], adjoint=True, device=device)
    np.testing.assert_array_equal(given.numpy(), 0.5)


def test_copies_between_wide_and_narrow_gradients(device):
    x = wp.ones(3, dtype=wp.float16, device=device, requires_grad=True)
    y = wp.zeros(3, dtype=wp.float16, device=device, requires_grad=True, grad_dtype=wp.float32)
    for source, target in ((x, y), (y, x)):
        source.grad.fill_(1.0)
        target.grad.zero_()
        with wp.Tape() as tape:
            wp.copy(target, source)
        tape.backward(grads={target: wp.full(3, 2.0, dtype=wp.float32, device=device)})
        np.testing.assert_array_equal(source.grad.numpy(), 3.0)


def test_second_derivatives(device):
    """d/dx of the sum of x^4 twice, 12 x^2, and its tangent, in 16 bits."""

    def function(x):
        y = wp.zeros(x.shape, dtype=wp.float16, device=device, requires_grad=True)
        wp.launch(fourth, x.size, [x, y], device=device)
        return y

    x = wp.array([0.5, 1.0, 2.0], dtype=wp.float16, device=device, requires_grad=True)
    ones = wp.ones(3, dtype=wp.float16, device=device)
    tangent = wp.autograd.jvp(function, inputs=[x], tangents=[ones])
    np.testing.assert_array_equal(tangent.numpy(), [0.5, 4, 32])
    product = wp.autograd.hvp(lambda x: total(function(x)), inputs=[x], vectors=[ones])
    np.testing.assert_array_equal(product.numpy(), [3, 12, 48])


@wp.kernel
def add_up(y: wp.array(dtype=wp.float16), e: wp.array(dtype=float)):
    wp.atomic_add(e, 0, float(y[wp.tid()]))


def total(y):
    e = wp.zeros(1, dtype=float, device=y.device, requires_grad=True)
    wp.launch(add_up, y.size, [y, e], device=y.device)
    return e


@wp.kernel
def invert(x: wp.array(dtype=wp.bfloat16), y: wp.array(dtype=wp.bfloat16)):
    i = wp.tid()
    y[i] = wp.bfloat16(1.0) / x[i]


def test_what_is_not_finite_is_found(device):
    x = wp.array([1.0, 0.0], dtype=wp.bfloat16, device=device, requires_grad=True)
    y = wp.zeros(2, dtype=wp.bfloat16, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(invert, 2, [x, y], device=device)
    seed = wp.ones(2, dtype=wp.bfloat16, device=device)
    with pytest.raises(RuntimeError, match=r"gradient of 'x' became -?(inf|nan) at \(?\[?1"):
        tape.backward(grads={y: seed}, check_finite=True)


@wp.kernel
def double(x: wp.array(dtype=wp.float16), y: wp.array(dtype=wp.float16)):
    i = wp.tid()
    y[i] = wp.float16(2.0) * x[i]


def test_many_passes_of_one_kernel(device):
    """Gradients of 16 bits are widened in every pass, not in the first alone."""
    x = wp.full(15, 0.5, dtype=wp.float16, device=device, requires_grad=True)
    y = wp.zeros_like(x)
    for count in range(1, 5):
        with wp.Tape() as tape:
            wp.launch(double, 15, [x, y], device=device)
        tape.backward(grads={y: wp.ones(15, dtype=wp.float16, device=device)})
        np.testing.assert_array_equal(x.grad.numpy(), np.full(15, 2.0 * count))
