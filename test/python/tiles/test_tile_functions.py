"""Functions get tiles by reference: what they change, the caller sees."""

from typing import Any

import numpy as np
import pytest

import warp as wp


@wp.func
def change(t: Any, s: float):
    t[0] = s
    t[1] += 2.0 * s


@wp.func
def twice(t: Any):
    t = t * 2.0
    return t


@wp.kernel
def call(a: wp.array(dtype=float), b: wp.array(dtype=float)):
    t = wp.tile_load(a, shape=4)
    u = twice(t)
    v = t[2:4]
    change(v, 1.0)
    wp.tile_store(b, t)
    wp.tile_store(b, u, offset=4)


def test_changes_reach_the_variable_and_replacements_do_not(device):
    a = wp.array(np.arange(4.0), dtype=float, device=device)
    b = wp.zeros(8, dtype=float, device=device)
    # One thread, as several would each add to the element.
    wp.launch_tiled(call, dim=1, inputs=[a, b], block_dim=1, device=device)
    np.testing.assert_array_equal(b.numpy(), [0, 1, 1, 5, 0, 2, 4, 6])


@wp.func
def scale(t: wp.tile[float, 2, Any], s: float) -> wp.tile[float, 2, 3]:
    return t * s


@wp.func
def add_one(t: wp.tile[float, 2, 3]):
    t += wp.tile_ones(shape=(2, 3), dtype=float)


@wp.kernel
def annotated(a: wp.array2d(dtype=float), b: wp.array2d(dtype=float)):
    t = wp.tile_load(a, shape=(2, 3))
    add_one(t)
    wp.tile_store(b, scale(t, 2.0))


def test_annotated_parameters(device):
    values = np.arange(6.0).reshape(2, 3)
    a = wp.array(values, dtype=float, device=device)
    b = wp.zeros((2, 3), dtype=float, device=device)
    wp.launch_tiled(annotated, dim=1, inputs=[a, b], block_dim=32, device=device)
    np.testing.assert_array_equal(b.numpy(), 2.0 * (values + 1.0))


def test_another_shape_than_declared():
    def kernel(a: wp.array(dtype=float)):
        add_one(wp.tile_load(a, shape=3))

    with pytest.raises(wp.WarpCodegenError) as caught:
        wp.Kernel(kernel).ir("warp")
    text = str(caught.value)
    for word in ("shape=(3,)", "shape=(2, 3)", "test_tile_functions.py", "^"):
        assert word in text, text


def test_extents_of_an_annotation():
    for extents in ((0,), (2.5,), (1, 1, 1, 1, 1)):
        with pytest.raises(TypeError, match="positive"):
            wp.tile[(float, *extents)]
    with pytest.raises(TypeError, match="no items"):
        wp.tile_load[float, 2]


@wp.kernel
def change_in_a_loop(rounds: int, b: wp.array(dtype=float)):
    t = wp.tile_zeros(shape=4, dtype=float)
    for r in range(rounds):
        change(t, float(r))
    wp.tile_store(b, t)


def test_changes_in_a_loop_are_carried(device):
    b = wp.zeros(4, dtype=float, device=device)
    wp.launch_tiled(change_in_a_loop, dim=1, inputs=[4, b], block_dim=1, device=device)
    np.testing.assert_array_equal(b.numpy(), [3, 12, 0, 0])
