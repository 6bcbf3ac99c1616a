"""Sorts and runs ask that what they use of arrays is apart, not that the arrays are."""

import numpy as np
import pytest

import warp as wp


def ints(values, device):
    return wp.array(values, dtype=int, device=device)


def encoded(values):
    """Values and lengths of runs by NumPy."""
    starts = np.flatnonzero(np.r_[True, values[1:] != values[:-1]])
    return values[starts], np.diff(np.r_[starts, len(values)])


@pytest.mark.parametrize("gap", [0, 1])
def test_runs_of_views_of_one_array(device, gap):
    """Input, values, lengths and number of runs share one array whose views overlap behind."""
    n = 50
    data = np.random.default_rng(0).integers(0, 3, n).astype(np.int32)
    memory = ints(np.r_[data, np.zeros(3 * (n + gap) + 1)].astype(np.int32), device)
    views = [memory[i * (n + gap) :] for i in range(4)]
    count = wp.utils.runlength_encode(*views[:3], run_count=views[3][:1], value_count=n)
    runs = int(count.numpy()[0])
    values, lengths = encoded(data)
    assert runs == len(values)
    assert (views[1].numpy()[:runs] == values).all()
    assert (views[2].numpy()[:runs] == lengths).all()
    assert (memory.numpy()[:n] == data).all()
    # The number is returned if there is nowhere to write it.
    assert wp.utils.runlength_encode(*views[:3], value_count=n) == runs


def test_runs_of_a_strided_view(device):
    n = 40
    memory = ints(np.arange(4 * n) // 8, device)
    view = memory[: 2 * n : 2]
    data = view.numpy().copy()
    out = memory[2 * n : 3 * n], memory[3 * n :]
    runs = wp.utils.runlength_encode(view, *out, value_count=n)
    values, lengths = encoded(data)
    assert runs == len(values)
    assert (out[0].numpy()[:runs] == values).all() and (out[1].numpy()[:runs] == lengths).all()


def test_used_parts_that_overlap_are_refused(device):
    memory = ints(np.zeros(64), device)
    total = ints([0], device)
    first, apart = memory[:16], memory[32:]
    for arrays in (
        (first, memory[15:], apart, total),
        (memory[8:], memory[:16], apart, total),
        (first, memory[16:], memory[31:], total),
        (first, memory[16:], apart, memory[40:]),
        (first, memory[16:], apart, memory[3:]),
        (memory[:31:2], memory[16:], apart, total),
    ):
        with pytest.raises(RuntimeError, match="requires arrays that do not overlap"):
            wp.utils.runlength_encode(*arrays, value_count=16)
    assert not memory.numpy().any()


@pytest.mark.parametrize("sort", ["radix_sort_pairs", "segmented_sort_pairs"])
def test_sorts_of_views_of_one_array(device, sort):
    """The first `2 * count` elements of `count` pairs are used."""
    n = 30
    keys = np.random.default_rng(1).integers(0, 100, n)
    memory = ints(np.r_[keys, np.zeros(n), np.arange(n), np.zeros(3 * n)], device)
    segments = (ints([0, n], device),) if sort == "segmented_sort_pairs" else ()
    getattr(wp.utils, sort)(memory, memory[2 * n :], n, *segments)
    order = np.argsort(keys, kind="stable")
    assert (memory.numpy()[:n] == keys[order]).all()
    assert (memory.numpy()[2 * n : 3 * n] == order).all()
    with pytest.raises(RuntimeError, match="requires arrays that do not overlap"):
        getattr(wp.utils, sort)(memory, memory[2 * n - 1 :], n, *segments)
