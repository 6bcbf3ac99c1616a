"""Closest points, edges, triangles and areas: G6 to G17."""

import functools

import numpy as np

import warp as wp
from warp.report.stability._case import case
from warp.report.stability.geometry import HALVES, SQUARE, closest, icosphere, make_mesh
from warp.report.stability.rotations import units


@case("G6", "closest points 1e7 away from the origin", ("float32",))
def far_mesh(p):
    points, faces = icosphere(1)
    offset = np.float32([1e7, -1e7, 1e7])
    moved = np.float32(points * 8 + offset)
    mesh = make_mesh(p, moved, faces)
    x = np.float32(units(p.random, 200) * 16 + offset)
    _, distance = closest(p, mesh, x)
    exact = closest_by_sampling(moved.astype(float), faces, x.astype(float))
    p.check("distance", (distance - exact) / 16, 4 * 2.0**-24 * 1e7 / 16 * 2, x=x)


def closest_by_sampling(points, faces, x):
    """Distances to triangles: their plane, edges and corners in float64."""
    best = np.full(len(x), np.inf)
    for a, b, c in points[faces]:
        n = np.cross(b - a, c - a)
        square = n @ n
        if square:
            h = ((x - a) @ n)[:, None] / square * n
            foot = x - h
            inside = np.ones(len(x), bool)
            for s, e in ((a, b), (b, c), (c, a)):
                inside &= np.cross(e - s, foot - s) @ n >= 0
            best = np.where(inside, np.minimum(best, np.linalg.norm(h, axis=1)), best)
        for s, e in ((a, b), (b, c), (c, a)):
            d = e - s
            t = np.clip(((x - s) @ d) / max(d @ d, 1e-300), 0, 1)[:, None]
            best = np.minimum(best, np.linalg.norm(x - s - t * d, axis=1))
    return best


@case("G8", "triangles without area: lines and points", ("float32",))
def no_area(p):
    shapes = {
        "on a line": [(0, 0, 0), (1, 0, 0), (2, 0, 0)],
        "two equal": [(0, 0, 0), (0, 0, 0), (1, 0, 0)],
        "a point": [(0.5, 0, 0), (0.5, 0, 0), (0.5, 0, 0)],
    }
    x = np.float32(p.random.uniform(-2, 3, (200, 3)))
    for what, points in shapes.items():
        points = np.float32(points)
        _, distance = closest(p, make_mesh(p, points, [(0, 1, 2)]), x)
        exact = closest_by_sampling(points.astype(float), np.array([(0, 1, 2)]), x.astype(float))
        p.check(what, distance - exact, 8 * p.u, x=x)


@case("G9", "needles and caps of height 1e-6", ("float32",))
def needles(p):
    shapes = {"needle": [(0, 0, 0), (1, 0, 0), (1, 1e-6, 0)]}
    shapes["cap"] = [(0, 0, 0), (1, 0, 0), (0.5, 1e-6, 0)]
    x = np.float32(p.random.uniform(-1, 2, (400, 3)))
    for what, points in shapes.items():
        points = np.float32(points)
        _, distance = closest(p, make_mesh(p, points, [(0, 1, 2)]), x)
        exact = closest_by_sampling(points.astype(float), np.array([(0, 1, 2)]), x.astype(float))
        p.check(what, distance / exact - 1, 1e-4, x=x)


@wp.kernel
def find_sides(mesh: wp.uint64, x: wp.array(dtype=wp.vec3), side: wp.array(dtype=float)):
    i = wp.tid()
    found = wp.mesh_query_point_sign_winding_number(mesh, x[i], 1.0e9)
    side[i] = found.sign


def winding_numbers(points, faces, x):
    """Solid angles over 4 pi (van Oosterom and Strackee) in float64."""
    a, b, c = (points[faces[:, k]].astype(float)[None] - x[:, None] for k in range(3))
    p, q, r = (np.linalg.norm(v, axis=2) for v in (a, b, c))
    triple = (a * np.cross(b, c)).sum(2)
    rest = (a * b).sum(2) * r + (b * c).sum(2) * p + (c * a).sum(2) * q
    return np.arctan2(triple, p * q * r + rest).sum(1) / (2 * np.pi)


@case("G11", "sides by winding numbers: closed, open, doubled and overlapping shells", ("float32",))
def winding(p):
    if p.absent("mesh_query_point_sign_winding_number"):
        return
    points, faces = icosphere(2)
    moved = np.concatenate([points, points + np.float32([0.7, 0, 0])])
    shells = {
        "closed": (points, faces),
        "open": (points, faces[points[faces].mean(1)[:, 2] < 0.6]),
        "doubled": (points, np.concatenate([faces, faces])),
        "overlapping": (moved, np.concatenate([faces, faces + len(points)])),
    }
    x = np.float32(p.random.uniform(-1.5, 2.0, (300, 3)))
    for what, (corners, shell) in shells.items():
        mesh = wp.Mesh(
            p.array(corners, wp.vec3),
            p.array(shell.ravel(), wp.int32),
            support_winding_number=True,
        )
        side = p.zeros(len(x), wp.float32)
        p.launch(find_sides, len(x), mesh.id, p.array(x, wp.vec3), side)
        w = winding_numbers(corners, shell, x.astype(float))
        wrong = (side.numpy() < 0) != (w > 0.5)
        p.check(what, (wrong & (np.abs(w - 0.5) > 0.02)).astype(float), 0.0, x=x)


