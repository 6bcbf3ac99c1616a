"""`wp.Tape`: what is recorded, and the gradients that a backward pass leaves."""

import numpy as np
import pytest

import warp as wp


@wp.struct
class Params:
    gain: float
    weights: wp.array(dtype=float)


@wp.kernel
def square(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i]


@wp.kernel
def total(y: wp.array(dtype=float), loss: wp.array(dtype=float)):
    i = wp.tid()
    wp.atomic_add(loss, 0, y[i])


@wp.kernel
def weigh(p: Params, y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = p.gain * p.weights[i] * p.weights[i]


def variables(device, values=(1.0, 2.0, 3.0)):
    x = wp.array(list(values), dtype=float, requires_grad=True, device=device)
    y = wp.zeros(len(values), dtype=float, requires_grad=True, device=device)
    loss = wp.zeros(1, dtype=float, requires_grad=True, device=device)
    return x, y, loss


def recorded(device):
    x, y, loss = variables(device)
    with wp.Tape() as tape:
        wp.launch(square, 3, [x], [y], device=device)
        wp.launch(total, 3, [y], [loss], device=device)
    return tape, x, y, loss


def test_gradient_of_a_loss(device):
    tape, x, y, loss = recorded(device)
    tape.backward(loss)
    assert np.array_equal(x.grad.numpy(), [2, 4, 6])
    assert tape.loss is loss
    assert np.array_equal(y.grad.numpy(), [0, 0, 0])


def test_gradients_add_up_until_zero(device):
    tape, x, _, loss = recorded(device)
    tape.backward(loss)
    tape.backward(loss)
    assert np.array_equal(x.grad.numpy(), [4, 8, 12])
    tape.zero()
    assert not x.grad.numpy().any() and not loss.grad.numpy().any()
    tape.backward(loss)
    assert np.array_equal(x.grad.numpy(), [2, 4, 6])


def test_seeds_of_several_results_are_only_read(device):
    tape, x, y, loss = recorded(device)
    seed = wp.array([1.0, 10.0, 100.0], dtype=float, device=device)
    tape.backward(grads={y: seed})
    first = x.grad.numpy().copy()
    tape.zero()
    tape.backward(grads={y: seed})
    assert np.array_equal(first, [2, 40, 600])
    assert np.array_equal(x.grad.numpy(), first)
    assert np.array_equal(seed.numpy(), [1, 10, 100])


def test_what_a_pass_leaves_in_results_is_no_seed(device):
    @wp.kernel
    def square_loss(s: wp.array(dtype=float), loss: wp.array(dtype=float)):
        loss[0] = s[0] * s[0]

    x, _, loss = variables(device)
    s = wp.zeros(1, dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch(total, 3, [x], [s], device=device)
        wp.launch(square_loss, 1, [s], [loss], device=device)
    tape.backward(loss)
    assert np.array_equal(x.grad.numpy(), [12, 12, 12])
    tape.backward(loss)
    assert np.array_equal(x.grad.numpy(), [24, 24, 24])


def test_a_gradient_set_by_hand_is_a_seed(device):
    x, y, _ = variables(device)
    with wp.Tape() as tape:
        wp.launch(square, 3, [x], [y], device=device)
    for _ in range(2):
        tape.zero()
        y.grad.fill_(1.0)
        tape.backward()
        assert np.array_equal(x.grad.numpy(), [2, 4, 6])


def test_shown_gradients_change_nothing(device):
    plain, x, _, loss = recorded(device)
    plain.backward(loss)
    expected = x.grad.numpy().copy()
    x, y, loss = variables(device)
    y.retain_grad = True
    with wp.Tape() as tape:
        wp.launch(square, 3, [x], [y], device=device)
        wp.launch(square, 3, [x], [y], device=device)
        wp.launch(total, 3, [y], [loss], device=device)
    tape.backward(loss)
    assert np.array_equal(x.grad.numpy(), expected)
    assert np.array_equal(y.grad.numpy(), [1, 1, 1])


def test_structs_and_the_mapping_of_gradients(device):
    x, y, _ = variables(device)
    p = Params(gain=3.0, weights=x)
    with wp.Tape() as tape:
        wp.launch(weigh, 3, [p], [y], device=device)
    tape.backward(grads={y: wp.ones(3, dtype=float, device=device)})
    assert np.array_equal(x.grad.numpy(), [6, 12, 18])
    assert tape.gradients[x] is x.grad and tape.gradients[y] is y.grad
    assert tape.gradients[p].weights is x.grad
    assert tape.get_adjoint(x) is x.grad and tape.get_adjoint(2.0) == 2.0


def test_functions_run_in_their_place(device):
    x, y, loss = variables(device)
    order = []

    def backward():
        order.append(np.array_equal(y.grad.numpy(), [1, 1, 1]))
        x.grad.assign(np.array([7.0, 8.0, 9.0], dtype=np.float32))

    with wp.Tape() as tape:
        tape.record_func(backward, [x, y])
        wp.launch(total, 3, [y], [loss], device=device)
    tape.backward(loss)
    assert order == [True]
    assert np.array_equal(x.grad.numpy(), [7, 8, 9])
    tape.reset()
    assert not x.grad.numpy().any() and not tape.launches


def test_tapes_do_not_nest():
    with wp.Tape() as tape:
        with pytest.raises(wp.WarpError, match="leave its block"):
            wp.Tape().__enter__()
        with pytest.raises(wp.WarpError, match="cannot be recorded"), wp.ScopedDevice("cpu"):
            with wp.ScopedCapture(device="cpu") as capture:
                pass
            wp.capture_launch(capture.graph)
    assert not tape.launches


def test_bad_seeds(device):
    tape, x, y, loss = recorded(device)
    constant = wp.zeros(1, dtype=float, device=device)
    with pytest.raises(RuntimeError, match="one element"):
        tape.backward(x)
    with pytest.raises(RuntimeError, match="requires_grad=True"):
        tape.backward(constant)
    with pytest.raises(RuntimeError, match=r"shape \(3,\)"):
        tape.backward(grads={y: constant})
    tape.backward(grads={constant: constant})
    assert constant.grad.numpy()[0] == 0.0
    with pytest.raises(ValueError, match="'auto' or 'never'"):
        wp.Tape(preserve="always")


def test_only_arrays_with_a_gradient_keep_it(device):
    message = "retain_grad needs a gradient"
    for make in (wp.zeros, wp.empty, wp.ones):
        with pytest.raises(ValueError, match=message):
            make(3, retain_grad=True, device=device)
    with pytest.raises(ValueError, match=message):
        wp.array([1.0], dtype=float, retain_grad=True, device=device)
    x = wp.array([1.0], dtype=float, requires_grad=True, retain_grad=True, device=device)
    assert x.retain_grad and x[:1].retain_grad
    x.requires_grad = False
    assert not x.retain_grad
    with pytest.raises(ValueError, match=message):
        x.retain_grad = True
    x.requires_grad = x.retain_grad = True
    for like in (wp.zeros_like, wp.empty_like, wp.ones_like, wp.clone):
        assert like(x, retain_grad=True).retain_grad and not like(x).retain_grad
    assert wp.full_like(x, 2.0, retain_grad=True).retain_grad
    made = wp.from_numpy(np.ones(2, np.float32), requires_grad=True, retain_grad=True)
    assert made.retain_grad
    assert x.retain_grad and not wp.zeros_like(x).retain_grad
