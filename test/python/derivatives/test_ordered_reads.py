"""Gradients through loops that read elements by an index from memory and write each once, in order.

Parents come before their child, are the child itself, or come later: what was there before the
launch is read then. Expected slopes are complex steps of the same recurrence in NumPy.
"""

import numpy as np
import pytest

import warp as wp

REAL = wp.float64
rng = np.random.default_rng(11)
N = 7


@wp.kernel
def upwards(x: wp.array2d(dtype=REAL), p: wp.array(dtype=int), y: wp.array2d(dtype=REAL)):
    i = wp.tid()
    for k in range(x.shape[1]):
        y[i, k] = wp.sin(y[i, p[k]] * x[i, k]) + x[i, k]


def upwards_again(x, p, y):
    for k in range(N):
        y[k] = np.sin(y[p[k]] * x[k]) + x[k]


@wp.kernel
def downwards(x: wp.array2d(dtype=REAL), p: wp.array(dtype=int), y: wp.array2d(dtype=REAL)):
    i = wp.tid()
    for k in range(x.shape[1]):
        at = x.shape[1] - 1 - k
        y[i, at] = x[i, at]
        y[i, at] = wp.sin(y[i, p[at]] * y[i, p[k]]) + x[i, at]


def downwards_again(x, p, y):
    for k in range(N):
        at = N - 1 - k
        y[at] = x[at]
        y[at] = np.sin(y[p[at]] * y[p[k]]) + x[at]


@wp.kernel
def written_first(x: wp.array2d(dtype=REAL), p: wp.array(dtype=int), y: wp.array2d(dtype=REAL)):
    i = wp.tid()
    for k in range(1, x.shape[1], 2):
        y[i, k] = x[i, k]
        y[i, 0] += wp.sin(y[i, p[k]] * x[i, k])


def written_first_again(x, p, y):
    for k in range(1, N, 2):
        y[k] = x[k]
        y[0] += np.sin(y[p[k]] * x[k])


@wp.kernel
def after_a_root(x: wp.array2d(dtype=REAL), p: wp.array(dtype=int), y: wp.array2d(dtype=REAL)):
    i = wp.tid()
    row = y[i]
    row[0] = wp.exp(x[i, 0])
    for k in range(1, x.shape[1]):
        if p[k] != 3:
            sum = REAL(0.0)
            for j in range(p.shape[0]):
                if p[j] == p[k]:
                    sum += row[p[j]] * x[i, j]
            row[k] = wp.sin(sum) * row[p[k]]


def after_a_root_again(x, p, y):
    y[0] = np.exp(x[0])
    for k in range(1, N):
        if p[k] != 3:
            y[k] = np.sin(sum(y[p[j]] * x[j] for j in range(N) if p[j] == p[k])) * y[p[k]]


@wp.kernel
def overwritten_root(x: wp.array2d(dtype=REAL), p: wp.array(dtype=int), y: wp.array2d(dtype=REAL)):
    i = wp.tid()
    y[i, 2] = wp.exp(x[i, 0])
    for k in range(1, x.shape[1]):
        y[i, k] = wp.sin(y[i, p[k]]) * x[i, k]


def overwritten_root_again(x, p, y):
    y[2] = np.exp(x[0])
    for k in range(1, N):
        y[k] = np.sin(y[p[k]]) * x[k]


@wp.kernel
def shifted(x: wp.array2d(dtype=REAL), p: wp.array(dtype=int), y: wp.array2d(dtype=REAL)):
    i = wp.tid()
    for k in range(x.shape[1] - 1):
        y[i, k] = wp.sin(y[i, p[k]]) * x[i, k]
        y[i, k + 1] = y[i, k] * x[i, k] + y[i, p[k + 1]]


def shifted_again(x, p, y):
    for k in range(N - 1):
        y[k] = np.sin(y[p[k]]) * x[k]
        y[k + 1] = y[k] * x[k] + y[p[k + 1]]


CASES = {
    upwards: upwards_again,
    downwards: downwards_again,
    written_first: written_first_again,
    after_a_root: after_a_root_again,
    overwritten_root: overwritten_root_again,
    shifted: shifted_again,
}


def slopes(again, x, p, y, weights):
    """Gradients of a weighted sum of a row by `x` and by the first `y`."""
    found = []
    for one in range(2):
        for j in range(N):
            start = [x.astype(complex), y.astype(complex)]
            start[one][j] += 1e-30j
            again(start[0], p, start[1])
            found.append((start[1] @ weights).imag / 1e-30)
    return np.reshape(found, (2, N))