@functools.cache
def make_edges(real):
    vec3 = wp.types.vector(3, real)

    @wp.func
    def nearest(a: vec3, b: vec3, c: vec3, d: vec3):
        return wp.closest_point_edge_edge(a, b, c, d, real(1e-6))

    return nearest


@case("G12", "closest points of two edges, parallel and nearly so", ("float32",))
def edges(p):
    if p.absent("closest_point_edge_edge"):
        return
    a, c = p.random.normal(size=(2, 2000, 3))
    way = p.random.normal(size=(2000, 3))
    tilt = np.where(np.arange(2000) % 2, 1e-8, 0.5)[:, None]
    b, d = a + way, c + way + tilt * p.random.normal(size=(2000, 3))
    a, b, c, d = (np.float32(x) for x in (a, b, c, d))
    found = p.map(make_edges(p.real), *(p.array(x, p.vector(3)) for x in (a, b, c, d)))
    p.holds("weights from 0 to 1", ((found[:, :2] >= 0) & (found[:, :2] <= 1)).all(1), a=a, b=b)
    s, t = found[:, :1].astype(float), found[:, 1:2].astype(float)
    at = np.linalg.norm(a + s * (b - a).astype(float) - c - t * (d - c).astype(float), axis=1)
    best = np.full(2000, np.inf)
    for s in np.linspace(0, 1, 201)[:, None]:
        x = a + s * (b - a).astype(float)
        e = (d - c).astype(float)
        t = np.clip(((x - c) * e).sum(1) / (e * e).sum(1), 0, 1)[:, None]
        best = np.minimum(best, np.linalg.norm(x - c - t * e, axis=1))
    p.check("longer than the least of a sample", (at - best).clip(0), 1e-4, a=a, b=b, c=c, d=d)


@functools.cache
def make_triangles(real):
    vec3 = wp.types.vector(3, real)

    @wp.func
    def meet(a: vec3, b: vec3, c: vec3, d: vec3, e: vec3, f: vec3):
        return wp.intersect_tri_tri(a, b, c, d, e, f)

    return meet


def crossing(first, second):
    """True if an edge of the first triangles passes through the second, and how clearly."""
    a, b, c = (second[:, k] for k in range(3))
    hit, clear = np.zeros(len(first), bool), np.full(len(first), np.inf)
    for k in range(3):
        o, d = first[:, k], first[:, (k + 1) % 3] - first[:, k]
        n = np.cross(d, c - a)
        scale = ((b - a) * n).sum(1)
        u = ((o - a) * n).sum(1) / scale
        q = np.cross(o - a, b - a)
        v, t = (d * q).sum(1) / scale, ((c - a) * q).sum(1) / scale
        signs = np.stack([u, v, 1 - u - v, t, 1 - t])
        hit |= (signs > 0).all(0)
        clear = np.minimum(clear, np.abs(signs.min(0)))
    return hit, clear


@case("G13", "intersection of two triangles", ("float32",))
def triangles(p):
    if p.absent("intersect_tri_tri"):
        return
    first, second = np.float32(p.random.normal(size=(2, 20_000, 3, 3)))
    given = [p.array(one[:, k], p.vector(3)) for one in (first, second) for k in range(3)]
    found = p.map(make_triangles(p.real), *given) != 0
    hits = [crossing(*pair) for pair in ((first, second), (second, first))]
    exact, clear = hits[0][0] | hits[1][0], np.minimum(hits[0][1], hits[1][1]) > 1e-4
    p.check("wrong", ((found != exact) & clear).astype(float), 0.0, first=first, second=second)


@case("G14", "NaN and infinite corners, one face, no face, 1e5 coincident faces", ("float32",))
def degenerate_meshes(p):
    points = np.concatenate([SQUARE, [[np.nan, 0, 0], [np.inf, 0, 0]]]).astype(np.float32)
    mesh = make_mesh(p, points, [*HALVES, (0, 1, 4), (0, 1, 5)])
    _, distance = closest(p, mesh, np.float32([[0.5, 0.5, 2.0]]))
    p.check("distance beside a face of NaN", distance[0] - 2, 0.0)
    p.check("faces left out", mesh.report.skipped - 2, 0.0)
    same = make_mesh(p, SQUARE, np.tile(HALVES, (50_000, 1)))
    _, distance = closest(p, same, np.float32([[0.5, 0.5, 2.0]]))
    p.check("1e5 coincident faces", distance[0] - 2, 0.0)
    try:
        empty = make_mesh(p, SQUARE, np.zeros((0, 3), int))
    except (ValueError, wp.WarpError) as error:
        p.explained("no face", str(error))
    else:
        _, distance = closest(p, empty, np.float32([[0.5, 0.5, 2.0]]))
        p.check("no face: nothing is found", distance[0] + 1, 0.0)


@functools.cache
def make_area(real):
    vec3 = wp.types.vector(3, real)

    @wp.func
    def area(sides: vec3):
        # Kahan: sides in decreasing order, brackets as they are.
        a = wp.max(sides)
        c = wp.min(sides)
        b = wp.max(wp.min(sides[0], sides[1]), wp.min(wp.max(sides[0], sides[1]), sides[2]))
        return real(0.25) * wp.sqrt((a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c)))

    return area


@case("G17", "area of a needle from its sides")
def needle_area(p):
    sides = np.array([[100000.0, 99999.99979, 0.00029]])
    found = p.map(make_area(p.real), p.array(sides, p.vector(3)))
    p.check("area", found[0] / 10.000000077 - 1, 1e-9, sides=sides)
