"""Queries of hierarchies over boxes in kernels, against all boxes."""

import numpy as np
import pytest

import warp as wp

RANDOM = np.random.default_rng(11)


@wp.kernel
def touch_box(bvh: wp.uint64, low: wp.vec3, high: wp.vec3, seen: wp.array(dtype=int)):
    for i in wp.bvh_query_aabb(bvh, low, high):
        seen[i] += 1


@wp.kernel
def touch_ball(bvh: wp.uint64, center: wp.vec3, radius: float, seen: wp.array(dtype=int)):
    for i in wp.bvh_query_sphere(bvh, center, radius):
        seen[i] += 1


@wp.kernel
def touch_ray(bvh: wp.uint64, start: wp.vec3, dir: wp.vec3, end: float, seen: wp.array(dtype=int)):
    query = wp.bvh_query_ray(bvh, start, dir)
    index = int(-1)
    while wp.bvh_query_next(query, index, end):
        seen[index] += 1


@wp.kernel
def first_of_two(a: wp.uint64, b: wp.uint64, low: wp.vec3, high: wp.vec3, out: wp.array(dtype=int)):
    i = wp.tid()
    query = wp.bvh_query_aabb(a, low, high)
    if i % 2 == 1:
        query = wp.bvh_query_aabb(b, low, high)
    n = int(0)
    for _ in query:
        n += 1
        if n == 50:
            break
    out[i] = n


def boxes(n=600):
    low = (RANDOM.random((n, 3)) * 2 - 1).astype(np.float32)
    return low, (low + RANDOM.random((n, 3)) * 0.1).astype(np.float32)


def make(low, high, **options):
    lowers, uppers = (wp.array(x, dtype=wp.vec3, device="cpu") for x in (low, high))
    return wp.Bvh(lowers, uppers, **options)


def run(kernel, n, *inputs):
    seen = wp.zeros(n, dtype=int, device="cpu")
    wp.launch(kernel, dim=1, inputs=[*inputs, seen], device="cpu")
    return seen.numpy()


@pytest.mark.parametrize("constructor", ["sah", "median", "lbvh"])
def test_boxes_and_balls(constructor):
    low, high = boxes()
    bvh = make(low, high, constructor=constructor)
    for _ in range(20):
        a = (RANDOM.random(3) * 2 - 1.3).astype(np.float32)
        b = a + np.float32(0.5)
        expected = ((low <= b) & (high >= a)).all(1)
        assert (run(touch_box, 600, bvh.id, wp.vec3(*a), wp.vec3(*b)) == expected).all()
        off = np.maximum(np.maximum(low - a, a - high), 0).astype(float)
        near = np.linalg.norm(off, axis=1)
        got = run(touch_ball, 600, bvh.id, wp.vec3(*a), 0.4)
        assert (got[near < 0.4 - 1e-6] == 1).all() and (got[near > 0.4 + 1e-6] == 0).all()


def test_rays_end_where_they_are_told():
    low, high = boxes()
    bvh = make(low, high)
    for _ in range(20):
        start, direction = RANDOM.random(3) * 4 - 2, RANDOM.normal(size=3)
        with np.errstate(divide="ignore"):
            t = np.stack([low - start, high - start]) / direction
        entry, leave = np.maximum(t.min(0).max(1), 0), t.max(0).min(1)
        got = run(touch_ray, 600, bvh.id, wp.vec3(*start), wp.vec3(*direction), 1.5)
        clear = (np.abs(leave - entry) > 1e-5) & (np.abs(entry - 1.5) > 1e-5)
        assert (got == ((entry <= leave) & (entry < 1.5)))[clear].all()


def test_refit_and_rebuild_find_moved_boxes():
    low, high = boxes()
    bvh = make(low, high)
    for change in (bvh.refit, bvh.rebuild):
        moved = (low[::-1] * 3).copy()
        bvh.lowers.assign(moved)
        bvh.uppers.assign(moved + np.float32(0.1))
        change()
        got = run(touch_box, 600, bvh.id, wp.vec3(-1.0), wp.vec3(1.0))
        assert (got == ((moved <= 1) & (moved + np.float32(0.1) >= -1)).all(1)).all()


def test_a_query_may_be_chosen_and_left_early():
    low, high = boxes(80)
    many, few = make(low, high), make(low[:7], high[:7])
    out = wp.zeros(4, dtype=int, device="cpu")
    inputs = [many.id, few.id, wp.vec3(-9.0), wp.vec3(9.0), out]
    wp.launch(first_of_two, dim=4, inputs=inputs, device="cpu")
    assert out.numpy().tolist() == [50, 7, 50, 7]


def test_bad_input():
    low, high = boxes(10)
    with pytest.raises(RuntimeError, match="10 and 9"):
        make(low, high[:9])
    with pytest.raises(ValueError, match="leaf size"):
        make(low, high, leaf_size=0)
    with pytest.raises(ValueError, match="'sah'"):
        make(low, high, constructor="best")
    low[3] = np.nan
    assert make(low, high).report.skipped == 1
    empty = make(low[:0], high[:0])
    assert run(touch_box, 1, empty.id, wp.vec3(-9.0), wp.vec3(9.0))[0] == 0
