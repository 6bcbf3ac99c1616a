"""A deterministic launch hands out places in the order of its threads, whatever way they take."""

import numpy as np
import pytest

import warp as wp

OPTIONS = {"deterministic": "run_to_run"}
N = 203


@wp.kernel(module_options=OPTIONS)
def branched(kind: wp.array[int], used: wp.array[int], place: wp.array[int], turn: wp.array[int]):
    i = wp.tid()
    if kind[i] == 0:
        place[i] = wp.atomic_add(used, 0, 3)
    elif kind[i] == 1:
        place[i] = wp.atomic_sub(used, 0, -1)
    elif kind[i] == 2:
        place[i] = used[1]
        place[i] = wp.atomic_add(used, 0, 2)
    turn[i] = wp.atomic_exch(used, 1, i)


@wp.kernel(module_options=OPTIONS)
def looped(length: wp.array[int], used: wp.array[int], list_of: wp.array[int]):
    i = wp.tid()
    for k in range(length[i]):
        list_of[wp.atomic_add(used, 0, 1)] = 100 * i + k


@wp.kernel(module_options=OPTIONS)
def bid(value: wp.array[int], slot: wp.array[int], seen: wp.array[int]):
    i = wp.tid()
    seen[i] = wp.atomic_cas(slot, 0, value[i], i)


def ints(values, device):
    return wp.array(values, dtype=int, device=device)


@pytest.mark.parametrize("n", [5, N])
def test_places_of_branches(n, device):
    kind = np.random.default_rng(n).integers(0, 4, n)
    used = ints([0, -1], device)
    place, turn = wp.full(n, -1, dtype=int, device=device), wp.zeros(n, dtype=int, device=device)
    wp.launch(branched, n, [ints(kind, device), used, place, turn], device=device)
    size = np.array([3, 1, 2, 0])[kind]
    before = np.cumsum(size) - size
    np.testing.assert_array_equal(place.numpy(), np.where(kind == 3, -1, before))
    np.testing.assert_array_equal(turn.numpy(), np.arange(n) - 1)
    assert used.numpy().tolist() == [size.sum(), n - 1]


@pytest.mark.parametrize("n", [5, N])
def test_places_of_loops(n, device):
    length = np.random.default_rng(n).integers(0, 5, n)
    used = wp.zeros(1, dtype=int, device=device)
    list_of = wp.full(int(length.sum()) + 1, -1, dtype=int, device=device)
    wp.launch(looped, n, [ints(length, device), used, list_of], device=device)
    wanted = [100 * i + k for i in range(n) for k in range(length[i])]
    assert list_of.numpy().tolist() == [*wanted, -1]


def test_turns_of_comparisons(device):
    value = np.random.default_rng(1).integers(0, 20, N)
    slot, seen = wp.zeros(1, dtype=int, device=device), wp.zeros(N, dtype=int, device=device)
    wp.launch(bid, N, [ints(value, device), slot, seen], device=device)
    held, wanted = 0, []
    for i in range(N):
        wanted.append(held)
        held = i if value[i] == held else held
    assert seen.numpy().tolist() == wanted and slot.numpy()[0] == held
