"""Elements beside a thread's own, with indices that are kept inside of the array."""

import numpy as np
import pytest

import warp as wp

WIDTHS = (1, 2, 7, 15, 16, 17, 33, 64, 100)


@wp.kernel
def clamped(x: wp.array2d(dtype=float), shift: int, y: wp.array2d(dtype=float)):
    i, j = wp.tid()
    k = wp.clamp(j + shift, 0, x.shape[1] - 1)
    y[i, j] = x[wp.min(i + 1, x.shape[0] - 1), k] + 2.0 * x[i, wp.max(j - 1, 0)]


@wp.kernel
def wrapped(x: wp.array2d(dtype=wp.uint8), shift: int, y: wp.array2d(dtype=wp.uint8)):
    i, j = wp.tid()
    n = x.shape[1]
    y[i, j] = x[i, (j + shift + n) % n]


@wp.kernel
def chosen(x: wp.array2d(dtype=wp.vec3), y: wp.array2d(dtype=wp.vec3)):
    i, j = wp.tid()
    y[i, j] = x[i, wp.where(j > 0, j - 1, x.shape[1] - 1)]


@wp.kernel
def from_the_end(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
    i = wp.tid()
    y[i] = x[wp.min(i - 3, 5)]


@wp.kernel
def in_rows(x: wp.array2d(dtype=float), w: int, y: wp.array(dtype=float)):
    i = wp.tid()
    row = i // w
    column = i % w
    if (i * 7) % 5 != 0:
        y[i] = x[row, column] - x[row, wp.min(column + 1, w - 1)]


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("shift", (-2, 0, 3))
def test_clamped(width, shift):
    values = np.random.default_rng(width).random((3, width)).astype(np.float32)
    x, y = wp.array(values, dtype=float, device="cpu"), wp.zeros((3, width), device="cpu")
    wp.launch(clamped, (3, width), inputs=[x, shift, y], device="cpu")
    i, j = np.meshgrid(np.arange(3), np.arange(width), indexing="ij")
    beside = values[np.minimum(i + 1, 2), np.clip(j + shift, 0, width - 1)]
    np.testing.assert_array_equal(y.numpy(), beside + 2 * values[i, np.maximum(j - 1, 0)])


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("shift", (-1, 0, 1))
def test_wrapped(width, shift):
    values = np.random.default_rng(width).integers(0, 256, (4, width)).astype(np.uint8)
    x = wp.array(values, dtype=wp.uint8, device="cpu")
    y = wp.zeros_like(x)
    wp.launch(wrapped, (4, width), inputs=[x, shift, y], device="cpu")
    np.testing.assert_array_equal(y.numpy(), np.roll(values, -shift, 1))


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("packed", (True, False))
def test_chosen(width, packed):
    values = np.random.default_rng(width).random((3, width, 3)).astype(np.float32)
    x = wp.array(np.repeat(values, 2, 0), dtype=wp.vec3, device="cpu")[::2]
    if packed:
        x = wp.array(values, dtype=wp.vec3, device="cpu")
    y = wp.zeros((3, width), dtype=wp.vec3, device="cpu")
    wp.launch(chosen, (3, width), inputs=[x, y], device="cpu")
    np.testing.assert_array_equal(y.numpy(), np.roll(values, 1, 1))


def test_indices_from_the_end_and_from_the_start_in_one_vector():
    values = np.random.default_rng(1).random(40)
    x = wp.array(values, dtype=wp.float64, device="cpu")
    y = wp.zeros_like(x)
    wp.launch(from_the_end, 40, inputs=[x, y], device="cpu")
    np.testing.assert_array_equal(y.numpy(), values[np.minimum(np.arange(40) - 3, 5)])


@pytest.mark.parametrize("width", WIDTHS)
def test_rows_of_one_dimension_in_some_threads(width):
    values = np.random.default_rng(width).random((9, width)).astype(np.float32)
    x = wp.array(values, dtype=float, device="cpu")
    y = wp.zeros(9 * width, dtype=float, device="cpu")
    wp.launch(in_rows, 9 * width, inputs=[x, width, y], device="cpu")
    beside = values[:, np.minimum(np.arange(width) + 1, width - 1)]
    wanted = np.where(np.arange(9 * width) * 7 % 5 != 0, (values - beside).reshape(-1), 0)
    np.testing.assert_array_equal(y.numpy(), wanted.astype(np.float32))


def test_quotients_by_a_number_that_all_threads_share():
    @wp.kernel
    def signed(a: wp.array(dtype=int), n: int, q: wp.array(dtype=int), r: wp.array(dtype=int)):
        i = wp.tid()
        q[i] = a[i] // n
        r[i] = a[i] % n

    @wp.kernel
    def unsigned(
        a: wp.array(dtype=wp.uint32),
        n: wp.uint32,
        q: wp.array(dtype=wp.uint32),
        r: wp.array(dtype=wp.uint32),
    ):
        i = wp.tid()
        q[i] = a[i] / n
        r[i] = a[i] % n

    random = np.random.default_rng(3)
    divisors = [1, 2, 3, 7, 10, 641, 65535, 65536, 2**31 - 1, *random.integers(1, 2**31, 40)]
    for n in divisors:
        whole = random.integers(0, 2**32 // n, 300, endpoint=True) * n
        edges = np.concatenate([whole, whole - 1, whole + 1, random.integers(0, 2**32, 99)])
        a = np.concatenate([edges % 2**32, [0, 1, 2**31 - 1, 2**31, 2**32 - 1]]).astype(np.uint32)
        x = wp.array(a, dtype=wp.uint32, device="cpu")
        q, r = wp.zeros_like(x), wp.zeros_like(x)
        wp.launch(unsigned, len(a), inputs=[x, int(n), q, r], device="cpu")
        np.testing.assert_array_equal(q.numpy(), a // np.uint32(n))
        np.testing.assert_array_equal(r.numpy(), a % np.uint32(n))
        b = a.view(np.int32)
        x = wp.array(b, dtype=int, device="cpu")
        for m in (int(n), -int(n)):
            q, r = wp.zeros_like(x), wp.zeros_like(x)
            # The quotient that is out of range is nobody's.
            wp.launch(signed, len(b), inputs=[x, m, q, r], device="cpu")
            inside = (b != -(2**31)) | (m != -1)
            wide = b.astype(np.int64)
            rest = np.sign(wide) * (np.abs(wide) % abs(m))
            np.testing.assert_array_equal(r.numpy()[inside], rest[inside])
            np.testing.assert_array_equal((wide - r.numpy())[inside] % m, 0)


@pytest.mark.parametrize("width", WIDTHS)
def test_gradients_of_what_borders_repeat(width):
    @wp.kernel
    def around(x: wp.array2d(dtype=float), w: wp.array(dtype=float), y: wp.array2d(dtype=float)):
        i, j = wp.tid()
        s = float(0.0)
        for k in range(3):
            s += w[k] * x[i, wp.clamp(j + k - 1, 0, x.shape[1] - 1)]
        y[i, j] = s + x[(i + 1) % x.shape[0], j]

    random = np.random.default_rng(width)
    values, weights = random.random((5, width)), random.random(3)
    x = wp.array(values, dtype=float, device="cpu", requires_grad=True)
    w = wp.array(weights, dtype=float, device="cpu", requires_grad=True)
    y = wp.zeros((5, width), dtype=float, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(around, (5, width), inputs=[x, w, y], device="cpu")
    seeds = random.random((5, width))
    tape.backward(grads={y: wp.array(seeds, dtype=float, device="cpu")})
    wanted, by_weight = np.roll(seeds, 1, 0), np.zeros(3)
    for k in range(3):
        at = np.clip(np.arange(width) + k - 1, 0, width - 1)
        np.add.at(wanted, (slice(None), at), weights[k] * seeds)
        by_weight[k] = (seeds * values[:, at]).sum()
    np.testing.assert_allclose(x.grad.numpy(), wanted, rtol=1e-5)
    np.testing.assert_allclose(w.grad.numpy(), by_weight, rtol=1e-5)
