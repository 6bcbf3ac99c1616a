"""Kernels of shapes.py over particles, links between them, and surfaces."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable


@differentiable
def gravity_kernel(
    x: wp.array(dtype=wp.vec3d), m: wp.array(dtype=wp.float64), soft: wp.float64,
    a: wp.array(dtype=wp.vec3d),
):  # fmt: skip
    i = wp.tid()
    p = x[i]
    total = wp.vec3d()
    for j in range(x.shape[0]):
        d = x[j] - p
        r2 = wp.dot(d, d) + soft
        total += d * (m[j] / (r2 * wp.sqrt(r2)))
    a[i] = total


@case
def gravity(data):
    """All pairs of bodies in 64 bits."""
    n = data.size(512, 8192)
    arrays = [data.real((n, 3), wp.vec3d), data.real(n, wp.float64), 0.01]
    return Case(gravity_kernel, n, arrays, [data.out(n, wp.vec3d)], n * n, "pair")


@differentiable
def cloth_kernel(
    x: wp.array(dtype=wp.vec3), v: wp.array(dtype=wp.vec3), ends: wp.array2d(dtype=int),
    rest: wp.array(dtype=float), k: float, damp: float, f: wp.array(dtype=wp.vec3),
):  # fmt: skip
    s = wp.tid()
    i = ends[s, 0]
    j = ends[s, 1]
    d = x[i] - x[j]
    far = wp.length(d)
    n = d / far
    size = k * (far - rest[s]) + damp * wp.dot(v[i] - v[j], n)
    wp.atomic_sub(f, i, n * size)
    wp.atomic_add(f, j, n * size)


def links(n):
    """Pairs of neighbours on a square of n times n nodes."""
    nodes = np.arange(n * n).reshape(n, n)
    pairs = [(nodes[:, :-1], nodes[:, 1:]), (nodes[:-1], nodes[1:])]
    pairs.append((nodes[:-1, :-1], nodes[1:, 1:]))
    return np.concatenate([np.stack([a.ravel(), b.ravel()], 1) for a, b in pairs]).astype(np.int32)


@case
def cloth(data):
    """Springs with dampers in a cloth."""
    n = data.size(192, 1024)
    ends = links(n)
    x = data.real((n * n, 3), wp.vec3)
    arrays = [x, data.real((n * n, 3), wp.vec3), data.given(ends, int), data.real(len(ends))]
    out = [data.out(n * n, wp.vec3)]
    return Case(cloth_kernel, len(ends), [*arrays, 50.0, 0.5], out, len(ends))


@differentiable
def bending_kernel(
    x: wp.array(dtype=wp.vec3), corners: wp.array(dtype=wp.vec4i), k: float,
    energy: wp.array(dtype=float),
):  # fmt: skip
    t = wp.tid()
    c = corners[t]
    a = x[c[0]]
    e = x[c[1]] - a
    n1 = wp.cross(e, x[c[2]] - a)
    n2 = wp.cross(x[c[3]] - a, e)
    angle = wp.atan2(wp.dot(wp.cross(n1, n2), wp.normalize(e)), wp.dot(n1, n2))
    energy[t] = k * angle * angle


@case
def bending(data):
    """Angles between triangles that share an edge."""
    n, m = data.size(1 << 13, 1 << 20), data.size(1 << 15, 1 << 22)
    near = data.random.integers(0, n - 64, (m, 1))
    offsets = np.stack([data.random.permutation(64)[:4] for _ in range(m)])
    corners = (near + offsets).astype(np.int32)
    arrays = [data.real((n, 3), wp.vec3), data.given(corners, wp.vec4i), 2.0]
    return Case(bending_kernel, m, arrays, [data.out(m)], m, smooth=False)


@differentiable
def density_kernel(
    grid: wp.uint64, x: wp.array(dtype=wp.vec3), h: float, rho: wp.array(dtype=float)
):
    i = wp.hash_grid_point_id(grid, wp.tid())
    p = x[i]
    total = float(0.0)
    query = wp.hash_grid_query(grid, p, h)
    j = int(0)
    while wp.hash_grid_query_next(query, j):
        r2 = wp.length_sq(p - x[j])
        if r2 < h * h:
            w = h * h - r2
            total += w * w * w
    rho[i] = total


def grid_of(data, x, cells, radius):
    """A hash grid over points; the case keeps it alive."""
    grid = wp.HashGrid(cells, cells, cells, device=data.device)
    grid.build(x, radius)
    data.grid = grid
    CACHE.append(grid)
    return grid


CACHE = []


@case
def density(data):
    """Sums over the neighbours that a hash grid finds."""
    n = data.size(1 << 14, 1 << 20)
    h = float((40.0 / n) ** (1 / 3))
    x = data.real((n, 3), wp.vec3)
    grid = grid_of(data, x, data.size(16, 64), h)
    return Case(density_kernel, n, [grid.id, x, h], [data.out(n)], n, smooth=False)


@differentiable
def contact_kernel(
    grid: wp.uint64, x: wp.array(dtype=wp.vec3), v: wp.array(dtype=wp.vec3), r: float, k: float,
    mu: float, f: wp.array(dtype=wp.vec3),
):  # fmt: skip
    i = wp.hash_grid_point_id(grid, wp.tid())
    p = x[i]
    u = v[i]
    total = wp.vec3(0.0, -9.8, 0.0)
    if p[1] < r:
        total += wp.vec3(0.0, k * (r - p[1]), 0.0)
    for j in wp.hash_grid_query(grid, p, 2.0 * r):
        if j != i:
            d = p - x[j]
            far = wp.length(d)
            deep = 2.0 * r - far
            if deep > 0.0:
                n = d / far
                w = u - v[j]
                slip = w - n * wp.dot(w, n)
                s = wp.length(slip)
                total += n * (k * deep)
                if s > 1.0e-6:
                    total -= slip * (wp.min(mu * k * deep, s) / s)
    f[i] = total


@case
def contact(data):
    """Contacts of spheres with friction."""
    n = data.size(1 << 14, 1 << 20)
    r = float(0.5 * (6.0 / n) ** (1 / 3))
    x, v = data.real((n, 3), wp.vec3), data.real((n, 3), wp.vec3, -1.0)
    grid = grid_of(data, x, data.size(32, 128), 2.0 * r)
    arrays = [grid.id, x, v, r, 100.0, 0.3]
    return Case(contact_kernel, n, arrays, [data.out(n, wp.vec3)], n, smooth=False)


@differentiable
def rigid_kernel(
    q: wp.array(dtype=wp.transform), qd: wp.array(dtype=wp.spatial_vector),
    inertia: wp.array(dtype=wp.mat33), dt: float, out: wp.array(dtype=wp.transform),
    out_d: wp.array(dtype=wp.spatial_vector),
):  # fmt: skip
    i = wp.tid()
    pose = q[i]
    p = wp.transform_get_translation(pose)
    r = wp.transform_get_rotation(pose)
    w = wp.spatial_top(qd[i])
    v = wp.spatial_bottom(qd[i]) + wp.vec3(0.0, -9.8, 0.0) * dt
    local = wp.quat_rotate_inv(r, w)
    torque = wp.cross(inertia[i] * local, local)
    w = wp.quat_rotate(r, local + wp.inverse(inertia[i]) * torque * dt)
    r = wp.normalize(r + wp.quat(w, 0.0) * r * 0.5 * dt)
    out[i] = wp.transform(p + v * dt, r)
    out_d[i] = wp.spatial_vector(w, v)


@case
def rigid(data):
    """A step of rigid bodies: rotation, inertia, gyroscopic torque."""
    n = data.size(1 << 14, 1 << 20)
    inertia = data.random.uniform(0.0, 0.1, (n, 3, 3)) + np.eye(3)
    poses = data.random.normal(size=(n, 7))
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    arrays = [data.given(poses.astype(np.float32), wp.transform, True)]
    arrays.append(data.real((n, 6), wp.spatial_vector))
    arrays += [data.given(inertia.astype(np.float32), wp.mat33, True), 0.01]
    return Case(
        rigid_kernel, n, arrays, [data.out(n, wp.transform), data.out(n, wp.spatial_vector)], n
    )


@wp.func
def smooth_min(a: float, b: float, k: float):
    h = wp.clamp(0.5 + 0.5 * (b - a) / k, 0.0, 1.0)
    return wp.lerp(b, a, h) - k * h * (1.0 - h)


@wp.func
def box(p: wp.vec3, size: wp.vec3):
    d = wp.vec3(wp.abs(p[0]), wp.abs(p[1]), wp.abs(p[2])) - size
    outside = wp.vec3(wp.max(d[0], 0.0), wp.max(d[1], 0.0), wp.max(d[2], 0.0))
    return wp.length(outside) + wp.min(wp.max(d[0], wp.max(d[1], d[2])), 0.0)


@wp.func
def world(p: wp.vec3, balls: wp.array(dtype=wp.vec4)):
    d = box(p - wp.vec3(0.0, -1.0, 0.0), wp.vec3(2.0, 0.2, 2.0))
    for b in range(balls.shape[0]):
        s = balls[b]
        d = smooth_min(d, wp.length(p - wp.vec3(s[0], s[1], s[2])) - s[3], 0.2)
    return d


@differentiable
def march_kernel(balls: wp.array(dtype=wp.vec4), steps: int, y: wp.array2d(dtype=float)):
    i, j = wp.tid()
    u = 2.0 * float(j) / float(y.shape[1]) - 1.0
    v = 1.0 - 2.0 * float(i) / float(y.shape[0])
    o = wp.vec3(0.0, 0.5, 4.0)
    d = wp.normalize(wp.vec3(u, v, -2.0))
    t = float(0.0)
    for _ in range(steps):
        s = world(o + d * t, balls)
        if s < 0.001 or t > 10.0:
            break
        t += s
    shade = float(0.0)
    if t < 10.0:
        p = o + d * t
        e = 0.001
        c = world(p, balls)
        n = wp.vec3(
            world(p + wp.vec3(e, 0.0, 0.0), balls) - c,
            world(p + wp.vec3(0.0, e, 0.0), balls) - c,
            world(p + wp.vec3(0.0, 0.0, e), balls) - c,
        )
        shade = wp.max(wp.dot(wp.normalize(n), wp.vec3(0.5, 0.7, 0.5)), 0.0)
    y[i, j] = shade


@case
def march(data):
    """Rays through a distance field of balls that melt together, shaded by its slope."""
    n = data.size(96, 1024)
    balls = data.real((6, 4), wp.vec4, -0.6, 0.6, grad=False)
    return Case(
        march_kernel, (n, n), [balls, 64], [data.out((n, n), grad=False)], n * n, smooth=False
    )
