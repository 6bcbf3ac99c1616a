"""Boxes with infinite sides in a `Bvh`: half-spaces, slabs and the whole space, against NumPy."""

import numpy as np
import pytest

import warp as wp
from warp._src.geometry import bvh as hierarchies

INF = np.inf


@wp.kernel
def overlaps(
    bvh: wp.uint64,
    low: wp.array(dtype=wp.vec3),
    high: wp.array(dtype=wp.vec3),
    found: wp.array2d(dtype=int),
):
    i = wp.tid()
    for box in wp.bvh_query_aabb(bvh, low[i], high[i]):
        found[i, box] += 1


@wp.kernel
def rays(
    bvh: wp.uint64,
    start: wp.array(dtype=wp.vec3),
    direction: wp.array(dtype=wp.vec3),
    found: wp.array2d(dtype=int),
):
    i = wp.tid()
    for box in wp.bvh_query_ray(bvh, start[i], direction[i]):
        found[i, box] += 1


@wp.kernel
def spheres(
    bvh: wp.uint64,
    center: wp.array(dtype=wp.vec3),
    radius: float,
    found: wp.array2d(dtype=int),
):
    i = wp.tid()
    for box in wp.bvh_query_sphere(bvh, center[i], radius):
        found[i, box] += 1


def boxes(n):
    """Small boxes around 100, of which every fourth has infinite sides."""
    rng = np.random.default_rng(n)
    low = rng.uniform(99, 101, (n, 3)).astype(np.float32)
    high = low + rng.uniform(0, 0.3, (n, 3)).astype(np.float32)
    for i in range(0, n, 4):
        sides = rng.integers(0, 3, 3)
        low[i] = np.where(sides > 0, -INF, low[i])
        high[i] = np.where(sides > 1, INF, high[i])
    return low, high


def check(bvh, low, high):
    n, device = len(low), bvh.device
    rng = np.random.default_rng(1)
    p = rng.uniform(98, 102, (60, 3)).astype(np.float32)
    d = rng.standard_normal((60, 3)).astype(np.float32)
    d[:9] = np.repeat(np.eye(3), 3, axis=0)
    p[-2:] = [[1e30, 1e30, -1e30], [-1e30, 100, 100]]
    far = p + np.float32(0.4)
    p[0], far[0] = -INF, INF
    finite = p.copy()
    finite[0] = 100

    def vectors(values):
        return wp.array(values, dtype=wp.vec3, device=device)

    def found(kernel, *inputs):
        out = wp.zeros((60, n), dtype=int, device=device)
        wp.launch(kernel, 60, [bvh.id, *inputs, out], device=device)
        return out.numpy()

    wanted = ((low <= far[:, None]) & (high >= p[:, None])).all(2)
    np.testing.assert_array_equal(found(overlaps, vectors(p), vectors(far)), wanted)
    start = finite.astype(np.float64)[:, None]
    with np.errstate(all="ignore"):
        times = [(side - start) / d.astype(np.float64)[:, None] for side in (low, high)]
    rest = d[:, None] == 0
    inside = (low <= finite[:, None]) & (high >= finite[:, None])
    enter = np.where(rest, np.where(inside, -INF, INF), np.minimum(*times)).max(2)
    leave = np.where(rest, INF, np.maximum(*times)).min(2)
    # Rays that pass a box by less than rounding may meet it.
    with np.errstate(invalid="ignore"):
        clear = np.abs(enter - leave) > 1e-3
    wanted = (np.maximum(enter, 0) <= leave) & (leave >= 0)
    met = found(rays, vectors(finite), vectors(d))
    np.testing.assert_array_equal(met[clear], wanted[clear])
    offset = np.maximum(np.maximum(low - start, start - high), 0)
    distance = np.sqrt((offset**2).sum(2))
    clear = np.abs(distance - 0.5) > 1e-4
    near = found(spheres, vectors(finite), 0.5)
    np.testing.assert_array_equal(near[clear], (distance <= 0.5)[clear])


@pytest.mark.parametrize("builder", ["sah", "median", "lbvh"])
@pytest.mark.parametrize("n", [1, 2, 9, 300])
def test_queries(builder, n, device):
    low, high = boxes(n)
    lowers, uppers = (wp.array(one, dtype=wp.vec3, device=device) for one in (low, high))
    bvh = wp.Bvh(lowers, uppers, constructor=builder)
    assert bvh.report.skipped == 0
    check(bvh, low, high)
    for order in (np.roll(np.arange(n), 1), np.arange(n)[::-1]):
        lowers.assign(low[order])
        uppers.assign(high[order])
        bvh.refit()
        check(bvh, low[order], high[order])


@pytest.mark.parametrize("by_kernels", [False, True])
def test_queries_of_grouped_boxes(by_kernels, device, monkeypatch):
    if by_kernels:
        monkeypatch.setattr(hierarchies, "builds_on_device", lambda device, name: True)
    low, high = boxes(300)
    groups = wp.array(np.arange(300) % 5, dtype=int, device=device)
    lowers, uppers = (wp.array(one, dtype=wp.vec3, device=device) for one in (low, high))
    bvh = wp.Bvh(lowers, uppers, groups=groups)
    assert bvh.report.skipped == 0
    check(bvh, low, high)