@pytest.mark.parametrize("kernel", CASES, ids=lambda kernel: kernel.key)
@pytest.mark.parametrize("parents", ["before", "any", "negative"])
@pytest.mark.parametrize("rows", [1, 37])
def test_gradients(kernel, parents, rows, device):
    p = rng.integers(-N if parents == "negative" else 0, N, N)
    if parents == "before":
        p = np.array([0, *(rng.integers(0, k) for k in range(1, N))])
    x, y, weights = rng.normal(size=(3, rows, N))
    given = wp.array(x, dtype=REAL, device=device, requires_grad=True)
    made = wp.array(y, dtype=REAL, device=device, requires_grad=True)
    table = wp.array(p, dtype=int, device=device)
    with wp.Tape() as tape:
        wp.launch(kernel, rows, [given, table, made], device=device)
    for _ in range(2):
        tape.zero()
        tape.backward(grads={made: wp.array(weights, dtype=REAL, device=device)})
    for i in range(rows):
        wanted = slopes(CASES[kernel], x[i], p, y[i], weights[i])
        np.testing.assert_allclose(given.grad.numpy()[i], wanted[0], rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(made.grad.numpy()[i], wanted[1], rtol=1e-12, atol=1e-14)


@wp.kernel
def steps(x: wp.array2d(dtype=REAL), p: wp.array(dtype=int), y: wp.array3d(dtype=REAL)):
    i = wp.tid()
    for t in range(1, y.shape[1]):
        for k in range(y.shape[2]):
            y[i, t, k] = wp.sin(y[i, t, p[k]] + x[i, k]) + y[i, t - 1, k]


def test_steps_have_rows_of_their_own(device):
    p = rng.integers(0, N, N)
    x, y, weights = rng.normal(size=(2, N)), rng.normal(size=(2, 4, N)), rng.normal(size=(2, 4, N))
    given = wp.array(x, dtype=REAL, device=device, requires_grad=True)
    made = wp.array(y, dtype=REAL, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(steps, 2, [given, wp.array(p, dtype=int, device=device), made], device=device)
    tape.backward(grads={made: wp.array(weights, dtype=REAL, device=device)})
    for i in range(2):
        for j in range(N):
            moved, whole = x[i].astype(complex), y[i].astype(complex)
            moved[j] += 1e-30j
            for t in range(1, 4):
                for k in range(N):
                    whole[t, k] = np.sin(whole[t, p[k]] + moved[k]) + whole[t - 1, k]
            slope = (whole * weights[i]).sum().imag / 1e-30
            np.testing.assert_allclose(given.grad.numpy()[i, j], slope, rtol=1e-12, atol=1e-14)


def test_a_graph_holds_the_adjoint(device):
    """The kernel does not run again, so that nothing is read from the device."""
    p = np.array([0, *(rng.integers(0, k) for k in range(1, N))])
    x, y, weights = rng.normal(size=(3, 5, N))
    given = wp.array(x, dtype=REAL, device=device, requires_grad=True)
    made = wp.array(y, dtype=REAL, device=device, requires_grad=True)
    table = wp.array(p, dtype=int, device=device)
    seed = wp.array(weights, dtype=REAL, device=device)
    with wp.Tape() as tape:
        wp.launch(upwards, 5, [given, table, made], device=device)
    tape.backward(grads={made: seed})
    wanted = given.grad.numpy()
    tape.zero()
    with wp.ScopedCapture(device=device) as capture:
        tape.backward(grads={made: seed})
    tape.zero()
    wp.capture_launch(capture.graph)
    np.testing.assert_array_equal(given.grad.numpy(), wanted)


def test_second_derivatives(device):
    p = np.array([0, *(rng.integers(0, k) for k in range(1, N))])
    x, direction = rng.normal(size=(2, 1, N))

    def total(x):
        y = wp.full((1, N), 0.3, dtype=REAL, device=device, requires_grad=True)
        e = wp.zeros(1, dtype=REAL, device=device, requires_grad=True)
        wp.launch(upwards, 1, [x, wp.array(p, dtype=int, device=device), y], device=device)
        wp.launch(add_up, N, [y, e], device=device)
        return e

    @wp.kernel
    def add_up(y: wp.array2d(dtype=REAL), e: wp.array(dtype=REAL)):
        wp.atomic_add(e, 0, y[0, wp.tid()])

    given = wp.array(x, dtype=REAL, device=device, requires_grad=True)
    along = wp.array(direction, dtype=REAL, device=device)
    found = wp.autograd.hvp(total, inputs=[given], vectors=[along])
    found = found[0] if isinstance(found, (list, tuple)) else found
    start, ones, step = np.full(N, 0.3), np.ones(N), 1e-6
    high, low = (
        slopes(upwards_again, x[0] + s * direction[0], p, start, ones)[0] for s in (step, -step)
    )
    np.testing.assert_allclose(found.numpy()[0], (high - low) / (2 * step), rtol=1e-7, atol=1e-8)
