"""Queries of triangle meshes: rays, G1 to G5."""

import functools

import numpy as np

import warp as wp
from warp.report.stability._case import case
from warp.report.stability.rotations import units


@wp.kernel
def cast_rays(
    mesh: wp.uint64, start: wp.array(dtype=wp.vec3), way: wp.array(dtype=wp.vec3),
    face: wp.array(dtype=int), t: wp.array(dtype=float),
):  # fmt: skip
    i = wp.tid()
    found = wp.mesh_query_ray(mesh, start[i], way[i], 1.0e6)
    face[i] = -1
    if found.result:
        face[i] = found.face
        t[i] = found.t


@wp.kernel
def find_closest(
    mesh: wp.uint64, x: wp.array(dtype=wp.vec3), at: wp.array(dtype=wp.vec3),
    distance: wp.array(dtype=float),
):  # fmt: skip
    i = wp.tid()
    found = wp.mesh_query_point_no_sign(mesh, x[i], 1.0e9)
    distance[i] = -1.0
    if found.result:
        at[i] = wp.mesh_eval_position(mesh, found.face, found.u, found.v)
        distance[i] = wp.length(at[i] - x[i])


def make_mesh(p, points, faces):
    return wp.Mesh(p.array(np.float32(points), wp.vec3), p.array(np.ravel(faces), wp.int32))


def rays(p, mesh, start, way):
    start, way = np.float32(start), np.float32(way)
    face, t = p.zeros(len(start), wp.int32), p.zeros(len(start), wp.float32)
    inputs = [mesh.id, p.array(start, wp.vec3), p.array(way, wp.vec3), face, t]
    p.launch(cast_rays, len(start), *inputs)
    return face.numpy(), t.numpy()


def closest(p, mesh, x):
    at, distance = p.zeros(len(x), wp.vec3), p.zeros(len(x), wp.float32)
    p.launch(find_closest, len(x), mesh.id, p.array(np.float32(x), wp.vec3), at, distance)
    return at.numpy(), distance.numpy()


