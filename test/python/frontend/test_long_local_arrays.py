"""Arrays of a thread with many elements, and long vectors and matrices, indexed at run time."""

import numpy as np
import pytest

import warp as wp
from autodiff_programs import Dual, Functions
from frontend_programs import define
from local_array_programs import make_program
from random_runs import seeds

KERNEL = """
@wp.kernel
def kernel(x: wp.array(dtype=R), q: wp.array(dtype=int), m: int, p: int, out: wp.array(dtype=R)):
    i = wp.tid()
    out[i] = program(x[i], q[i], m, p)

@wp.func
def program(x: R, q0: int, m: int, p: int):
    a = wp.zeros(shape=({0},), dtype=R)
    b = wp.zeros(shape=({1},), dtype=R)
{2}"""
PYTHON = """
def program(x, q0, m, p):
    a, b = [R(0.0)] * {0}, [R(0.0)] * {1}
{2}"""
THREADS = 21


@pytest.mark.parametrize("seed", seeds(16))
def test_random_programs_have_the_values_and_gradients_of_python(seed):
    body, sizes = make_program(seed)
    plain = define(PYTHON.format(*sizes, body), wp=Functions, R=Dual)["program"]
    kernel = define(KERNEL.format(*sizes, body), R=wp.float64)["kernel"]
    random = np.random.default_rng(seed)
    x, q = random.uniform(-1.0, 1.0, THREADS), random.integers(0, 50, THREADS)
    m, p = int(random.integers(0, 6)), int(random.integers(0, 30))
    expected = [plain(Dual(u, 1.0), int(v), m, p) for u, v in zip(x, q)]
    given = wp.array(x, dtype=wp.float64, device="cpu", requires_grad=True)
    out = wp.zeros(THREADS, dtype=wp.float64, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        start = wp.array(q, dtype=int, device="cpu")
        wp.launch(kernel, THREADS, [given, start, m, p, out], device="cpu")
    tape.backward(grads={out: wp.ones_like(out)})
    close = {"rtol": 1e-9, "atol": 1e-10, "err_msg": body}
    np.testing.assert_allclose(out.numpy(), [e.value for e in expected], **close)
    np.testing.assert_allclose(given.grad.numpy(), [e.slope for e in expected], **close)


def test_arrays_that_change_places():
    @wp.kernel
    def kernel(n: int, out: wp.array(dtype=int)):
        i = wp.tid()
        a = wp.vector(0, length=12)
        b = wp.vector(0, length=12)
        for k in range(n):
            a[(i + k) % 12] += k + 1
            b, a = a, b
        out[i] = a[i % 12] * 1000 + b[(i + 3) % 12]

    def row(i, n):
        a, b = [0] * 12, [0] * 12
        for k in range(n):
            a[(i + k) % 12] += k + 1
            b, a = a, b
        return a[i % 12] * 1000 + b[(i + 3) % 12]

    for n in (0, 1, 7, 30):
        out = wp.zeros(20, dtype=int, device="cpu")
        wp.launch(kernel, 20, [n, out], device="cpu")
        assert out.numpy().tolist() == [row(i, n) for i in range(20)]


def test_copies_are_values():
    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        i = wp.tid()
        a = wp.vector(float(i), length=16)
        b = a
        for k in range(i):
            a[k] = a[(k + 1) % 16] + 1.0
            if k == 2:
                b = a
        out[i] = a[i % 16] * 100.0 + b[(i // 2) % 16]

    def row(i):
        a = [float(i)] * 16
        b = list(a)
        for k in range(i):
            a[k] = a[(k + 1) % 16] + 1.0
            if k == 2:
                b = list(a)
        return a[i % 16] * 100.0 + b[(i // 2) % 16]

    out = wp.zeros(16, dtype=float, device="cpu")
    wp.launch(kernel, 16, [out], device="cpu")
    assert out.numpy().tolist() == [row(i) for i in range(16)]


def test_rows_and_components_of_long_matrices():
    matrix = wp.types.matrix(shape=(6, 5), dtype=float)

    @wp.kernel
    def kernel(m: wp.array(dtype=matrix), at: wp.array(dtype=int), out: wp.array(dtype=matrix)):
        i = wp.tid()
        x = m[i]
        r, c = at[i] % 6, at[i] % 5
        row = x[r]
        x[r, c] = row[c] * 2.0 + x[c, r % 5]
        x[c] = row
        x[-1, -2] += x[r, c]
        out[i] = x

    random = np.random.default_rng(3)
    m, at = random.normal(size=(33, 6, 5)).astype(np.float32), random.integers(0, 90, 33)
    expected = m.copy()
    for x, n in zip(expected, at):
        r, c = n % 6, n % 5
        row = x[r].copy()
        x[r, c] = row[c] * 2 + x[c, r % 5]
        x[c] = row
        x[-1, -2] += x[r, c]
    out = wp.zeros(33, dtype=matrix, device="cpu")
    given = wp.array(m, dtype=matrix, device="cpu")
    wp.launch(kernel, 33, [given, wp.array(at, dtype=int, device="cpu"), out], device="cpu")
    np.testing.assert_allclose(out.numpy(), expected, rtol=1e-6)


def test_an_index_out_of_range_touches_nothing_else():
    @wp.kernel
    def kernel(at: wp.array(dtype=int), out: wp.array2d(dtype=int)):
        i = wp.tid()
        a = wp.zeros(shape=(20,), dtype=int)
        b = wp.zeros(shape=(20,), dtype=int)
        a[at[i]] = 7
        for k in range(20):
            out[i, 0] += a[k]
            out[i, 1] += b[k]

    at = np.array([0, 19, 20, 1000, 2**31 - 1, -1, -20, -21, -(2**31)])
    out = wp.zeros((9, 2), dtype=int, device="cpu")
    wp.launch(kernel, 9, [wp.array(at, dtype=int, device="cpu"), out], device="cpu")
    found = out.numpy()
    assert (found[:, 1] == 0).all()
    assert (found[[0, 1, 5, 6], 0] == 7).all() and np.isin(found[:, 0], [0, 7]).all()


mat66 = wp.types.matrix(shape=(6, 6), dtype=float)


@wp.kernel(enable_backward=False)
def diagonal(places: wp.array(dtype=int), damped: bool, out: wp.array(dtype=float)):
    a = mat66(0.0)
    for k in range(places.shape[0]):
        a[places[k] % 6, places[k] // 6] = float(k + 1)
    if damped:
        # Components that are read after others have changed.
        for r in range(6):
            a[r, r] += float(r) + a[r, 5 - r]
    for k in range(places.shape[0]):
        out[k] = a[places[k] // 6, places[k] % 6]


@pytest.mark.parametrize("damped", [False, True])
def test_constant_places_of_a_matrix_that_is_indexed(damped):
    order = np.random.default_rng(6).permutation(36).astype(np.int32)
    a = np.zeros((6, 6))
    a[order % 6, order // 6] = np.arange(36) + 1
    for r in range(6 if damped else 0):
        a[r, r] += r + a[r, 5 - r]
    places = wp.array(order, dtype=int)
    out = wp.zeros(36, dtype=float)
    wp.launch(diagonal, 1, [places, damped, out])
    np.testing.assert_array_equal(out.numpy(), a[order // 6, order % 6])
