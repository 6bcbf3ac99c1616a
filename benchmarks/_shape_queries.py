"""Kernels of shapes.py that ask meshes, hierarchies, grids of points and volumes in loops."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable, forward_only


def ball(data, n):
    """A mesh of a ball with a bumpy surface."""
    u, v = np.meshgrid(np.linspace(0, np.pi, n), np.linspace(0, 2 * np.pi, 2 * n), indexing="ij")
    r = 1.0 + 0.1 * np.sin(5 * u) * np.cos(4 * v)
    p = np.stack([r * np.sin(u) * np.cos(v), r * np.sin(u) * np.sin(v), r * np.cos(u)], -1)
    at = np.arange(2 * n * n).reshape(n, 2 * n)
    a, b, c, d = at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]
    faces = np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1), np.stack([a, c, d], -1).reshape(-1)]
    )
    points = data.given(p.reshape(-1, 3).astype(np.float32), wp.vec3)
    return wp.Mesh(points, data.given(faces.astype(np.int32), int))


@forward_only
def bounces_kernel(
    mesh: wp.uint64,
    o: wp.array(dtype=wp.vec3),
    d: wp.array(dtype=wp.vec3),
    out: wp.array(dtype=float),
):
    i = wp.tid()
    p = o[i]
    way = wp.normalize(d[i])
    length = float(0.0)
    for _k in range(6):
        hit = wp.mesh_query_ray(mesh, p, way, 10.0)
        if not hit.result:
            break
        length += hit.t
        p = p + way * (hit.t * 0.999)
        n = hit.normal
        if wp.dot(n, way) > 0.0:
            n = -n
        way = wp.normalize(way - n * (2.0 * wp.dot(n, way)))
    out[i] = length


@case
def bounces(data):
    """Rays reflected six times inside of a mesh."""
    n = data.size(1 << 12, 1 << 19)
    mesh = ball(data, data.size(32, 200))
    arrays = [
        mesh.id,
        data.real((n, 3), wp.vec3, -0.3, 0.3, False),
        data.real((n, 3), wp.vec3, -1.0, grad=False),
    ]
    return Case(bounces_kernel, n, arrays, [data.out(n, grad=False)], n * 6, "ray", keep=mesh)


@differentiable
def push_out_kernel(
    mesh: wp.uint64, x: wp.array(dtype=wp.vec3), v: wp.array(dtype=wp.vec3), dt: float, steps: int,
    out: wp.array(dtype=wp.vec3),
):  # fmt: skip
    i = wp.tid()
    p = x[i]
    w = v[i]
    for _s in range(steps):
        w += wp.vec3(0.0, -9.81, 0.0) * dt
        p += w * dt
        q = wp.mesh_query_point(mesh, p, 0.5)
        if q.result:
            c = wp.mesh_eval_position(mesh, q.face, q.u, q.v)
            d = p - c
            depth = wp.length(d) * q.sign
            if depth < 0.02:
                n = wp.normalize(d) * q.sign
                p += n * (0.02 - depth)
                w -= n * wp.min(wp.dot(n, w), 0.0)
    out[i] = p


@case
def push_out(data):
    """Points fall on a mesh, which pushes them out."""
    n = data.size(1 << 9, 1 << 16)
    mesh = ball(data, data.size(24, 100))
    x = data.random.standard_normal((n, 3))
    x *= 1.2 / np.linalg.norm(x, axis=1, keepdims=True)
    arrays = [
        mesh.id,
        data.given(x.astype(np.float32), wp.vec3, True),
        data.real((n, 3), wp.vec3),
        0.02,
        8,
    ]
    one = Case(push_out_kernel, n, arrays, [data.out(n, wp.vec3)], n * 8, "step", smooth=False)
    one.keep = mesh
    return one


@forward_only
def overlaps_kernel(
    bvh: wp.uint64,
    lower: wp.array(dtype=wp.vec3),
    upper: wp.array(dtype=wp.vec3),
    count: wp.array(dtype=int),
    pairs: wp.array(dtype=int),
):
    i = wp.tid()
    q = wp.bvh_query_aabb(bvh, lower[i], upper[i])
    j = int(0)
    found = int(0)
    while wp.bvh_query_next(q, j):
        if j > i:
            found += 1
    count[i] = found
    wp.atomic_add(pairs, 0, found)


@case
def overlaps(data):
    """Pairs of boxes that overlap, by a hierarchy."""
    n = data.size(1 << 13, 1 << 19)
    lower = data.random.random((n, 3)).astype(np.float32)
    upper = lower + data.random.uniform(0.0, 1.5 * n ** (-1 / 3), (n, 3)).astype(np.float32)
    boxes = [data.given(a, wp.vec3) for a in (lower, upper)]
    bvh = wp.Bvh(*boxes)
    outs = [data.out(n, int, False), data.out(1, int, False)]
    return Case(overlaps_kernel, n, [bvh.id, *boxes], outs, n, "box", keep=bvh)


@differentiable
def smoothed_kernel(
    grid: wp.uint64, x: wp.array(dtype=wp.vec3), u: wp.array(dtype=float), h: float,
    out: wp.array(dtype=float),
):  # fmt: skip
    i = wp.tid()
    p = x[i]
    total = float(0.0)
    weight = float(0.0)
    for j in wp.hash_grid_query(grid, p, h):
        d = wp.length_sq(p - x[j])
        if d < h * h:
            w = 1.0 - d / (h * h)
            w = w * w * w
            total += w * u[j]
            weight += w
    out[i] = total / weight


@case
def smoothed(data):
    """Means of neighbours, smooth in the places."""
    n = data.size(1 << 12, 1 << 18)
    x = data.real((n, 3), wp.vec3)
    h = float((8.0 / n) ** (1.0 / 3.0))
    grid = wp.HashGrid(64, 64, 64, device=data.device)
    grid.build(x, h)
    return Case(
        smoothed_kernel, n, [grid.id, x, data.real(n), h], [data.out(n)], n, "point", keep=grid
    )


@forward_only
def nearest_few_kernel(
    grid: wp.uint64, x: wp.array(dtype=wp.vec3), h: float, out: wp.array2d(dtype=int)
):
    i = wp.tid()
    p = x[i]
    far = wp.vec4(h * h, h * h, h * h, h * h)
    who = wp.vec4i(-1, -1, -1, -1)
    q = wp.hash_grid_query(grid, p, h)
    j = int(0)
    while wp.hash_grid_query_next(q, j):
        d = wp.length_sq(p - x[j])
        if j != i and d < far[3]:
            k = int(3)
            while k > 0 and far[k - 1] > d:
                far[k] = far[k - 1]
                who[k] = who[k - 1]
                k -= 1
            far[k] = d
            who[k] = j
    for k in range(4):
        out[i, k] = who[k]


@case
def nearest_few(data):
    """The four nearest points, kept in order."""
    n = data.size(1 << 12, 1 << 18)
    x = data.real((n, 3), wp.vec3, grad=False)
    h = float((8.0 / n) ** (1.0 / 3.0))
    grid = wp.HashGrid(64, 64, 64, device=data.device)
    grid.build(x, h)
    return Case(
        nearest_few_kernel,
        n,
        [grid.id, x, h],
        [data.out((n, 4), int, False)],
        n,
        "point",
        keep=grid,
    )


def fog(data, n):
    """A volume of numbers n cubed, whose zeros lie on a sphere."""
    c = (np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), -1) + 0.5) * (2.0 / n) - 1.0
    values = (np.linalg.norm(c, axis=-1) - 0.7).astype(np.float32)
    if "cuda" not in data.device:
        return wp.Volume.load_from_numpy(
            values, (-1.0, -1.0, -1.0), 2.0 / n, 1.0, device=data.device
        )
    return wp.Volume.load_from_numpy(values, (-1.0, -1.0, -1.0), 2.0 / n, 1.0, device=data.device)


@forward_only
def absorb_kernel(volume: wp.uint64, width: int, steps: int, out: wp.array(dtype=float)):
    t = wp.tid()
    o = wp.vec3(-1.5, float(t % width) / float(width) - 0.5, float(t // width) / float(width) - 0.5)
    d = wp.normalize(wp.vec3(1.0, 0.1, -0.1))
    seen = float(1.0)
    for s in range(steps):
        p = wp.volume_world_to_index(volume, o + d * (3.0 * (float(s) + 0.5) / float(steps)))
        f = wp.volume_sample_f(volume, p, wp.Volume.LINEAR)
        if f < 0.0:
            seen *= wp.exp(f * 0.5)
            if seen < 0.01:
                break
    out[t] = seen


@case
def absorb(data):
    """Light through a volume, sampled along rays."""
    n = data.size(48, 512)
    volume = fog(data, data.size(32, 128))
    one = Case(
        absorb_kernel,
        n * n,
        [volume.id, n, 64],
        [data.out(n * n, grad=False)],
        n * n * 64,
        "sample",
    )
    one.keep = volume
    return one


@forward_only
def sphere_volume_kernel(
    volume: wp.uint64, p: wp.array(dtype=wp.vec3), steps: int, out: wp.array(dtype=wp.vec3)
):
    i = wp.tid()
    q = p[i]
    for _s in range(steps):
        g = wp.vec3()
        f = wp.volume_sample_grad_f(
            volume, wp.volume_world_to_index(volume, q), wp.Volume.LINEAR, g
        )
        n = wp.normalize(wp.volume_index_to_world_dir(volume, g))
        q -= n * f
    out[i] = q


@case
def on_level(data):
    """Points walk to the zero of a volume by its slope."""
    n = data.size(1 << 12, 1 << 19)
    volume = fog(data, data.size(32, 128))
    arrays = [volume.id, data.real((n, 3), wp.vec3, 0.2, 0.6, False), 4]
    return Case(
        sphere_volume_kernel, n, arrays, [data.out(n, wp.vec3, False)], n * 4, "sample", keep=volume
    )
