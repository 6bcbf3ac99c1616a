"""Kernels of shapes.py that keep an index inside of the array, or an array inside of a thread."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable, forward_only


@wp.func
def inside(f: wp.array2d(dtype=float), i: int, j: int):
    return f[wp.clamp(i, 0, f.shape[0] - 1), wp.clamp(j, 0, f.shape[1] - 1)]


@differentiable
def jacobi_kernel(
    p: wp.array2d(dtype=float), div: wp.array2d(dtype=float), q: wp.array2d(dtype=float)
):
    i, j = wp.tid()
    around = inside(p, i - 1, j) + inside(p, i + 1, j) + inside(p, i, j - 1) + inside(p, i, j + 1)
    q[i, j] = (around - div[i, j]) * 0.25


@case
def jacobi(data):
    """A step towards the pressure of a fluid, with a border that nothing passes."""
    n = data.size(512, 4096)
    arrays = [data.real((n, n)), data.real((n, n))]
    return Case(jacobi_kernel, (n, n), arrays, [data.out((n, n))], n * n, "cell")


@differentiable
def convolution_kernel(
    x: wp.array2d(dtype=float), w: wp.array2d(dtype=float), y: wp.array2d(dtype=float)
):
    i, j = wp.tid()
    s = float(0.0)
    for a in range(5):
        for b in range(5):
            s += w[a, b] * inside(x, i + a - 2, j + b - 2)
    y[i, j] = s


@case
def convolution(data):
    """With 5 x 5 weights; the border is repeated."""
    n = data.size(256, 2048)
    arrays = [data.real((n, n)), data.real((5, 5))]
    return Case(convolution_kernel, (n, n), arrays, [data.out((n, n))], n * n, "pixel")


@differentiable
def smoothing_kernel(x: wp.array(dtype=float), k: float, y: wp.array(dtype=float)):
    i = wp.tid()
    last = x.shape[0] - 1
    d = x[wp.max(i - 1, 0)] - 2.0 * x[i] + x[wp.min(i + 1, last)]
    y[i] = x[i] + k * d


@case
def smoothing(data):
    """A step of diffusion along a line whose ends are repeated."""
    n = data.size(1 << 17, 1 << 24)
    return Case(smoothing_kernel, n, [data.real(n), 0.3], [data.out(n)], n)


@forward_only
def fire_kernel(a: wp.array2d(dtype=wp.uint8), seed: int, b: wp.array2d(dtype=wp.uint8)):
    i, j = wp.tid()
    n, m = a.shape[0], a.shape[1]
    state = wp.rand_init(seed, i * m + j)
    was = int(a[i, j])
    now = int(0)
    if was == 1:
        now = 1
        near = int(0)
        for di in range(-1, 2):
            for dj in range(-1, 2):
                if int(a[(i + di + n) % n, (j + dj + m) % m]) == 2:
                    near += 1
        if near > 0 or wp.randf(state) < 1.0e-3:
            now = 2
    elif was == 0 and wp.randf(state) < 0.05:
        now = 1
    b[i, j] = wp.uint8(now)


@case
def fire(data):
    """A forest that burns on a torus, bytes per cell."""
    n = data.size(256, 4096)
    trees = data.integers((n, n), 0, 3, wp.uint8)
    return Case(fire_kernel, (n, n), [trees, 9], [data.out((n, n), wp.uint8, False)], n * n, "cell")


@differentiable
def pendulum_kernel(
    start: wp.array(dtype=float), length: wp.array(dtype=float), dt: float, steps: int,
    path: wp.array2d(dtype=float),
):  # fmt: skip
    i = wp.tid()
    angle = start[i]
    speed = float(0.0)
    for k in range(steps):
        speed = speed - 9.81 / length[i] * wp.sin(angle) * dt
        angle = angle + speed * dt
        path[i, k] = angle


@case
def pendulum(data):
    """Paths of pendulums, of which all steps are stored."""
    n, steps = data.size(1 << 10, 1 << 16), 64
    arrays = [data.real(n), data.real(n, low=0.5, high=2.0), 0.01, steps]
    return Case(pendulum_kernel, n, arrays, [data.out((n, steps))], n * steps, "step")


@differentiable
def pivots_kernel(
    a: wp.array(dtype=wp.mat44), b: wp.array(dtype=wp.vec4), x: wp.array(dtype=wp.vec4)
):
    t = wp.tid()
    m = a[t]
    r = b[t]
    for k in range(4):
        p = k
        for i in range(k + 1, 4):
            if wp.abs(m[i, k]) > wp.abs(m[p, k]):
                p = i
        if p != k:
            for j in range(4):
                held = m[k, j]
                m[k, j] = m[p, j]
                m[p, j] = held
            last = r[k]
            r[k] = r[p]
            r[p] = last
        for i in range(k + 1, 4):
            f = m[i, k] / m[k, k]
            for j in range(k, 4):
                m[i, j] = m[i, j] - f * m[k, j]
            r[i] = r[i] - f * r[k]
    y = wp.vec4()
    for n in range(4):
        i = 3 - n
        s = r[i]
        for j in range(i + 1, 4):
            s = s - m[i, j] * y[j]
        y[i] = s / m[i, i]
    x[t] = y


@case
def pivots(data):
    """Four equations by elimination, with a pivot that is searched for."""
    n = data.size(1 << 12, 1 << 18)
    rows = np.eye(4)[data.random.permutation(4)]
    a = (data.random.uniform(-0.4, 0.4, (n, 4, 4)) + 2.0 * rows).astype(np.float32)
    arrays = [data.given(a, wp.mat44, True), data.real((n, 4), wp.vec4)]
    return Case(pivots_kernel, n, arrays, [data.out(n, wp.vec4)], n, "system")
