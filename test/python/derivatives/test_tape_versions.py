"""Gradients that depend on memory that is written again."""

import itertools
import random

import numpy as np
import pytest
from warp._native import Region

import warp as wp
from warp._src.arrays.observers import copy_layout


@wp.struct
class Holder:
    x: wp.array(dtype=float)


@wp.kernel
def square(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i]


@wp.kernel
def square_held(h: Holder, y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = h.x[i] * h.x[i]


@wp.kernel
def twice(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = 2.0 * x[i]


@wp.kernel
def scale(x: wp.array(dtype=float), b: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = x[i] * b[i]


@wp.kernel
def set_all(h: Holder, value: float):
    i = wp.tid()
    h.x[i] = value


def pair(device):
    x = wp.array([1.0, 2.0, 3.0], dtype=float, requires_grad=True, device=device)
    return x, wp.zeros(3, dtype=float, requires_grad=True, device=device)


def ones(device):
    return wp.ones(3, dtype=float, device=device)


WRITES = {
    "fill_": lambda x: x.fill_(5.0),
    "zero_": lambda x: x.zero_(),
    "assign": lambda x: x.assign(np.zeros(3, dtype=np.float32)),
    "copy": lambda x: wp.copy(x, wp.zeros_like(x)),
    "item": lambda x: x.__setitem__(1, 7.0),
    "view": lambda x: x[1:].fill_(1.0),
    "launch": lambda x: wp.launch(set_all, 3, [Holder(x=x), 4.0], device=x.device),
    "operator": lambda x: x.__iadd__(1.0),
}


@pytest.mark.parametrize("write", WRITES)
def test_overwritten_inputs_are_an_error(write, device):
    x, y = pair(device)
    with wp.Tape(preserve="never") as tape:
        wp.launch(square, 3, [x], [y], device=device)
    WRITES[write](x)
    with pytest.raises(RuntimeError) as caught:
        tape.backward(grads={y: ones(device)})
    text = str(caught.value)
    assert "launch of 'square'" in text and "array 'x'" in text
    assert text.count("test_tape_versions.py") >= 2
    assert "preserve='auto'" in text


@pytest.mark.parametrize("write", WRITES)
def test_preserved_inputs(write, device):
    x, y = pair(device)
    with wp.Tape(preserve="auto") as tape:
        wp.launch(square, 3, [x], [y], device=device)
    WRITES[write](x)
    now = x.numpy().copy()
    tape.backward(grads={y: ones(device)})
    assert np.array_equal(x.grad.numpy(), [2, 4, 6])
    assert np.array_equal(x.numpy(), now)


def through_numpy(x):
    x.numpy()[1] = 7.0


def through_an_interface(x):
    np.asarray(x)[...] = 7.0


def through_a_view(x):
    x[1:].numpy()[:] = 7.0


@pytest.mark.parametrize("write", [through_numpy, through_an_interface, through_a_view])
def test_writes_through_numpy(write):
    x, y = pair("cpu")
    with wp.Tape(preserve="never") as tape:
        wp.launch(square, 3, [x], [y], device="cpu")
    assert x.numpy()[1] == 2 and np.asarray(y)[1] == 4
    tape.backward(grads={y: ones("cpu")})
    write(x)
    with pytest.raises(RuntimeError, match="lent to NumPy at test_tape_versions.py"):
        tape.backward(grads={y: ones("cpu")})
    x, y = pair("cpu")
    with wp.Tape(preserve="auto") as tape:
        wp.launch(square, 3, [x], [y], device="cpu")
    write(x)
    tape.backward(grads={y: ones("cpu")})
    assert np.array_equal(x.grad.numpy(), [2, 4, 6])


def test_writes_through_numpy_between_launches():
    x, y = pair("cpu")
    z = wp.zeros_like(y)
    with wp.Tape(preserve="never") as tape:
        wp.launch(twice, 3, [x], [z], device="cpu")
        view = x.numpy()
        view[:] = 3.0
        wp.launch(square, 3, [x], [y], device="cpu")
    tape.backward(grads={y: ones("cpu"), z: ones("cpu")})
    assert np.array_equal(x.grad.numpy(), [8, 8, 8])
    view[:] = 4.0
    with pytest.raises(RuntimeError, match="lent to NumPy"):
        tape.backward(grads={y: ones("cpu")})


def test_seeds_written_through_numpy():
    x, y = pair("cpu")
    with wp.Tape() as tape:
        wp.launch(square, 3, [x], [y], device="cpu")
    for _ in range(2):
        y.grad.numpy()[:] = 1.0
        tape.backward()
        assert np.array_equal(x.grad.numpy(), [2, 4, 6])
        x.grad.zero_()


def test_arrays_in_structs(device):
    x, y = pair(device)
    for preserve in ("never", "auto"):
        with wp.Tape(preserve=preserve) as tape:
            wp.launch(square_held, 3, [Holder(x=x)], [y], device=device)
        x.fill_(9.0)
        if preserve == "never":
            with pytest.raises(RuntimeError, match=r"array 'h\.x'"):
                tape.backward(grads={y: ones(device)})
        else:
            tape.backward(grads={y: ones(device)})
            assert np.array_equal(x.grad.numpy(), [2, 4, 6])
        x.assign(np.array([1.0, 2.0, 3.0], dtype=np.float32))


def test_what_no_gradient_depends_on_may_be_written(device):
    x, y = pair(device)
    with wp.Tape() as tape:
        wp.launch(twice, 3, [x], [y], device=device)
    x.fill_(5.0)
    y.fill_(5.0)
    tape.backward(grads={y: ones(device)})
    assert np.array_equal(x.grad.numpy(), [2, 2, 2])


def test_rows_of_one_allocation_have_versions_of_their_own(device):
    rows = wp.zeros((4, 3), dtype=float, requires_grad=True, device=device)
    rows[0].assign(np.array([1.0, 2.0, 3.0], dtype=np.float32))
    with wp.Tape() as tape:
        for k in range(3):
            wp.launch(square, 3, [rows[k]], [rows[k + 1]], device=device)
    tape.backward(grads={rows[3]: ones(device)})
    assert np.allclose(rows.grad.numpy()[0], 8 * np.array([1.0, 2.0, 3.0]) ** 7)


def test_updates_in_place(device):
    x, b = pair(device)
    b.assign(np.array([2.0, 3.0, 4.0], dtype=np.float32))
    with wp.Tape() as tape:
        wp.launch(scale, 3, [x, b], device=device)
        wp.launch(scale, 3, [x, b], device=device)
    tape.backward(grads={x: ones(device)})
    start, factor = np.array([1.0, 2.0, 3.0]), np.array([2.0, 3.0, 4.0])
    assert np.allclose(x.grad.numpy(), factor**2)
    assert np.allclose(b.grad.numpy(), 2 * start * factor)


def test_arguments_that_overlap(device):
    x = wp.array([1.0, 2.0, 3.0, 4.0], dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch(square, 3, [x[:3]], [x[1:]], device=device)
    with pytest.raises(RuntimeError, match=r"'y'.*'x' overlap"):
        tape.backward(grads={x: wp.ones(4, dtype=float, device=device)})


def test_operators_in_place(device):
    x, y = pair(device)
    y.assign(np.array([5.0, 6.0, 7.0], dtype=np.float32))
    with wp.Tape() as tape:
        x *= y
        x *= x
    tape.backward(grads={x: ones(device)})
    start, factor = np.array([1.0, 2.0, 3.0]), np.array([5.0, 6.0, 7.0])
    assert np.allclose(x.grad.numpy(), 2 * start * factor**2)
    assert np.allclose(y.grad.numpy(), 2 * start**2 * factor)


def addresses(view):
    starts = (
        view.ptr + sum(i * s for i, s in zip(index, view.strides))
        for index in itertools.product(*map(range, view.shape))
    )
    return {start + byte for start in starts for byte in range(view.item_size)}


def test_overlap_of_views_is_never_missed():
    whole = wp.zeros((6, 8, 5), dtype=float, device="cpu")
    chance = random.Random(1)

    def view():
        keys = []
        for extent in whole.shape:
            low = chance.randrange(extent)
            high = chance.randrange(low + 1, extent + 1)
            step = chance.choice([1, 1, 2])
            keys.append(slice(low, high, step) if chance.random() < 0.7 else low)
        keys = tuple(keys) if any(isinstance(key, slice) for key in keys) else (keys[0],)
        return whole[keys].transpose() if chance.random() < 0.3 else whole[keys]

    wrong = 0
    for _ in range(500):
        one, other = view(), view()
        shared = bool(addresses(one) & addresses(other))
        found = Region(one).overlaps(Region(other))
        assert found or not shared
        wrong += found and not shared
    assert wrong < 60


def test_copies_keep_strides(device):
    source = wp.array(np.arange(24.0).reshape(4, 6), dtype=float, device=device)[1:, ::2]
    copy = copy_layout(source)
    assert copy.strides == source.strides
    assert np.array_equal(copy.numpy(), source.numpy())
