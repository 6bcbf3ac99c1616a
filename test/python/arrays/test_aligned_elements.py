"""Arrays whose elements are no multiples of their size in memory."""

import numpy as np
import pytest

import warp as wp

rng = np.random.default_rng(29)
N = 1000


def shifted(dtype, words, values, device):
    """An array of the values, as many words of 32 bits behind where memory begins."""
    whole = wp.zeros(words + values.size, dtype=float, device=device)
    array = wp.array(
        ptr=whole.ptr + 4 * words, shape=len(values), dtype=dtype, device=device, copy=False
    )
    array.assign(values)
    return array, whole


@pytest.mark.parametrize("words", [0, 1, 2, 3])
@pytest.mark.parametrize("dtype", [wp.vec2, wp.vec4, wp.quat, wp.mat22, wp.types.vector(6, float)])
def test_elements_and_gradients_lie_anywhere(dtype, words, device):
    @wp.kernel(module="unique")
    def scaled(x: wp.array(dtype=dtype), y: wp.array(dtype=dtype)):
        i = wp.tid()
        y[i] = 2.0 * x[i]

    shape = (N, *wp.zeros(1, dtype=dtype, device="cpu").numpy().shape[1:])
    values = rng.normal(size=shape).astype(np.float32)
    x, held = shifted(dtype, words, values, device)
    y, also_held = shifted(dtype, words, 0 * values, device)
    gradients = [shifted(dtype, 3 - words, number + 0 * values, device) for number in (0, 1)]
    x.grad, y.grad = gradients[0][0], gradients[1][0]
    with wp.Tape() as tape:
        wp.launch(scaled, N, [x, y], device=device)
    np.testing.assert_array_equal(y.numpy(), 2.0 * values)
    tape.backward()
    np.testing.assert_array_equal(x.grad.numpy(), np.full_like(values, 2.0))
    for whole in (held, also_held):
        assert not whole.numpy()[:words].any()
