"""Kernels of shapes.py that add to elements which other threads add to."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable, forward_only


@forward_only
def histogram_kernel(x: wp.array(dtype=float), bins: int, y: wp.array(dtype=int)):
    i = wp.tid()
    wp.atomic_add(y, wp.min(int(x[i] * float(bins)), bins - 1), 1)


@case
def histogram(data):
    """Counts of 256 bins."""
    n = data.size(1 << 18, 1 << 24)
    return Case(
        histogram_kernel, n, [data.real(n, grad=False), 256], [data.out(256, int, False)], n
    )


@differentiable
def to_grid_kernel(
    x: wp.array(dtype=wp.vec2), v: wp.array(dtype=wp.vec2), mass: wp.array(dtype=float),
    cells: int, grid_mass: wp.array2d(dtype=float), grid_v: wp.array2d(dtype=wp.vec2),
):  # fmt: skip
    i = wp.tid()
    p = x[i]
    bx = wp.clamp(int(p[0] - 0.5), 0, cells - 3)
    by = wp.clamp(int(p[1] - 0.5), 0, cells - 3)
    fx = p[0] - float(bx)
    fy = p[1] - float(by)
    wx = wp.vec3(
        0.5 * (1.5 - fx) * (1.5 - fx), 0.75 - (fx - 1.0) * (fx - 1.0), 0.5 * (fx - 0.5) * (fx - 0.5)
    )
    wy = wp.vec3(
        0.5 * (1.5 - fy) * (1.5 - fy), 0.75 - (fy - 1.0) * (fy - 1.0), 0.5 * (fy - 0.5) * (fy - 0.5)
    )
    for a in range(3):
        for b in range(3):
            m = wx[a] * wy[b] * mass[i]
            wp.atomic_add(grid_mass, by + b, bx + a, m)
            wp.atomic_add(grid_v, by + b, bx + a, v[i] * m)


@case
def to_grid(data):
    """Particles to a grid: nine nodes each, as in the material point method."""
    cells = data.size(64, 1024)
    n = 4 * cells * cells
    x = data.real((n, 2), wp.vec2, 1.0, cells - 2.0)
    arrays = [x, data.real((n, 2), wp.vec2, -1.0), data.real(n), cells]
    outputs = [data.out((cells, cells)), data.out((cells, cells), wp.vec2)]
    return Case(to_grid_kernel, n, arrays, outputs, n)


@differentiable
def tetrahedra_kernel(
    x: wp.array(dtype=wp.vec3), corner: wp.array2d(dtype=int), rest: wp.array(dtype=wp.mat33),
    mu: float, lam: float, force: wp.array(dtype=wp.vec3),
):  # fmt: skip
    t = wp.tid()
    a = corner[t, 0]
    b = corner[t, 1]
    c = corner[t, 2]
    d = corner[t, 3]
    e = wp.matrix_from_cols(x[b] - x[a], x[c] - x[a], x[d] - x[a])
    m = rest[t]
    f = e * m
    j = wp.determinant(f)
    p = f * mu + wp.transpose(wp.inverse(f)) * (lam * wp.log(j) - mu)
    h = p * wp.transpose(m) * (-wp.determinant(e) / 6.0)
    fb = wp.vec3(h[0, 0], h[1, 0], h[2, 0])
    fc = wp.vec3(h[0, 1], h[1, 1], h[2, 1])
    fd = wp.vec3(h[0, 2], h[1, 2], h[2, 2])
    wp.atomic_add(force, b, fb)
    wp.atomic_add(force, c, fc)
    wp.atomic_add(force, d, fd)
    wp.atomic_sub(force, a, fb + fc + fd)


@case
def tetrahedra(data):
    """Elastic forces of tetrahedra: four gathers, four vector sums."""
    n = data.size(24, 96)
    where = np.arange(n**3).reshape(n, n, n)
    ends = [where[:-1, :-1, :-1], where[1:, :-1, :-1], where[:-1, 1:, :-1], where[:-1, :-1, 1:]]
    corner = np.stack([one.ravel() for one in ends], 1)
    points = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), -1).reshape(-1, 3)
    points = points + 0.1 * data.random.uniform(-1, 1, points.shape)
    count = len(corner)
    rest = data.given(np.tile(np.eye(3, dtype=np.float32), (count, 1, 1)), wp.mat33)
    x = data.given(points.astype(np.float32), wp.vec3, True)
    arrays = [x, data.given(corner, int), rest, 1.0, 10.0]
    return Case(tetrahedra_kernel, count, arrays, [data.out(n**3, wp.vec3)], count)


@differentiable
def loss_kernel(
    x: wp.array(dtype=wp.vec3), goal: wp.array(dtype=wp.vec3), loss: wp.array(dtype=float)
):
    i = wp.tid()
    d = x[i] - goal[i]
    wp.atomic_add(loss, 0, wp.dot(d, d) / (1.0 + wp.length(d)))


@case
def loss(data):
    """One number from all threads."""
    n = data.size(1 << 18, 1 << 24)
    x, goal = (data.real((n, 3), wp.vec3) for _ in range(2))
    return Case(loss_kernel, n, [x, goal], [data.out(1)], n)


@forward_only
def compact_kernel(
    x: wp.array(dtype=float), limit: float, count: wp.array(dtype=int), total: wp.array(dtype=int)
):
    i = wp.tid()
    if x[i] > limit:
        place = wp.atomic_add(count, 0, 1)
        if place % 2 == 0:
            wp.atomic_add(total, 0, 1)


@case
def compact(data):
    """Places from a counter, whose old value is used."""
    n = data.size(1 << 17, 1 << 22)
    inputs = [data.real(n, grad=False), 0.5]
    return Case(compact_kernel, n, inputs, [data.out(1, int, False), data.out(1, int, False)], n)


@differentiable
def extrema_kernel(x: wp.array(dtype=wp.vec3), row: int, y: wp.array(dtype=float)):
    i = wp.tid()
    r = wp.length(x[i])
    wp.atomic_max(y, i / row, r)


@case
def extrema(data):
    """The largest of each 1024 numbers."""
    n = data.size(1 << 17, 1 << 23)
    x = data.real((n, 3), wp.vec3)
    return Case(extrema_kernel, n, [x, 1024], [data.out(n // 1024)], n)
