"""Queries from nodes that are none, and arrays of geometry that were replaced by others."""

import numpy as np
import pytest

import warp as wp

BAD_ROOTS = (-2, -(2**31), 40, 1000, 10**9, 2**31 - 1)


def ask(b: wp.uint64, root: int, n: wp.array(dtype=int)):
    low, high = wp.vec3(-9.0), wp.vec3(9.0)
    for _ in wp.bvh_query_aabb(b, low, high, root):
        n[0] += 1
    for _ in wp.bvh_query_sphere(b, wp.vec3(), 9.0, root):
        n[1] += 1
    for _ in wp.bvh_query_ray(b, wp.vec3(0.5, 0.5, -3.0), wp.vec3(0.0, 0.0, 1.0), root):
        n[2] += 1
    for _ in wp.bvh_query_capsule(b, wp.vec3(-1.0), wp.vec3(1.0), 0.5, root):
        n[3] += 1
    # One that is at its end stays there.
    query = wp.bvh_query_aabb(b, low, high, root)
    i = int(0)
    for _ in range(3):
        if wp.bvh_query_next(query, i):
            n[4] += 1


def cast(m: wp.uint64, root: int, n: wp.array(dtype=int)):
    start, along = wp.vec3(0.5, 0.5, -3.0), wp.vec3(0.0, 0.0, 1.0)
    n[0] = wp.where(wp.mesh_query_ray(m, start, along, 9.0, root).result, 1, 0)
    n[1] = wp.where(wp.mesh_query_ray_anyhit(m, start, along, 9.0, root), 1, 0)
    n[2] = wp.mesh_query_ray_count_intersections(m, start, along, root)
    for _ in wp.bvh_query_aabb(wp.mesh_get_bvh(m), wp.vec3(-9.0), wp.vec3(9.0), root):
        n[3] += 1


RELEASE = [wp.kernel(one, module="unique") for one in (ask, cast)]
DEBUG = [wp.kernel(one, module="unique", module_options={"mode": "debug"}) for one in (ask, cast)]


def hierarchy(n=200, groups=None, device="cpu"):
    low = np.random.default_rng(0).random((n, 3)).astype(np.float32)
    corners = [wp.array(one, dtype=wp.vec3, device=device) for one in (low, low + 0.3)]
    if groups is not None:
        groups = wp.array(np.arange(n) % groups, dtype=int, device=device)
    return wp.Bvh(*corners, groups=groups)


def mesh(n=200, device="cpu"):
    points = np.random.default_rng(0).random((3 * n, 3)).astype(np.float32)
    corners = wp.array(np.arange(3 * n), dtype=int, device=device)
    return wp.Mesh(wp.array(points, dtype=wp.vec3, device=device), corners)


def counts(kernel, of, root):
    n = wp.zeros(5, dtype=int, device=of.device)
    wp.launch(kernel, 1, inputs=[of.id, root, n], device=of.device)
    return n.numpy()


@pytest.mark.parametrize("groups", [None, 3])
def test_no_node_finds_nothing(device, groups):
    bvh, triangles = hierarchy(groups=groups, device=device), mesh(device=device)
    assert bvh.report.nodes <= 40 and triangles.report.nodes <= 40
    for kernel, of in zip(RELEASE, (bvh, triangles), strict=True):
        whole = counts(kernel, of, -1)
        assert (whole > 0).sum() >= 4
        for root in BAD_ROOTS:
            assert (counts(kernel, of, root) == 0).all()
        for root in range(of.report.nodes):
            assert (counts(kernel, of, root) <= whole).all()
        assert (counts(kernel, of, 0) == whole).all()


def test_an_empty_hierarchy_has_no_nodes(device):
    bvh = hierarchy(0, device=device)
    for root in (-1, 0, *BAD_ROOTS):
        assert (counts(RELEASE[0], bvh, root) == 0).all()


def test_debug_mode_reports_it(device):
    for kernel, of in zip(DEBUG, (hierarchy(device=device), mesh(device=device)), strict=True):
        assert (counts(kernel, of, -1) == counts(kernel, of, 0)).all()
        for root in BAD_ROOTS:
            with pytest.raises(RuntimeError, match="`root` is no node of the hierarchy") as error:
                counts(kernel, of, root)
            # It names the line of the kernel, not that of the library.
            assert "test_roots_and_replaced_arrays.py:" in str(error.value)


