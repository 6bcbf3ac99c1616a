"""Gradients get memory when they are first used, and are zero then."""

import numpy as np
import pytest

import warp as wp
from warp import _native

N = 1000


@wp.struct
class Pair:
    weights: wp.array(dtype=float)
    gain: float


@wp.kernel
def square(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = y[i] + x[i] * x[i]


@wp.kernel
def weigh(p: Pair, y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = p.gain * p.weights[i]


@wp.kernel
def weigh_all(pairs: wp.array(dtype=Pair), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = pairs[0].gain * pairs[0].weights[i]


def variable(device, value=2.0):
    return wp.full(N, value, dtype=float, requires_grad=True, device=device)


def allocated(run):
    """Bytes of arrays that a function makes and returns."""
    with wp.ScopedMemoryTracker(print=False) as tracker:
        tracker.clear()
        kept = run()
        (current, *_), *_ = _native.tracker_totals().values()
    assert kept
    return current


def test_forward_launches_cost_no_gradient(device):
    def run():
        x, y = variable(device), variable(device)
        view = x[10:20].reshape((2, 5))
        pair = Pair()
        pair.weights, pair.gain = x, 2.0
        wp.launch(square, N, [x, y], device=device)
        wp.launch(weigh, N, [pair, y], device=device)
        with wp.Tape() as tape:
            wp.launch(square, N, [x, y], device=device)
            wp.launch(weigh, N, [pair, y], device=device)
            wp.copy(y, x, 0, 5, 10)
            y.zero_()
        tape.zero()
        tape.reset()
        copied = wp.clone(x)
        assert all(one.requires_grad for one in (x, y, view, pair.weights, copied))
        return x, y, view, copied

    assert allocated(run) == 3 * 4 * N


def test_only_what_a_backward_pass_touches_gets_a_gradient(device):
    x, y, other = variable(device), variable(device), variable(device)
    with wp.Tape() as tape:
        wp.launch(square, N, [x, y], device=device)
    tape.backward(grads={y: wp.ones(N, dtype=float, device=device)})
    np.testing.assert_array_equal(x.grad.numpy(), 4.0)
    assert other.grad_ptr == 0 and x.grad_ptr == x.grad.ptr
    np.testing.assert_array_equal(other.grad.numpy(), 0.0)
    assert other.grad is other.grad and other.grad_ptr == other.grad.ptr


def test_views_share_the_gradient_of_their_array(device):
    x, y = variable(device), wp.zeros(5, dtype=float, requires_grad=True, device=device)
    early = x[10:20][::2]
    y.grad.fill_(1.0)
    wp.launch(square, 5, [early, y], adjoint=True, device=device)
    expected = np.zeros(N, np.float32)
    expected[10:20:2] = 4.0
    np.testing.assert_array_equal(x.grad.numpy(), expected)
    np.testing.assert_array_equal(x[8:12].grad.numpy(), expected[8:12])
    x.grad.fill_(3.0)
    np.testing.assert_array_equal(early.grad.numpy(), 3.0)
    np.testing.assert_array_equal(x.reshape((10, 100)).grad.numpy(), 3.0)


def test_a_view_outlives_the_gradient_of_its_array(device):
    x = variable(device)
    view = x[:4]
    x.requires_grad = False
    assert view.requires_grad and not x.requires_grad and x.grad is None
    np.testing.assert_array_equal(view.grad.numpy(), np.zeros(4))


@pytest.mark.parametrize("in_array", [False, True])
def test_arrays_in_structs(device, in_array):
    pair, y = Pair(), variable(device)
    pair.weights, pair.gain = variable(device), 2.5
    given = wp.array([pair], dtype=Pair, device=device) if in_array else pair
    with wp.Tape() as tape:
        wp.launch(weigh_all if in_array else weigh, N, [given, y], device=device)
    if in_array:
        # Nobody knows of the arrays that structs in memory name: their gradients are there.
        assert pair.weights.grad_ptr
        return
    assert pair.weights.grad_ptr == 0
    tape.backward(grads={y: wp.ones(N, dtype=float, device=device)})
    np.testing.assert_array_equal(pair.weights.grad.numpy(), 2.5)


def test_a_graph_does_not_clear_gradients_first_used_in_it(device):
    x, y = variable(device), variable(device, 0.0)
    ones = wp.ones(N, dtype=float, device=device)
    with wp.ScopedCapture(device) as capture:
        with wp.Tape() as tape:
            wp.launch(square, N, [x, y], device=device)
        tape.backward(grads={y: ones})
    assert x.grad_ptr
    np.testing.assert_array_equal(x.grad.numpy(), 0.0)
    for count in (1, 2, 3):
        wp.capture_launch(capture.graph)
        np.testing.assert_array_equal(x.grad.numpy(), 4.0 * count)


def test_clearing_gradients_in_a_graph_is_recorded_before_they_are_used(device):
    x, y = variable(device), variable(device, 0.0)
    with wp.Tape() as tape:
        wp.launch(square, N, [x, y], device=device)
    with wp.ScopedCapture(device) as capture:
        tape.zero()
    x.grad.fill_(7.0)
    wp.capture_launch(capture.graph)
    np.testing.assert_array_equal(x.grad.numpy(), 0.0)


def test_half_precision_and_strides(device):
    x = wp.full((4, 6), 1.5, dtype=wp.float16, requires_grad=True, device=device)
    part = x[1:3, ::2]
    assert x.grad_ptr == 0 and part.requires_grad
    assert part.grad.dtype is wp.float16 and part.grad.shape == (2, 3)
    part.grad.fill_(1.0)
    assert x.grad.numpy().sum() == 6.0
