"""Copies that a tape keeps of overwritten memory, and its budget."""

import numpy as np
import pytest
from test_tape_regions import between, product, ring, step, sweep

import warp as wp

ROW = 8 * 5


def trajectory(rows, device):
    start = np.linspace(0.2, 0.9, rows * 5).reshape(rows, 5)
    return wp.array(start, dtype=wp.float64, requires_grad=True, device=device)


def seed(x):
    return {x: wp.ones(x.shape, dtype=wp.float64, device=x.device)}


@pytest.mark.parametrize("preserve", ["auto", "never"])
def test_a_trajectory_costs_no_copies(preserve, device):
    x = trajectory(9, device)
    with wp.Tape(preserve=preserve) as tape:
        for k in range(8):
            wp.launch(step, 5, [x, k], device=device)
    assert tape.kept_bytes == 0
    tape.backward(grads=seed(x))
    assert np.isfinite(x.grad.numpy()).all() and x.grad.numpy()[0].any()


def test_a_ring_keeps_one_row_per_launch(device):
    x = trajectory(4, device)
    with wp.Tape() as tape:
        for k in range(20):
            wp.launch(ring, 5, [x, k, 4], device=device)
    assert 16 * ROW <= tape.kept_bytes <= 20 * ROW
    tape.backward(grads=seed(x))
    tape.reset()
    assert tape.kept_bytes == 0


def test_a_sweep_keeps_the_row_that_it_changes(device):
    x = trajectory(100, device)
    w = wp.zeros(5, dtype=wp.float64, device=device)
    with wp.Tape(preserve="never") as tape:
        wp.launch(sweep, 5, [x, w, 7], device=device)
    tape.backward(grads=seed(x))
    with wp.Tape() as tape:
        for k in (7, 8, 7):
            wp.launch(sweep, 5, [x, w, k], device=device)
    assert tape.kept_bytes == 3 * ROW


def test_an_array_passed_twice(device):
    x = trajectory(4, device)
    with wp.Tape(preserve="never") as tape:
        wp.launch(between, 5, [x, x, 0, 1], device=device)
        wp.launch(product, 5, [x[1], x[2]], device=device)
    before = x.numpy()[:2].copy()
    tape.backward(grads=seed(x))
    into = 1.0 + 2.0 * before[1]
    assert np.allclose(x.grad.numpy()[:2], [1.0 + 2.0 * before[0] * into, into])
    row = x.numpy()[1].copy()
    with wp.Tape() as tape:
        wp.launch(between, 5, [x, x, 1, 1], device=device)
    expected = np.ones((4, 5))
    expected[1] += 2.0 * row
    x.grad.zero_()
    tape.backward(grads=seed(x))
    assert np.allclose(x.grad.numpy(), expected)


def test_never_is_an_error_that_names_both_launches(device):
    x = trajectory(4, device)
    with wp.Tape(preserve="never") as tape:
        wp.launch(product, 5, [x[0], x[1]], device=device)
        wp.launch(step, 5, [x, -1], device=device)
    with pytest.raises(RuntimeError, match=r"launch of 'product'.*'a'.*launch of 'step'"):
        tape.backward(grads=seed(x))
    with pytest.raises(ValueError, match="'auto' or 'never', but got 'error'"):
        wp.Tape(preserve="error")


def test_out_of_budget_names_what_cost_most(device):
    x = trajectory(4, device)
    w = wp.zeros(5, dtype=wp.float64, device=device)
    with wp.Tape(max_bytes=3 * ROW) as tape:
        wp.launch(sweep, 5, [x, w, 0], device=device)
        for k in range(8):
            wp.launch(ring, 5, [x, k, 4], device=device)
    assert tape.kept_bytes <= 3 * ROW
    with pytest.raises(RuntimeError) as caught:
        tape.backward(grads=seed(x))
    text = str(caught.value)
    assert f"{3 * ROW} bytes" in text and "launch of 'ring'" in text
    assert "max_bytes" in text and "checkpoint" in text
    with pytest.raises(ValueError, match="number of bytes"):
        wp.Tape(max_bytes=-1)


def test_many_launches(device):
    """No recursion, neither in a backward pass nor when a long chain of versions dies."""
    x = trajectory(3, device)
    w = wp.zeros(5, dtype=wp.float64, device=device)
    with wp.Tape() as tape:
        for _ in range(3000):
            wp.launch(sweep, 5, [x, w, 1], device=device)
            wp.launch(product, 5, [x[0], x[1]], device=device)
    tape.backward(grads=seed(x))
    start = np.linspace(0.2, 0.9, 15)[:5]
    assert np.allclose(x.grad.numpy()[0], 1.0 + 2.0 * start)
