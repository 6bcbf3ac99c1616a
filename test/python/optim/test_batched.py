"""Optimisers of many small problems: minima, Jacobians, rows on their own, runs that repeat."""

import numpy as np
import pytest

import warp as wp
from warp.optim import LBFGS, BatchedLBFGS, BatchedLevenbergMarquardt


@wp.kernel
def rosenbrock(x: wp.array2d(dtype=wp.float64), loss: wp.array(dtype=wp.float64)):
    i = wp.tid()
    a = wp.float64(1.0) - x[i, 0]
    b = x[i, 1] - x[i, 0] * x[i, 0]
    loss[i] = a * a + wp.float64(100.0) * b * b


@wp.kernel
def decay(
    t: wp.array(dtype=wp.float64),
    y: wp.array2d(dtype=wp.float64),
    x: wp.array2d(dtype=wp.float64),
    r: wp.array2d(dtype=wp.float64),
):
    i, k = wp.tid()
    r[i, k] = x[i, 0] * wp.exp(-x[i, 1] * t[k]) + x[i, 2] - y[i, k]


def valley(device, start):
    x = wp.array(start, dtype=wp.float64, device=device, requires_grad=True)
    loss = wp.zeros(len(start), dtype=wp.float64, device=device, requires_grad=True)

    def closure():
        with wp.Tape() as tape:
            wp.launch(rosenbrock, len(start), [x], [loss], device=device)
        tape.backward(grads={loss: wp.ones_like(loss)})
        return loss

    return x, closure


def test_rows_find_their_minima(device):
    start = np.random.default_rng(0).uniform(-2, 2, (200, 2))
    x, closure = valley(device, start)
    solver = BatchedLBFGS(x)
    losses = solver.step(closure, 200).numpy()
    np.testing.assert_allclose(x.numpy(), 1.0, atol=1e-6)
    assert losses.max() < 1e-12
    assert (solver.status.numpy() == 1).all()


def test_a_row_does_not_know_of_others(device):
    start = np.random.default_rng(1).uniform(-2, 2, (8, 2))
    x, closure = valley(device, start)
    BatchedLBFGS(x).step(closure, 25)
    alone, closure = valley(device, start[5:6])
    BatchedLBFGS(alone).step(closure, 25)
    np.testing.assert_array_equal(x.numpy()[5], alone.numpy()[0])


def test_rows_without_a_finite_loss_stay(device):
    x, closure = valley(device, [[np.nan, 0.0], [0.5, 0.5]])
    solver = BatchedLBFGS(x)
    solver.step(closure, 100)
    np.testing.assert_allclose(x.numpy()[1], 1.0, atol=1e-6)
    assert np.isnan(x.numpy()[0, 0]) and solver.status.numpy().tolist() == [2, 1]


def fits(device, dtype=wp.float64, rows=50):
    rng = np.random.default_rng(2)
    true = rng.uniform([0.5, 0.3, -1.0], [2.0, 2.0, 1.0], (rows, 3))
    t = np.linspace(0.0, 3.0, 12)
    y = true[:, :1] * np.exp(-true[:, 1:2] * t) + true[:, 2:]
    make = {"dtype": wp.float64, "device": device}
    x = wp.array(np.tile([1.0, 1.0, 0.0], (rows, 1)), requires_grad=True, **make)
    r = wp.zeros((rows, 12), requires_grad=True, **make)
    inputs = [wp.array(t, **make), wp.array(y, **make), x]
    return x, r, true, lambda: wp.launch(decay, (rows, 12), inputs, [r], device=device)


def test_levenberg_and_marquardt_fit(device):
    x, r, true, forward = fits(device)
    losses = BatchedLevenbergMarquardt(x, r).step(forward, 30).numpy()
    np.testing.assert_allclose(x.numpy(), true, rtol=1e-6, atol=1e-8)
    assert losses.max() < 1e-15


