"""On the CPU threads take slots of a counter in their order, unless they are very many."""

import numpy as np
import pytest

import warp as wp
from warp._src.kernels import native_code

CPU = "cpu"


@wp.kernel
def take(used: wp.array[int], holder: wp.array[int], work: int):
    i = wp.tid()
    x = float(i)
    for _ in range(work):
        x = wp.sin(x)
    if x < 2.0:
        holder[wp.atomic_add(used, 0, 1)] = i


@wp.kernel
def take_some(count: wp.array[int], used: wp.array[int], holder: wp.array[int]):
    i = wp.tid()
    for k in range(count[i]):
        holder[wp.atomic_add(used, 0, 1)] = 10 * i + k


@wp.kernel
def take_and_return(used: wp.array[int], seen: wp.array[int]):
    i = wp.tid()
    seen[i] = wp.atomic_add(used, 0, 1)
    wp.atomic_sub(used, 0, 1)


@wp.func
def take_of_cell(used: wp.array[int], cell: int):
    return wp.atomic_add(used, cell, 1)


@wp.kernel
def sort_into(cell: wp.array[int], used: wp.array[int], rank: wp.array[int]):
    i = wp.tid()
    rank[i] = take_of_cell(used, cell[i])


@wp.kernel
def take_of_grid(used: wp.array[int], holder: wp.array[int]):
    i, j = wp.tid()
    holder[wp.atomic_add(used, 0, 1)] = 1000 * i + j


@wp.kernel
def others(top: wp.array[int], top_seen: wp.array[int], last: wp.array[int], before: wp.array[int]):
    i = wp.tid()
    top_seen[i] = wp.atomic_max(top, 0, (i * 7919) % 1009)
    before[i] = wp.atomic_exch(last, 0, i)


@wp.kernel
def lock(word: wp.array[int], order: wp.array[int], used: wp.array[int]):
    i = wp.tid()
    while wp.atomic_cas(word, 0, 0, 1) == 1:
        pass
    order[used[0]] = i
    used[0] = used[0] + 1
    wp.atomic_exch(word, 0, 0)


@wp.func_native("return atomicAdd(&used.data[0], 1);")
def next_slot(used: wp.array(dtype=int)) -> int: ...


@wp.func_native("for (int k = 0; k < 2; ++k) holder.data[wp::atomic_add(used, 0, 1)] = 10 * i + k;")
def two_slots(used: wp.array(dtype=int), holder: wp.array(dtype=int), i: int): ...


@wp.kernel(enable_backward=False)
def take_natively(used: wp.array[int], holder: wp.array[int], pairs: wp.array[int]):
    i = wp.tid()
    holder[next_slot(used)] = i
    two_slots(pairs, pairs, i)


@wp.kernel
def histogram(bin_of: wp.array[int], count: wp.array[int]):
    wp.atomic_add(count, bin_of[wp.tid()], 1)


def ints(values):
    return wp.array(values, dtype=int, device=CPU)


def zeros(n):
    return wp.zeros(n, dtype=int, device=CPU)


@pytest.mark.parametrize("n, work, times", [(30, 400, 50), (4096, 50, 20), (100_000, 5, 10)])
def test_one_slot(n, work, times):
    for _ in range(times):
        used, holder = zeros(1), zeros(n)
        wp.launch(take, n, [used, holder, work], device=CPU)
        assert np.array_equal(holder.numpy(), np.arange(n))


def test_several_slots_of_a_thread_are_neighbours():
    count = np.random.default_rng(0).integers(0, 4, 50_000)
    holder = zeros(int(count.sum()))
    wp.launch(take_some, len(count), [ints(count), zeros(1), holder], device=CPU)
    first = np.cumsum(count) - count
    within = np.arange(count.sum()) - np.repeat(first, count)
    assert np.array_equal(holder.numpy(), 10 * np.repeat(np.arange(len(count)), count) + within)


def test_a_thread_ends_before_the_next_one():
    used, seen = zeros(1), zeros(30_000)
    wp.launch(take_and_return, 30_000, [used, seen], device=CPU)
    assert not seen.numpy().any() and used.numpy()[0] == 0


def test_slots_of_cells():
    cell = np.random.default_rng(1).integers(0, 7, 40_000)
    rank = zeros(len(cell))
    wp.launch(sort_into, len(cell), [ints(cell), zeros(7), rank], device=CPU)
    for one in range(7):
        assert np.array_equal(rank.numpy()[cell == one], np.arange(np.sum(cell == one)))


def test_two_dimensions():
    holder = zeros(300 * 170)
    wp.launch(take_of_grid, (300, 170), [zeros(1), holder], device=CPU)
    i, j = np.divmod(np.arange(300 * 170), 170)
    assert np.array_equal(holder.numpy(), 1000 * i + j)


def test_other_atomics():
    n = 20_000
    seen, before = zeros(n), zeros(n)
    wp.launch(others, n, [zeros(1), seen, ints([-1]), before], device=CPU)
    bids = np.maximum.accumulate((np.arange(n) * 7919) % 1009)
    assert np.array_equal(seen.numpy(), np.concatenate([[0], bids[:-1]]))
    assert np.array_equal(before.numpy(), np.arange(n) - 1)


def test_a_lock():
    order = zeros(20_000)
    wp.launch(lock, 20_000, [zeros(1), order, zeros(1)], device=CPU)
    assert np.array_equal(order.numpy(), np.arange(20_000))


def test_native_code():
    if not native_code.compiler():
        pytest.skip("no Clang")
    n = 20_000
    holder, pairs = zeros(n), zeros(2 * n + 1)
    pairs.fill_(1)
    wp.launch(take_natively, n, [zeros(1), holder, pairs], device=CPU)
    assert np.array_equal(holder.numpy(), np.arange(n))
    assert np.array_equal(pairs.numpy()[1:], 10 * np.repeat(np.arange(n), 2) + np.tile([0, 1], n))


def test_a_graph_keeps_the_order():
    used, holder = zeros(1), zeros(20_000)
    with wp.ScopedCapture(CPU) as capture:
        used.zero_()
        wp.launch(take, 20_000, [used, holder, 3], device=CPU)
    for _ in range(10):
        wp.capture_launch(capture.graph)
        assert np.array_equal(holder.numpy(), np.arange(20_000))


def updates(kernel):
    choices = kernel.schedule(CPU, dim=1 << 17)[0].choices
    return [str(one.reason) for one in choices if one.what == "updates"]


REASON = "who comes first shows, and is who has the lower index"


def test_the_setting():
    """Without it, such kernels run on all cores; others do in any case."""
    assert updates(take) == [REASON] and REASON not in updates(histogram)
    try:
        wp.config.ordered_slots = False
        assert REASON not in updates(take)
    finally:
        wp.config.ordered_slots = 1 << 17
    free = wp.Kernel(take.func, "take_freely", options={"ordered_slots": False})
    assert REASON not in updates(free)
    used, holder = zeros(1), zeros(5000)
    wp.launch(free, 5000, [used, holder, 3], device=CPU)
    assert np.array_equal(np.sort(holder.numpy()), np.arange(5000))


def test_lanes_stay_where_threads_take_one_slot():
    """Lanes take it one after another; of several slots each thread takes all at once."""
    lanes = {}
    for kernel in (take, take_some):
        choices = kernel.schedule(CPU, dim=1 << 17)[0].choices
        lanes[kernel.key] = next(one for one in choices if one.what == "lanes")
    assert int(lanes["take"].value) > 1
    assert lanes["take_some"].value == "1"