def other(n, dtype=wp.vec3, device="cpu", shape=None):
    return wp.zeros(n if shape is None else shape, dtype=dtype, device=device)


WRONG = {
    "type": (lambda d: other(200, wp.uint8, d), "are an array of"),
    "rank": (lambda d: other(0, device=d, shape=(2, 100)), "one dimension"),
    "stride": (lambda d: other(400, device=d)[::2], "packed array"),
    "none": (lambda d: None, "are an array of"),
    "list": (lambda d: [0.0] * 600, "are an array of"),
}


NAMES = ("lowers", "uppers", "groups", "points", "indices", "velocities")


@pytest.mark.parametrize(
    "name, case",
    # None stands for no such array.
    [
        (name, case)
        for name in NAMES
        for case in WRONG
        if not (case == "none" and name in ("groups", "velocities"))
    ],
)
def test_replaced_arrays_are_checked_at_once(device, name, case):
    """The message names what is wrong, and the old array stays."""
    make, message = WRONG[case]
    integers = name in ("groups", "indices")
    wrong = make(device)
    if integers and case in ("rank", "stride"):
        wrong = wp.zeros((2, 100), dtype=int, device=device)
        wrong = wrong if case == "rank" else wp.zeros(1200, dtype=int, device=device)[::2]
    objects = [hierarchy(groups=3, device=device), mesh(device=device)]
    tried = [one for one in objects if hasattr(one, name)]
    assert tried
    for one in tried:
        old = getattr(one, name)
        with pytest.raises(RuntimeError, match=message):
            setattr(one, name, wrong)
        assert getattr(one, name) is old
        one.refit()
        one.rebuild()


def test_other_lengths(device):
    """A refit keeps the number of boxes and faces; a rebuild takes another one."""
    bvh = hierarchy(device=device)
    bvh.lowers = other(100, device=device)
    for update in (bvh.refit, bvh.rebuild):
        with pytest.raises(RuntimeError, match="but got 100 and 200"):
            update()
    bvh.uppers = other(100, device=device)
    with pytest.raises(RuntimeError, match="keeps its 200 boxes, but got 100"):
        bvh.refit()
    bvh.rebuild()
    assert counts(RELEASE[0], bvh, -1)[0] == 100
    bvh.refit()
    bvh.groups = wp.zeros(7, dtype=int, device=device)
    with pytest.raises(RuntimeError, match="each of its 100 boxes, but got 7"):
        bvh.rebuild()
    triangles = mesh(device=device)
    triangles.indices = triangles.indices[:300]
    with pytest.raises(RuntimeError, match="keeps its 200 faces, but got 100"):
        triangles.refit()
    triangles.groups = wp.zeros(7, dtype=int, device=device)
    with pytest.raises(RuntimeError, match="each of its 100 faces, but got 7"):
        triangles.rebuild()
    triangles.groups = None
    triangles.rebuild()
    triangles.refit()
    assert counts(RELEASE[1], triangles, -1)[3] == 100
    with pytest.raises(RuntimeError, match="faces have three indices, but there are 100"):
        triangles.indices = triangles.indices[:100]


def test_the_device_stays(device):
    for one in (hierarchy(device=device), mesh(device=device), wp.HashGrid(2, 2, 2, device)):
        with pytest.raises(AttributeError):
            one.device = "cuda:7"


@wp.kernel
def move(m: wp.uint64, out: wp.array(dtype=wp.vec3)):
    out[0] = wp.mesh_eval_velocity(m, 0, 0.25, 0.25)
    out[1] = wp.mesh_get_velocity(m, 2)


def test_a_mesh_without_velocities_does_not_move(device):
    """At first, and when they were replaced by none."""
    triangles, out = mesh(device=device), wp.ones(2, dtype=wp.vec3, device=device)
    for velocities, wanted in ((None, 0.0), (wp.ones_like(triangles.points), 1.0), (None, 0.0)):
        triangles.velocities = velocities
        wp.launch(move, 1, inputs=[triangles.id, out], device=device)
        assert (out.numpy() == wanted).all()
