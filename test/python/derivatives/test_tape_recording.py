"""Records of a tape: values, commands, graphs, streams."""

import gc

import numpy as np
import pytest
from test_tape import Params, recorded, square, total, variables, weigh

import warp as wp
from warp._src.arrays.observers import Observers, copy_elements
from warp._src.arrays.versions import Memory


@wp.kernel
def along(x: wp.array(dtype=wp.vec3), direction: wp.vec3, loss: wp.array(dtype=float)):
    i = wp.tid()
    wp.atomic_add(loss, 0, wp.dot(x[i], direction))


def test_launches_without_tape_and_recorded_by_hand(device):
    x, y, loss = variables(device)
    with wp.Tape() as tape:
        wp.launch(square, 3, [x], [y], device=device, record_tape=False)
        command = wp.launch(total, 3, [y], [loss], device=device, record_cmd=True)
        assert not tape.launches
        command.launch()
    wp.launch(total, 3, [y], [loss], device=device)
    assert [record.event.what for record in tape.launches] == ["launch of 'total'"]
    other = wp.Tape()
    other.record_launch(square, 3, 0, [x], [y], device)
    other.backward(grads={y: wp.ones(3, dtype=float, device=device)})
    assert np.array_equal(x.grad.numpy(), [2, 4, 6])


def test_maps_and_operators(device):
    x, _, loss = variables(device)
    with wp.Tape() as tape:
        y = wp.map(wp.sin, x) * x
        wp.launch(total, 3, [y], [loss], device=device)
    tape.backward(loss)
    numbers = np.array([1.0, 2.0, 3.0])
    assert np.allclose(x.grad.numpy(), np.sin(numbers) + numbers * np.cos(numbers), rtol=1e-6)


def test_values_that_change_later(device):
    x, y, loss = variables(device)
    p, direction = Params(gain=3.0, weights=x), wp.vec3(1.0, 2.0, 3.0)
    v = wp.zeros(2, dtype=wp.vec3, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch(weigh, 3, [p], [y], device=device)
        wp.launch(along, 2, [v, direction], [loss], device=device)
    p.gain, p.weights = 5.0, None
    direction[0] = 7.0
    tape.backward(loss, grads={y: wp.ones(3, dtype=float, device=device)})
    assert np.array_equal(x.grad.numpy(), [6, 12, 18])
    assert np.array_equal(v.grad.numpy(), [[1, 2, 3], [1, 2, 3]])
    assert list(tape.gradients).count(p) == 1


def test_a_graph_of_forward_and_backward(device):
    x, y, loss = variables(device)
    wp.launch(square, 3, [x], [y], device=device)
    with wp.ScopedCapture(device=device) as capture:
        with wp.Tape(preserve="auto") as tape:
            loss.zero_()
            z = wp.clone(x)
            wp.launch(square, 3, [z], [y], device=device)
            z *= z
            wp.launch(total, 3, [z], [loss], device=device)
            wp.launch(total, 3, [y], [loss], device=device)
        x.grad.zero_()
        tape.zero()
        tape.backward(loss)
    for scale in (1.0, 2.0, 3.0):
        x.assign(scale * np.array([1.0, 2.0, 3.0], dtype=np.float32))
        wp.capture_launch(capture.graph)
        assert np.array_equal(x.grad.numpy(), 4 * scale * np.array([1.0, 2.0, 3.0]))


def test_seeds_of_narrow_arrays(device):
    x = wp.array([1.0, 2.0], dtype=wp.float16, requires_grad=True, device=device)
    with wp.Tape() as tape:
        y = x * x
    for dtype in (wp.float16, wp.float32):
        tape.zero()
        tape.backward(grads={y: wp.ones(2, dtype=dtype, device=device)})
        assert x.grad.dtype is wp.float16 and np.array_equal(x.grad.numpy(), [2, 4])
    with pytest.raises(TypeError, match="'float64'"):
        tape.backward(grads={y: wp.ones(2, dtype=wp.float64, device=device)})


def test_gradients_of_narrow_arrays_are_set_with_either_width(device):
    x = wp.array([1.0, 2.0], dtype=wp.float16, requires_grad=True, device=device)
    with wp.Tape() as tape:
        y = x * x
    for dtype in (wp.float16, wp.float32):
        tape.zero()
        y.grad = wp.full(2, 1.5, dtype=dtype, device=device)
        tape.backward()
        assert x.grad.dtype is wp.float16 and np.array_equal(x.grad.numpy(), [3, 6])
    with pytest.raises(ValueError, match="expects a gradient of 'float16' or 'float32' for"):
        y.grad = wp.ones(2, dtype=wp.float64, device=device)


def test_arrays_given_as_ctypes_objects(device):
    x, y, _ = variables(device)
    command = wp.launch(square, 3, [x], [y], device=device, record_cmd=True)
    command.set_param_at_index_from_ctype(0, x.__ctype__())
    command.launch()
    with wp.Tape(), pytest.raises(RuntimeError, match="'x' was set from a ctypes object"):
        command.launch()


@pytest.mark.cuda
def test_launches_on_other_streams():
    x, y, loss = variables("cuda:0", np.ones(1000))
    stream = wp.Stream("cuda:0")
    wp.synchronize_device("cuda:0")
    with wp.Tape() as tape:
        wp.launch(square, 1000, [x], [y], stream=stream)
        wp.launch(total, 1000, [y], [loss], stream=stream)
    tape.backward(loss)
    assert (x.grad.numpy() == 2).all()


def test_memory_that_nobody_wants_is_forgotten():
    memory = Memory(copy_elements)
    arrays = [wp.zeros(3, dtype=float, device="cpu") for _ in range(40)]
    kept = [memory.observe(one) for one in arrays[:3]]
    for one in arrays[3:]:
        memory.observe(one)
    assert len(memory) == 3
    memory.writing(arrays[1][1:], type("Writer", (), {"event": "write"}))
    assert [version.ended for version in kept] == [None, "write", None]


def test_nobody_observes_once_tapes_are_gone(device):

    tape, *_ = recorded(device)
    assert Observers.active
    tape.reset()
    other, *_ = recorded(device)
    del other
    gc.collect()
    assert not Observers.active
    assert "launch" not in vars(wp.Launch)
