"""Kernels of shapes.py whose iterations wait for each other: integrators, filters, joints, rows."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable, forward_only

mat24 = wp.types.matrix((2, 4), float)
vec32 = wp.types.vector(32, float)


@wp.func
def oscillator(y: wp.vec2, mu: float):
    return wp.vec2(y[1], mu * (1.0 - y[0] * y[0]) * y[1] - y[0])


@differentiable
def adaptive_kernel(
    y0: wp.array(dtype=wp.vec2), mu: wp.array(dtype=float), end: float, tol: float,
    out: wp.array(dtype=wp.vec2),
):  # fmt: skip
    i = wp.tid()
    y = y0[i]
    m = mu[i]
    t = float(0.0)
    h = float(0.05)
    steps = int(0)
    while t < end and steps < 500:
        if t + h > end:
            h = end - t
        k1 = oscillator(y, m)
        k2 = oscillator(y + h * 0.5 * k1, m)
        k3 = oscillator(y + h * 0.75 * k2, m)
        new = y + h * (2.0 / 9.0 * k1 + 1.0 / 3.0 * k2 + 4.0 / 9.0 * k3)
        k4 = oscillator(new, m)
        error = h * (-5.0 / 72.0 * k1 + 1.0 / 12.0 * k2 + 1.0 / 9.0 * k3 - 0.125 * k4)
        size = wp.length(error) / tol
        if size <= 1.0:
            t = t + h
            y = new
        h = h * wp.clamp(0.9 * wp.pow(size + 1.0e-10, -1.0 / 3.0), 0.2, 5.0)
        steps += 1
    out[i] = y


@case
def adaptive(data):
    """Bogacki and Shampine's pair with a step of its own for each thread."""
    n = data.size(2048, 1 << 17)
    arrays = [data.real((n, 2), wp.vec2, 0.5), data.real(n, low=0.5), 2.0, 1.0e-4]
    return Case(adaptive_kernel, n, arrays, [data.out(n, wp.vec2)], n, smooth=False)


