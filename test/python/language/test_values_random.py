"""Random numbers: the generator is defined here a second time, in NumPy, with each rounding.

Sequences equal those of NVIDIA Warp bit by bit for integers and uniform floats; normal ones are
the correctly rounded values of the same formula.
"""

import numpy as np
import pytest

import warp as wp
from builtin_values import assert_ulps

COUNT = 512
F = np.float32


@wp.kernel
def draw_all(
    seeds: wp.array(dtype=int),
    offsets: wp.array(dtype=int),
    states: wp.array2d(dtype=wp.uint32),
    signed: wp.array2d(dtype=int),
    unsigned: wp.array2d(dtype=wp.uint32),
    floats: wp.array2d(dtype=float),
):
    i = wp.tid()
    states[i, 0] = wp.rand_init(seeds[i])
    state = wp.rand_init(seeds[i], offsets[i])
    states[i, 1] = state
    signed[i, 0] = wp.randi(state)
    signed[i, 1] = wp.randi(state, -7, 1000)
    unsigned[i, 0] = wp.randu(state)
    unsigned[i, 1] = wp.randu(state, wp.uint32(3), wp.uint32(1000000))
    floats[i, 0] = wp.randf(state)
    floats[i, 1] = wp.randf(state, -2.5, 3.7)
    floats[i, 2] = wp.randn(state)
    signed[i, 2] = wp.randi(state, 5, 5)
    states[i, 2] = state


def hashed(state):
    """PCG-RXS-M-XS, 32 bits."""
    word = (state.astype(np.uint64) * 747796405 + 2891336453) & 0xFFFFFFFF
    word = ((word >> ((word >> 28) + 4)) ^ word) * 277803737 & 0xFFFFFFFF
    return ((word >> 22) ^ word).astype(np.uint32)


def unit(state):
    return (state >> 8).astype(F) * F(2**-24)


@pytest.fixture(scope="module")
def inputs():
    random = np.random.default_rng(11)
    return random.integers(-(2**31), 2**31, (2, COUNT)).astype(np.int32)


@pytest.fixture
def drawn(device, inputs):
    arrays = [wp.array(x, dtype=int, device=device) for x in inputs]
    results = [
        wp.zeros((COUNT, columns), dtype=dtype, device=device)
        for columns, dtype in ((3, wp.uint32), (3, int), (2, wp.uint32), (3, float))
    ]
    wp.launch(draw_all, dim=COUNT, inputs=arrays, outputs=results, device=device)
    return [x.numpy() for x in results]


def test_sequence(drawn, inputs):
    states, signed, unsigned, floats = drawn
    seeds, offsets = inputs.view(np.uint32)
    np.testing.assert_array_equal(states[:, 0], hashed(seeds))
    s = hashed(seeds + hashed(offsets))
    np.testing.assert_array_equal(states[:, 1], s)
    s = hashed(s)
    np.testing.assert_array_equal(signed[:, 0], s.view(np.int32))
    s = hashed(s)
    np.testing.assert_array_equal(signed[:, 1], (s % 1007).astype(np.int64) - 7)
    s = hashed(s)
    np.testing.assert_array_equal(unsigned[:, 0], s)
    s = hashed(s)
    np.testing.assert_array_equal(unsigned[:, 1], s % 999997 + 3)
    s = hashed(s)
    np.testing.assert_array_equal(floats[:, 0], unit(s))
    s = hashed(s)
    np.testing.assert_array_equal(floats[:, 1], (F(3.7) - F(-2.5)) * unit(s) + F(-2.5))
    first = hashed(s)
    s = hashed(first)
    radius = np.sqrt(-2.0 * np.log((unit(first) + F(5.96e-8)).astype(np.float64)))
    angle = (F(2) * F(np.pi) * unit(s)).astype(np.float64)
    assert_ulps(floats[:, 2].astype(np.float64), radius * np.cos(angle), wp.float32, 3)
    s = hashed(s)
    np.testing.assert_array_equal(signed[:, 2], np.full(COUNT, 5))
    np.testing.assert_array_equal(states[:, 2], s)


def test_sequence_of_nvidia_warp(device):
    """The numbers that NVIDIA Warp 1.19 gives on the CPU."""

    @wp.kernel
    def draw_known(y: wp.array(dtype=wp.uint32), f: wp.array(dtype=float)):
        state = wp.rand_init(42)
        y[0] = state
        y[1] = wp.rand_init(7, 3)
        y[2] = wp.randu(state)
        f[0] = wp.randf(state)
        f[1] = wp.randf(state, -2.5, 3.7)

    y = wp.zeros(3, dtype=wp.uint32, device=device)
    f = wp.zeros(2, dtype=float, device=device)
    wp.launch(draw_known, dim=1, outputs=[y, f], device=device)
    assert y.numpy().tolist() == [1223963391, 1201941248, 2785308739]
    assert f.numpy().tolist() == [0.9323613047599792, 1.6755423545837402]
