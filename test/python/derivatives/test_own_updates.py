"""Gradients through what atomics return: where the element belongs to the thread, and errors."""

import numpy as np
import pytest

import warp as wp
from warp.extend import errors

REAL = wp.float64
rng = np.random.default_rng(11)
N = 5


def differences(value, x, step=1e-6):
    """Central differences of a function of an array."""
    found = np.zeros_like(x)
    for at in np.ndindex(x.shape):
        moved = np.zeros_like(x)
        moved[at] = step
        found[at] = (value(x + moved) - value(x - moved)) / (2.0 * step)
    return found


def gradients(kernel, dim, inputs, outputs, weights, others=(), device="cpu"):
    """Gradients of the weighted sum of outputs, by the inputs and by what outputs held before."""
    arrays = [wp.array(x, dtype=REAL, device=device, requires_grad=True) for x in inputs]
    made = [wp.array(y, dtype=REAL, device=device, requires_grad=True) for y in outputs]
    with wp.Tape() as tape:
        wp.launch(kernel, dim, [*arrays, *made, *others], device=device)
    seeds = [wp.array(w, dtype=REAL, device=device) for w in weights]
    tape.backward(grads=dict(zip(made, seeds)))
    return [one.grad.numpy() for one in (*arrays, *made)]


@pytest.mark.parametrize(
    ("update", "combine"),
    [
        (wp.atomic_min, np.minimum),
        (wp.atomic_max, np.maximum),
        (wp.atomic_add, np.add),
        (wp.atomic_sub, np.subtract),
        (wp.atomic_exch, lambda old, new: new),
    ],
)
def test_what_an_own_update_returns(update, combine, device):
    @wp.kernel
    def program(x: wp.array(dtype=REAL), slot: wp.array(dtype=REAL), y: wp.array(dtype=REAL)):
        i = wp.tid()
        first = update(slot, i, wp.sin(x[i]))
        second = update(slot, i, first * x[i])
        y[i] = first * x[i] + second * second

    x, slot, *weights = rng.uniform(-1.0, 1.0, size=(4, N))

    def total(x, slot):
        first = slot
        after = combine(first, np.sin(x))
        second = after
        left = combine(after, first * x)
        return (weights[0] * left + weights[1] * (first * x + second**2)).sum()

    found = gradients(program, N, [x], [slot, np.zeros(N)], weights, device=device)
    np.testing.assert_allclose(found[0], differences(lambda v: total(v, slot), x), atol=1e-8)
    np.testing.assert_allclose(found[1], differences(lambda v: total(x, v), slot), atol=1e-8)

    def run(x, slot):
        y = wp.zeros(N, dtype=REAL, device=device)
        wp.launch(program, N, [x, slot, y], device=device)
        return slot, y

    directions = rng.uniform(-1.0, 1.0, size=(2, N))
    given = [wp.array(v, dtype=REAL, device=device) for v in (x, slot)]
    tangents = [wp.array(v, dtype=REAL, device=device) for v in directions]
    pushed = wp.autograd.jvp(run, given, tangents)
    product = sum((p.numpy() * w).sum() for p, w in zip(pushed, weights))
    wanted = sum((g * d).sum() for g, d in zip(found, directions))
    assert product == pytest.approx(wanted, rel=1e-12)


def test_a_loop_of_own_updates(device):
    """A running minimum, whose old values are used, and an own counter."""

    @wp.kernel
    def program(
        x: wp.array2d(dtype=REAL),
        low: wp.array(dtype=REAL),
        y: wp.array(dtype=REAL),
        count: wp.array(dtype=int),
    ):
        i = wp.tid()
        total = REAL(0.0)
        for _k in range(x.shape[1]):
            at = wp.atomic_add(count, i, 1)
            old = wp.atomic_min(low, i, x[i, at])
            total += old * x[i, at]
        y[i] = total

    x, weights = rng.uniform(-1.0, 1.0, size=(N, 7)), rng.uniform(-1.0, 1.0, size=(2, N))
    start = rng.uniform(0.0, 1.0, size=N)

    def total(x):
        before = np.minimum.accumulate(np.column_stack([start, x]), axis=1)
        return weights[0] @ before[:, -1] + weights[1] @ (before[:, :-1] * x).sum(axis=1)

    count = wp.zeros(N, dtype=int, device=device)
    found = gradients(program, N, [x], [start, np.zeros(N)], weights, [count], device)
    np.testing.assert_allclose(found[0], differences(total, x), atol=1e-8)


