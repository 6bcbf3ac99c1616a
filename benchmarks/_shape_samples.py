"""Kernels of shapes.py with random numbers, sums over all threads and walks through lists."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable, forward_only


@wp.struct
class Ball:
    x: wp.vec3
    v: wp.vec3
    radius: float
    hits: int


@forward_only
def circle_kernel(seed: int, samples: int, count: wp.array(dtype=int)):
    i = wp.tid()
    state = wp.rand_init(seed, i)
    inside = int(0)
    for _ in range(samples):
        x = wp.randf(state)
        y = wp.randf(state)
        if x * x + y * y < 1.0:
            inside += 1
    wp.atomic_add(count, 0, inside)


@case
def circle(data):
    """Points inside of a circle, counted."""
    n = data.size(1 << 14, 1 << 20)
    return Case(circle_kernel, n, [5, 64], [data.out(1, int, False)], 64 * n, "sample")


@differentiable
def option_kernel(
    spot: wp.array(dtype=float), seed: int, steps: int, vol: float, y: wp.array(dtype=float)
):
    i = wp.tid()
    state = wp.rand_init(seed, i)
    s = spot[i]
    total = float(0.0)
    for _ in range(steps):
        s = s * wp.exp(vol * wp.randn(state) - 0.5 * vol * vol)
        total += s
    y[i] = wp.max(total / float(steps) - 1.0, 0.0)


@case
def option(data):
    """Paths of a price with normal steps."""
    n = data.size(1 << 14, 1 << 20)
    arrays = [data.real(n, low=0.9, high=1.1), 3, 16, 0.1]
    return Case(option_kernel, n, arrays, [data.out(n)], 16 * n, "step", smooth=False)


@forward_only
def walk_kernel(seed: int, radius: float, y: wp.array(dtype=int)):
    i = wp.tid()
    state = wp.rand_init(seed, i)
    p = wp.vec2()
    steps = int(0)
    while wp.length_sq(p) < radius * radius:
        p += wp.sample_unit_ring(state)
        steps += 1
        if steps == 400:
            break
    y[i] = steps


@case
def walk(data):
    """Random walks until they leave a disc."""
    n = data.size(1 << 13, 1 << 19)
    return Case(walk_kernel, n, [9, 6.0], [data.out(n, int, False)], n, "walk")


@differentiable
def skin_kernel(
    x: wp.array(dtype=wp.vec3), bones: wp.array(dtype=wp.mat44), of: wp.array(dtype=wp.vec4i),
    weight: wp.array(dtype=wp.vec4), y: wp.array(dtype=wp.vec3),
):  # fmt: skip
    i = wp.tid()
    b = of[i]
    w = weight[i]
    m = bones[b[0]] * w[0] + bones[b[1]] * w[1] + bones[b[2]] * w[2] + bones[b[3]] * w[3]
    y[i] = wp.transform_point(m, x[i])


@case
def skin(data):
    """Points that follow four bones each."""
    n = data.size(1 << 15, 1 << 21)
    arrays = [data.real((n, 3), wp.vec3), data.real((64, 4, 4), wp.mat44)]
    arrays += [data.integers((n, 4), 0, 64, wp.vec4i), data.real((n, 4), wp.vec4)]
    return Case(skin_kernel, n, arrays, [data.out(n, wp.vec3)], n)


@forward_only
def bounce_kernel(balls: wp.array(dtype=Ball), dt: float, out: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    b = balls[i]
    v = b.v + wp.vec3(0.0, -9.8, 0.0) * dt
    x = b.x + v * dt
    hits = b.hits
    for axis in range(3):
        if x[axis] < b.radius:
            x[axis] = 2.0 * b.radius - x[axis]
            v[axis] = -0.8 * v[axis]
            hits += 1
        elif x[axis] > 1.0 - b.radius:
            x[axis] = 2.0 * (1.0 - b.radius) - x[axis]
            v[axis] = -0.8 * v[axis]
            hits += 1
    out[i] = x + v * 0.001 + wp.vec3(float(hits))


@case
def bounce(data):
    """Balls in a box, as structs."""
    n = data.size(1 << 15, 1 << 21)
    balls = np.zeros(n, Ball.numpy_dtype())
    balls["x"] = data.random.random((n, 3))
    balls["v"] = data.random.normal(size=(n, 3))
    balls["radius"] = 0.1
    return Case(bounce_kernel, n, [data.given(balls, Ball), 0.01], [data.out(n, wp.vec3, False)], n)


@differentiable
def pairs_kernel(
    x: wp.array(dtype=wp.vec3d), near: wp.array2d(dtype=int), count: wp.array(dtype=int),
    f: wp.array(dtype=wp.vec3d), energy: wp.array(dtype=wp.float64),
):  # fmt: skip
    i = wp.tid()
    p = x[i]
    total = wp.vec3d()
    e = wp.float64(0.0)
    for k in range(count[i]):
        d = p - x[near[i, k]]
        r2 = wp.dot(d, d) + wp.float64(0.05)
        s = wp.float64(0.01) / r2
        s6 = s * s * s
        e += s6 * s6 - s6
        total += d * ((wp.float64(12.0) * s6 * s6 - wp.float64(6.0) * s6) / r2)
    f[i] = total
    wp.atomic_add(energy, 0, e)


@case
def lennard_jones(data):
    """Forces and energy over lists of neighbours in 64 bits."""
    n, m = data.size(1 << 13, 1 << 18), 48
    base = np.arange(n)[:, None] + data.random.integers(-200, 200, (n, m))
    arrays = [data.real((n, 3), wp.vec3d), data.given((base % n).astype(np.int32), int)]
    arrays.append(data.integers(n, 8, m))
    outputs = [data.out(n, wp.vec3d), data.out(1, wp.float64)]
    return Case(pairs_kernel, n, arrays, outputs, n * m // 2, "pair")


@forward_only
def nearest_kernel(of: wp.array(dtype=int), depth: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    wp.atomic_min(y, of[i], -depth[i])


@case
def nearest(data):
    """The least of the values of each cell."""
    n = data.size(1 << 17, 1 << 22)
    arrays = [data.integers(n, 0, n // 16), data.real(n, grad=False)]
    return Case(nearest_kernel, n, arrays, [data.out(n // 16, grad=False)], n)


@forward_only
def bounds_kernel(
    x: wp.array(dtype=wp.vec3), low: wp.array(dtype=wp.vec3), high: wp.array(dtype=wp.vec3)
):
    i = wp.tid()
    wp.atomic_min(low, 0, x[i])
    wp.atomic_max(high, 0, x[i])


@case
def bounds(data):
    """The box around all points."""
    n = data.size(1 << 18, 1 << 23)
    x = data.real((n, 3), wp.vec3, -1.0, grad=False)
    outputs = [data.out(1, wp.vec3, False), data.out(1, wp.vec3, False)]
    return Case(bounds_kernel, n, [x], outputs, n)


@differentiable
def centroid_kernel(
    x: wp.array(dtype=wp.vec3), m: wp.array(dtype=float), total: wp.array(dtype=float),
    moment: wp.array(dtype=wp.vec3), second: wp.array(dtype=wp.mat33),
):  # fmt: skip
    i = wp.tid()
    p = x[i]
    wp.atomic_add(total, 0, m[i])
    wp.atomic_add(moment, 0, p * m[i])
    wp.atomic_add(second, 0, wp.outer(p, p) * m[i])


@case
def centroid(data):
    """Mass, moment and second moments of all points."""
    n = data.size(1 << 16, 1 << 22)
    outputs = [data.out(1), data.out(1, wp.vec3), data.out(1, wp.mat33)]
    return Case(centroid_kernel, n, [data.real((n, 3), wp.vec3), data.real(n)], outputs, n)


@differentiable
def normals_kernel(
    x: wp.array(dtype=wp.vec3), corners: wp.array(dtype=int), y: wp.array(dtype=wp.vec3)
):
    t = wp.tid()
    a = corners[3 * t]
    b = corners[3 * t + 1]
    c = corners[3 * t + 2]
    n = wp.cross(x[b] - x[a], x[c] - x[a])
    wp.atomic_add(y, a, n)
    wp.atomic_add(y, b, n)
    wp.atomic_add(y, c, n)


@case
def normals(data):
    """Normals of triangles added to their corners."""
    n = data.size(192, 1024)
    nodes = np.arange(n * n).reshape(n, n)
    a, b, c, d = nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]
    corners = np.stack([a, b, c, a, c, d], -1).reshape(-1).astype(np.int32)
    arrays = [data.real((n * n, 3), wp.vec3), data.given(corners, int)]
    return Case(
        normals_kernel, len(corners) // 3, arrays, [data.out(n * n, wp.vec3)], len(corners) // 3
    )


@forward_only
def lists_kernel(
    head: wp.array(dtype=int), after: wp.array(dtype=int), value: wp.array(dtype=float),
    y: wp.array(dtype=float),
):  # fmt: skip
    i = wp.tid()
    total = float(0.0)
    at = head[i]
    while at >= 0:
        total += value[at]
        at = after[at]
    y[i] = total


@case
def lists(data):
    """Sums along linked lists of different lengths."""
    n = data.size(1 << 14, 1 << 19)
    of = data.random.integers(0, n, 8 * n)
    head, after = np.full(n, -1, np.int32), np.full(8 * n, -1, np.int32)
    for k, cell in enumerate(of):
        after[k], head[cell] = head[cell], k
    arrays = [data.given(head, int), data.given(after, int), data.real(8 * n, grad=False)]
    return Case(lists_kernel, n, arrays, [data.out(n, grad=False)], 8 * n, "link")
