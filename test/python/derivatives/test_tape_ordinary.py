"""Launches that are recorded and reversed natively, and what sends them back to Python."""

import gc
import os
import weakref

import numpy as np
import pytest

import warp as wp
from warp._src.arrays.observers import Observers


@wp.kernel
def scale(x: wp.array(dtype=float), y: wp.array(dtype=float), factor: float):
    i = wp.tid()
    y[i] = y[i] + factor * x[i] * x[i]


@wp.kernel
def project(x: wp.array(dtype=wp.vec3), axis: wp.vec3, y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = wp.dot(x[i], axis) * wp.dot(x[i], axis)


@wp.kernel
def advance(x: wp.array2d(dtype=wp.float64), k: int):
    i = wp.tid()
    x[k + 1, i] = x[k, i] - wp.float64(0.001) * x[k, i] * x[k, i]


def ones(count, device):
    return wp.ones(count, dtype=float, device=device, requires_grad=True)


def test_arguments_that_change_later(device):
    x = wp.array(np.ones((4, 3)), dtype=wp.vec3, device=device, requires_grad=True)
    y, axis, inputs = ones(4, device), wp.vec3(1.0, 2.0, 0.0), [x]
    with wp.Tape() as tape:
        inputs += [axis, y]
        wp.launch(project, 4, inputs, device=device)
        axis[0] = 100.0
        inputs.clear()
    tape.backward(grads={y: wp.ones(4, device=device)})
    assert (x.grad.numpy() == [[6.0, 12.0, 0.0]] * 4).all()


def test_extents_and_numbers_that_differ(device):
    x, y = ones(6, device), ones(6, device)
    expected = np.zeros(6)
    with wp.Tape() as tape:
        for count, factor in ((6, 1.0), (3, 1.0), (3, 5.0), ((2,), 5.0), ([4], 0.5), (0, 9.0)):
            wp.launch(scale, count, [x, y, factor], device=device)
            length = count if isinstance(count, int) else count[0]
            expected[:length] += 2.0 * factor
    seed = wp.ones(6, device=device)
    tape.backward(grads={y: seed})
    assert (x.grad.numpy() == expected).all() and (y.grad.numpy() == 1.0).all()
    # Gradients of another pass are added.
    tape.backward(grads={y: seed})
    assert (x.grad.numpy() == 2 * expected).all()


def test_gradients_that_are_wanted_later(device):
    x, y = wp.ones(3, device=device), wp.zeros(3, device=device)
    with wp.Tape() as tape:
        wp.launch(scale, 3, [x, y, 2.0], device=device)
    x.requires_grad = True
    tape.backward(grads={y: wp.ones(3, device=device)})
    assert (x.grad.numpy() == 4.0).all()


def test_launches_that_are_not_recorded_overwrite(device):
    x, y, z = ones(3, device), ones(3, device), ones(3, device)
    with wp.Tape() as tape:
        wp.launch(scale, 3, [x, y, 1.0], device=device)
        wp.launch(scale, 3, [z, x, 7.0], device=device, record_tape=False)
    assert (x.numpy() == 8.0).all() and tape.kept_bytes == 12
    wp.launch(scale, 3, [z, x, 7.0], device=device)
    tape.backward(grads={y: wp.ones(3, device=device)})
    assert (x.grad.numpy() == 2.0).all()


def test_messages_name_the_lines(device):
    x, y = ones(3, device), ones(3, device)
    with wp.Tape(preserve="never") as tape:
        wp.launch(scale, 3, [x, y, 1.0], device=device)
        wp.launch(scale, 3, [y, x, 1.0], device=device)
    first = next(iter(tape.launches)).event
    assert os.path.basename(first.file) == os.path.basename(__file__)
    place = rf"{os.path.basename(__file__)}:{first.line + 1}"
    with pytest.raises(RuntimeError, match=rf"'x' has been over.*'scale' at {place}") as e:
        tape.backward(grads={y: wp.ones(3, device=device)})
    assert f"{os.path.basename(__file__)}:{first.line}" in str(e.value)


def test_bad_arguments_are_not_recorded(device):
    x, y = ones(3, device), ones(3, device)
    with wp.Tape() as tape:
        wp.launch(scale, 3, [x, y, 1.0], device=device)
        for dim, values in (
            (3, [x, y]),
            (3, [x, y, "1"]),
            (3, [x, x.numpy, 1.0]),
            (-1, [x, y, 1.0]),
        ):
            with pytest.raises(wp.WarpError, match="launch.'scale'.:"):
                wp.launch(scale, dim, values, device=device)
    assert len(tape.launches) == 1
    tape.backward(grads={y: wp.ones(3, device=device)})
    assert (x.grad.numpy() == 2.0).all()


def test_records_go_with_their_tape(device):
    x, y = ones(3, device), ones(3, device)
    with wp.Tape() as tape:
        wp.launch(scale, 3, [x, y, 1.0], device=device)
        wp.launch(scale, 3, [x, y, 2.0], device=device)
    record, array = (weakref.ref(one) for one in (tape.launches[0], y))
    assert record().values[2] == 1.0 and record().call.leaves[0] == ("x", x)
    del tape, y
    gc.collect()
    assert record() is None and array() is None
    assert not len(Observers.memory)


def test_a_long_rollout(device):
    """Many launches: no recursion, nothing kept; the derivative by the chain rule."""
    count = 20_000
    x = wp.full((count + 1, 2), 0.5, dtype=wp.float64, device=device, requires_grad=True)
    with wp.Tape() as tape:
        for k in range(count):
            wp.launch(advance, 2, [x, k], device=device)
    seed = wp.zeros_like(x, requires_grad=False)
    seed[count].fill_(1.0)
    tape.backward(grads={x: seed})
    assert tape.kept_bytes == 0
    found = x.grad.numpy()[0].copy()
    tape.reset()
    expected = np.prod(1.0 - 0.002 * x.numpy()[:count, 0])
    np.testing.assert_allclose(found, [expected, expected], rtol=1e-9)


@wp.kernel
def square(x: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = 0.75 * x[i] * x[i]


@wp.kernel
def bend(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
    i, j = wp.tid()
    y[i, j] = wp.sin(x[i, j])


def python_records(monkeypatch) -> list:
    """The calls that Python makes backwards from here on."""
    from warp._src.derivatives.tape_records import LaunchRecord

    seen, reverse = [], LaunchRecord.reverse
    monkeypatch.setattr(
        LaunchRecord, "reverse", lambda self, state: (seen.append(self), reverse(self, state))
    )
    return seen


@pytest.mark.parametrize("preserve", ["auto", "never"])
def test_a_launch_that_overwrites_what_its_adjoint_reads(device, preserve, monkeypatch):
    start = np.linspace(0.9, 1.4, 6)
    x = wp.array(start, dtype=float, device=device, requires_grad=True)
    seen, tape = python_records(monkeypatch), wp.Tape(preserve=preserve)
    with tape:
        for _ in range(5):
            wp.launch(square, 6, [x], device=device)
    # x_5 = 0.75^31 x_0^32
    for _ in range(2):
        x.grad.zero_()
        tape.backward(grads={x: wp.ones(6, device=device)})
        expected = 32 * 0.75**31 * start**31
        np.testing.assert_allclose(x.grad.numpy(), expected, rtol=2e-5)
    assert not seen, "each adjoint is one native call"


def test_arrays_that_take_turns(device, monkeypatch):
    start = np.linspace(-1.0, 1.0, 12).reshape(3, 4)
    x = wp.array(start, dtype=float, device=device, requires_grad=True)
    y = wp.zeros((3, 4), device=device, requires_grad=True)
    with wp.Tape():
        wp.launch(bend, (3, 4), [wp.clone(x), y], device=device)
    seen, tape = python_records(monkeypatch), wp.Tape()
    with tape:
        for k in range(6):
            pair = [x, y] if k % 2 == 0 else [y, x]
            wp.launch(bend, (3, 4), pair, device=device)
    tape.backward(grads={x: wp.ones((3, 4), device=device)})
    value, expected = start, np.ones_like(start)
    for _ in range(6):
        expected, value = expected * np.cos(value), np.sin(value)
    np.testing.assert_allclose(x.grad.numpy(), expected, rtol=1e-5)
    assert not seen
    # Parts of what was kept, and arrays with gaps, are put together in Python.
    x = wp.array(start, dtype=float, device=device, requires_grad=True)
    tape = wp.Tape()
    with tape:
        wp.launch(bend, (3, 2), [x[:, :2], y[:, 2:]], device=device)
        wp.launch(bend, (3, 2), [y[:, 2:], x[:, :2]], device=device)
    tape.backward(grads={x: wp.ones((3, 4), device=device)})
    part = start[:, :2]
    np.testing.assert_allclose(
        x.grad.numpy()[:, :2], np.cos(part) * np.cos(np.sin(part)), rtol=1e-5
    )
    assert seen


def test_copies_beyond_the_budget_name_the_launch(device):
    x = ones(1000, device)
    tape = wp.Tape(max_bytes=10_000)
    with tape:
        for _ in range(4):
            wp.launch(square, 1000, [x], device=device)
    with pytest.raises(wp.WarpError, match=r"launch of 'square' at .*8000 bytes in 2"):
        tape.backward(grads={x: ones(1000, device)})


@pytest.mark.parametrize("launched_before", [False, True])
def test_first_launch_on_a_tape(device, launched_before, monkeypatch):
    @wp.kernel(module="unique")
    def square(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = x[i] * x[i]

    x, y = ones(3, device), ones(3, device)
    if launched_before:
        wp.launch(square, 3, [x, y], device=device)
    with wp.Tape() as tape:
        wp.launch(square, 3, [x], [y], device=device)
    seen = python_records(monkeypatch)
    tape.backward(grads={y: wp.full(3, 3.0, dtype=float, device=device)})
    assert not seen, "the adjoint is one native call"
    np.testing.assert_array_equal(x.grad.numpy(), 6.0)