@wp.kernel
def by_index(
    x: wp.array(dtype=REAL),
    best: wp.array(dtype=REAL),
    y: wp.array(dtype=REAL),
    cell: wp.array(dtype=int),
):
    i = wp.tid()
    y[i] = x[i] * wp.atomic_max(best, cell[i], x[i] * x[i])


def test_places_that_the_launch_shows_to_be_apart(device):
    x, start, *weights = rng.uniform(-1.0, 1.0, size=(4, N))
    place = rng.permutation(N)
    cell = wp.array(place, dtype=int, device=device)

    def total(x, start):
        left = start.copy()
        left[place] = np.maximum(start[place], x * x)
        return weights[0] @ left + weights[1] @ (x * start[place])

    found = gradients(by_index, N, [x], [start, np.zeros(N)], weights, [cell], device)
    np.testing.assert_allclose(found[0], differences(lambda v: total(v, start), x), atol=1e-8)
    np.testing.assert_allclose(found[1], differences(lambda v: total(x, v), start), atol=1e-8)


def test_threads_that_meet_are_an_error(device):
    cell = wp.array([0, 1, 2, 1, 3], dtype=int, device=device)
    with pytest.raises(errors.WarpGradientError, match=r"written by another thread of the launch"):
        ones = np.ones(N)
        gradients(by_index, N, [ones], [ones, ones], [ones, ones], [cell], device)


def test_one_place_of_all_threads_takes_one_thread(device):
    @wp.kernel
    def program(x: wp.array(dtype=REAL), best: wp.array(dtype=REAL), y: wp.array(dtype=REAL)):
        i = wp.tid()
        y[i] = x[i] * wp.atomic_max(best, 0, x[i])

    found = gradients(program, 1, [[2.0]], [[3.0], [0.0]], [[0.5], [1.0]], device=device)
    assert [one.tolist() for one in found[:2]] == [[3.0], [2.5]]
    with pytest.raises(errors.WarpGradientError, match="one thread only"):
        gradients(program, 2, [[2.0, 1.0]], [[3.0], [0.0, 0.0]], [[0.5], [1.0, 1.0]], device=device)


def test_neighbours_places_are_an_error():
    @wp.kernel
    def program(x: wp.array(dtype=REAL), best: wp.array(dtype=REAL), y: wp.array(dtype=REAL)):
        i = wp.tid()
        wp.atomic_max(best, i, x[i])
        y[i] = wp.atomic_max(best, i + 1, x[i])

    with pytest.raises(
        errors.WarpCompileError, match=r"(?s)unless the element belongs.*atomic_max"
    ):
        wp.autograd.adjoint_metrics(program)


def test_launches_of_more_dimensions_than_the_kernel_knows(device):
    @wp.kernel
    def program(x: wp.array(dtype=REAL), slot: wp.array(dtype=REAL), y: wp.array(dtype=REAL)):
        i = wp.tid()
        y[i] = wp.atomic_add(slot, i, x[i]) * x[i]

    ones = np.ones(3)
    with pytest.raises(errors.WarpGradientError, match="up to 1 dimensions, but this one has 2"):
        gradients(program, (3, 2), [ones], [ones, ones], [ones, ones], device=device)


