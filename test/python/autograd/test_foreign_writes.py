"""Writes of other libraries while a tape records: right gradients, or an error."""

import numpy as np
import pytest

import warp as wp
from warp.extend import errors

N = 4


@wp.kernel
def step(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i + 1] = 0.5 * x[i + 1] + 0.25 * (x[i] + x[i + 2]) * x[i + 1]


@wp.kernel
def add_up(x: wp.array(dtype=float), loss: wp.array(dtype=float)):
    wp.atomic_add(loss, 0, x[wp.tid() + 1])


def wrap(a):
    """A periodic halo: the cells beyond each end get what is at the other end."""
    a[0], a[-1] = a[-2], a[1]


def by_numpy(x, tape):
    wrap(x.numpy())


def by_parts(x, tape):
    """As messages between neighbours do."""
    np.asarray(x[0:1])[:] = np.asarray(x[N : N + 1])
    np.asarray(x[N + 1 :])[:] = np.asarray(x[1:2])


def by_torch(x, tape):
    torch = pytest.importorskip("torch")
    with torch.no_grad():
        wrap(wp.to_torch(x, requires_grad=False))


def by_copies(x, tape):
    wp.copy(x[0:1], x[N : N + 1])
    wp.copy(x[N + 1 :], x[1:2])


def way_back(x):
    g = x.grad.numpy()
    g[N] += g[0]
    g[1] += g[N + 1]
    g[0] = g[N + 1] = 0.0


def with_function_after(x, tape):
    by_numpy(x, tape)
    tape.record_func(lambda: None, [wp.zeros(1, dtype=float, device="cpu", requires_grad=True)])
    tape.record_func(lambda: way_back(x), [x])


def with_function_before(x, tape):
    tape.record_func(lambda: way_back(x), [x])
    by_numpy(x, tape)


def gradient(exchange):
    arrays = [wp.array(np.arange(6.0) * 0.1, dtype=float, device="cpu", requires_grad=True)]
    arrays += [wp.zeros(N + 2, dtype=float, device="cpu", requires_grad=True) for _ in range(3)]
    loss = wp.zeros(1, dtype=float, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        for x, y in zip(arrays, arrays[1:], strict=False):
            exchange(x, tape)
            wp.launch(step, N, [x, y], device="cpu")
        wp.launch(add_up, N, [arrays[-1], loss], device="cpu")
    tape.backward(loss)
    return arrays[0].grad.numpy().copy()


def reference():
    """Central differences of the same in float64."""

    def value(x):
        for _ in range(3):
            wrap(x)
            x[1:-1] = 0.5 * x[1:-1] + 0.25 * (x[:-2] + x[2:]) * x[1:-1]
        return x[1:-1].sum()

    found = []
    for i in range(6):
        ends = []
        for sign in (1.0, -1.0):
            x = np.arange(6.0) * 0.1
            x[i] += sign * 1e-5
            ends.append(value(x))
        found.append((ends[0] - ends[1]) / 2e-5)
    return np.array(found)


@pytest.mark.parametrize("exchange", [by_copies, with_function_after, with_function_before])
def test_recorded_exchanges_have_the_right_gradient(exchange):
    np.testing.assert_allclose(gradient(exchange), reference(), rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("exchange", [by_numpy, by_parts, by_torch])
def test_exchange_that_the_tape_cannot_know_is_an_error(exchange):
    with pytest.raises(
        errors.WarpGradientError, match=r"test_foreign_writes.*another library wrote"
    ):
        gradient(exchange)


def test_reading_is_no_writing():
    """To look at arrays, or to write what nothing recorded reads, changes no gradient."""

    def look(x, tape):
        assert np.isfinite(x.numpy()).all()
        by_copies(x, tape)

    np.testing.assert_allclose(gradient(look), gradient(by_copies))


def test_initial_values_and_results_may_be_written():
    x = wp.zeros(N + 2, dtype=float, device="cpu", requires_grad=True)
    y = wp.zeros(N + 2, dtype=float, device="cpu", requires_grad=True)
    loss = wp.zeros(1, dtype=float, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        x.numpy()[:] = 1.0
        wp.launch(step, N, [x, y], device="cpu")
        wp.launch(add_up, N, [y, loss], device="cpu")
        y.numpy()[:] = 7.0
    tape.backward(loss)
    np.testing.assert_allclose(x.grad.numpy(), [0.25, 1.25, 1.5, 1.5, 1.25, 0.25])


def test_own_writes_are_not_foreign():
    """Launches, copies and fills after a look at the memory are recorded."""
    x, y = (wp.ones(N + 2, dtype=float, device="cpu", requires_grad=True) for _ in range(2))
    loss = wp.zeros(1, dtype=float, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(step, N, [x, y], device="cpu")
        y.numpy()
        y.fill_(2.0)
        y.numpy()
        wp.copy(y, x)
        y.numpy()
        wp.launch(step, N, [x, y], device="cpu")
        wp.launch(add_up, N, [y, loss], device="cpu")
    tape.backward(loss)
    np.testing.assert_allclose(x.grad.numpy(), [0.25, 1.25, 1.5, 1.5, 1.25, 0.25])
