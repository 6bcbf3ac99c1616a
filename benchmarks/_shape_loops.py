"""Kernels of shapes.py that diverge, gather and add: while loops, rows, neighbours, atomics."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable, forward_only


@differentiable
def kepler_kernel(
    anomaly: wp.array(dtype=float), eccentricity: wp.array(dtype=float), y: wp.array(dtype=float)
):
    i = wp.tid()
    m = anomaly[i]
    e = eccentricity[i]
    x = m
    step = float(1.0)
    k = int(0)
    while wp.abs(step) > 1.0e-5 and k < 50:
        step = (x - e * wp.sin(x) - m) / (1.0 - e * wp.cos(x))
        x -= step
        k += 1
    y[i] = x


@case
def kepler(data):
    """Newton's iteration until it has converged."""
    n = data.size(1 << 15, 1 << 21)
    m, e = data.real(n, high=6.28), data.real(n, high=0.9)
    return Case(kepler_kernel, n, [m, e], [data.out(n)], n)


@forward_only
def collatz_kernel(limit: int, y: wp.array(dtype=int)):
    i = wp.tid()
    n = wp.int64(i + 1)
    steps = int(0)
    while n != wp.int64(1) and steps < limit:
        if n % wp.int64(2) == wp.int64(0):
            n = n / wp.int64(2)
        else:
            n = wp.int64(3) * n + wp.int64(1)
        steps += 1
    y[i] = steps


@case
def collatz(data):
    """An integer iteration of very different lengths."""
    n = data.size(1 << 13, 1 << 20)
    return Case(collatz_kernel, n, [1000], [data.out(n, int, False)], n)


@forward_only
def search_kernel(rows: wp.array2d(dtype=int), width: int, y: wp.array(dtype=int)):
    i = wp.tid()
    found = int(-1)
    for k in range(width):
        v = rows[i, k]
        if v % 3 == 0:
            continue
        if v > 980:
            found = k
            break
    y[i] = found


@case
def search(data):
    """break and continue in a loop over a row."""
    n, width = data.size(1 << 14, 1 << 19), 64
    rows = data.integers((n, width), 0, 1000)
    return Case(search_kernel, n, [rows, width], [data.out(n, int, False)], n)


@forward_only
def bisect_kernel(
    table: wp.array(dtype=float), count: int, x: wp.array(dtype=float), y: wp.array(dtype=int)
):
    i = wp.tid()
    low = int(0)
    high = count
    while low < high:
        middle = (low + high) / 2
        if table[middle] < x[i]:
            low = middle + 1
        else:
            high = middle
    y[i] = low


@case
def bisect(data):
    """A binary search in a table."""
    n, count = data.size(1 << 15, 1 << 22), 4096
    table = data.given(np.sort(data.random.random(count)).astype(np.float32), float)
    x = data.real(n, grad=False)
    return Case(bisect_kernel, n, [table, count, x], [data.out(n, int, False)], n)


@wp.func
def distance(p: wp.vec3, radius: float):
    ball = wp.length(p) - radius
    box = wp.max(wp.max(wp.abs(p[0]), wp.abs(p[1])), wp.abs(p[2])) - 0.8 * radius
    return wp.max(ball, box)


@differentiable
def sphere_trace_kernel(
    radius: wp.array(dtype=float), w: int, h: int, depth: wp.array2d(dtype=float)
):
    i, j = wp.tid()
    origin = wp.vec3(0.0, 0.0, -3.0)
    d = wp.normalize(wp.vec3(float(j) / float(w) - 0.5, float(i) / float(h) - 0.5, 1.0))
    t = float(0.0)
    for _k in range(64):
        s = distance(origin + d * t, radius[0])
        if s < 1.0e-3 or t > 8.0:
            break
        t += s
    depth[i, j] = t


@case
def sphere_trace(data):
    """Rays that march to a surface, and leave when they are there."""
    n = data.size(96, 1 << 10)
    radius, depth = data.given(np.ones(1, np.float32), float, True), data.out((n, n))
    return Case(sphere_trace_kernel, (n, n), [radius, n, n], [depth], n * n, "ray", smooth=False)


@differentiable
def neighbors_kernel(
    x: wp.array(dtype=wp.vec2), start: wp.array2d(dtype=int), count: wp.array2d(dtype=int),
    cells: int, h: float, density: wp.array(dtype=float),
):  # fmt: skip
    i = wp.tid()
    p = x[i]
    cx = wp.clamp(int(p[0]), 0, cells - 1)
    cy = wp.clamp(int(p[1]), 0, cells - 1)
    s = float(0.0)
    for dy in range(-1, 2):
        for dx in range(-1, 2):
            a = cy + dy
            b = cx + dx
            if a >= 0 and a < cells and b >= 0 and b < cells:
                first = start[a, b]
                for k in range(first, first + count[a, b]):
                    r = p - x[k]
                    q = h * h - wp.dot(r, r)
                    if q > 0.0:
                        s += q * q * q
    density[i] = s


@case
def neighbors(data):
    """Nested loops over the particles of nine cells."""
    cells = data.size(40, 512)
    n = 4 * cells * cells
    points = data.random.uniform(0, cells, (n, 2)).astype(np.float32)
    cell = points[:, 1].astype(int) * cells + points[:, 0].astype(int)
    order = np.argsort(cell, kind="stable")
    count = np.bincount(cell, minlength=cells * cells)
    start = np.cumsum(count) - count
    grids = [data.given(one.reshape(cells, cells), int) for one in (start, count)]
    x = data.given(points[order], wp.vec2, True)
    return Case(neighbors_kernel, n, [x, *grids, cells, 1.0], [data.out(n)], n)


