"""Updates that neighbouring threads make together: counters, and elements of whole rows."""

import numpy as np
import pytest

import warp as wp
from frontend_programs import define
from threads_launches import MODES, SIZES

COUNTERS = """
@wp.kernel(module_options=OPTIONS)
def k(step: wp.array(dtype=int), up: wp.array(dtype=int), down: wp.array(dtype=wp.uint64),
      first: wp.array(dtype=int), before: wp.array(dtype=wp.uint64)):
    i = wp.tid()
    if step[i] > 0:
        first[i] = wp.atomic_add(up, 1, step[i])
        if step[i] > 2:
            before[i] = wp.atomic_sub(down, 0, wp.uint64(3))
"""
ROWS = """
@wp.kernel(module_options=OPTIONS)
def k(x: wp.array(dtype=float), width: int, most: wp.array(dtype=float),
      least: wp.array(dtype=wp.vec2), count: wp.array(dtype=int), sums: wp.array(dtype=float)):
    i = wp.tid()
    row = i // width
    wp.atomic_max(most, row, x[i])
    wp.atomic_min(least, row, wp.vec2(x[i], -x[i]))
    if x[i] > 0.0:
        wp.atomic_sub(count, row, i)
    wp.atomic_add(sums, i / width, x[i])
"""


@pytest.mark.parametrize("mode", MODES)
def test_numbers_from_a_counter_are_given_once(device, mode):
    kernel = define(COUNTERS, OPTIONS=MODES[mode])["k"]
    for n in SIZES:
        step = np.random.default_rng(n).integers(-2, 6, n).astype(np.int32)
        up = wp.array(np.array([5, 100], np.int32), device=device)
        down = wp.array(np.array([7], np.uint64), device=device)
        first = wp.zeros(n, dtype=int, device=device)
        before = wp.zeros(n, dtype=wp.uint64, device=device)
        arrays = [wp.array(step, device=device), up, down, first, before]
        wp.launch(kernel, n, arrays, device=device)
        taken, begin = step[step > 0], first.numpy()[step > 0]
        order = np.argsort(begin)
        ends = 100 + np.cumsum(taken[order])
        np.testing.assert_array_equal(begin[order], ends - taken[order])
        assert up.numpy().tolist() == [5, 100 + taken.sum()]
        count = (step > 2).sum()
        # Integers wrap.
        seen = np.uint64(7) - np.uint64(3) * np.arange(count + 1, dtype=np.uint64)
        assert down.numpy()[0] == seen[-1]
        found = before.numpy()[step > 2]
        np.testing.assert_array_equal(np.sort(found), np.sort(seen[:-1]))


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("width", [1, 5, 16, 40, 64, 5000])
def test_rows(device, mode, width):
    kernel = define(ROWS, OPTIONS=MODES[mode])["k"]
    for n in SIZES:
        x = (np.random.default_rng(n).integers(-40, 40, n) / 4).astype(np.float32)
        row, rows = np.arange(n) // width, n // width + 2
        most = np.full(rows, -3, np.float32)
        least = np.full((rows, 2), 3, np.float32)
        count, sums = np.full(rows, 9, np.int32), np.zeros(rows, np.float32)
        arrays = [most, least, count, sums]
        given = [wp.array(one, device=device) for one in (x, most, count, sums)]
        given.insert(2, wp.array(least, dtype=wp.vec2, device=device))
        wp.launch(kernel, n, [given[0], width, *given[1:]], device=device)
        np.maximum.at(most, row, x)
        np.minimum.at(least, row, np.stack([x, -x], 1))
        np.subtract.at(count, row[x > 0], np.arange(n, dtype=np.int32)[x > 0])
        np.add.at(sums, row, x)
        for found, expected in zip(given[1:], arrays, strict=True):
            np.testing.assert_array_equal(found.numpy(), expected)
