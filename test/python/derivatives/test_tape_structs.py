"""Launches of structs with arrays: recorded and run backwards in native calls, or by Python."""

import gc
import weakref

import numpy as np
import pytest

import warp as wp


@wp.struct
class State:
    x: wp.array(dtype=float)
    y: wp.array(dtype=float)
    factor: float


@wp.struct
class Outer:
    inner: State
    shift: float


@wp.kernel
def add_squares(s: State, more: wp.array(dtype=float)):
    i = wp.tid()
    s.y[i] = s.y[i] + s.factor * s.x[i] * s.x[i] * more[i]


@wp.kernel
def square(s: State):
    i = wp.tid()
    s.x[i] = 0.75 * s.x[i] * s.x[i]


@wp.kernel
def turn(s: State):
    i = wp.tid()
    s.y[i] = wp.sin(s.x[i])


@wp.kernel
def add_inner(o: Outer):
    i = wp.tid()
    o.inner.y[i] = o.inner.y[i] + o.inner.x[i] * o.inner.x[i] + o.shift


START = np.linspace(0.5, 1.2, 5)


def state(device, grad=True):
    s = State()
    s.x = wp.array(START, dtype=float, device=device, requires_grad=grad)
    s.y = wp.zeros(5, dtype=float, device=device, requires_grad=grad)
    s.factor = 2.0
    return s


def ones(device):
    return wp.ones(5, dtype=float, device=device, requires_grad=True)


@pytest.fixture
def by_python(monkeypatch):
    """Records that Python runs backwards."""
    from warp._src.derivatives.tape_records import LaunchRecord

    seen, reverse = [], LaunchRecord.reverse
    monkeypatch.setattr(
        LaunchRecord, "reverse", lambda self, state: (seen.append(self), reverse(self, state))
    )
    return seen


def warmed(kernel, values, device):
    """The first launch of a kernel under a tape is recorded by Python."""
    with wp.Tape():
        wp.launch(kernel, 5, values, device=device)


def test_structs_that_change_later(device, by_python):
    s, more = state(device), ones(device)
    warmed(add_squares, [state(device), more], device)
    with wp.Tape() as tape:
        for factor in (2.0, 3.0, 5.0):
            s.factor = factor
            wp.launch(add_squares, 5, [s, more], device=device)
        x, y = s.x, s.y
        s.factor, s.x = 100.0, ones(device)
    tape.backward(grads={y: ones(device)})
    np.testing.assert_allclose(x.grad.numpy(), 20.0 * START, rtol=1e-6)
    np.testing.assert_allclose(more.grad.numpy(), 10.0 * START**2, rtol=1e-6)
    assert not s.x.grad.numpy().any() and not by_python


def test_gradients_that_are_wanted_or_replaced_later(device, by_python):
    s, more = state(device, grad=False), wp.ones(5, dtype=float, device=device)
    warmed(add_squares, [state(device), ones(device)], device)
    s.x.requires_grad = s.y.requires_grad = True
    with wp.Tape() as tape:
        wp.launch(add_squares, 5, [s, more], device=device)
    s.x.grad = wp.full(5, 7.0, device=device)
    tape.backward(grads={s.y: ones(device)})
    np.testing.assert_allclose(s.x.grad.numpy(), 7.0 + 4.0 * START, rtol=1e-6)
    assert not by_python
    found = tape.gradients
    assert found[s].x.ptr == s.x.grad.ptr and found[s.x] is s.x.grad
    tape.zero()
    assert not s.x.grad.numpy().any()


@pytest.mark.parametrize("preserve", ["auto", "never"])
def test_a_struct_whose_array_is_overwritten(device, preserve, by_python):
    s = state(device)
    warmed(square, [state(device)], device)
    tape = wp.Tape(preserve=preserve)
    with tape:
        for _ in range(4):
            wp.launch(square, 5, [s], device=device)
    tape.backward(grads={s.x: ones(device)})
    np.testing.assert_allclose(s.x.grad.numpy(), 16 * 0.75**15 * START**15, rtol=1e-5)
    assert not by_python


def test_structs_that_take_turns(device, by_python):
    s, t = state(device), state(device)
    t.x, t.y = s.y, s.x
    warmed(turn, [state(device)], device)
    with wp.Tape() as tape:
        for k in range(6):
            wp.launch(turn, 5, [s if k % 2 == 0 else t], device=device)
    tape.backward(grads={s.x: ones(device)})
    value, expected = START, np.ones(5)
    for _ in range(6):
        expected, value = expected * np.cos(value), np.sin(value)
    np.testing.assert_allclose(s.x.numpy(), value, rtol=1e-6)
    np.testing.assert_allclose(s.x.grad.numpy(), expected, rtol=1e-5)
    assert not by_python


def test_structs_in_structs_and_missing_arrays(device, by_python):
    o = Outer()
    o.inner, o.shift = state(device), 1.0
    x, y = o.inner.x, o.inner.y
    with wp.Tape() as tape:
        for _ in range(3):
            wp.launch(add_inner, 5, [o], device=device)
    tape.backward(grads={y: ones(device)})
    np.testing.assert_allclose(x.grad.numpy(), 6.0 * START, rtol=1e-6)
    assert by_python
    s = state(device)
    s.y = None
    with wp.Tape() as tape:
        wp.launch(square, 5, [s], device=device)
    tape.backward(grads={s.x: ones(device)})
    np.testing.assert_allclose(s.x.grad.numpy(), 1.5 * START, rtol=1e-6)


def test_something_else_than_the_struct(device):
    s, more = state(device), ones(device)
    warmed(add_squares, [s, more], device)
    with wp.Tape() as tape:
        for wrong in (Outer(), None, 1.0):
            with pytest.raises(TypeError, match="argument 's'"):
                wp.launch(add_squares, 5, [wrong, more], device=device)
        wp.launch(add_squares, 5, [s, more], device=device)
    tape.backward(grads={s.y: ones(device)})
    np.testing.assert_allclose(s.x.grad.numpy(), 4.0 * START, rtol=1e-6)


def test_records_let_structs_go(device):
    s, more = state(device), ones(device)
    warmed(add_squares, [s, more], device)
    tape = wp.Tape()
    with tape:
        wp.launch(add_squares, 5, [s, more], device=device)
    alive = weakref.ref(s.x)
    del s
    gc.collect()
    assert alive() is not None
    tape.reset()
    gc.collect()
    assert alive() is None
