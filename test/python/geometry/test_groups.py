"""Groups of boxes and faces: queries from the node that holds one."""

import numpy as np
import pytest

import warp as wp


def boxes(n, groups, seed=0):
    rng = np.random.default_rng(seed)
    low = rng.uniform(0, 10, (n, 3)).astype(np.float32)
    high = low + rng.uniform(0, 1, (n, 3)).astype(np.float32)
    return low, high, rng.integers(0, groups, n).astype(np.int32) * 3 - 5


@wp.kernel
def overlaps(
    bvh: wp.uint64,
    low: wp.vec3,
    high: wp.vec3,
    groups: wp.array(dtype=int),
    roots: wp.array(dtype=int),
    found: wp.array2d(dtype=int),
):
    i = wp.tid()
    root = wp.bvh_get_group_root(bvh, groups[i])
    roots[i] = root
    for box in wp.bvh_query_aabb(bvh, low, high, root):
        found[i, box] += 1


@pytest.mark.parametrize("n, count", [(1, 1), (40, 3), (3000, 2), (3000, 700), (900, 9)])
def test_a_group_is_searched_alone(device, n, count):
    low, high, groups = boxes(n, count)
    bvh = wp.Bvh(
        wp.array(low, dtype=wp.vec3, device=device),
        wp.array(high, dtype=wp.vec3, device=device),
        groups=wp.array(groups, dtype=int, device=device),
    )
    asked = np.append(np.unique(groups), -1000).astype(np.int32)
    roots = wp.zeros(len(asked), dtype=int, device=device)
    found = wp.zeros((len(asked), n), dtype=int, device=device)
    a, b = wp.vec3(2.0, 1.0, 0.0), wp.vec3(8.0, 9.0, 7.0)
    which = wp.array(asked, dtype=int, device=device)
    inputs = [bvh.id, a, b, which, roots, found]
    for again in range(2):
        wp.launch(overlaps, dim=len(asked), inputs=inputs, device=device)
        touched = ((low <= [8, 9, 7]) & (high >= [2, 1, 0])).all(axis=1)
        wanted = touched[None] & (groups[None] == asked[:, None])
        # The root of an absent group is that of all.
        wanted[-1] = touched
        assert (found.numpy() == wanted).all()
        assert (roots.numpy()[:-1] >= 0).all() and roots.numpy()[-1] == -1
        found.zero_()
        bvh.refit() if again else bvh.rebuild("median")
    assert bvh.report.depth <= 16


@wp.kernel
def first_hit(mesh: wp.uint64, groups: wp.array(dtype=int), out: wp.array(dtype=float)):
    i = wp.tid()
    root = wp.mesh_get_group_root(mesh, groups[i])
    hit = wp.mesh_query_ray(mesh, wp.vec3(0.2, 0.2, -1.0), wp.vec3(0.0, 0.0, 1.0), 100.0, root)
    out[i] = hit.t


def test_rays_meet_a_group_of_faces_alone(device):
    layers = 12
    corner = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=np.float32)
    points = np.concatenate([corner + [0, 0, z] for z in range(layers)])
    mesh = wp.Mesh(
        wp.array(points, dtype=wp.vec3, device=device),
        wp.array(np.arange(3 * layers), dtype=int, device=device),
        groups=wp.array(np.arange(layers), dtype=int, device=device),
    )
    out = wp.zeros(layers, dtype=float, device=device)
    groups = wp.array(np.arange(layers), dtype=int, device=device)
    wp.launch(first_hit, dim=layers, inputs=[mesh.id, groups, out], device=device)
    assert (out.numpy() == np.arange(layers) + 1).all()


def test_groups_that_do_not_fit_are_refused():
    low, high, groups = boxes(10, 2)
    corners = [wp.array(x, dtype=wp.vec3, device="cpu") for x in (low, high)]
    with pytest.raises(RuntimeError, match="10 boxes, but got 9"):
        wp.Bvh(*corners, groups=wp.array(groups[:9], dtype=int, device="cpu"))
    with pytest.raises(RuntimeError, match="groups"):
        wp.Bvh(*corners, groups=wp.zeros(10, dtype=float, device="cpu"))


@wp.kernel
def sweep(bvh: wp.uint64, start: wp.vec3, dir: wp.vec3, radius: float, found: wp.array(dtype=int)):
    query = wp.bvh_query_capsule(bvh, start, dir, radius)
    box = int(0)
    while wp.bvh_query_next(query, box, 1.0):
        found[box] += 1


def test_capsules_find_boxes_grown_by_their_radius(device):
    low, high, _ = boxes(500, 1)
    bvh = wp.Bvh(*(wp.array(x, dtype=wp.vec3, device=device) for x in (low, high)))
    start, dir, radius = np.array([1.0, 2.0, 3.0]), np.array([6.0, 4.0, 3.0]), 0.5
    t = np.stack([(low - radius - start) / dir, (high + radius - start) / dir])
    enter, leave = t.min(axis=0).max(axis=1), t.max(axis=0).min(axis=1)
    sure = np.abs(enter - leave) > 1e-5
    wanted = (np.maximum(enter, 0) <= np.minimum(leave, 1)).astype(int)
    found = wp.zeros(500, dtype=int, device=device)
    inputs = [bvh.id, wp.vec3(*start), wp.vec3(*dir), radius, found]
    wp.launch(sweep, dim=1, inputs=inputs, device=device)
    assert (found.numpy()[sure] == wanted[sure]).all() and wanted.sum() > 5
