"""Sorting and extrema of tiles: any numbers, with equal ones, NaN and zeros of both signs."""

import numpy as np
import pytest

import warp as wp


def sorting(dtype, count):
    @wp.kernel
    def sort(keys: wp.array(dtype=dtype), places: wp.array(dtype=int)):
        k = wp.tile_load(keys, shape=count)
        v = wp.tile_arange(count)
        wp.tile_sort(k, v)
        wp.tile_store(keys, k)
        wp.tile_store(places, v)

    return sort


def some(dtype, count):
    """Numbers with many equal ones, from the least to the largest."""
    rng = np.random.default_rng(count)
    if np.issubdtype(dtype, np.integer):
        known = np.iinfo(dtype)
        chosen = [known.min, known.max, known.max // 2, 0, 1, known.min // 2]
    else:
        tiny = np.finfo(dtype).smallest_subnormal
        chosen = [-np.inf, np.inf, np.nan, -np.nan, 0.0, -0.0, tiny, -tiny, 1.5, -2.5]
    return rng.choice(np.array(chosen, dtype=dtype), count)


SORTED = [(np.float32, count) for count in (1, 7, 64, 203)] + [
    (dtype, 203) for dtype in (np.int8, np.uint16, np.int32, np.uint64, np.float16, np.float64)
]


@pytest.mark.parametrize(("dtype", "count"), SORTED)
def test_sorting_is_stable(dtype, count, device):
    values = some(dtype, count)
    keys = wp.array(values, device=device)
    places = wp.zeros(count, dtype=int, device=device)
    kernel = sorting(keys.dtype, count)
    wp.launch_tiled(kernel, dim=1, inputs=[keys, places], block_dim=32, device=device)
    order = np.argsort(values, kind="stable")
    np.testing.assert_array_equal(places.numpy(), order)
    np.testing.assert_array_equal(keys.numpy(), values[order])


def test_sorting_on_a_gpu_is_a_network():
    """The order of 64 places, as 40 elements have, in 21 steps."""
    ptx = sorting(wp.int32, 40).ir("ptx", arch=90)
    assert ptx.count("bar.sync") >= 21


@wp.kernel
def extrema(a: wp.array(dtype=float), out: wp.array(dtype=float)):
    t = wp.tile_load(a, shape=37)
    wp.tile_store(out, wp.tile_min(t))
    wp.tile_store(out, wp.tile_max(t), offset=1)


@pytest.mark.parametrize("kind", ["random", "negative", "with NaN", "nothing but NaN", "infinite"])
def test_extrema(kind, device):
    values = np.random.default_rng(3).normal(size=37).astype(np.float32)
    if kind == "negative":
        values = -np.abs(values)
    elif kind == "with NaN":
        values[::3] = np.nan
    elif kind == "nothing but NaN":
        values[:] = np.nan
    elif kind == "infinite":
        values[:] = np.inf
        values[5] = -np.inf
    a = wp.array(values, dtype=float, device=device)
    out = wp.zeros(2, dtype=float, device=device)
    wp.launch_tiled(extrema, dim=1, inputs=[a, out], block_dim=32, device=device)
    expected = [np.fmin.reduce(values), np.fmax.reduce(values)]
    np.testing.assert_array_equal(out.numpy(), np.array(expected, dtype=np.float32))