@differentiable
def track_kernel(
    z: wp.array2d(dtype=wp.vec2), dt: float, drift: float, noise: float,
    out: wp.array(dtype=wp.vec4),
):  # fmt: skip
    i = wp.tid()
    f = wp.mat44(1.0, 0.0, dt, 0.0, 0.0, 1.0, 0.0, dt, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    h = mat24(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    x = wp.vec4(0.0, 0.0, 0.0, 0.0)
    p = wp.identity(n=4, dtype=float)
    for t in range(z.shape[1]):
        x = f * x
        p = f * p * wp.transpose(f) + wp.identity(n=4, dtype=float) * drift
        s = h * p * wp.transpose(h) + wp.identity(n=2, dtype=float) * noise
        k = p * wp.transpose(h) * wp.inverse(s)
        x = x + k * (z[i, t] - h * x)
        p = (wp.identity(n=4, dtype=float) - k * h) * p
    out[i] = x


@case
def track(data):
    """Kalman filters of moving points, whose covariance is the same in all threads."""
    n, steps = data.size(2048, 1 << 16), 16
    z = data.real((n, steps, 2), wp.vec2)
    return Case(track_kernel, n, [z, 0.1, 0.01, 0.1], [data.out(n, wp.vec4)], n * steps, "step")


@wp.func
def turned(w: wp.vec3):
    angle = wp.length(w)
    if angle < 1.0e-6:
        return wp.quat_identity()
    return wp.quat_from_axis_angle(w / angle, angle)


@differentiable
def joints_kernel(
    joint: wp.array2d(dtype=wp.vec3), offset: wp.array(dtype=wp.vec3), tip: wp.array(dtype=wp.vec3)
):
    i = wp.tid()
    t = wp.transform_identity()
    for j in range(joint.shape[1]):
        t = wp.transform_multiply(t, wp.transform(offset[j], turned(joint[i, j])))
    tip[i] = wp.transform_point(t, wp.vec3(0.1, 0.2, 0.3))


@case
def joints(data):
    """Forward kinematics along a chain of ball joints."""
    n, m = data.size(4096, 1 << 18), 8
    arrays = [data.real((n, m, 3), wp.vec3, 0.2), data.real((m, 3), wp.vec3)]
    return Case(joints_kernel, n, arrays, [data.out(n, wp.vec3)], n * m, "joint")


@forward_only
def american_kernel(
    s: wp.array(dtype=float), strike: float, rate: float, sigma: float, y: wp.array(dtype=float)
):
    i = wp.tid()
    v = vec32()
    dt = 1.0 / 31.0
    up = wp.exp(sigma * wp.sqrt(dt))
    p = (wp.exp(rate * dt) - 1.0 / up) / (up - 1.0 / up)
    discount = wp.exp(-rate * dt)
    for k in range(32):
        v[k] = wp.max(strike - s[i] * wp.pow(up, float(2 * k - 31)), 0.0)
    for step in range(31):
        n = 31 - step
        for k in range(n):
            now = strike - s[i] * wp.pow(up, float(2 * k - n + 1))
            v[k] = wp.max(discount * (p * v[k + 1] + (1.0 - p) * v[k]), now)
    y[i] = v[0]


@case
def american(data):
    """Binomial trees in memory of the thread."""
    n = data.size(512, 1 << 16)
    s = data.real(n, low=80.0, high=120.0, grad=False)
    return Case(american_kernel, n, [s, 100.0, 0.05, 0.3], [data.out(n, grad=False)], n)


@forward_only
def viterbi_kernel(
    seen: wp.array2d(dtype=int), change: wp.array2d(dtype=float), emit: wp.array2d(dtype=float),
    best: wp.array(dtype=float), last: wp.array(dtype=int),
):  # fmt: skip
    t = wp.tid()
    now = wp.vec4()
    for s in range(4):
        now[s] = emit[s, seen[t, 0]]
    for i in range(1, seen.shape[1]):
        then = wp.vec4()
        o = seen[t, i]
        for s in range(4):
            m = float(-1.0e30)
            for p in range(4):
                m = wp.max(m, now[p] + change[p, s])
            then[s] = m + emit[s, o]
        now = then
    m = now[0]
    w = int(0)
    for s in range(1, 4):
        if now[s] > m:
            m = now[s]
            w = s
    best[t] = m
    last[t] = w


@case
def viterbi(data):
    """The likeliest states of hidden Markov models."""
    n, m = data.size(1024, 1 << 16), 32
    tables = [data.real((4, k), low=-3.0, high=0.0, grad=False) for k in (4, 8)]
    arrays = [data.integers((n, m), 0, 8), *tables]
    return Case(viterbi_kernel, n, arrays, [data.out(n, grad=False), data.out(n, int, False)], n)


@differentiable
def element_kernel(
    nodes: wp.array(dtype=wp.vec2), corners: wp.array(dtype=wp.vec3i), kappa: wp.array(dtype=float),
    u: wp.array(dtype=float), r: wp.array(dtype=float), stiff: wp.array3d(dtype=float),
):  # fmt: skip
    e = wp.tid()
    t = corners[e]
    a = nodes[t[0]]
    b = nodes[t[1]]
    c = nodes[t[2]]
    j = wp.mat22(b[0] - a[0], c[0] - a[0], b[1] - a[1], c[1] - a[1])
    back = wp.transpose(wp.inverse(j))
    g1 = back * wp.vec2(1.0, 0.0)
    g2 = back * wp.vec2(0.0, 1.0)
    g = wp.matrix_from_rows(-(g1 + g2), g1, g2)
    k = g * wp.transpose(g) * (0.5 * wp.abs(wp.determinant(j)) * kappa[e])
    for m in range(3):
        s = float(0.0)
        for n in range(3):
            stiff[e, m, n] = k[m, n]
            s += k[m, n] * u[t[n]]
        wp.atomic_add(r, t[m], s)


@case
def elements(data):
    """Linear elements assembled by hand: stiffness and residual."""
    n = data.size(64, 512)
    count = (n + 1) ** 2
    g = np.arange(count).reshape(n + 1, n + 1)
    low = np.stack([g[:-1, :-1], g[1:, :-1], g[:-1, 1:]], -1).reshape(-1, 3)
    high = np.stack([g[1:, 1:], g[:-1, 1:], g[1:, :-1]], -1).reshape(-1, 3)
    corners = np.concatenate([low, high]).astype(np.int32)
    square = np.stack(np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"), -1)
    x = square.reshape(-1, 2) + data.random.uniform(-0.2, 0.2, (count, 2))
    m = len(corners)
    arrays = [data.given(x.astype(np.float32), wp.vec2, True), data.given(corners, wp.vec3i)]
    arrays += [data.real(m, low=1.0), data.real(count)]
    return Case(element_kernel, m, arrays, [data.out(count), data.out((m, 3, 3))], m)


@differentiable
def links_kernel(
    angle: wp.array2d(dtype=float),
    axis: wp.array(dtype=wp.vec3),
    parent: wp.array(dtype=int),
    pose: wp.array2d(dtype=wp.transform),
):
    world = wp.tid()
    for k in range(axis.shape[0]):
        local = wp.transform(axis[k], wp.quat_from_axis_angle(axis[k], angle[world, k]))
        p = parent[k]
        if p >= 0:
            local = wp.transform_multiply(pose[world, p], local)
        pose[world, k] = local


@case
def links(data):
    """Poses of the links of trees, rows of transforms that later links read."""
    worlds, n = data.size(1024, 1 << 15), 16
    axis = data.random.normal(size=(n, 3)).astype(np.float32)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    parent = np.arange(n) // 2 - (np.arange(n) == 0)
    inputs = [data.real((worlds, n)), data.given(axis, wp.vec3), data.given(parent, int)]
    return Case(
        links_kernel, worlds, inputs, [data.out((worlds, n), wp.transform)], worlds * n, "link"
    )