@differentiable
def laplacian_kernel(
    x: wp.array(dtype=wp.vec3), near: wp.array2d(dtype=int), y: wp.array(dtype=wp.vec3)
):
    i = wp.tid()
    s = wp.vec3(0.0, 0.0, 0.0)
    for k in range(6):
        s += x[near[i, k]] - x[i]
    y[i] = x[i] + s * 0.1


@case
def laplacian(data):
    """A sum over six neighbours from a list."""
    n = data.size(1 << 15, 1 << 21)
    near = (np.arange(n)[:, None] + data.random.integers(-40, 40, (n, 6))) % n
    x = data.real((n, 3), wp.vec3)
    return Case(laplacian_kernel, n, [x, data.given(near, int)], [data.out(n, wp.vec3)], n)


@differentiable
def csr_kernel(
    first: wp.array(dtype=int), column: wp.array(dtype=int), value: wp.array(dtype=float),
    x: wp.array(dtype=float), y: wp.array(dtype=float),
):  # fmt: skip
    i = wp.tid()
    s = float(0.0)
    for k in range(first[i], first[i + 1]):
        s += value[k] * x[column[k]]
    y[i] = s


@case
def csr(data):
    """A sparse matrix times a vector: rows of 0 to 31 numbers."""
    n = data.size(1 << 14, 1 << 20)
    first = np.concatenate([[0], np.cumsum(data.random.integers(0, 32, n))])
    total = int(first[-1])
    arrays = [data.given(first, int), data.integers(total, 0, n), data.real(total), data.real(n)]
    return Case(csr_kernel, n, arrays, [data.out(n)], total, "number")


@differentiable
def dense_kernel(
    a: wp.array2d(dtype=float), b: wp.array2d(dtype=float), m: int, c: wp.array2d(dtype=float)
):
    i, j = wp.tid()
    s = float(0.0)
    for k in range(m):
        s += a[i, k] * b[k, j]
    c[i, j] = s


@case
def matrix_product(data):
    """One dot product of a row and a column per thread."""
    n = data.size(128, 1 << 10)
    a, b = data.real((n, n)), data.real((n, n))
    return Case(dense_kernel, (n, n), [a, b, n], [data.out((n, n))], n**3, "product")


@differentiable
def rows_kernel(a: wp.array2d(dtype=float), b: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    s = float(0.0)
    for k in range(a.shape[1]):
        s += a[i, k] * b[k]
    y[i] = s


@case
def row_dots(data):
    """One dot product of a row and a vector per thread."""
    n, m = data.size(1 << 11, 1 << 16), 256
    return Case(rows_kernel, n, [data.real((n, m)), data.real(m)], [data.out(n)], n * m, "product")


@differentiable
def row_scan_kernel(a: wp.array2d(dtype=float), m: int, y: wp.array2d(dtype=float)):
    i = wp.tid()
    s = float(0.0)
    for k in range(m):
        s = 0.9 * s + a[i, k]
        y[i, k] = s


@case
def row_scan(data):
    """A recurrence along each row."""
    n, m = data.size(1 << 11, 1 << 16), 128
    return Case(row_scan_kernel, n, [data.real((n, m)), m], [data.out((n, m))], n * m, "number")


@differentiable
def stencil_kernel(u: wp.array2d(dtype=float), h: int, w: int, y: wp.array2d(dtype=float)):
    i, j = wp.tid()
    c = u[i, j]
    s = float(0.0)
    if i > 0:
        s += u[i - 1, j] - c
    if i < h - 1:
        s += u[i + 1, j] - c
    if j > 0:
        s += u[i, j - 1] - c
    if j < w - 1:
        s += u[i, j + 1] - c
    y[i, j] = c + 0.2 * s


@case
def stencil(data):
    """Four neighbours where there are such."""
    n = data.size(512, 1 << 12)
    u = data.real((n, n))
    return Case(stencil_kernel, (n, n), [u, n, n], [data.out((n, n))], n * n, "cell")


@differentiable
def blur_kernel(
    image: wp.array2d(dtype=float), weight: wp.array(dtype=float), h: int, w: int,
    y: wp.array2d(dtype=float),
):  # fmt: skip
    i, j = wp.tid()
    s = float(0.0)
    for a in range(-2, 3):
        for b in range(-2, 3):
            v = image[wp.clamp(i + a, 0, h - 1), wp.clamp(j + b, 0, w - 1)]
            s += v * weight[(a + 2) * 5 + b + 2]
    y[i, j] = s


@case
def blur(data):
    """An image filter whose indices are clamped."""
    n = data.size(160, 1 << 11)
    arrays = [data.real((n, n)), data.real(25), n, n]
    return Case(blur_kernel, (n, n), arrays, [data.out((n, n))], n * n, "pixel")


@forward_only
def life_kernel(a: wp.array2d(dtype=wp.uint8), h: int, w: int, y: wp.array2d(dtype=wp.uint8)):
    i, j = wp.tid()
    s = int(0)
    for p in range(-1, 2):
        for q in range(-1, 2):
            s += int(a[(i + p + h) % h, (j + q + w) % w])
    alive = int(a[i, j])
    s -= alive
    if s == 3 or (s == 2 and alive == 1):
        y[i, j] = wp.uint8(1)
    else:
        y[i, j] = wp.uint8(0)


@case
def life(data):
    """Bytes of a periodic grid."""
    n = data.size(256, 1 << 12)
    a = data.integers((n, n), 0, 2, wp.uint8)
    return Case(life_kernel, (n, n), [a, n, n], [data.out((n, n), wp.uint8, False)], n * n, "cell")
