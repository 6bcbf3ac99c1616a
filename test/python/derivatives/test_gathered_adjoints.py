"""Adjoints of stencils: the same as of any kernel, but without atomic additions."""

import numpy as np
import pytest

import warp as wp
from stencil_programs import REAL, check, compiled

RNG = np.random.default_rng(3)


def zeros_like(*arrays):
    return [np.zeros_like(a) for a in arrays]


LINE = """
@wp.kernel
def kernel(x: A1, y: A1, n: int):
    i = wp.tid()
    if i > 0 and i < n - 1:
        y[i] = x[i - 1] * R(0.5) - x[i] + R(2.0) * x[i + 1]
"""
CROSS = """
@wp.kernel
def kernel(x: A2, y: A2, n: int, m: int):
    i, j = wp.tid()
    if i > 0 and j > 0 and i < n - 1 and j < m - 1:
        around = x[i - 1, j] + x[i + 1, j] + x[i, j - 1] + x[i, j + 1]
        y[i, j] = x[i, j] + R(0.2) * (around - R(4.0) * x[i, j])
"""
BOX = """
@wp.kernel
def kernel(x: A2, y: A2, n: int, m: int):
    i, j = wp.tid()
    if i == 0 or j == 0 or i >= n - 1 or j >= m - 1:
        return
    s = R(0.0)
    for a in range(3):
        for b in range(3):
            s += R(a * 3 + b) * x[i + a - 1, j + b - 1]
    y[i, j] = s
"""
SEVEN = """
@wp.kernel
def kernel(x: A3, y: A3, c: R):
    i, j, k = wp.tid()
    if i < 1 or j < 1 or k < 1:
        return
    if i >= x.shape[0] - 1 or j >= x.shape[1] - 1 or k >= x.shape[2] - 1:
        return
    s = x[i - 1, j, k] + x[i + 1, j, k] + x[i, j - 1, k] + x[i, j + 1, k]
    y[i, j, k] = x[i, j, k] + c * (s + x[i, j, k - 1] + x[i, j, k + 1] - R(6.0) * x[i, j, k])
"""
CUBE = """
@wp.kernel
def kernel(x: A3, y: A3):
    i, j, k = wp.tid()
    s = R(0.0)
    for a in range(3):
        for b in range(3):
            for c in range(3):
                s += R(1 + a + 2 * b - c) * x[i + a, j + b, k + c]
    y[i, j, k] = s
"""
NONLINEAR = """
@wp.kernel
def kernel(x: A2, y: A2, c: R):
    i, j = wp.tid()
    if i >= 1 and j >= 1 and i + 1 < x.shape[0]:
        d = x[i + 1, j] - x[i - 1, j]
        y[i, j] = wp.sin(x[i, j]) * d * d + c * x[i, j - 1] * x[i, j]
"""
SIDES = """
@wp.kernel
def kernel(x: A1, y: A1, n: int):
    i = wp.tid()
    if i == 0:
        y[i] = x[i + 1] - x[i]
    else:
        if i < n - 1:
            y[i] = (x[i + 1] - x[i - 1]) * x[i]
        else:
            y[i] = x[i] * x[i] - x[i - 1]
"""
UPWIND = """
@wp.kernel
def kernel(x: A1, v: A1, y: A1, n: int):
    i = wp.tid()
    if i > 0 and i < n - 1:
        if v[i] > R(0.0):
            y[i] = v[i] * (x[i] - x[i - 1])
        else:
            y[i] = v[i] * (x[i + 1] - x[i])
"""
CHANNELS = """
@wp.kernel
def kernel(x: A4, y: A4, n: int):
    i, j, k = wp.tid()
    if i < 1 or j < 1 or k < 1:
        return
    if i >= x.shape[1] - 1 or j >= x.shape[2] - 1 or k >= x.shape[3] - 1:
        return
    y[0, i, j, k] = x[0, i + 1, j, k] - x[0, i - 1, j, k] + x[1, i, j, k + 1] * x[n, i, j, k]
    y[1, i, j, k] = x[1, i, j + 1, k] + R(2.0) * x[0, i, j - 1, k] - x[n, i, j, k - 1]
"""
LAST = """
@wp.kernel
def kernel(x: A3, y: A2):
    i, j = wp.tid()
    if i < 1 or j < 2 or i >= x.shape[0] - 1:
        return
    s = R(0.0)
    for c in range(3):
        s += R(c + 1) * (x[i - 1, j, c] + x[i + 1, j, c] * x[i, j - 2, 2 - c])
    y[i, j] = s
"""
TRANSPOSED = """
@wp.kernel
def kernel(x: A2, y: A2):
    i, j = wp.tid()
    y[i, j] = x[j, i] + R(2.0) * x[j + 1, i] - x[j, i + 2]
"""
TWO = """
@wp.kernel
def kernel(x: A1, z: A1, y: A1):
    i = wp.tid()
    y[i] = x[i] * z[i + 1] - x[i + 1] * z[i] + x[i + 2]
"""
ADDED = """
@wp.kernel
def kernel(x: A2, y: A2, w: A2, s: R):
    i, j = wp.tid()
    if i > 1:
        g = x[i - 2, j] - x[i, j + 1]
        y[i, j] = s * g
        w[i, j] += x[i, j] * R(3.0) - g
"""
UPDATED = """
@wp.kernel
def kernel(x: A1, y: A1):
    i = wp.tid()
    y[i] = R(2.0) * y[i] + x[i] - R(3.0) * x[i + 1]
"""
TWICE = """
@wp.kernel
def kernel(x: A1, y: A1):
    i = wp.tid()
    y[i] = x[i] * x[i + 1]
    y[i] = R(3.0) * x[i] - x[i + 1]
"""
BORDERS = """
@wp.kernel
def kernel(x: A1, y: A1, n: int):
    i = wp.tid()
    d = x[wp.max(i - 2, 0)] - R(2.0) * x[i] + x[wp.min(i + 1, n - 1)] * x[wp.max(i - 1, 0)]
    y[i] = x[i] + R(0.3) * d
"""
BORDERS_OF_PLANE = """
@wp.kernel
def kernel(x: A2, y: A2):
    i, j = wp.tid()
    n = x.shape[0] - 1
    m = x.shape[1] - 1
    s = x[wp.max(i - 1, 0), j] * x[wp.min(i + 1, n), j] + x[i, wp.min(wp.max(j - 1, 0), m)]
    y[i, j] = s - x[wp.max(wp.min(i + 1, n), 0), wp.max(wp.min(j + 2, m), 0)]
"""
# Most threads are beyond a bound.
MOSTLY_OUT = """
@wp.kernel
def kernel(x: A1, y: A1, low: int, high: int):
    i = wp.tid()
    y[i] = x[wp.min(wp.max(i + 1, low), high)] + R(2.0) * x[i]
"""