def test_gauss_and_newton_solve_linear_problems_in_one_step(device):
    @wp.kernel
    def linear(x: wp.array2d(dtype=wp.float64), r: wp.array2d(dtype=wp.float64)):
        i = wp.tid()
        r[i, 0] = x[i, 0] + wp.float64(2.0) * x[i, 1] - wp.float64(i)
        r[i, 1] = x[i, 0] - x[i, 1]
        r[i, 2] = wp.float64(3.0) * x[i, 1] - wp.float64(1.0)

    x = wp.zeros((4, 2), dtype=wp.float64, device=device, requires_grad=True)
    r = wp.zeros((4, 3), dtype=wp.float64, device=device, requires_grad=True)
    solver = BatchedLevenbergMarquardt(x, r, damping=0.0)
    solver.step(lambda: wp.launch(linear, 4, [x], [r], device=device), 1)
    a = np.array([[1.0, 2.0], [1.0, -1.0], [0.0, 3.0]])
    for i in range(4):
        expected = np.linalg.lstsq(a, np.array([i, 0.0, 1.0]))[0]
        np.testing.assert_allclose(x.numpy()[i], expected, rtol=1e-12)


def test_singular_normal_matrices_keep_what_is_known(device):
    @wp.kernel
    def half(x: wp.array2d(dtype=wp.float64), r: wp.array2d(dtype=wp.float64)):
        r[wp.tid(), 0] = x[wp.tid(), 0] - wp.float64(3.0)

    x = wp.zeros((2, 2), dtype=wp.float64, device=device, requires_grad=True)
    r = wp.zeros((2, 1), dtype=wp.float64, device=device, requires_grad=True)
    forward = lambda: wp.launch(half, 2, [x], [r], device=device)  # noqa: E731
    BatchedLevenbergMarquardt(x, r).step(forward, 25)
    np.testing.assert_allclose(x.numpy(), [[3.0, 0.0]] * 2, atol=1e-8)


def test_wrong_problems_are_refused():
    x = wp.zeros((2, 3), dtype=float, device="cpu")
    with pytest.raises(ValueError, match="no gradient"):
        BatchedLBFGS(x)
    x.requires_grad = True
    with pytest.raises(ValueError, match="each of 2 rows"):
        BatchedLBFGS(x).step(lambda: 1.0, 1)
    with pytest.raises(ValueError, match=r"\(2, m\)"):
        BatchedLevenbergMarquardt(x, wp.zeros((3, 1), dtype=float, device="cpu"))


@wp.kernel
def spread(
    x: wp.array2d(dtype=float), target: wp.array2d(dtype=float), loss: wp.array(dtype=float)
):
    i, j = wp.tid()
    d = wp.sin(x[i, j]) - target[i, j]
    wp.atomic_add(loss, 0, d * d)


# One sum over all threads has one order, so that optimisers take the same way in every run.
def test_runs_repeat():
    rng = np.random.default_rng(3)
    start = rng.normal(size=(256, 6)).astype(np.float32)
    target = wp.array(rng.uniform(-1, 1, (256, 6)), dtype=float, device="cpu")
    ways = set()
    for _ in range(4):
        x = wp.array(start, dtype=float, device="cpu", requires_grad=True)
        loss = wp.zeros(1, dtype=float, device="cpu", requires_grad=True)

        def closure(x=x, loss=loss):
            loss.zero_()
            with wp.Tape() as tape:
                wp.launch(spread, x.shape, [x, target, loss], device="cpu")
            tape.backward(loss)
            return loss

        LBFGS([x], max_iter=30).step(closure)
        ways.add(x.numpy().tobytes())
    assert len(ways) == 1


@wp.kernel
def long_terms(x: wp.array(dtype=float), total: wp.array(dtype=float)):
    v = x[wp.tid()]
    for _ in range(40):
        v = wp.sin(v) + 0.3 * wp.cos(v)
    wp.atomic_add(total, 0, v)


def test_sums_of_short_launches_of_many_operations_repeat():
    """Vectors do in some tens of microseconds what is a launch for several threads without them."""
    x = np.random.default_rng(0).normal(size=8192)
    x = wp.array(x, dtype=float, device="cpu")
    found = set()
    for _ in range(400):
        total = wp.zeros(1, dtype=float, device="cpu")
        wp.launch(long_terms, x.size, [x, total], device="cpu")
        found.add(total.numpy().item())
    assert len(found) == 1
