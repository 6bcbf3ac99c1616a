"""Branches and loops in the code that blocks of a GPU run, by threads in any order between
barriers, against NumPy: a block waits where an access meets one before a branch, in it or in an
earlier turn of a loop."""

import numpy as np
import pytest
from support.block_program import run_block

import warp as wp

LENGTH, STEPS = 96, 5


@wp.kernel
def steps(
    a: wp.array(dtype=wp.float64),
    kinds: wp.array(dtype=int),
    room: wp.array(dtype=wp.float64),
    out: wp.array(dtype=wp.float64),
):
    t = wp.tile_load(a, shape=LENGTH, storage="shared")
    for k in range(STEPS):
        kind = kinds[k]
        if kind < 3:
            if kind == 0:
                # Elements of other threads, through the array.
                wp.tile_store(room, t, offset=1)
            elif kind == 1:
                s = wp.tile_sum(t)
                t = t * wp.float64(0.5) + wp.tile_broadcast(s, shape=(LENGTH,))
        elif kind == 3:
            t = wp.tile_load(room, shape=LENGTH, offset=2)
        u = wp.tile_load(room, shape=LENGTH)
        if kind != 4:
            t += u
        else:
            # An element of another thread, from shared memory.
            x = t[7 * k + 3]
            t = t + wp.tile_full(shape=LENGTH, value=x, dtype=wp.float64)
    if kinds[0] == 2:
        wp.tile_store(room, t)
    v = wp.tile_load(room, shape=LENGTH, offset=2)
    wp.tile_store(out, t - v)


def expected(a, kinds, room):
    t = a.copy()
    for k, kind in enumerate(kinds):
        if kind == 0:
            room[1 : LENGTH + 1] = t
        elif kind == 1:
            t = t * 0.5 + t.sum()
        elif kind == 3:
            t = room[2 : LENGTH + 2].copy()
        t = t + (t[7 * k + 3] if kind == 4 else room[:LENGTH])
    if kinds[0] == 2:
        room[:LENGTH] = t
    return t - room[2 : LENGTH + 2]


def run(kinds, seed, waits=True):
    rng = np.random.default_rng(seed)
    a, room, out = rng.normal(size=LENGTH), rng.normal(size=LENGTH + 2), np.zeros(LENGTH)
    found = room.copy()
    kinds = np.array(kinds, dtype=np.int32)
    run_block(steps, [a, kinds, found, out], seed, waits=waits)
    wanted = expected(a, kinds, room)
    return out, wanted, found, room


@pytest.mark.parametrize("seed", range(12))
def test_branches_in_loops(seed):
    kinds = np.random.default_rng(100 + seed).integers(0, 5, STEPS)
    out, wanted, found, room = run(kinds, seed)
    np.testing.assert_allclose(out, wanted, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found, room, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("kind", range(5))
def test_the_same_branch_in_each_turn(kind):
    out, wanted, found, room = run([kind] * STEPS, kind)
    np.testing.assert_allclose(out, wanted, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found, room, rtol=1e-9, atol=1e-9)


def test_branches_need_their_barriers():
    wrong = 0
    for seed in range(3):
        out, wanted, *_ = run([0, 3, 0, 1, 4], seed, waits=False)
        wrong += not np.allclose(out, wanted)
    assert wrong == 3