PERIODIC_LINE = """
@wp.kernel
def kernel(x: A1, y: A1, n: int):
    i = wp.tid()
    y[i] = x[(i + n - 1) % n] - R(2.0) * x[i % n] + R(3.0) * x[(i + 1) % n] + x[(i + 2 + n) % n]
"""
# The rest of a division of a number below zero is one, too, which counts from the end.
PERIODIC_PLANE = """
@wp.kernel
def kernel(x: A2, y: A2):
    i, j = wp.tid()
    n = x.shape[0]
    y[i, j] = x[(i + 1) % n, (j - 1) % 7] - x[(i - 2) % n, (j + 6) % 7] + R(2.0) * x[i, j]
"""


@pytest.mark.parametrize("n", [1, 2, 3, 9])
@pytest.mark.parametrize("threads", [1, 2, 3, 9])
def test_periodic_line(device, n, threads):
    x = RNG.normal(size=9)
    kernel = check(PERIODIC_LINE, threads, [x, np.zeros(9)], [n], device, gathered=None)
    assert kernel.derivatives.last_adjoint().gathered is not None


@pytest.mark.parametrize("shape", [(2, 7), (5, 7), (6, 7)])
def test_periodic_plane(device, shape):
    x = RNG.normal(size=shape)
    kernel = check(PERIODIC_PLANE, shape, [x, *zeros_like(x)], [], device, gathered=None)
    assert kernel.derivatives.last_adjoint().gathered is not None


@pytest.mark.parametrize("n", [1, 2, 3, 9])
def test_clamped_line(device, n):
    x = RNG.normal(size=n)
    kernel = check(BORDERS, n, [x, *zeros_like(x)], [n], device, gathered=None)
    assert kernel.derivatives.last_adjoint().gathered is not None


@pytest.mark.parametrize("shape", [(1, 1), (1, 4), (5, 2), (6, 7)])
def test_clamped_plane(device, shape):
    x = RNG.normal(size=shape)
    kernel = check(BORDERS_OF_PLANE, shape, [x, *zeros_like(x)], [], device, gathered=None)
    assert kernel.derivatives.last_adjoint().gathered is not None


@pytest.mark.parametrize("low, high", [(0, 7), (3, 3), (7, 2), (0, 0), (6, 7)])
def test_bounds_that_most_threads_are_beyond(device, low, high):
    x = RNG.normal(size=8)
    check(MOSTLY_OUT, 8, [x, *zeros_like(x)], [low, high], device, gathered=None)


