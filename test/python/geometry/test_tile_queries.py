"""Queries that the threads of a block ask together, against all boxes."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def touch_box(bvh: wp.uint64, low: wp.vec3, high: wp.vec3, seen: wp.array(dtype=int)):
    query = wp.tile_bvh_query_aabb(bvh, low, high)
    while wp.tile_query_valid(query):
        found = wp.untile(wp.tile_bvh_query_next(query))
        if found >= 0:
            wp.atomic_add(seen, found, 1)


@wp.kernel
def touch_ray(bvh: wp.uint64, start: wp.vec3, dir: wp.vec3, seen: wp.array(dtype=int)):
    query = wp.tile_bvh_query_ray(bvh, start, dir)
    while wp.tile_query_valid(query):
        found = wp.untile(wp.tile_bvh_query_next(query))
        if found >= 0:
            wp.atomic_add(seen, found, 1)


@wp.kernel
def touch_faces(mesh: wp.uint64, low: wp.vec3, high: wp.vec3, seen: wp.array(dtype=int)):
    query = wp.tile_mesh_query_aabb(mesh, low, high)
    while wp.tile_query_valid(query):
        found = wp.untile(wp.tile_mesh_query_aabb_next(query))
        if found >= 0:
            wp.atomic_add(seen, found, 1)


@wp.kernel
def count_in_many(
    bvh: wp.uint64, lows: wp.array(dtype=wp.vec3), size: float, n: wp.array(dtype=int)
):
    i = wp.tid()
    query = wp.tile_bvh_query_aabb(bvh, lows[i], lows[i] + wp.vec3(size))
    while wp.tile_query_valid(query):
        found = wp.tile_bvh_query_next(query)
        wp.tile_atomic_add(n, wp.tile_sum(wp.tile_map(is_found, found)), offset=i)


@wp.func
def is_found(index: int):
    return int(index >= 0)


def boxes(count, seed=3):
    random = np.random.default_rng(seed)
    low = random.uniform(-4, 4, (count, 3)).astype(np.float32)
    return low, low + random.uniform(0, 0.6, (count, 3)).astype(np.float32)


def bvh_of(low, high, device, **options):
    arrays = (wp.array(corner, dtype=wp.vec3, device=device) for corner in (low, high))
    return wp.Bvh(*arrays, **options)


def block_sizes(device):
    # CPUs have one thread in a block, whatever is asked for.
    return (64, 1) if device == "cpu" else (32, 64, 96, 256)


def ask(kernel, block, device, seen, *inputs):
    seen.zero_()
    wp.launch_tiled(kernel, dim=[1], inputs=[*inputs, seen], block_dim=block, device=device)
    return seen.numpy()


@pytest.mark.parametrize("count", [1, 7, 300, 20000])
def test_boxes_are_found_once_each(device, count):
    low, high = boxes(count)
    bvh = bvh_of(low, high, device)
    seen = wp.zeros(count, dtype=int, device=device)
    for at, size in (((-4.0, -4.0, -4.0), 9.0), ((-0.5, 0.3, -1.0), 1.2), ((3.9, 3.9, 3.9), 0.4)):
        first = np.float32(at)
        last = first + np.float32(size)
        expected = ((low <= last) & (high >= first)).all(axis=1)
        for block in block_sizes(device):
            got = ask(touch_box, block, device, seen, bvh.id, wp.vec3(*first), wp.vec3(*last))
            assert np.array_equal(got, expected)


def test_rays_find_what_a_thread_finds_alone(device):
    low, high = boxes(30000)
    bvh = bvh_of(low, high, device)
    seen = wp.zeros(len(low), dtype=int, device=device)
    start, dir = np.float64([-5.0, 0.1, 0.2]), np.float64([1.0, 0.07, -0.11])
    with np.errstate(invalid="ignore"):
        a, b = (low - start) / dir, (high - start) / dir
    enter, leave = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
    sure = np.abs(leave - enter) > 1e-5
    for block in block_sizes(device):
        got = ask(touch_ray, block, device, seen, bvh.id, wp.vec3(*start), wp.vec3(*dir))
        assert got.sum() > 5 and got.max() == 1
        assert np.array_equal(got[sure] > 0, (enter <= leave)[sure] & (leave >= 0)[sure])


def test_faces_by_their_bounds(device):
    random = np.random.default_rng(4)
    corners = random.uniform(-1, 1, (2000, 1, 3)) + random.uniform(-0.1, 0.1, (2000, 3, 3))
    corners = corners.astype(np.float32)
    points = wp.array(corners.reshape(-1, 3), dtype=wp.vec3, device=device)
    mesh = wp.Mesh(points, wp.array(np.arange(6000), dtype=int, device=device))
    seen = wp.zeros(2000, dtype=int, device=device)
    first, last = np.float32([-0.2, -0.7, 0.1]), np.float32([0.5, 0.1, 0.9])
    expected = ((corners.min(axis=1) <= last) & (corners.max(axis=1) >= first)).all(axis=1)
    for block in block_sizes(device):
        got = ask(touch_faces, block, device, seen, mesh.id, wp.vec3(*first), wp.vec3(*last))
        assert np.array_equal(got, expected)


def test_blocks_ask_for_themselves(device):
    low, high = boxes(5000)
    bvh = bvh_of(low, high, device)
    places = np.random.default_rng(5).uniform(-4, 4, (70, 3)).astype(np.float32)
    found = wp.zeros(70, dtype=int, device=device)
    given = [bvh.id, wp.array(places, dtype=wp.vec3, device=device), 0.75, found]
    wp.launch_tiled(count_in_many, dim=[70], inputs=given, block_dim=64, device=device)
    last = places + np.float32(0.75)
    touched = (low <= last[:, None]) & (high >= places[:, None])
    assert np.array_equal(found.numpy(), touched.all(axis=2).sum(axis=1))


def test_nothing_to_find(device):
    low, high = boxes(50)
    nan = float("nan")
    bvh = bvh_of(low, high, device)
    seen = wp.zeros(50, dtype=int, device=device)
    for first, last in (((9.0,) * 3, (10.0,) * 3), ((nan, 0.0, 0.0), (1.0, 1.0, 1.0))):
        assert not ask(touch_box, 64, device, seen, bvh.id, wp.vec3(*first), wp.vec3(*last)).any()
    empty = bvh_of(np.zeros((0, 3)), np.zeros((0, 3)), device)
    assert not ask(touch_box, 64, device, seen, empty.id, wp.vec3(-9.0), wp.vec3(9.0)).any()


def test_freed_and_foreign_ids_are_refused(device):
    low, high = boxes(50)
    bvh = bvh_of(low, high, device)
    seen = wp.zeros(50, dtype=int, device=device)
    with pytest.raises(RuntimeError, match="'mesh'.*Mesh.*Bvh"):
        ask(touch_faces, 64, device, seen, bvh.id, wp.vec3(), wp.vec3())
    freed = bvh.id
    # The builder keeps the memory that it still uses.
    wp.synchronize_device(device)
    del bvh
    with pytest.raises(RuntimeError, match="'bvh'"):
        ask(touch_box, 64, device, seen, freed, wp.vec3(), wp.vec3())


def test_code_is_for_blocks_and_checks_handles():
    """A kernel of both kinds: what tiles and what handles add to launches come together."""
    assert "warp.block_threads = 256" in touch_box.ir("gpu", arch=90)
    assert {hook.role for hook in touch_box.hooks} == {"blocks", "handles"}


def test_balls_of_a_mesh_by_bounds_or_by_faces(device):
    """A `Bvh` query over a mesh asks for bounds, a `Mesh` query for the faces."""

    @wp.kernel(module="unique")
    def touch(
        mesh: wp.uint64,
        at: wp.vec3,
        r: float,
        by_bounds: wp.array(dtype=int),
        by_face: wp.array(dtype=int),
    ):
        for i in wp.bvh_query_sphere(wp.mesh_get_bvh(mesh), at, r):
            by_bounds[i] = 1
        for i in wp.mesh_query_sphere(mesh, at, r):
            by_face[i] = 1

    # The ball is within the bounds, but beyond the longest edge.
    corners = wp.array([[0, 0, 0], [2, 0, 0], [0, 2, 0]], dtype=wp.vec3, device=device)
    mesh = wp.Mesh(corners, wp.array([0, 1, 2], dtype=int, device=device))
    found = [wp.zeros(1, dtype=int, device=device) for _ in range(2)]
    wp.launch(touch, 1, inputs=[mesh.id, wp.vec3(1.9, 1.9, 0.0), 0.2, *found], device=device)
    assert [int(n.numpy()[0]) for n in found] == [1, 0]
