"""Far from the origin, coincident, nearly parallel, across leaves: what geometry gives there."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def close(
    grid: wp.uint64, x: wp.array(dtype=wp.vec3d), r: wp.float64, found: wp.array2d(dtype=int)
):
    i = wp.tid()
    for j in wp.hash_grid_query(grid, x[i], r):
        if wp.length(x[j] - x[i]) <= r:
            found[i, j] += 1


@pytest.mark.parametrize("offset", [0.0, -1e7, 1e10, 3e12])
def test_no_pair_is_missed_or_comes_twice_far_from_the_origin(device, offset):
    points = np.random.default_rng(0).uniform(0, 5, (200, 3)) + offset
    x = wp.array(points, dtype=wp.vec3d, device=device)
    grid = wp.HashGrid(16, 16, 16, device=device, dtype=wp.float64)
    grid.build(x, radius=1.0)
    found = wp.zeros((200, 200), dtype=int, device=device)
    wp.launch(close, 200, inputs=[grid.id, x, wp.float64(1), found], device=device)
    points = x.numpy()
    apart = np.sqrt(((points[:, None] - points[None]) ** 2).sum(2))
    assert (found.numpy() == (apart <= 1)).all()


@wp.kernel
def count(grid: wp.uint64, x: wp.array(dtype=wp.vec3), n: wp.array(dtype=int)):
    i = wp.tid()
    for _ in wp.hash_grid_query(grid, x[i], 0.5):
        n[i] += 1


def test_coincident_points_are_all_found(device):
    x = wp.full(100_000, wp.vec3(0.25, -3.0, 7.5), dtype=wp.vec3, device=device)
    grid = wp.HashGrid(8, 8, 8, device=device)
    grid.build(x, radius=0.5)
    n = wp.zeros(3, dtype=int, device=device)
    wp.launch(count, 3, inputs=[grid.id, x, n], device=device)
    assert (n.numpy() == 100_000).all() and grid.skipped == 0


@wp.kernel
def cast(mesh: wp.uint64, o: wp.array(dtype=wp.vec3), d: wp.vec3, t: wp.array(dtype=float)):
    i = wp.tid()
    hit = wp.mesh_query_ray(mesh, o[i], d, 100.0)
    t[i] = wp.where(hit.result, hit.t, -1.0)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("constructor", ["sah", "lbvh"])
def test_rays_along_axes_meet_a_lattice_at_its_corners_and_edges(device, axis, constructor):
    n = 9
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    points = np.insert(np.stack([i, j], 1), axis, 0, axis=1).astype(np.float32)
    a = (i * n + j).reshape(n, n)
    faces = np.stack([a[:-1, :-1], a[1:, :-1], a[:-1, 1:], a[1:, :-1], a[1:, 1:], a[:-1, 1:]], -1)
    x = wp.array(points, dtype=wp.vec3, device=device)
    mesh = wp.Mesh(
        x, wp.array(faces.ravel(), dtype=int, device=device), bvh_constructor=constructor
    )
    # Corners, middles of edges, and beyond the border.
    at = np.arange(-1, 2 * n) * 0.5
    u, v = (a.ravel() for a in np.meshgrid(at, at, indexing="ij"))
    starts = np.insert(np.stack([u, v], 1), axis, 3.0, axis=1).astype(np.float32)
    t = wp.zeros(len(starts), dtype=float, device=device)
    along = wp.vec3(*(-2.0 * (np.arange(3) == axis)))
    o = wp.array(starts, dtype=wp.vec3, device=device)
    wp.launch(cast, len(starts), inputs=[mesh.id, o, along, t], device=device)
    within = (u >= 0) & (u <= n - 1) & (v >= 0) & (v <= n - 1)
    assert (t.numpy() == np.where(within, 1.5, -1)).all()


@wp.kernel
def edges(q: wp.array(dtype=wp.vec3), out: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    out[i] = wp.closest_point_edge_edge(
        wp.vec3(0.0, 0.0, 0.0), wp.vec3(1.0, 0.0, 0.0), wp.vec3(0.0, 0.0, 1.0), q[i], 1.0e-6
    )


def test_edges_that_are_nearly_parallel_are_one_apart(device):
    """The other edge starts above the first one's start and leaves it at an angle, at most 1e-2."""
    angle = np.concatenate([[0], 10.0 ** np.arange(-12, -1.5, 0.25)])
    ends = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)], 1)
    out = wp.zeros(len(angle), dtype=wp.vec3, device=device)
    q = wp.array(ends, dtype=wp.vec3, device=device)
    wp.launch(edges, len(angle), inputs=[q, out], device=device)
    s, t, distance = out.numpy().T
    assert (s >= 0).all() and (s <= 1).all() and (t >= 0).all() and (t <= 1).all()
    # Exactly 1 at the starts; where they are parallel any place is as close.
    assert np.abs(distance - 1).max() <= 1e-6


@wp.kernel
def sample(id: wp.uint64, p: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = wp.volume_sample_f(id, p[i], wp.Volume.LINEAR)


@wp.kernel
def store(id: wp.uint64):
    i, j, k = wp.tid()
    x, y, z = i - 20, j - 20, k - 20
    wp.volume_store_f(id, x, y, z, float(2 * x - 3 * y + 5 * z))


def test_samples_are_continuous_and_linear_across_leaves(device):
    volume = wp.Volume.allocate([-20] * 3, [20] * 3, 1.0, bg_value=0.0, device=device)
    wp.launch(store, (41, 41, 41), inputs=[volume.id], device=device)
    rng = np.random.default_rng(3)
    # On both sides of where leaves and nodes meet, also at negative places.
    border = rng.choice([-16.0, -8.0, 0.0, 8.0, 16.0], (500, 3))
    p = np.float32(border + rng.uniform(-1e-3, 1e-3, (500, 3)))
    out = wp.zeros(500, dtype=float, device=device)
    at = wp.array(p, dtype=wp.vec3, device=device)
    wp.launch(sample, 500, inputs=[volume.id, at, out], device=device)
    wanted = p.astype(float) @ [2, -3, 5]
    # For values up to 10 times the largest coordinate, four units in the last place.
    assert np.abs(out.numpy() - wanted).max() <= 4 * 2**-24 * 160


@wp.kernel
def there_and_back(id: wp.uint64, p: wp.array(dtype=wp.vec3d), out: wp.array(dtype=wp.vec3d)):
    i = wp.tid()
    out[i] = wp.volume_index_to_world(id, wp.volume_world_to_index(id, p[i]))


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_transforms_are_inverse_whatever_the_size_of_voxels(device, size):
    volume = wp.Volume.load_from_numpy(np.ones((2, 2, 2)), (0, 0, 0), size, 0.0, device=device)
    p = np.random.default_rng(1).uniform(-100, 100, (100, 3)) * size
    out = wp.zeros(100, dtype=wp.vec3d, device=device)
    at = wp.array(p, dtype=wp.vec3d, device=device)
    wp.launch(there_and_back, 100, inputs=[volume.id, at, out], device=device)
    assert (np.abs(out.numpy() - p) <= 4 * 2**-53 * 100 * size).all()
