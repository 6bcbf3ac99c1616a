"""Spatial structures, scans and sorts: S2 to S7."""

import numpy as np

import warp as wp
from warp.report.stability._case import case


@wp.kernel
def count_neighbours(
    grid: wp.uint64, x: wp.array(dtype=wp.vec3), radius: float, n: wp.array(dtype=int)
):
    i = wp.tid()
    for j in wp.hash_grid_query(grid, x[i], radius):
        if wp.length(x[j] - x[i]) <= radius:
            n[i] += 1


def neighbours(p, points, radius, cells=16):
    grid = wp.HashGrid(cells, cells, cells, device=p.device)
    x = p.array(points, wp.vec3)
    grid.build(x, radius)
    n = p.zeros(len(points), wp.int32)
    p.launch(count_neighbours, len(points), grid.id, x, float(radius), n)
    return n.numpy(), grid


def expected(points, radius):
    """Pairs within a radius by brute force in the kernel's precision."""
    d = points[:, None] - points[None]
    with np.errstate(all="ignore"):
        length = np.sqrt((d * d).sum(-1, dtype=np.float32))
    near = np.abs(length - radius) < 1e-5 * radius
    inside = (length <= radius) & np.isfinite(length)
    return (inside & ~near).sum(1), (inside | near).sum(1)


@case("S2", "hash grid: far away, across its period, radius larger than it, NaN", ("float32",))
def hash_grid_extremes(p):
    base = p.random.uniform(0, 1, (600, 3)).astype(np.float32)
    sets = {
        "unit cube": (base, 0.1),
        "around 1000": (base + np.float32(1000), 0.1),
        "negative": (base - np.float32(3), 0.1),
        "radius larger than the grid": (base, 5.0),
        "across the period": (base * np.float32(10), 0.5),
        "1e7 apart": (base * np.float32(1e7), 1e6),
    }
    for what, (points, radius) in sets.items():
        found, _ = neighbours(p, points, radius)
        low, high = expected(points, np.float32(radius))
        p.holds(what, (found >= low) & (found <= high), point=points)
    base[3] = np.nan
    found, grid = neighbours(p, base, 0.1)
    p.check("points left out", grid.skipped - 1, 0.0)
    p.check("neighbours of NaN", found[3], 0.0)
    found, _ = neighbours(p, np.full((8, 3), 1e10, np.float32), 1.0)
    p.check("neighbours of 8 coincident points at 1e10", np.abs(found - 8).max(), 0.0)
    p.diagnosed("radius 0", lambda: neighbours(p, base, 0.0), "radius")


@case("S3", "all points in one cell", ("float32",))
def one_cell(p):
    found, _ = neighbours(p, np.full((2000, 3), 0.5, np.float32), 0.1)
    p.check("neighbours of 2000 coincident points", found - 2000, 0.0)
    n = 1_000_000
    grid = wp.HashGrid(8, 8, 8, device=p.device)
    grid.build(p.array(np.full((n, 3), 0.5, np.float32), wp.vec3), 0.1)
    p.note("1e6 coincident points", "built")


@wp.kernel
def sample_volume(
    volume: wp.uint64, places: wp.array(dtype=wp.vec3), linear: bool, out: wp.array(dtype=float)
):
    i = wp.tid()
    at = wp.volume_world_to_index(volume, places[i])
    if linear:
        out[i] = wp.volume_sample_f(volume, at, wp.Volume.LINEAR)
    else:
        out[i] = wp.volume_sample_f(volume, at, wp.Volume.CLOSEST)


def sampled(p, volume, places, linear=True):
    """Values of a volume at places of the world."""
    found = p.zeros(len(places), wp.float32)
    given = p.array(np.asarray(places, np.float32), wp.vec3)
    p.launch(sample_volume, len(places), volume.id, given, linear, found)
    return found.numpy().astype(np.float64)


