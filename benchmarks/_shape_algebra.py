"""Kernels of shapes.py with small matrices and quaternions."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable

mat66 = wp.types.matrix((6, 6), float)
vec6 = wp.types.vector(6, float)
mat88 = wp.types.matrix((8, 8), float)
vec8 = wp.types.vector(8, float)


@differentiable
def svd_kernel(f: wp.array(dtype=wp.mat33), mu: float, y: wp.array(dtype=wp.mat33)):
    i = wp.tid()
    u, s, v = wp.svd3(f[i])
    r = u * wp.transpose(v)
    y[i] = (f[i] - r) * (2.0 * mu) + r * (s[0] + s[1] + s[2] - 3.0)


@case
def svd(data):
    """Corotated stress by singular values."""
    n = data.size(1 << 13, 1 << 20)
    f = data.random.normal(size=(n, 3, 3)) * 0.2 + np.eye(3)
    f = data.given(f.astype(np.float32), wp.mat33, True)
    return Case(svd_kernel, n, [f, 1.0], [data.out(n, wp.mat33)], n, smooth=False)


@differentiable
def eigen_kernel(a: wp.array(dtype=wp.mat33), y: wp.array(dtype=wp.mat33)):
    i = wp.tid()
    s = (a[i] + wp.transpose(a[i])) * 0.5
    q, d = wp.eig3(s)
    big = wp.vec3(wp.max(d[0], 0.1), wp.max(d[1], 0.1), wp.max(d[2], 0.1))
    y[i] = q * wp.diag(big) * wp.transpose(q)


@case
def eigen(data):
    """Symmetric matrices made positive by their eigenvalues."""
    n = data.size(1 << 13, 1 << 20)
    a = data.real((n, 3, 3), wp.mat33, -1.0)
    return Case(eigen_kernel, n, [a], [data.out(n, wp.mat33)], n, smooth=False)


@differentiable
def solve6_kernel(a: wp.array(dtype=mat66), b: wp.array(dtype=vec6), y: wp.array(dtype=vec6)):
    i = wp.tid()
    m = a[i]
    x = b[i]
    for k in range(6):
        for r in range(k + 1, 6):
            f = m[r, k] / m[k, k]
            for c in range(k, 6):
                m[r, c] -= f * m[k, c]
            x[r] -= f * x[k]
    for back in range(6):
        k = 5 - back
        for c in range(k + 1, 6):
            x[k] -= m[k, c] * x[c]
        x[k] = x[k] / m[k, k]
    y[i] = x


@case
def solve6(data):
    """Gauss's elimination of 6 x 6 in a thread."""
    n = data.size(1 << 13, 1 << 19)
    a = data.random.uniform(-0.1, 0.1, (n, 6, 6)) + np.eye(6)
    a = data.given(a.astype(np.float32), mat66, True)
    return Case(solve6_kernel, n, [a, data.real((n, 6), vec6)], [data.out(n, vec6)], n)


