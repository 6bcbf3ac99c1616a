"""Programs by Numba: parallel loops on the CPU; it has no derivatives."""

import functools

import numba
import numpy as np
from numba import njit, prange
from packages import Run

VERSION = f"numba {numba.__version__}"
parallel = functools.partial(njit, parallel=True)


@parallel
def saxpy(x, y, a, out):
    for i in prange(x.size):
        out[i] = np.float32(a) * x[i] + y[i]


@parallel
def elementary(x, out):
    for i in prange(x.size):
        a = x[i]
        one = np.float32(1)
        out[i] = np.sin(a) * np.exp(-a * a) + np.sqrt(a + np.float32(4)) + np.log(one + a * a)


@parallel
def total(x, out):
    found = np.float32(0)
    for i in prange(x.size):
        found += x[i]
    out[0] = found


@parallel
def nbody(x, softening, out):
    for i in prange(x.shape[0]):
        fx = fy = fz = np.float32(0)
        for j in range(x.shape[0]):
            dx, dy, dz = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]
            r2 = dx * dx + dy * dy + dz * dz + np.float32(softening)
            w = np.float32(1) / (r2 * np.sqrt(r2))
            fx += dx * w
            fy += dy * w
            fz += dz * w
        out[i, 0], out[i, 1], out[i, 2] = fx, fy, fz


@njit
def springs(x, i, j, rest, stiffness, out):
    # There are no atomic updates of arrays, so that this loop is not parallel.
    out[:] = 0
    for t in range(i.size):
        a, b = i[t], j[t]
        dx, dy, dz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        w = np.float32(stiffness) * (length - rest[t]) / length
        out[a, 0] += w * dx
        out[a, 1] += w * dy
        out[a, 2] += w * dz
        out[b, 0] -= w * dx
        out[b, 1] -= w * dy
        out[b, 2] -= w * dz


@parallel
def mandelbrot(cx, cy, most, out):
    for i in prange(cx.shape[0]):
        for j in range(cx.shape[1]):
            x = y = np.float32(0)
            k = 0
            while k < most and x * x + y * y < np.float32(4):
                x, y = x * x - y * y + cx[i, j], np.float32(2) * x * y + cy[i, j]
                k += 1
            out[i, j] = k


@parallel
def matrices(m, b, out):
    for i in prange(m.shape[0]):
        p, q, r = m[i, 0], m[i, 1], m[i, 2]
        for k in range(3):
            u, v = (k + 1) % 3, (k + 2) % 3
            det = (
                p[0] * (q[1] * r[2] - q[2] * r[1])
                + p[1] * (q[2] * r[0] - q[0] * r[2])
                + p[2] * (q[0] * r[1] - q[1] * r[0])
            )
            solved = (
                (q[u] * r[v] - q[v] * r[u]) * b[i, 0]
                + (r[u] * p[v] - r[v] * p[u]) * b[i, 1]
                + (p[u] * q[v] - p[v] * q[u]) * b[i, 2]
            )
            turned = p[k] * b[i, 0] + q[k] * b[i, 1] + r[k] * b[i, 2]
            out[i, k] = solved / det + turned * det


@parallel
def neohooke(f, mu, lam, out):
    for i in prange(f.shape[0]):
        p, q, r = f[i, 0], f[i, 1], f[i, 2]
        det = (
            p[0] * (q[1] * r[2] - q[2] * r[1])
            + p[1] * (q[2] * r[0] - q[0] * r[2])
            + p[2] * (q[0] * r[1] - q[1] * r[0])
        )
        squares = np.float32(0)
        for k in range(3):
            squares += p[k] * p[k] + q[k] * q[k] + r[k] * r[k]
        log = np.log(det)
        m, n = np.float32(mu), np.float32(lam)
        half = np.float32(0.5)
        out[i] = half * m * (squares - np.float32(3)) - m * log + half * n * log * log


@parallel
def stencil(u, rate, out):
    n = u.shape[0]
    for i in prange(n):
        up, down = u[i - 1 if i > 0 else n - 1], u[i + 1 if i < n - 1 else 0]
        for j in range(n):
            left = j - 1 if j > 0 else n - 1
            right = j + 1 if j < n - 1 else 0
            around = up[j] + down[j] + u[i, left] + u[i, right]
            out[i, j] = u[i, j] + np.float32(rate) * (around - np.float32(4) * u[i, j])


def heat(u, steps, rate, out):
    source, target = u, np.empty_like(u)
    other = np.empty_like(u)
    for _ in range(steps):
        stencil(source, rate, target)
        source, target = target, other if source is u else source
    out[:] = source


@njit
def product(a, b, out):
    np.dot(a, b, out)


@parallel
def pendulum(angle, speed, steps, dt, out):
    for i in prange(angle.size):
        a, s = angle[i], speed[i]
        for _ in range(steps):
            s -= np.float32(dt) * np.sin(a)
            a += np.float32(dt) * s
        out[i] = a


@parallel
def neighbours(x, first, side, out):
    for i in prange(x.shape[0]):
        cx, cy, cz = int(x[i, 0]), int(x[i, 1]), int(x[i, 2])
        s = np.float32(0)
        for ix in range(max(cx - 1, 0), min(cx + 2, side)):
            for iy in range(max(cy - 1, 0), min(cy + 2, side)):
                for iz in range(max(cz - 1, 0), min(cz + 2, side)):
                    cell = (ix * side + iy) * side + iz
                    for j in range(first[cell], first[cell + 1]):
                        dx, dy, dz = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1], x[i, 2] - x[j, 2]
                        q = np.float32(1) - (dx * dx + dy * dy + dz * dz)
                        if q > 0:
                            s += q * q * q
        out[i] = s


@njit
def histogram(x, bins, out):
    out[:] = 0
    for value in x:
        out[int(value * np.float32(bins))] += 1


def _like(name):
    return lambda inputs: inputs[name].shape


# Shapes of results, by program.
SHAPES = {
    "saxpy": _like("x"),
    "elementary": _like("x"),
    "total": lambda inputs: 1,
    "nbody": _like("x"),
    "springs": _like("x"),
    "mandelbrot": _like("cx"),
    "matrices": _like("b"),
    "neohooke": lambda inputs: len(inputs["f"]),
    "heat": _like("u"),
    "product": _like("a"),
    "pendulum": _like("angle"),
    "neighbours": lambda inputs: len(inputs["x"]),
    "histogram": lambda inputs: inputs["bins"],
}
PROGRAMS = {name: globals()[name] for name in SHAPES}


def build(name, inputs, weights, device):
    if device != "cpu":
        raise NotImplementedError("these programs are for the CPU")
    inputs = {key: value for key, value in inputs.items() if (name, key) != ("neighbours", "most")}
    out = np.empty(SHAPES[name](inputs), np.float32)
    return Run(lambda: PROGRAMS[name](*inputs.values(), out), lambda: out)
