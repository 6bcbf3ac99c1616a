"""Copies and fills on a tape."""

import numpy as np
import pytest

import warp as wp


@wp.struct
class Inner:
    weight: float


@wp.struct
class Particle:
    position: wp.vec3
    kind: int
    inner: Inner


def array(values, device, dtype=float):
    return wp.array(values, dtype=dtype, requires_grad=True, device=device)


def backward(tape, result, seed):
    tape.backward(grads={result: wp.array(seed, dtype=result.dtype, device=result.device)})


def test_a_copy_adds_to_the_gradient(device):
    x = array([1.0, 2.0], device)
    y = wp.zeros_like(x)
    with wp.Tape() as tape:
        wp.copy(y, x)
        z = x * x + y
    backward(tape, z, [1.0, 10.0])
    assert np.array_equal(x.grad.numpy(), [3, 50])
    assert not y.grad.numpy().any()


def test_parts_and_strides(device):
    x = array(np.arange(12.0).reshape(3, 4), device)
    y = wp.zeros(4, dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.copy(y, x.reshape(12), dest_offset=1, src_offset=5, count=2)
        wp.copy(y[3:], x[2, 1:2])
    backward(tape, y, [1.0, 2.0, 3.0, 4.0])
    expected = np.zeros(12)
    expected[[5, 6, 9]] = [2, 3, 4]
    assert np.array_equal(x.grad.numpy().reshape(12), expected)
    assert np.array_equal(y.grad.numpy(), [1, 0, 0, 0])


def test_columns_and_items(device):
    x = array([[1.0, 2.0], [3.0, 4.0]], device)
    y = wp.zeros((2, 2), dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.copy(y.transpose(), x)
        y[0, 0] = 5.0
        y[1] = x[0]
    backward(tape, y, [[1.0, 2.0], [3.0, 4.0]])
    assert np.array_equal(x.grad.numpy(), [[3, 4], [2, 0]])


def test_clone_assign_and_contiguous(device):
    x = array([[1.0, 2.0], [3.0, 4.0]], device)
    y = wp.zeros_like(x)
    with wp.Tape() as tape:
        a = wp.clone(x)
        y.assign(a.transpose().contiguous())
    assert a.requires_grad
    backward(tape, y, [[1.0, 2.0], [3.0, 4.0]])
    assert np.array_equal(x.grad.numpy(), [[1, 3], [2, 4]])


def test_elements_of_other_types_with_the_same_scalars(device):
    x = wp.ones(2, dtype=wp.vec4, requires_grad=True, device=device)
    y = wp.zeros(2, dtype=wp.mat22, requires_grad=True, device=device)
    bits = wp.zeros(2, dtype=wp.types.vector(4, wp.int32), device=device)
    with wp.Tape() as tape:
        wp.copy(y, x)
        wp.copy(bits, x)
    backward(tape, y, np.arange(8.0).reshape(2, 2, 2))
    assert np.array_equal(x.grad.numpy(), np.arange(8.0).reshape(2, 4))


def test_constants_cut_what_came_before(device):
    x = array([1.0, 2.0], device)
    y = wp.zeros_like(x)
    with wp.Tape() as tape:
        wp.copy(y, x)
        y.fill_(3.0)
        z = y * y
    backward(tape, z, [1.0, 1.0])
    assert not x.grad.numpy().any()
    assert not y.grad.numpy().any()


def test_the_first_contents_keep_their_gradient(device):
    x = wp.zeros(2, dtype=float, requires_grad=True, device=device)
    with wp.Tape(preserve="auto") as tape:
        x.assign(np.array([3.0, 4.0], dtype=np.float32))
        first = x * x
        x.fill_(5.0)
        second = x * x
    one = wp.ones(2, dtype=float, device=device)
    tape.backward(grads={first: one, second: one})
    assert np.array_equal(x.grad.numpy(), [6, 8])


def test_elements_that_are_structs(device):
    x = wp.zeros(2, dtype=Particle, requires_grad=True, device=device)
    y, z = wp.zeros_like(x), wp.zeros_like(x)
    with wp.Tape() as tape:
        wp.copy(y, x)
        z.assign(x)
    seed = wp.zeros(2, dtype=Particle, device=device)
    numbers = seed.numpy().copy()
    numbers["position"] = np.arange(6.0).reshape(2, 3)
    numbers["inner"]["weight"] = [7.0, 8.0]
    seed.assign(wp.array(numbers, dtype=Particle, device="cpu"))
    tape.backward(grads={y: seed, z: seed})
    got = x.grad.numpy()
    assert np.array_equal(got["position"], 2 * np.arange(6.0).reshape(2, 3))
    assert np.array_equal(got["inner"]["weight"], [14, 16])


@pytest.mark.cuda
def test_copies_between_devices():
    x = array([1.0, 2.0], "cpu")
    with wp.Tape() as tape:
        y = wp.clone(x, device="cuda:0")
        z = y * y
    backward(tape, z, [1.0, 10.0])
    assert np.array_equal(x.grad.numpy(), [2, 40])
