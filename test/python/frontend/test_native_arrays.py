"""`wp.func_native` with arrays: what snippets see, gradients, and what is refused."""

import math

import numpy as np
import pytest

import warp as wp

pytestmark = pytest.mark.usefixtures("native_device")


def array(values, dtype=float, **options):
    return wp.array(values, dtype=dtype, **options)


@wp.func_native(
    "out[tid] = a * x[tid] + y[tid];",
    """
    adj_a += x[tid] * adj_out[tid];
    adj_x[tid] += a * adj_out[tid];
    adj_y[tid] += adj_out[tid];
    """,
)
def saxpy(
    a: wp.float32,
    x: wp.array[wp.float32],
    y: wp.array[wp.float32],
    out: wp.array[wp.float32],
    tid: int,
): ...


@wp.kernel
def call_saxpy(
    a: wp.array(dtype=float),
    x: wp.array(dtype=float),
    y: wp.array(dtype=float),
    out: wp.array(dtype=float),
):
    saxpy(2.0 * a[0], x, y, out, wp.tid())


@pytest.mark.parametrize("count", [1, 7, 128, 100_000])
def test_values_and_gradients(count):
    rng = np.random.default_rng(count)
    a = array([1.5], requires_grad=True)
    x, y = (array(rng.random(count, np.float32), requires_grad=True) for _ in range(2))
    out = wp.zeros(count, dtype=float, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(call_saxpy, count, [a, x, y], [out])
    exact = 3.0 * x.numpy().astype(np.float64) + y.numpy()
    np.testing.assert_allclose(out.numpy(), exact, rtol=2e-7)
    seed = rng.random(count, np.float32)
    tape.backward(grads={out: array(seed)})
    np.testing.assert_allclose(x.grad.numpy(), 3.0 * seed, rtol=2e-7)
    np.testing.assert_array_equal(y.grad.numpy(), seed)
    total = 2.0 * np.dot(x.numpy().astype(np.float64), seed)
    np.testing.assert_allclose(a.grad.numpy(), [total], rtol=1e-5)


def test_arrays_without_gradients_are_zeros_that_nobody_reads():
    a, x = array([1.0]), array([1.0, 2.0, 3.0], requires_grad=True)
    y, out = array([0.0] * 3), wp.zeros(3, dtype=float, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(call_saxpy, 3, [a, x, y], [out])
    tape.backward(grads={out: array([1.0, 10.0, 100.0])})
    assert x.grad.numpy().tolist() == [2.0, 20.0, 200.0]
    assert y.grad is None


@wp.func_native(
    """
    for (int j = 0; j < m.shape[1]; ++j)
      wp::index(sums, i) += *wp::address(m, i, j);
    wp::array_store(m, i, 0, wp::load(wp::address(m, i, m.shape[1] - 1)));
    auto row = wp::view(m, i);
    wp::store(row.data, row.data[0] + float(m.ndim * 1000 + row.ndim * 100 + m.strides[1]));
    """
)
def row_sum(m: wp.array2d(dtype=float), sums: wp.array(dtype=wp.float64), i: int): ...


@wp.kernel
def row_sums(m: wp.array2d(dtype=float), sums: wp.array(dtype=wp.float64)):
    row_sum(m, sums, wp.tid())


def test_shape_strides_and_helpers():
    values = np.arange(24.0, dtype=np.float32).reshape(4, 6)
    whole = array(values)
    part = whole[::2, 1::2]
    sums = wp.zeros(2, dtype=wp.float64)
    wp.launch(row_sums, 2, [part, sums])
    chosen = values[::2, 1::2]
    assert sums.numpy().tolist() == chosen.sum(axis=1).tolist()
    expected = values.copy()
    # Two dimensions, a row of one, eight bytes from column to column.
    expected[::2, 1] = chosen[:, -1] + 2108
    np.testing.assert_array_equal(whole.numpy(), expected)


@wp.func_native(
    """
    wp::vec3 shifted = x[i] + 2.0f * wp::vec3(1.0f, 0.0f, -1.0f);
    out[i] = shifted;
    m[i][1][0] += wp::dot(shifted, shifted);
    return shifted[0] > 3.0f;
    """
)
def shift(
    x: wp.array(dtype=wp.vec3), out: wp.array(dtype=wp.vec3), m: wp.array(dtype=wp.mat22), i: int
) -> wp.bool: ...


@wp.kernel
def shifts(
    x: wp.array(dtype=wp.vec3),
    out: wp.array(dtype=wp.vec3),
    m: wp.array(dtype=wp.mat22),
    big: wp.array(dtype=wp.bool),
):
    i = wp.tid()
    big[i] = shift(x, out, m, i)


def test_elements_of_several_numbers_and_a_result():
    values = np.arange(30.0, dtype=np.float32).reshape(10, 3)
    out, m = wp.zeros(10, dtype=wp.vec3), wp.zeros(10, dtype=wp.mat22)
    big = wp.zeros(10, dtype=wp.bool)
    wp.launch(shifts, 10, [array(values, wp.vec3), out, m, big])
    shifted = values + np.float32([2.0, 0.0, -2.0])
    np.testing.assert_array_equal(out.numpy(), shifted)
    np.testing.assert_allclose(m.numpy()[:, 1, 0], (shifted**2).sum(axis=1), rtol=1e-6)
    assert big.numpy().tolist() == (shifted[:, 0] > 3).tolist()


@wp.func_native("slots[tid] = atomicAdd(counter.data, 1);", replay_snippet="")
def count(counter: wp.array(dtype=int), slots: wp.array(dtype=int), tid: int): ...


@wp.kernel
def by_slot(
    x: wp.array(dtype=float),
    counter: wp.array(dtype=int),
    slots: wp.array(dtype=int),
    out: wp.array(dtype=float),
):
    i = wp.tid()
    count(counter, slots, i)
    j = slots[i]
    out[j] = x[j] ** 2.0


def test_atomic_updates_and_replay():
    x = array(np.arange(16.0), requires_grad=True)
    counter, slots = (wp.zeros(n, dtype=int) for n in (1, 16))
    out = wp.zeros(16, dtype=float, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(by_slot, 16, [x, counter, slots], [out])
    assert sorted(slots.numpy().tolist()) == list(range(16)) and counter.numpy()[0] == 16
    tape.backward(grads={out: wp.ones(16, dtype=float)})
    np.testing.assert_allclose(x.grad.numpy(), 2.0 * np.arange(16.0), rtol=1e-5)
    assert counter.numpy()[0] == 16, "the replay must not count again"


@wp.func_native("y[tid] = powf(x[tid], 2.0f);", "adj_x[tid] += 2.0f * x[tid] * adj_y[tid];")
def square(x: wp.array[float], y: wp.array[float], tid: int): ...


@wp.kernel
def log_of_square(x: wp.array[float], y: wp.array[float], z: wp.array[float]):
    tid = wp.tid()
    square(x, y, tid)
    z[tid] = wp.log(y[tid])


def test_a_kernel_reads_what_native_code_wrote():
    x = array(1.0 + np.arange(8.0), requires_grad=True)
    y, z = wp.zeros_like(x), wp.zeros_like(x)
    with wp.Tape() as tape:
        wp.launch(log_of_square, 8, [x, y], [z])
    np.testing.assert_allclose(z.numpy(), 2.0 * np.log(1.0 + np.arange(8.0)), rtol=1e-6)
    tape.backward(grads={z: wp.ones_like(x)})
    np.testing.assert_allclose(x.grad.numpy(), 2.0 / (1.0 + np.arange(8.0)), rtol=1e-6)


@wp.func_native(
    """
    double u = x[i];
    y[i] = sin(u) + exp(-u) * log1p(u) + pow(u, 1.5) + cbrt(u) + erf(u) + atan2(u, 2.0);
    """
)
def libm(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64), i: int): ...


@wp.func_native("y[i] += cos(x[i]) - sin(x[i]);")
def more_libm(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64), i: int): ...


@wp.kernel
def calls_libm(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
    libm(x, y, wp.tid())
    more_libm(x, y, wp.tid())


def test_functions_of_the_c_library():
    u = np.linspace(0.1, 3.0, 50)
    y = wp.zeros(50, dtype=wp.float64)
    wp.launch(calls_libm, 50, [array(u, wp.float64), y])
    erf = np.array([math.erf(one) for one in u])
    exact = np.cos(u) + np.exp(-u) * np.log1p(u) + u**1.5 + np.cbrt(u) + erf + np.arctan2(u, 2.0)
    np.testing.assert_allclose(y.numpy(), exact, rtol=1e-14)


def refused(kernel, *arguments):
    with pytest.raises(wp.WarpError) as problem:
        wp.launch(kernel, 1, arguments)
        wp.synchronize()
    return str(problem.value)


def test_what_cannot_be_passed():
    @wp.func_native("return;")
    def halves(x: wp.array(dtype=wp.float16)): ...

    @wp.func_native("not_there(x);")
    def broken(x: wp.array(dtype=float)): ...

    @wp.kernel
    def passes(x: wp.array(dtype=wp.float16)):
        halves(x)

    @wp.kernel
    def breaks(x: wp.array(dtype=float)):
        broken(x)

    message = refused(passes, wp.zeros(1, dtype=wp.float16))
    assert "whose 'x' C++ has no type for" in message and "halves(x)" in message
    message = refused(breaks, wp.zeros(1, dtype=float))
    assert "not_there" in message and ("broken:1" in message or "broken(1)" in message)
    assert "called from 'breaks' at" in message and "test_native_arrays.py" in message


def test_no_adjoint_is_an_error_and_no_zero():
    @wp.func_native("y[0] = x[0];")
    def assign(x: wp.array(dtype=float), y: wp.array(dtype=float)): ...

    @wp.kernel
    def assigns(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        assign(x, y)

    x, y = array([1.0], requires_grad=True), array([0.0], requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(assigns, 1, [x], [y])
    assert y.numpy()[0] == 1.0
    with pytest.raises(RuntimeError, match="native code with arrays has no derivative"):
        tape.backward(grads={y: array([1.0])})
        wp.synchronize()


def test_the_tape_knows_what_native_code_may_change():
    @wp.kernel
    def product(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = x[i] * x[i]

    a, x = array([1.0]), array([1.0, 2.0], requires_grad=True)
    y = wp.zeros(2, dtype=float, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(product, 2, [x], [y])
        wp.launch(call_saxpy, 2, [a, y, array([0.0, 0.0])], [x])
    tape.backward(grads={x: array([1.0, 1.0])})
    # dx/dy = 2, dy/dx = 2 x with the x of before, which the tape has kept.
    np.testing.assert_allclose(x.numpy(), [2.0, 8.0])
    # The adjoint leaves the seed where it is, as that of NVIDIA Warp does.
    np.testing.assert_allclose(x.grad.numpy(), [1.0 + 2.0 * 2.0, 1.0 + 4.0 * 2.0])
