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
