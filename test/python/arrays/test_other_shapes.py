"""Assigning elements in another shape, or only some, and arrays whose address is taken away."""

import numpy as np
import pytest

import warp as wp


def test_assigning_as_many_elements(device):
    x = np.arange(6.0, dtype=np.float32)
    target = wp.zeros((1, 2), dtype=wp.vec3, device=device)
    other = wp.array(x.reshape(2, 3), dtype=wp.vec3, device=device)
    for source in (x.reshape(2, 3), x.reshape(1, 2, 3), x, x.reshape(2, 3).tolist(), other):
        target.zero_()
        target.assign(source)
        np.testing.assert_array_equal(target.numpy().ravel(), x)


# MuJoCo Warp fills the part of a padded array that is in use.
def test_fewer_elements_are_the_first(device):
    target = wp.full((2, 4), 7.0, dtype=float, device=device)
    target.assign(np.arange(5.0))
    np.testing.assert_array_equal(target.numpy(), [[0, 1, 2, 3], [4, 7, 7, 7]])
    target.assign(wp.zeros((1, 3), dtype=float, device=device))
    np.testing.assert_array_equal(target.numpy(), [[0, 0, 0, 3], [4, 7, 7, 7]])
    target.assign([])
    assert target.numpy()[1, 0] == 4


def test_more_elements_are_refused(device):
    target = wp.zeros((1, 2), dtype=wp.vec3, device=device)
    with pytest.raises(ValueError, match=r"expects shape \(1, 2\) to assign, but got \(3,\)"):
        target.assign(np.ones((3, 3)))


def test_views_need_the_same_shape(device):
    target = wp.zeros((4, 2), dtype=float, device=device)[:, 0]
    for shape in ((2, 2), (3,)):
        with pytest.raises(ValueError, match=r"expects shape \(4,\) to assign"):
            target.assign(np.ones(shape, np.float32))
    target.assign(np.ones(4, np.float32))
    assert target.numpy().tolist() == [1.0] * 4


def test_gradients_through_another_shape(device):
    source = wp.array(np.arange(6.0), dtype=float, requires_grad=True, device=device)
    target = wp.zeros((2, 3), dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        target.assign(source)
    weights = np.arange(6.0, dtype=np.float32).reshape(2, 3)
    tape.backward(grads={target: wp.array(weights, device=device)})
    np.testing.assert_array_equal(source.grad.numpy(), weights.ravel())


# Newton marks empty selections so.
def test_an_address_can_be_taken_away(device):
    made = wp.empty((3, 0), dtype=float, device=device)
    made.ptr = None
    assert made.ptr is None and made.shape == (3, 0) and made.numpy().shape == (3, 0)
