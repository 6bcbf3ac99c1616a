"""Threads that are not there, or have returned, say nothing of where elements lie."""

import numpy as np
import pytest
from support.block_program import run_launch

import warp as wp

B = 4


@pytest.fixture(autouse=True)
def cpu_blocks(monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)


def launched(kernel, count, inputs, where):
    """Arrays after a launch of `count` threads: on a device, or as a GPU runs the code."""
    if where == "gpu code":
        given = [np.array(one) for one in inputs]
        run_launch(kernel, given, count, B, seed=count)
        return given
    given = [wp.array(one, device=where) for one in inputs]
    wp.launch(kernel, count, given, block_dim=B, device=where)
    return [one.numpy() for one in given]


@pytest.fixture(params=["device", "gpu code"])
def where(request, device):
    return device if request.param == "device" else request.param


@wp.kernel
def by_number(o: wp.array(dtype=int)):
    i = wp.tid()
    wp.tile_store(o, wp.tile(i + 100), offset=i / 4 * 4)


@wp.kernel
def by_table(o: wp.array(dtype=int), starts: wp.array(dtype=int)):
    i = wp.tid()
    wp.tile_store(o, wp.tile(i + 100), offset=starts[i])


@wp.kernel
def by_sum(o: wp.array(dtype=int), starts: wp.array(dtype=int)):
    i = wp.tid()
    wp.tile_atomic_add(o, wp.tile(i + 101), offset=starts[i])


@wp.kernel
def those_that_stay(o: wp.array(dtype=int), starts: wp.array(dtype=int)):
    i = wp.tid()
    if i >= 2 and i < 8 and i != 5:
        return
    wp.tile_store(o, wp.tile(i + 100), offset=starts[i])


@pytest.mark.parametrize("count", [1, 4, 5, 6, 7, 8, 11])
def test_stores(where, count):
    room = 16
    none = np.full(room, -1, dtype=np.int32)
    starts = (np.arange(room, dtype=np.int32) // B) * B
    rest = {-1, 0}
    for kernel, inputs in ((by_number, [none]), (by_table, [none, starts]),
                           (by_sum, [none, starts])):  # fmt: skip
        o = launched(kernel, count, inputs, where)[0]
        np.testing.assert_array_equal(o[:count], np.arange(count) + 100)
        assert set(o[count:]) <= rest, (kernel.key, o)
    o = launched(those_that_stay, count, [none, starts], where)[0]
    stays = [i for i in range(count) if not (2 <= i < 8 and i != 5)]
    np.testing.assert_array_equal(o[stays], np.array(stays) + 100)
    assert set(np.delete(o, stays)) <= rest, o


@wp.kernel
def scattered(o: wp.array(dtype=int), places: wp.array(dtype=int)):
    i = wp.tid()
    wp.tile_store(o, wp.tile(i + 100), offset=places[i] - i % 4)


@wp.kernel
def picked(o: wp.array(dtype=int), places: wp.array(dtype=int)):
    i = wp.tid()
    wp.tile_store_indexed(o, wp.tile(places[i]), wp.tile(i + 100))


@wp.kernel
def picked_sums(o: wp.array(dtype=int), places: wp.array(dtype=int)):
    i = wp.tid()
    at = wp.tile(places[i])
    wp.tile_atomic_add_indexed(o, wp.tile_map(wp.neg, wp.tile_map(wp.neg, at)), wp.tile(1))


@pytest.mark.parametrize("count", [3, 4, 5, 9, 10])
def test_places_of_each_thread(where, count):
    """Absent threads store nothing."""
    places = np.random.default_rng(count).permutation(24).astype(np.int32)
    expected = np.full(24, -1)
    expected[places[:count]] = np.arange(count) + 100
    for kernel in (scattered, picked):
        o = launched(kernel, count, [np.full(24, -1, dtype=np.int32), places], where)[0]
        np.testing.assert_array_equal(o, expected, err_msg=kernel.key)
    o = launched(picked_sums, count, [np.zeros(24, dtype=np.int32), places], where)[0]
    np.testing.assert_array_equal(o, expected >= 0)


@wp.kernel
def rows_of_each(a: wp.array2d(dtype=float), rows: wp.array(dtype=int), o: wp.array2d(dtype=float)):
    i = wp.tid()
    t = wp.tile_load(a, shape=(1, 8), offset=(rows[i], 0))
    wp.tile_atomic_add(o, t, offset=(rows[i], 0))


@pytest.mark.parametrize("count", [2, 4, 5, 7])
def test_loads_and_sums_at_places_of_each_thread(device, count):
    """Element (0, e) is that of thread e mod B."""
    a = np.arange(1.0, 65.0, dtype=np.float32).reshape(8, 8)
    rows = np.random.default_rng(count).integers(0, 8, 8).astype(np.int32)
    o = launched(rows_of_each, count, [a, rows, np.zeros_like(a)], device)[2]
    expected = np.zeros_like(a)
    for i in range(count):
        for e in range(i % B, 8, B):
            expected[rows[i], e] += a[rows[i], e]
    np.testing.assert_array_equal(o, expected)


@wp.kernel
def operands(x: wp.array(dtype=float), o: wp.array(dtype=float)):
    i = wp.tid()
    v = x[i]
    t = wp.tile_ones(8, dtype=float) * v
    wp.tile_store(o, t + wp.tile_full(8, float(i), dtype=float), offset=i // 4 * 8)


@pytest.mark.parametrize("count", [1, 4, 5, 6, 8])
def test_operands_of_threads_that_are_not_there_are_zero(where, count):
    x = np.arange(10.0, 18.0, dtype=np.float32)
    o = launched(operands, count, [x, np.full(16, -1, dtype=np.float32)], where)[1]
    blocks = -(-count // B)
    each = np.where(np.arange(blocks * B) < count, x[: blocks * B] + np.arange(blocks * B), 0)
    expected = np.full(16, -1.0)
    expected[: blocks * 8] = np.tile(each.reshape(blocks, 1, B), (1, 2, 1)).ravel()
    np.testing.assert_array_equal(o, expected)


@wp.kernel
def moved(x: wp.array(dtype=float), places: wp.array(dtype=int), y: wp.array(dtype=float)):
    i = wp.tid()
    t = wp.tile_load(x, shape=4, offset=places[i] - i % 4)
    wp.tile_store(y, t * t, offset=places[i] - i % 4)


def test_gradients(device):
    count, places = 6, np.array([5, 2, 7, 0, 3, 6, 1, 4], dtype=np.int32)
    x = wp.array(np.arange(1.0, 9.0), dtype=float, requires_grad=True, device=device)
    y = wp.zeros(8, dtype=float, requires_grad=True, device=device)
    given = wp.array(places, device=device)
    with wp.Tape() as tape:
        wp.launch(moved, dim=count, inputs=[x, given, y], block_dim=B, device=device)
    there = np.isin(np.arange(8), places[:count])
    np.testing.assert_array_equal(y.numpy(), np.where(there, np.arange(1.0, 9.0) ** 2, 0))
    tape.backward(grads={y: wp.array(np.arange(2.0, 10.0), dtype=float, device=device)})
    expected = np.where(there, 2 * np.arange(1.0, 9.0) * np.arange(2.0, 10.0), 0)
    np.testing.assert_array_equal(x.grad.numpy(), expected)