@pytest.mark.parametrize("threads", [1, 2, 5, 9])
@pytest.mark.parametrize("n", [2, 3, 9])
def test_line(device, threads, n):
    x = RNG.normal(size=9)
    check(LINE, threads, [x, *zeros_like(x)], [n], device)


@pytest.mark.parametrize("n", [2**31 - 1, 2**30 + 1, 0, -5, 1 - 2**31])
def test_bounds_of_any_size(device, n):
    x = RNG.normal(size=9)
    check(LINE, 8, [x, *zeros_like(x)], [n], device)


@pytest.mark.parametrize("source", [CROSS, BOX])
@pytest.mark.parametrize("dims", [(6, 5), (3, 5), (1, 1), (6, 9), (11, 2)])
def test_grid(device, source, dims):
    x = RNG.normal(size=(6, 5))
    check(source, dims, [x, *zeros_like(x)], x.shape, device)


def test_block_of_seven_points(device):
    x = RNG.normal(size=(4, 3, 5))
    check(SEVEN, (4, 3, 5), [x, *zeros_like(x)], [0.3], device)


def test_block_of_27_points(device):
    x = RNG.normal(size=(4, 3, 5))
    check(CUBE, (2, 1, 3), [x, np.zeros((2, 1, 3))], [], device)


@pytest.mark.parametrize("n", [0, 1, 2, -1])
@pytest.mark.parametrize("dims", [(4, 3, 5), (3, 2, 4)])
def test_fixed_first_index(device, n, dims):
    x = RNG.normal(size=(3, 4, 3, 5))
    check(CHANNELS, dims, [x, *zeros_like(x)], [n], device)


@pytest.mark.parametrize("dims", [(5, 4), (2, 3)])
def test_fixed_last_index(device, dims):
    x = RNG.normal(size=(5, 4, 3))
    check(LAST, dims, [x, np.zeros((5, 4))], [], device)


@pytest.mark.parametrize("dims", [(5, 4), (5, 2), (2, 4)])
def test_values_that_depend_on_the_thread(device, dims):
    x = RNG.normal(size=(5, 4))
    check(NONLINEAR, dims, [x, *zeros_like(x)], [0.7], device)


@pytest.mark.parametrize("n", [2, 3, 7])
def test_branches_on_both_sides(device, n):
    x = RNG.normal(size=n)
    check(SIDES, n, [x, *zeros_like(x)], [n], device)


def test_branches_on_data(device):
    x, v = RNG.normal(size=(2, 8))
    check(UPWIND, 8, [x, v, *zeros_like(x)], [8], device)


def test_transposed(device):
    x = RNG.normal(size=(6, 7))
    check(TRANSPOSED, (5, 4), [x, np.zeros((5, 4))], [], device)


def test_gradients_of_two_arrays(device):
    x, z = RNG.normal(size=(2, 8))
    check(TWO, 6, [x, z, np.zeros(6)], [], device)


def test_results_that_are_added_to(device):
    x, y, w = RNG.normal(size=(3, 5, 4))
    check(ADDED, (5, 3), [x, y, w], [0.5], device)


def test_result_that_is_also_read(device):
    x, y = RNG.normal(size=6), RNG.normal(size=5)
    check(UPDATED, 5, [x, y], [], device)


def test_result_written_twice(device):
    x = RNG.normal(size=6)
    check(TWICE, 5, [x, np.zeros(5)], [], device, gathered=False)


# Where a thread may add to an element that its index does not tell, or the values of other threads
# cannot be had, additions stay atomic.
WRAPPED = """
@wp.kernel
def kernel(x: A1, y: A1):
    i = wp.tid()
    y[i] = x[i - 1] * R(2.0) + x[i]
"""
PERIODIC = """
@wp.kernel
def kernel(x: A1, y: A1, n: int):
    i = wp.tid()
    y[i] = x[(i + n - 1) % n] * x[(i + 1) % n]
"""
CLAMPED = """
@wp.kernel
def kernel(x: A1, y: A1, n: int):
    i = wp.tid()
    y[i] = x[wp.max(i - 1, 0)] + x[i] * x[wp.min(i + 1, n - 1)]
"""
STRIDED = """
@wp.kernel
def kernel(x: A1, y: A1):
    i = wp.tid()
    y[i] = x[2 * i] + x[2 * i + 1] * x[i]
"""
HALF_GUARDED = """
@wp.kernel
def kernel(x: A1, y: A1):
    i = wp.tid()
    if i != 1:
        y[i] = x[i - 1] + x[i]
"""
DIAGONAL = """
@wp.kernel
def kernel(x: A2, y: A2):
    i, j = wp.tid()
    y[i, j] = x[i, i] + x[j, j + 1]
"""
TURNED = """
@wp.kernel
def kernel(x: A2, y: A2):
    i, j = wp.tid()
    y[i, j] = x[i, j] - x[j, i]
"""