@functools.cache
def icosphere(level):
    """Vertices on the unit sphere and faces of a closed mesh."""
    g = (1 + 5**0.5) / 2
    points = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g)]
    points += [(0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4)]
    faces += [(11, 10, 2), (10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8)]
    faces += [(3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    points = [np.array(x) / np.linalg.norm(x) for x in points]
    for _ in range(level):
        middle, finer = {}, []

        def half(i, j, middle=middle):
            key = (min(i, j), max(i, j))
            if key not in middle:
                x = points[i] + points[j]
                points.append(x / np.linalg.norm(x))
                middle[key] = len(points) - 1
            return middle[key]

        for a, b, c in faces:
            d, e, f = half(a, b), half(b, c), half(c, a)
            finer += [(a, d, f), (b, e, d), (c, f, e), (d, e, f)]
        faces = finer
    return np.float32(points), np.array(faces)


def brute_force(points, faces, start, way):
    """Nearest t over all faces in float64 (Moeller and Trumbore), infinite where none is met."""
    a, b, c = (points[faces[:, k]].astype(float) for k in range(3))
    best = np.full(len(start), np.inf)
    for i, (o, d) in enumerate(zip(start.astype(float), way.astype(float))):
        n = np.cross(d, c - a)
        with np.errstate(all="ignore"):
            scale = 1 / ((b - a) * n).sum(1)
            u = ((o - a) * n).sum(1) * scale
            q = np.cross(o - a, b - a)
            v, t = (d * q).sum(1) * scale, ((c - a) * q).sum(1) * scale
            hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0)
        best[i] = t[hit].min(initial=np.inf)
    return best


@case("G1", "rays through the edge of two tilted faces: none slips through", ("float32",))
def shared_edges(p):
    pairs, each = 400, 500
    for _ in range(pairs // 100):
        a, b, c, d = (p.random.normal(size=(100, 3)) for _ in range(4))
        points = np.stack([a, b, c, d], 1)
        way = (a + b) / 2 - (c + d) / 2 + 0.05 * p.random.normal(size=(100, 3))
        # Not a silhouette: c and d lie on two sides of the edge, seen along the ray.
        edge = np.cross(way, b - a)
        edge /= np.linalg.norm(edge, axis=1)[:, None]
        sides = (edge * (c - a)).sum(1), (edge * (d - a)).sum(1)
        split = (sides[0] * sides[1] < 0) & (np.minimum(*np.abs(sides)) > 0.1)
        points = points[split].reshape(-1, 3)
        count = split.sum()
        faces = np.array([((0, 1, 2), (1, 0, 3))]) + 4 * np.arange(count)[:, None, None]
        # Each pair on a place of its own.
        place = 8.0 * np.arange(count)[:, None]
        points = points + np.repeat(place * np.array([[1.0, 0, 0]]), 4, axis=0)
        mesh = make_mesh(p, points, faces)
        s = p.random.uniform(0.01, 0.99, (count, each, 1))
        corners = np.float32(points).astype(float).reshape(-1, 4, 3)
        target = corners[:, None, 0] * s + corners[:, None, 1] * (1 - s)
        start = (target - way[split][:, None]).reshape(-1, 3)
        face, _ = rays(p, mesh, start, np.repeat(way[split], each, axis=0))
        p.check("misses", (face < 0).astype(float), 0.0, start=start)


@case(
    "G2",
    "rays at the vertices and edges of a closed mesh meet it, from inside and outside",
    ("float32",),
)
def closed_mesh(p):
    points, faces = icosphere(2)
    mesh = make_mesh(p, points, faces)
    corners = points[faces].astype(float)
    targets = np.concatenate([points, corners.mean(1), (corners[:, 0] + corners[:, 1]) / 2])
    start = 3.0 * units(p.random, len(targets))
    visible = (targets * start).sum(1) > 2.0
    face, _ = rays(p, mesh, start[visible], (targets - start)[visible])
    p.check("misses from outside", (face < 0).astype(float), 0.0, start=start[visible])
    way = np.concatenate([units(p.random, 50_000), targets])
    face, _ = rays(p, mesh, np.zeros_like(way), way)
    p.check("misses from inside", (face < 0).astype(float), 0.0, way=way)


SQUARE = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
HALVES = np.array([(0, 1, 2), (0, 2, 3)])


@case("G3", "rays in a face's plane, from the surface, from behind", ("float32",))
def special_rays(p):
    mesh = make_mesh(p, SQUARE, HALVES)
    start = [(-1, 0.5, 0), (0.25, 0.5, 0), (0.25, 0.5, -1), (0.25, 0.5, 1), (2, 2, 1)]
    way = [(1, 0, 0), (0, 0, 1), (0, 0, 1), (0, 0, -1), (0, 0, -1)]
    face, t = rays(p, mesh, start, way)
    p.holds("in the plane: a miss", face[0] < 0)
    p.holds("from the surface: t = 0", face[1] >= 0 and t[1] == 0)
    p.holds("from behind and from the front: t = 1", [*(face[2:4] >= 0), *(t[2:4] == 1)])
    p.holds("beside it: a miss", face[4] < 0)
    start = [(np.nan, 0, 0), (0, 0, np.inf), (0, 0, 1), (0, 0, 1)]
    face, _ = rays(p, mesh, start, [(0, 0, 1), (0, 0, -1), (0, 0, 0), (np.nan, 0, 1)])
    p.holds("what is no number, and no direction: a miss", face < 0)


@case("G4", "rays along the axes that start in the planes of the boxes", ("float32",))
def slab_planes(p):
    mesh = make_mesh(p, SQUARE, HALVES)
    corners = [(x, y) for x in (0.0, 0.5, 1.0) for y in (0.0, 0.5, 1.0)]
    start = [(x, y, 1.0) for x, y in corners]
    face, _ = rays(p, mesh, start, [(0.0, 0.0, -1.0)] * 9)
    p.check("misses", (face < 0).astype(float), 0.0, start=start)
    face, _ = rays(p, mesh, start, [(-0.0, -0.0, -1.0)] * 9)
    p.check("misses with negative zeros", (face < 0).astype(float), 0.0, start=start)


@case("G5", "the hierarchy against all faces one by one", ("float32",))
def against_brute_force(p):
    points, faces = icosphere(2)
    mesh = make_mesh(p, points, faces)
    start = np.float32(2.0 * p.random.uniform(-1, 1, (1200, 3)))
    way = np.float32(units(p.random, 1200))
    way[:600] = np.float32(np.eye(3)[p.random.integers(0, 3, 600)])
    start[300:600] = np.round(start[300:600] * 4) / 4
    face, t = rays(p, mesh, start, way)
    best = brute_force(points, faces, start, way)
    clear = np.isfinite(best)
    p.check("misses of what is met", ((face < 0) & clear).astype(float), 0.0, start=start, way=way)
    error = np.where(clear & (face >= 0), np.abs(t - np.where(clear, best, 0)), 0)
    p.check("t", error, 40 * p.u, start=start, way=way)