def test_rows_that_a_counter_gives(device):
    """A loop reads what it has written, in a row that an atomic has given to the thread."""

    @wp.kernel
    def program(
        x: wp.array(dtype=REAL),
        rows: wp.array2d(dtype=REAL),
        row_of: wp.array(dtype=int),
        order: wp.array(dtype=int),
        count: wp.array(dtype=int),
    ):
        i = wp.tid()
        row = wp.atomic_add(count, 0, 1)
        row_of[i] = row
        rows[row, 0] = wp.sin(x[i])
        for k in range(1, rows.shape[1]):
            rows[row, k] = wp.sin(rows[row, order[k]] * x[i]) + rows[row, k - 1]

    order = np.array([0, 0, 1, 1, 3, 2])
    x, weights = rng.uniform(-1.0, 1.0, size=N), rng.uniform(-1.0, 1.0, size=(N, 6))

    def of_one(x):
        row = [np.sin(x)]
        for k in range(1, 6):
            row.append(np.sin(row[order[k]] * x) + row[k - 1])
        return np.array(row)

    given = wp.array(x, dtype=REAL, device=device, requires_grad=True)
    rows = wp.zeros((N, 6), dtype=REAL, device=device, requires_grad=True)
    row_of = wp.zeros(N, dtype=int, device=device)
    count = wp.zeros(1, dtype=int, device=device)
    indices = wp.array(order, dtype=int, device=device)
    with wp.Tape() as tape:
        wp.launch(program, N, [given, rows, row_of, indices, count], device=device)
    tape.backward(grads={rows: wp.array(weights, dtype=REAL, device=device)})
    own = weights[row_of.numpy()]

    def total(x):
        return sum(w @ of_one(one) for w, one in zip(own, x))

    np.testing.assert_allclose(given.grad.numpy(), differences(total, x), atol=1e-8)


def test_a_launch_that_keeps_what_atomics_return_stays_atomic(device):
    """Threads meet at places that come from memory, and their rows from a counter are kept."""

    @wp.kernel
    def program(
        x: wp.array(dtype=REAL),
        totals: wp.array(dtype=REAL),
        y: wp.array(dtype=REAL),
        rows: wp.array(dtype=REAL),
        cell: wp.array(dtype=int),
        count: wp.array(dtype=int),
    ):
        i = wp.tid()
        row = wp.atomic_add(count, 0, 1)
        rows[row] = x[i] * x[i]
        y[i] = x[i] * wp.atomic_add(totals, cell[i], x[i])

    n = 200_000
    x = wp.array(np.arange(n) % 7, dtype=REAL, device=device, requires_grad=True)
    totals = wp.zeros(3, dtype=REAL, device=device, requires_grad=True)
    y, rows = (wp.zeros(n, dtype=REAL, device=device, requires_grad=True) for _ in range(2))
    cell = wp.array(np.arange(n) % 3, dtype=int, device=device)
    count = wp.zeros(1, dtype=int, device=device)
    with wp.Tape() as tape:
        wp.launch(program, n, [x, totals, y, rows, cell, count], device=device)
    exact = np.bincount(np.arange(n) % 3, weights=np.arange(n) % 7)
    np.testing.assert_array_equal(totals.numpy(), exact)
    assert sorted(rows.numpy()) == sorted((np.arange(n) % 7.0) ** 2)
    with pytest.raises(errors.WarpGradientError, match="another thread"):
        tape.backward(grads={y: wp.ones(n, dtype=REAL, device=device)})


def test_a_launch_of_too_many_dimensions_computes_what_the_kernel_says(device):
    @wp.kernel
    def program(
        x: wp.array(dtype=REAL),
        slot: wp.array(dtype=REAL),
        y: wp.array(dtype=REAL),
        rows: wp.array(dtype=REAL),
        count: wp.array(dtype=int),
    ):
        i = wp.tid()
        rows[wp.atomic_add(count, 0, 1)] = x[i]
        y[i] = wp.atomic_add(slot, i, x[i]) * x[i]

    n, times = 50, 2000
    x = wp.array(np.arange(n), dtype=REAL, device=device, requires_grad=True)
    slot, y = (wp.zeros(n, dtype=REAL, device=device, requires_grad=True) for _ in range(2))
    rows = wp.zeros(n * times, dtype=REAL, device=device, requires_grad=True)
    count = wp.zeros(1, dtype=int, device=device)
    with wp.Tape() as tape:
        wp.launch(program, (n, times), [x, slot, y, rows, count], device=device)
    np.testing.assert_array_equal(slot.numpy(), times * np.arange(n))
    with pytest.raises(errors.WarpGradientError, match="up to 1 dimensions"):
        tape.backward(grads={y: wp.ones(n, dtype=REAL, device=device)})
