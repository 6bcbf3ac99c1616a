"""Hierarchies with groups that kernels build, on a CPU too: each group is found alone."""

import numpy as np
import pytest
from test_device_builds import answers, check_winding, soup
from test_groups import boxes, overlaps

import warp as wp
from warp._src.geometry import bvh as hierarchies
from warp._src.geometry import mesh as meshes


@pytest.fixture(autouse=True)
def by_kernels(monkeypatch):
    """Lets kernels build on a CPU."""
    for module in (hierarchies, meshes):
        monkeypatch.setattr(module, "builds_on_device", lambda device, name: name != "sah")


LOW, HIGH = [2.0, 1.0, 0.0], [8.0, 9.0, 7.0]


def check(bvh):
    """Compares what a box meets, of each group and of all, with all boxes."""
    device = bvh.device
    low, high, groups = (one.numpy() for one in (bvh.lowers, bvh.uppers, bvh.groups))
    is_proper = (low <= high).all(axis=1)
    asked = np.append(np.unique(groups[is_proper]), -1000).astype(np.int32)
    roots = wp.zeros(len(asked), dtype=int, device=device)
    found = wp.zeros((len(asked), len(low)), dtype=int, device=device)
    which = wp.array(asked, dtype=int, device=device)
    inputs = [bvh.id, wp.vec3(LOW), wp.vec3(HIGH), which, roots, found]
    wp.launch(overlaps, dim=len(asked), inputs=inputs, device=device)
    touched = is_proper & ((low <= HIGH) & (high >= LOW)).all(axis=1)
    wanted = touched[None] & (groups[None] == asked[:, None])
    # There is none of the last number.
    wanted[-1] = touched
    assert (found.numpy() == wanted).all()
    assert (roots.numpy()[:-1] >= 0).all() and roots.numpy()[-1] == -1


def arrays(n, count, device):
    low, high, groups = boxes(n, count)
    if n > 100:
        groups[11:13] = 2**31 - 1, -(2**31)
        low[7], groups[7] = np.nan, 777
    corners = [wp.array(one, dtype=wp.vec3, device=device) for one in (low, high)]
    return *corners, wp.array(groups, dtype=int, device=device)


@pytest.mark.parametrize(
    "n, count",
    [(1, 1), (40, 3), (64, 1), (65, 1), (900, 9), (3000, 2), (3000, 700), (600, 10**6), (5000, 1)],
)
def test_a_group_is_found_alone(device, n, count):
    low, high, groups = arrays(n, count, device)
    bvh = wp.Bvh(low, high, groups=groups)
    check(bvh)
    assert bvh._built and bvh.report.skipped == int(n > 100) and bvh.report.depth <= 16
    low.assign(low.numpy() * np.float32(1.25))
    high.assign(high.numpy() * np.float32(1.25))
    bvh.refit()
    check(bvh)
    groups.assign(groups.numpy()[::-1].copy())
    bvh.rebuild()
    check(bvh)


def test_groups_become_more_and_less(device):
    low, high, groups = arrays(700, 4, device)
    bvh = wp.Bvh(low, high, groups=groups)
    for count in (300, 5, 1, 700):
        groups.assign(boxes(700, count, seed=1)[2])
        bvh.rebuild()
        check(bvh)


def test_boxes_that_are_never_found_have_no_group(device):
    low, high, groups = arrays(20, 3, device)
    bvh = wp.Bvh(high, low, groups=groups)
    check(bvh)
    assert bvh.report.skipped == 20
    bvh.lowers, bvh.uppers = low, high
    bvh.rebuild()
    check(bvh)


@pytest.mark.parametrize("n", [0, 1, 9, 700, 4200])
def test_meshes_are_searched_as_those_of_the_host(device, n):
    points = soup(n)
    if n > 100:
        points[31], points[50, 1] = np.nan, np.inf
    x = wp.array(points, dtype=wp.vec3, device=device)
    faces = wp.array(np.arange(3 * n), dtype=int, device=device)
    groups = wp.array(np.arange(n) % 7, dtype=int, device=device)
    made, wanted = (wp.Mesh(x, faces, groups=groups, bvh_constructor=c) for c in (None, "sah"))
    p = np.random.default_rng(1).uniform(-1.5, 1.5, (500, 3)).astype(np.float32)
    assert made._built and not wanted._built
    assert made.report.skipped == wanted.report.skipped == (2 if n > 100 else 0)
    assert (answers(made, p) == answers(wanted, p)).all()
    x.assign(np.roll(points, 3, 0) * np.float32(40))
    for change in ("rebuild", "refit"):
        getattr(made, change)()
        getattr(wanted, change)()
        assert (answers(made, 40 * p) == answers(wanted, 40 * p)).all()


@pytest.mark.parametrize("n", [1, 900])
def test_winding_numbers(device, n):
    points = soup(n)
    x = wp.array(points, dtype=wp.vec3, device=device)
    faces = wp.array(np.arange(3 * n), dtype=int, device=device)
    groups = wp.array(np.arange(n) // 100, dtype=int, device=device)
    mesh = wp.Mesh(x, faces, support_winding_number=True, groups=groups)
    p = np.random.default_rng(3).uniform(-3, 3, (300, 3)).astype(np.float32)
    check_winding(mesh, points, p)
    x.assign(points * np.float32(0.75))
    mesh.refit()
    check_winding(mesh, points * np.float32(0.75), p)


def test_a_graph_builds(device):
    low, high, groups = arrays(900, 12, device)
    bvh = wp.Bvh(low, high, groups=groups)
    with wp.ScopedCapture(device=device) as capture:
        bvh.rebuild()
    for scale, count in ((0.5, 5), (3.0, 12), (1.0, 1)):
        low.assign(boxes(900, 1, seed=2)[0] * np.float32(scale))
        high.assign(boxes(900, 1, seed=2)[1] * np.float32(scale))
        groups.assign(boxes(900, count, seed=2)[2])
        wp.capture_launch(capture.graph)
        check(bvh)
    # There is room for those of before.
    groups.assign(boxes(900, 500)[2])
    wp.capture_launch(capture.graph)
    assert bvh.report.skipped == 900
    bvh.rebuild()
    check(bvh)


def test_a_graph_builds_nothing_new(device):
    low, high, groups = arrays(90, 3, device)
    bvh = wp.Bvh(low, high, groups=groups, constructor="sah")
    with wp.ScopedCapture(device=device), pytest.raises(RuntimeError, match="build it once outs"):
        bvh.rebuild("lbvh")


def test_bad_input_is_named(device):
    low, high, groups = arrays(10, 2, device)
    with pytest.raises(RuntimeError, match="10 boxes, but got 9"):
        wp.Bvh(low, high, groups=groups[:9])
    x = wp.zeros(3, dtype=wp.vec3, device=device)
    faces = wp.array([0, 1, 2, 0, 7, -1], dtype=int, device=device)
    with pytest.raises(RuntimeError, match="2 faces, but got 9"):
        wp.Mesh(x, faces, groups=groups[:9])
    with pytest.raises(RuntimeError, match="face 1 has the index 7, but there are 3 points"):
        wp.Mesh(x, faces, groups=groups[:2])