@differentiable
def kalman_kernel(
    x: wp.array(dtype=wp.vec4), p: wp.array(dtype=wp.mat44), z: wp.array(dtype=wp.vec2), dt: float,
    x1: wp.array(dtype=wp.vec4), p1: wp.array(dtype=wp.mat44),
):  # fmt: skip
    i = wp.tid()
    f = wp.mat44(1.0, 0.0, dt, 0.0, 0.0, 1.0, 0.0, dt, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    s = f * x[i]
    c = f * p[i] * wp.transpose(f) + wp.identity(n=4, dtype=float) * 0.01
    h = wp.mat22(c[0, 0] + 0.1, c[0, 1], c[1, 0], c[1, 1] + 0.1)
    g = wp.inverse(h)
    e = z[i] - wp.vec2(s[0], s[1])
    w = g * e
    for r in range(4):
        s[r] = s[r] + c[r, 0] * w[0] + c[r, 1] * w[1]
    k = wp.matrix(shape=(4, 2), dtype=float)
    for r in range(4):
        k[r, 0] = c[r, 0] * g[0, 0] + c[r, 1] * g[1, 0]
        k[r, 1] = c[r, 0] * g[0, 1] + c[r, 1] * g[1, 1]
    q = wp.mat44()
    for r in range(4):
        for j in range(4):
            q[r, j] = c[r, j] - k[r, 0] * c[0, j] - k[r, 1] * c[1, j]
    x1[i] = s
    p1[i] = q


@case
def kalman(data):
    """A Kalman filter with four states."""
    n = data.size(1 << 14, 1 << 20)
    root = data.random.normal(size=(n, 4, 4))
    p = (root @ root.transpose(0, 2, 1) + np.eye(4)).astype(np.float32)
    arrays = [data.real((n, 4), wp.vec4), data.given(p, wp.mat44, True)]
    arrays.append(data.real((n, 2), wp.vec2))
    return Case(kalman_kernel, n, [*arrays, 0.1], [data.out(n, wp.vec4), data.out(n, wp.mat44)], n)


@differentiable
def slerp_kernel(
    a: wp.array(dtype=wp.quat), b: wp.array(dtype=wp.quat), t: float, y: wp.array(dtype=wp.vec3)
):
    i = wp.tid()
    p = wp.normalize(a[i])
    q = wp.normalize(b[i])
    r = wp.quat_slerp(p, q, t)
    y[i] = wp.quat_rotate(r, wp.vec3(1.0, 2.0, 3.0)) + wp.quat_rotate(
        p * wp.quat_inverse(q), wp.vec3(1.0)
    )


@case
def slerp(data):
    """Rotations between two."""
    n = data.size(1 << 14, 1 << 20)
    a, b = data.real((n, 4), wp.quat, 0.1), data.real((n, 4), wp.quat, -0.5, 1.0)
    return Case(slerp_kernel, n, [a, b, 0.3], [data.out(n, wp.vec3)], n)


@differentiable
def network_kernel(
    w: wp.array(dtype=mat88),
    b: wp.array(dtype=vec8),
    x: wp.array(dtype=vec8),
    y: wp.array(dtype=vec8),
):
    i = wp.tid()
    h = x[i]
    for layer in range(3):
        h = w[layer] * h + b[layer]
        for k in range(8):
            h[k] = wp.tanh(h[k])
    y[i] = h


@case
def network(data):
    """A network of three layers of eight in each thread; all share its weights."""
    n = data.size(1 << 13, 1 << 18)
    arrays = [
        data.real((3, 8, 8), mat88, -0.5, 0.5),
        data.real((3, 8), vec8),
        data.real((n, 8), vec8),
    ]
    return Case(network_kernel, n, arrays, [data.out(n, vec8)], n)


@differentiable
def factor_kernel(a: wp.array(dtype=mat66), b: wp.array(dtype=vec6), out: wp.array(dtype=vec6)):
    i = wp.tid()
    m = a[i]
    rhs = b[i]
    low = mat66()
    for r in range(6):
        for c in range(r + 1):
            s = m[r, c]
            for k in range(c):
                s -= low[r, k] * low[c, k]
            if r == c:
                low[r, c] = wp.sqrt(s)
            else:
                low[r, c] = s / low[c, c]
    y = vec6()
    for r in range(6):
        s = rhs[r]
        for k in range(r):
            s -= low[r, k] * y[k]
        y[r] = s / low[r, r]
    x = vec6()
    for q in range(6):
        r = 5 - q
        s = y[r]
        for k in range(r + 1, 6):
            s -= low[k, r] * x[k]
        x[r] = s / low[r, r]
    out[i] = x


@case
def factor(data):
    """Cholesky's factors and a solve of six unknowns, written as loops over a matrix."""
    n = data.size(4096, 1 << 18)
    h = data.random.standard_normal((n, 6, 6))
    a = (h @ h.transpose(0, 2, 1) / 6.0 + np.eye(6)).astype(np.float32)
    arrays = [data.given(a, mat66, True), data.real((n, 6), vec6)]
    return Case(factor_kernel, n, arrays, [data.out(n, vec6)], n, "system")


@differentiable
def polar_part_kernel(
    f: wp.array(dtype=wp.mat33), r: wp.array(dtype=wp.mat33), e: wp.array(dtype=float)
):
    i = wp.tid()
    a = f[i]
    q = a
    for _ in range(6):
        q = (q + wp.transpose(wp.inverse(q))) * 0.5
    s = wp.transpose(q) * a
    r[i] = q
    d = s - wp.identity(n=3, dtype=float)
    e[i] = wp.ddot(d, d) + 0.5 * wp.trace(d) * wp.trace(d)


@case
def polar_part(data):
    """Rotations of deformations by Newton's iteration, and corotated energies."""
    n = data.size(8192, 1 << 18)
    f = np.eye(3) + data.random.uniform(-0.2, 0.2, (n, 3, 3))
    arrays = [data.given(f.astype(np.float32), wp.mat33, True)]
    return Case(polar_part_kernel, n, arrays, [data.out(n, wp.mat33), data.out(n)], n, "matrix")
