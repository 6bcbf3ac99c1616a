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


@case("S4", "sampling of volumes", ("float32",))
def volume_sampling(p):
    p.absent("Volume")


@case("S5", "leaves of sparse volumes", ("float32",))
def volume_leaves(p):
    p.absent("Volume")


@case("S6", "marching cubes", ("float32",))
def isosurface(p):
    p.absent("MarchingCubes")


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