@pytest.mark.parametrize("source", [WRAPPED, PERIODIC, CLAMPED, STRIDED, HALF_GUARDED])
def test_elements_that_an_index_does_not_tell(device, source):
    x = RNG.normal(size=14 if source is STRIDED else 7)
    scalars = [7] if "n: int" in source else []
    check(source, 7, [x, np.zeros(7)], scalars, device, gathered=False)


@pytest.mark.parametrize("source", [DIAGONAL, TURNED])
def test_dimensions_that_do_not_correspond(device, source):
    x = RNG.normal(size=(5, 5))
    check(source, (4, 4), [x, np.zeros((4, 4))], [], device, gathered=False)


LOSS = """
@wp.kernel
def kernel(x: A1, loss: A1):
    i = wp.tid()
    d = x[i + 1] - x[i]
    wp.atomic_add(loss, 0, d * d)
"""


def test_one_result(device):
    x = RNG.normal(size=40)
    check(LOSS, 39, [x, np.zeros(1)], [], device)


def test_more_launch_dimensions_than_indices(device):
    kernel = compiled(UPDATED.replace("R(2.0) * y[i] + ", ""))
    x = wp.zeros(6, dtype=REAL, device=device, requires_grad=True)
    y = wp.zeros(5, dtype=REAL, device=device, requires_grad=True)
    y.grad.fill_(1.0)
    wp.launch(kernel, (5, 1), [x, y], adjoint=True, device=device)
    assert x.grad.numpy().tolist() == [1.0, -2.0, -2.0, -2.0, -2.0, -3.0]
    assert not y.grad.numpy().any()


def test_gradients_that_share_memory(device):
    kernel = compiled(TWO)
    x, z = (wp.array(RNG.normal(size=8), dtype=REAL, device=device) for _ in range(2))
    y = wp.zeros(6, dtype=REAL, device=device, requires_grad=True)
    one = wp.zeros(8, dtype=REAL, device=device)
    y.grad.fill_(1.0)
    wp.launch(kernel, 6, [x, z, y], adj_inputs=[one, one, y.grad], adjoint=True, device=device)
    a, b = x.numpy(), z.numpy()
    wanted = np.zeros(8)
    wanted[:6] += b[1:7]
    wanted[1:7] -= b[:6]
    wanted[2:8] += 1.0
    wanted[1:7] += a[:6]
    wanted[:6] -= a[1:7]
    np.testing.assert_allclose(one.numpy(), wanted, rtol=1e-12)


def test_second_derivatives(device):
    x = wp.array(RNG.normal(size=6), dtype=REAL, device=device, requires_grad=True)
    kernel = compiled(LOSS)

    def total(x):
        loss = wp.zeros(1, dtype=REAL, device=device, requires_grad=True)
        wp.launch(kernel, 5, [x, loss], device=device)
        return loss

    vector = RNG.normal(size=6)
    given = wp.array(vector, dtype=REAL, device=device)
    slope = np.diff(np.eye(6), axis=0)
    product = wp.autograd.hvp(total, inputs=[x], vectors=[given])
    np.testing.assert_allclose(product.numpy(), 2.0 * slope.T @ slope @ vector, rtol=1e-12)


def test_replayed_in_a_graph(device):
    kernel = compiled(LINE)
    x = wp.array(RNG.normal(size=9), dtype=REAL, device=device, requires_grad=True)
    y = wp.zeros(9, dtype=REAL, device=device, requires_grad=True)

    def backward():
        wp.launch(kernel, 9, [x, y, 9], adjoint=True, device=device)

    backward()
    with wp.ScopedCapture(device) as capture:
        backward()
    x.grad.zero_()
    for _ in range(3):
        y.grad.fill_(1.0)
        wp.capture_launch(capture.graph)
    wanted = 3.0 * np.array([0.5, -0.5] + [1.5] * 5 + [1.0, 2.0])
    np.testing.assert_allclose(x.grad.numpy(), wanted, rtol=1e-14)
    assert y.grad.numpy().tolist() == [1.0] + [0.0] * 7 + [1.0]


def test_debug_mode_leaves_the_adjoint_whole(device, monkeypatch):
    monkeypatch.setattr(wp.config, "mode", "debug")
    x = RNG.normal(size=9)
    check(LINE, 9, [x, *zeros_like(x)], [9], device, gathered=False)
