"""Functions get tiles by reference: what they change, the caller sees."""

from typing import Any

import numpy as np

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