@case("S4", "sampling of volumes", ("float32",))
def volume_sampling(p):
    n, slope = 20, np.array([0.5, -2.0, 3.0])
    nodes = np.stack(np.meshgrid(*3 * [np.arange(n)], indexing="ij"), axis=-1)
    values = (nodes @ slope + 7.0).astype(np.float32)
    volume = wp.Volume.load_from_numpy(values, bg_value=-5.0, device=p.device)
    places = p.random.uniform(0.0, n - 1.0, (5000, 3)).astype(np.float32)
    exact = places.astype(np.float64) @ slope + 7.0
    error = np.abs(sampled(p, volume, places) - exact)
    # Eight products and seven sums of numbers up to 105, at places with half an ulp each.
    p.check("linear field", error, 16 * 2.0**-24 * 105.0, place=places)
    far = np.array([[1e6, 0, 0], [-1e6, 5, 5], [3, 3, 1e9], [-50, -50, -50]])
    p.check("background far away", sampled(p, volume, far) + 5.0, 0.0, place=far)


@case("S5", "leaves of sparse volumes", ("float32",))
def volume_leaves(p):
    corners = np.array([[0, 0, 0], [-8, 0, 0], [4096, -4096, 8], [8, 8, 8]], np.int32)
    tiles = p.array(corners, wp.int32)
    volume = wp.Volume.allocate_by_tiles(tiles, 1.0, bg_value=2.0, device=p.device)
    p.check("tiles", volume.get_tile_count() - len(corners), 0.0)
    inside = np.concatenate([corners, corners + 7])
    outside = np.array([[-9, 0, 0], [0, 0, 8], [4104, -4096, 8], [7, 8, 8], [8, 7, 7]])
    grid = wp.Volume.allocate_by_voxels(p.array(inside, wp.int32), 1.0, device=p.device)
    p.check("voxels", grid.get_voxel_count() - len(inside), 0.0)
    held = {tuple(row) for row in grid.get_voxels().numpy()}
    p.holds("voxels at corners of leaves", [held == {tuple(row) for row in inside}])
    p.check("background beside leaves", sampled(p, volume, outside, False) - 2.0, 0.0)


@case("S6", "marching cubes", ("float32",))
def isosurface(p):
    n = 16
    field = np.full((n, n, n), 1.0, np.float32)
    field[1:-1, 1:-1, 1:-1] = p.random.uniform(-1.0, 1.0, 3 * (n - 2,))
    with wp.ScopedDevice(p.device):
        cubes = wp.MarchingCubes(n, n, n)
    cubes.surface(p.array(field, wp.float32), 0.0)
    faces = cubes.indices.numpy().reshape(-1, 3)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    forward = {tuple(e) for e in edges}
    p.holds("every edge has its opposite", [(b, a) in forward for a, b in forward])
    p.holds("noise has a surface", [len(faces) > 1000])
    points = cubes.verts.numpy()
    p.holds("vertices are within the grid", [np.isfinite(points).all() and points.min() >= 0])
    cubes.surface(p.array(np.ones((n, n, n)), wp.float32), 0.0)
    p.check("faces of no surface", cubes.indices.size, 0.0)


@case("S7", "scans, sorts and run lengths of 0, 1 and many elements", ("float32",))
def sequences(p):
    for n in (0, 1, 2, 31, 4097, 300_001):
        x = p.random.integers(-1000, 1000, n).astype(np.int32)
        given, out = p.array(x, wp.int32), p.zeros(n, wp.int32)
        for inclusive in (True, False):
            wp.utils.array_scan(given, out, inclusive=inclusive)
            exact = np.cumsum(x) - (0 if inclusive else x)
            p.check(f"scan of {n}", np.abs(out.numpy() - exact).max(initial=0), 0.0)
        for what, keys in (("random", x), ("equal", x * 0), ("sorted", np.sort(x))):
            held = p.zeros(2 * n, wp.int32), p.zeros(2 * n, wp.int32)
            wp.copy(held[0], p.array(keys, wp.int32), count=n)
            wp.copy(held[1], p.array(np.arange(n), wp.int32), count=n)
            wp.utils.radix_sort_pairs(held[0], held[1], n)
            order = np.argsort(keys, kind="stable")
            same = (held[0].numpy()[:n] == keys[order]) & (held[1].numpy()[:n] == order)
            p.check(f"sort of {n}, {what}", 0.0 if same.all() else 1.0, 0.0)
        values, lengths = p.zeros(n, wp.int32), p.zeros(n, wp.int32)
        keys = np.sort(x // 100)
        count = wp.utils.runlength_encode(p.array(keys, wp.int32), values, lengths)
        exact, size = np.unique(keys, return_counts=True)
        good = count == len(exact) and (lengths.numpy()[:count] == size).all()
        p.check(f"run lengths of {n}", 0.0 if good else 1.0, 0.0)
