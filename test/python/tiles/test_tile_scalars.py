"""Kernels for CPUs whose blocks have one thread and whose tiles have one element."""

import numpy as np
import pytest

import warp as wp

rng = np.random.default_rng(17)
N = 1000


def lanes_of(kernel):
    """How many threads of a CPU are lanes together."""
    (launch,) = kernel.schedule("cpu", dim=N)
    return int(next(one.value for one in launch.choices if one.what == "lanes"))


@pytest.mark.parametrize("options", [{}, {"mode": "debug"}])
def test_a_loss_is_summed_by_lanes(options):
    @wp.kernel(module="unique", module_options=options or None)
    def loss(x: wp.array(dtype=wp.vec3), total: wp.array(dtype=float)):
        d = x[wp.tid()]
        t = wp.tile(wp.log(1.0 + wp.dot(d, d)))
        wp.tile_atomic_add(total, wp.tile_sum(t * t), offset=(1,))

    values = rng.normal(size=(N, 3)).astype(np.float32)
    x = wp.array(values, dtype=wp.vec3, device="cpu", requires_grad=True)
    total = wp.zeros(2, dtype=float, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(loss, N, [x, total], device="cpu")
    squares = 1.0 + (values.astype(np.float64) ** 2).sum(axis=1)
    assert total.numpy() == pytest.approx([0.0, (np.log(squares) ** 2).sum()], rel=1e-5)
    tape.backward(grads={total: wp.ones(2, dtype=float, device="cpu")})
    slope = (4.0 * np.log(squares) / squares)[:, None] * values
    np.testing.assert_allclose(x.grad.numpy(), slope, atol=1e-5)
    if not options:
        assert lanes_of(loss) > 1


def test_elements_outside_of_arrays():
    @wp.kernel(module="unique")
    def moved(x: wp.array(dtype=float), y: wp.array(dtype=float), old: wp.array(dtype=float)):
        i = wp.tid()
        t = wp.tile_load(x, shape=1, offset=i - 2)
        wp.tile_store(y, wp.tile_map(wp.neg, t), offset=i - 1)
        before = wp.tile_atomic_add(y, t, offset=i - 3)
        old[i] = wp.tile_max(before)[0]

    values = rng.normal(size=5).astype(np.float32)
    x = wp.array(values, dtype=float, device="cpu")
    y, old = wp.zeros(5, dtype=float, device="cpu"), wp.zeros(9, dtype=float, device="cpu")
    wp.launch_tiled(moved, [9], [x, y, old], block_dim=64, device="cpu")
    # y[k] is -x[k - 1], to which the thread after the next adds x[k + 1].
    zero = np.zeros(1, np.float32)
    stored = np.concatenate([zero, -values[:-1]])
    added = np.concatenate([values[1:], zero])
    np.testing.assert_array_equal(y.numpy(), stored + added)
    np.testing.assert_array_equal(old.numpy()[3:8], stored)
    np.testing.assert_array_equal(old.numpy()[[0, 1, 2, 8]], 0.0)


def test_threads_hold_vectors_and_a_choice_holds_tiles():
    @wp.kernel(module="unique")
    def norms(x: wp.array(dtype=wp.vec2), y: wp.array(dtype=float)):
        i = wp.tid()
        t = wp.tile(x[i], preserve_type=True)
        if i % 2 == 0:
            t = t + t
        y[i] = wp.length(wp.untile(t))

    values = rng.normal(size=(N, 2)).astype(np.float32)
    x, y = wp.array(values, dtype=wp.vec2, device="cpu"), wp.zeros(N, dtype=float, device="cpu")
    wp.launch(norms, N, [x, y], device="cpu")
    factors = np.where(np.arange(N) % 2 == 0, 2.0, 1.0)
    np.testing.assert_allclose(y.numpy(), factors * np.linalg.norm(values, axis=1), rtol=1e-6)
