"""Primitives that were NaN, infinite or inverted at the build are found after a refit."""

import numpy as np
import pytest

import warp as wp
from warp._src.geometry import bvh as hierarchies
from warp._src.geometry import mesh as meshes

BUILDERS = (None, "sah", "median", "lbvh", "cubql")
BAD = {"nan": np.nan, "infinite": np.inf, "inverted": 1e6}


@wp.kernel
def meet(b: wp.uint64, low: wp.vec3, high: wp.vec3, root: int, n: wp.array(dtype=int)):
    for i in wp.bvh_query_aabb(b, low, high, root):
        n[i] += 1


@wp.kernel
def root_of(b: wp.uint64, group: int, root: wp.array(dtype=int)):
    root[0] = wp.bvh_get_group_root(b, group)


@wp.kernel
def closest(m: wp.uint64, p: wp.array(dtype=wp.vec3), face: wp.array(dtype=int)):
    i = wp.tid()
    face[i] = wp.mesh_query_point_no_sign(m, p[i], 1e6).face


def found(bvh, low, high, group=None):
    """How often each box is found, of all or of a group."""
    device = bvh.device
    root = wp.full(1, -1, dtype=int, device=device)
    if group is not None:
        wp.launch(root_of, 1, inputs=[bvh.id, group, root], device=device)
        assert root.numpy()[0] >= 0
    n = wp.zeros(len(bvh.lowers), dtype=int, device=device)
    inputs = [bvh.id, wp.vec3(*low), wp.vec3(*high), int(root.numpy()[0]), n]
    wp.launch(meet, 1, inputs=inputs, device=device)
    return n.numpy()


def boxes(n):
    low = np.random.default_rng(n).uniform(-1, 1, (n, 3)).astype(np.float32)
    return low, low + np.float32(0.1)


def hidden(n, share):
    """Which of n are hidden at first."""
    return np.random.default_rng(n + 1).random(n) < share


def check(bvh, low, high, there):
    for reach in (9.0, 0.4):
        touched = (there[:, None] & (low <= reach) & (high >= -reach)).all(1)
        assert (found(bvh, [-reach] * 3, [reach] * 3) == touched).all()


@pytest.mark.parametrize("name", BAD)
@pytest.mark.parametrize("builder", BUILDERS)
@pytest.mark.parametrize("n, share", [(1, 2.0), (2, 0.5), (9, 2.0), (300, 0.5), (3000, 0.01)])
def test_boxes(device, builder, name, n, share):
    low, high = boxes(n)
    out = hidden(n, share)
    first = low.copy()
    first[out, 1] = BAD[name]
    lowers, uppers = (wp.array(one, dtype=wp.vec3, device=device) for one in (first, high))
    bvh = wp.Bvh(lowers, uppers, constructor=builder)
    assert bvh.report.skipped == out.sum()
    check(bvh, first, high, ~out)
    for there in (low, first, low):
        lowers.assign(there)
        bvh.refit()
        check(bvh, there, high, (there <= high).all(1) & np.isfinite(there).all(1))
    if device == "cpu":
        assert bvh.report.skipped == 0


@pytest.mark.parametrize("by_kernels", [False, True])
@pytest.mark.parametrize("n", [3, 40, 2000])
def test_boxes_of_groups(device, by_kernels, n, monkeypatch):
    """Each group is found alone, also one whose boxes were all hidden."""
    if by_kernels:
        monkeypatch.setattr(hierarchies, "builds_on_device", lambda device, name: True)
    low, high = boxes(n)
    groups = (np.arange(n) % 3).astype(np.int32)
    out = hidden(n, 0.3) | (groups == 1)
    first = low.copy()
    first[out] = np.nan
    lowers, uppers = (wp.array(one, dtype=wp.vec3, device=device) for one in (first, high))
    bvh = wp.Bvh(lowers, uppers, groups=wp.array(groups, dtype=int, device=device))
    assert bool(bvh._built) == (by_kernels or device != "cpu")
    for there, shown in ((first, ~out), (low, ~out | True), (first, ~out), (low, ~out | True)):
        lowers.assign(there)
        bvh.refit()
        check(bvh, there, high, shown)
        for group in range(3):
            wanted = shown & (groups == group)
            assert (found(bvh, [-9] * 3, [9] * 3, group) == wanted).all()


@pytest.mark.parametrize("builder", BUILDERS)
@pytest.mark.parametrize("support_winding", [False, True])
@pytest.mark.parametrize("n, share", [(1, 2.0), (20, 0.5), (2500, 0.05)])
def test_faces(device, builder, support_winding, n, share):
    centers = np.random.default_rng(n).uniform(-1, 1, (n, 1, 3)).astype(np.float32)
    shape = np.float32([[0, 0, 0], [0.02, 0, 0], [0, 0.02, 0.01]])
    points = (centers + shape).reshape(-1, 3)
    out = hidden(n, share)
    first = points.copy()
    first[3 * np.flatnonzero(out)] = np.nan
    x = wp.array(first, dtype=wp.vec3, device=device)
    corners = wp.array(np.arange(3 * n), dtype=int, device=device)
    mesh = wp.Mesh(x, corners, None, support_winding, bvh_constructor=builder)
    asked = wp.array(points[::3] + np.float32(0.004), dtype=wp.vec3, device=device)
    faces = wp.zeros(n, dtype=int, device=device)

    def nearest(there):
        """The face of each point by brute force is among those that are there."""
        wp.launch(closest, n, inputs=[mesh.id, asked, faces], device=device)
        best = faces.numpy()
        if not there.any():
            assert (best == -1).all()
        else:
            assert there[best].all() and (best[there] == np.flatnonzero(there)).all()

    nearest(~out)
    for there in (points, first, points):
        x.assign(there)
        mesh.refit()
        nearest(np.isfinite(there).all(1).reshape(n, 3).all(1))


@pytest.mark.parametrize("n", [9, 700])
def test_faces_of_groups_that_kernels_build(device, n, monkeypatch):
    monkeypatch.setattr(meshes, "builds_on_device", lambda device, name: True)
    points = np.random.default_rng(n).uniform(-1, 1, (3 * n, 3)).astype(np.float32)
    first = points.copy()
    first[::6] = np.inf
    x = wp.array(first, dtype=wp.vec3, device=device)
    corners, groups = (
        wp.array(one, dtype=int, device=device) for one in (np.arange(3 * n), np.arange(n) % 2)
    )
    mesh = wp.Mesh(x, corners, groups=groups)
    assert mesh._built
    x.assign(points)
    mesh.refit()
    middles = wp.array(points.reshape(n, 3, 3).mean(1), dtype=wp.vec3, device=device)
    faces = wp.zeros(n, dtype=int, device=device)
    wp.launch(closest, n, inputs=[mesh.id, middles, faces], device=device)
    assert (faces.numpy() == np.arange(n)).all()
