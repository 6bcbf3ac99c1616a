"""Programs that have reset a tape set its gradients to an empty dictionary."""

import pytest

import warp as wp


def test_gradients_of_a_tape_can_be_forgotten(device):
    x = wp.ones(2, dtype=float, requires_grad=True, device=device)
    tape = wp.Tape()
    with tape:
        y = x * 2.0
    tape.backward(grads={y: wp.ones_like(y)})
    tape.reset()
    tape.gradients = {}
    assert not tape.gradients
    with pytest.raises(AttributeError, match="set `array.grad`"):
        tape.gradients = {x: x}
