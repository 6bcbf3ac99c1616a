"""Extrema of tiles by IEEE 754-2019: -0 lies below +0 and NaN is missing, in any order."""

import numpy as np
import pytest

import warp as wp

ROWS, COLUMNS = 6, 40


def numbers(seed):
    """Rows of zeros of both signs, with NaN and greater numbers in some."""
    rng = np.random.default_rng(seed)
    x = np.where(rng.random((ROWS, COLUMNS)) < 0.5, 0.0, -0.0)
    x[1] = -0.0
    x[2, rng.integers(0, COLUMNS, 5)] = np.nan
    x[3, rng.integers(0, COLUMNS, 5)] = -3.0
    x[4, rng.integers(0, COLUMNS, 5)] = 2.0
    return x


def extremum(x, axis, sign):
    """The greatest (`sign` 1) or smallest number, zeros by their signs."""
    order = sign * np.where(x == 0.0, np.copysign(1e-3, x), x)
    order = np.where(np.isnan(x), -np.inf, order)
    return np.take_along_axis(x, np.expand_dims(order.argmax(axis), axis), axis).squeeze(axis)


def same(got, expected):
    got = got.astype(np.float64).ravel()
    return np.array_equal(got, expected) and (np.signbit(got) == np.signbit(expected)).all()


@pytest.mark.parametrize("blocks", [False, True])
@pytest.mark.parametrize("dtype", [wp.float16, wp.bfloat16, wp.float32, wp.float64])
def test_zeros_and_nan(device, dtype, blocks, monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", blocks)

    @wp.kernel(module="unique")
    def find(
        x: wp.array2d(dtype=dtype),
        row_most: wp.array(dtype=dtype),
        row_least: wp.array(dtype=dtype),
        column_most: wp.array(dtype=dtype),
        column_least: wp.array(dtype=dtype),
        most: wp.array(dtype=dtype),
        least: wp.array(dtype=dtype),
        running: wp.array(dtype=dtype),
    ):
        t = wp.tile_load(x, shape=(ROWS, COLUMNS))
        wp.tile_store(row_most, wp.tile_max(t, axis=1))
        wp.tile_store(row_least, wp.tile_min(t, axis=1))
        wp.tile_store(column_most, wp.tile_max(t, axis=0))
        wp.tile_store(column_least, wp.tile_min(t, axis=0))
        for i in range(ROWS):
            row = wp.tile_load(x, shape=(1, COLUMNS), offset=(i, 0))
            wp.tile_store(most, wp.tile_max(row), offset=i)
            wp.tile_store(least, wp.tile_min(row), offset=i)
        first = wp.tile_reshape(wp.tile_load(x, shape=(1, COLUMNS)), shape=(COLUMNS,))
        wp.tile_store(running, wp.tile_scan_max_inclusive(first))

    x = numbers(1)
    given = wp.empty((ROWS, COLUMNS), dtype=dtype, device=device)
    wp.utils.array_cast(wp.array(x, dtype=wp.float64, device=device), given)
    sizes = (ROWS, ROWS, COLUMNS, COLUMNS, ROWS, ROWS, COLUMNS)
    outputs = [wp.zeros(n, dtype=dtype, device=device) for n in sizes]
    wp.launch_tiled(find, [1], [given, *outputs], block_dim=64, device=device)

    axes_and_signs = [(1, 1), (1, -1), (0, 1), (0, -1), (1, 1), (1, -1)]
    for output, (axis, sign) in zip(outputs, axes_and_signs, strict=False):
        assert same(output.numpy(), extremum(x, axis, sign)), (axis, sign)
    prefixes = [extremum(x[:1, : n + 1], 1, 1)[0] for n in range(COLUMNS)]
    assert same(outputs[-1].numpy(), np.array(prefixes))
