"""Kernels of shapes.py that map items: straight-line code, short loops, branches, local arrays."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable, forward_only

vec9 = wp.types.vector(9, float)


@wp.struct
class Body:
    x: wp.vec3
    v: wp.vec3
    mass: float
    kind: int


@differentiable
def map64_kernel(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
    i = wp.tid()
    a = x[i]
    p = wp.float64(0.5)
    for k in range(12):
        p = p * a + wp.float64(k) * wp.float64(0.1)
    y[i] = p / (wp.float64(1.0) + a * a) + wp.sqrt(a + wp.float64(2.0))


@case
def map64(data):
    """A polynomial, a division and a root in 64 bits."""
    n = data.size(1 << 18, 1 << 24)
    return Case(map64_kernel, n, [data.real(n, wp.float64)], [data.out(n, wp.float64)], n)


@differentiable
def transcendental64_kernel(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
    i = wp.tid()
    a = x[i]
    y[i] = wp.sin(a) * wp.exp(-a) + wp.log(a + wp.float64(1.0)) * wp.cos(a)


@case
def transcendental64(data):
    """sin, exp, log, cos in 64 bits."""
    n = data.size(1 << 17, 1 << 23)
    x = data.real(n, wp.float64, 0.0, 20.0)
    return Case(transcendental64_kernel, n, [x], [data.out(n, wp.float64)], n)


@differentiable
def half_kernel(x: wp.array(dtype=wp.float16), a: float, y: wp.array(dtype=wp.float16)):
    i = wp.tid()
    v = float(x[i])
    y[i] = wp.float16(v / (1.0 + wp.abs(v)) + a * v * v)


@case
def half(data):
    """Numbers of 16 bits, arithmetic in 32."""
    n = data.size(1 << 19, 1 << 25)
    x = data.given(data.random.uniform(-2, 2, n).astype(np.float16), wp.float16, True)
    return Case(half_kernel, n, [x, 0.25], [data.out(n, wp.float16)], n)


@differentiable
def normalize_kernel(
    a: wp.array(dtype=wp.vec3), b: wp.array(dtype=wp.vec3), y: wp.array(dtype=wp.vec3)
):
    i = wp.tid()
    y[i] = wp.cross(wp.normalize(a[i]), b[i]) + wp.normalize(b[i]) * wp.length(a[i])


@case
def normalize(data):
    """Vectors of three: unit vectors and a cross product."""
    n = data.size(1 << 18, 1 << 24)
    a, b = (data.real((n, 3), wp.vec3, -1.0) for _ in range(2))
    return Case(normalize_kernel, n, [a, b], [data.out(n, wp.vec3)], n)


@differentiable
def polar_kernel(f: wp.array(dtype=wp.mat33), y: wp.array(dtype=wp.mat33)):
    i = wp.tid()
    r = f[i]
    for _k in range(4):
        r = (r + wp.inverse(wp.transpose(r))) * 0.5
    y[i] = r


@case
def polar(data):
    """The rotation of a 3 x 3 matrix by four Newton steps."""
    n = data.size(1 << 15, 1 << 21)
    values = np.eye(3) + 0.3 * data.random.uniform(-1, 1, (n, 3, 3))
    f = data.given(values.astype(np.float32), wp.mat33, True)
    return Case(polar_kernel, n, [f], [data.out(n, wp.mat33)], n)


@differentiable
def mat44_kernel(
    a: wp.array(dtype=wp.mat44), b: wp.array(dtype=wp.mat44), v: wp.array(dtype=wp.vec4),
    y: wp.array(dtype=wp.vec4),
):  # fmt: skip
    i = wp.tid()
    m = a[i] * b[i]
    y[i] = m * v[i] + wp.transpose(a[i]) * v[i] * wp.determinant(b[i])


@case
def mat44(data):
    """Products and a determinant of 4 x 4 matrices."""
    n = data.size(1 << 15, 1 << 21)
    a, b = (data.real((n, 4, 4), wp.mat44) for _ in range(2))
    return Case(mat44_kernel, n, [a, b, data.real((n, 4), wp.vec4)], [data.out(n, wp.vec4)], n)


@differentiable
def quaternion_kernel(
    q: wp.array(dtype=wp.quat), w: wp.array(dtype=wp.vec3), dt: float, steps: int,
    y: wp.array(dtype=wp.quat),
):  # fmt: skip
    i = wp.tid()
    r = q[i]
    spin = wp.quat(w[i], 0.0)
    for _k in range(steps):
        r = wp.normalize(r + spin * r * (0.5 * dt))
    y[i] = r


@case
def quaternion(data):
    """Integration of orientations: 8 steps."""
    n = data.size(1 << 15, 1 << 21)
    q, w = data.real((n, 4), wp.quat, -1.0), data.real((n, 3), wp.vec3, -1.0)
    return Case(quaternion_kernel, n, [q, w, 0.01, 8], [data.out(n, wp.quat)], 8 * n, "step")


@differentiable
def chain_kernel(
    joint: wp.array2d(dtype=wp.transform), axis: wp.array(dtype=wp.vec3),
    angle: wp.array2d(dtype=float), links: int, tip: wp.array(dtype=wp.vec3),
):  # fmt: skip
    i = wp.tid()
    t = wp.transform_identity()
    for k in range(links):
        turn = wp.quat_from_axis_angle(axis[k], angle[i, k])
        t = wp.transform_multiply(t, joint[i, k])
        t = wp.transform_multiply(t, wp.transform(wp.vec3(0.0, 0.0, 0.0), turn))
    tip[i] = wp.transform_point(t, wp.vec3(0.0, 0.0, 1.0))


@case
def chain(data):
    """Forward kinematics: 6 transforms per thread, one after the other."""
    n, links = data.size(1 << 13, 1 << 19), 6
    poses = data.random.uniform(-1, 1, (n, links, 7))
    poses[..., 3:] /= np.linalg.norm(poses[..., 3:], axis=-1, keepdims=True)
    joint = data.given(poses.astype(np.float32), wp.transform, True)
    axis = data.given(np.eye(3, dtype=np.float32)[np.arange(links) % 3], wp.vec3)
    angle = data.real((n, links), float, -3.0, 3.0)
    tip = data.out(n, wp.vec3)
    return Case(chain_kernel, n, [joint, axis, angle, links], [tip], links * n, "link")


@differentiable
def bodies_kernel(bodies: wp.array(dtype=Body), dt: float, x: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    b = bodies[i]
    drag = 0.1
    if b.kind == 1:
        drag = 0.4
    v = b.v * (1.0 - drag * dt / b.mass) + wp.vec3(0.0, -9.8, 0.0) * dt
    x[i] = b.x + v * dt


@case
def bodies(data):
    """An array of structs."""
    n = data.size(1 << 18, 1 << 22)
    values = np.zeros(n, dtype=Body.numpy_dtype())
    for name in ("x", "v"):
        values[name] = data.random.uniform(-1, 1, (n, 3))
    values["mass"] = data.random.uniform(0.5, 2, n)
    values["kind"] = data.random.integers(0, 2, n)
    return Case(bodies_kernel, n, [data.given(values, Body, True), 0.01], [data.out(n, wp.vec3)], n)


@wp.func
def pendulum(a: wp.float64, w: wp.float64):
    return -wp.float64(9.81) * wp.sin(a) - wp.float64(0.1) * w


@differentiable
def rk4_kernel(
    a: wp.array(dtype=wp.float64), w: wp.array(dtype=wp.float64), dt: wp.float64, steps: int,
    y: wp.array(dtype=wp.float64),
):  # fmt: skip
    i = wp.tid()
    p = a[i]
    v = w[i]
    h = dt * wp.float64(0.5)
    for _k in range(steps):
        a1 = pendulum(p, v)
        v2 = v + h * a1
        a2 = pendulum(p + h * v, v2)
        v3 = v + h * a2
        a3 = pendulum(p + h * v2, v3)
        v4 = v + dt * a3
        a4 = pendulum(p + dt * v3, v4)
        p += dt / wp.float64(6.0) * (v + wp.float64(2.0) * (v2 + v3) + v4)
        v += dt / wp.float64(6.0) * (a1 + wp.float64(2.0) * (a2 + a3) + a4)
    y[i] = p


@case
def rk4(data):
    """A pendulum by Runge-Kutta in 64 bits: 100 steps in a thread."""
    n = data.size(512, 1 << 16)
    a, w = (data.real(n, wp.float64, -1.0) for _ in range(2))
    return Case(rk4_kernel, n, [a, w, 0.01, 100], [data.out(n, wp.float64)], 100 * n, "step")


@differentiable
def early_kernel(x: wp.array(dtype=float), limit: float, y: wp.array(dtype=float)):
    i = wp.tid()
    a = x[i]
    if a < limit:
        y[i] = a
        return
    s = float(0.0)
    for k in range(10):
        s += wp.sqrt(a + float(k)) / (1.0 + a * a)
    if s > 30.0:
        return
    y[i] = s


@case
def early(data):
    """Threads that return before the work, or without a result."""
    n = data.size(1 << 16, 1 << 22)
    return Case(early_kernel, n, [data.real(n, high=2.0), 0.7], [data.out(n)], n, smooth=False)


@forward_only
def hash_kernel(x: wp.array(dtype=wp.uint32), y: wp.array(dtype=wp.uint32)):
    i = wp.tid()
    h = x[i]
    for _k in range(4):
        h = h * wp.uint32(747796405) + wp.uint32(2891336453)
        h = ((h >> ((h >> wp.uint32(28)) + wp.uint32(4))) ^ h) * wp.uint32(277803737)
        h = (h >> wp.uint32(22)) ^ h
    y[i] = h


@case
def hashing(data):
    """Shifts and products of unsigned integers."""
    n = data.size(1 << 18, 1 << 24)
    x = data.given(data.random.integers(0, 2**32, n, dtype=np.uint32), wp.uint32)
    return Case(hash_kernel, n, [x], [data.out(n, wp.uint32, False)], n)


@forward_only
def random_kernel(seed: int, samples: int, y: wp.array(dtype=float)):
    i = wp.tid()
    state = wp.rand_init(seed, i)
    inside = int(0)
    for _k in range(samples):
        a = wp.randf(state)
        b = wp.randf(state)
        if a * a + b * b < 1.0:
            inside += 1
    y[i] = float(inside) / float(samples)


@case
def random_numbers(data):
    """A share of random points, 32 for a thread."""
    n = data.size(1 << 15, 1 << 21)
    return Case(random_kernel, n, [3, 32], [data.out(n, grad=False)], 32 * n, "sample")


@forward_only
def rejection_kernel(seed: int, y: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    state = wp.rand_init(seed, i)
    p = wp.vec3(2.0, 0.0, 0.0)
    while wp.dot(p, p) > 1.0:
        p = wp.vec3(
            wp.randf(state, -1.0, 1.0), wp.randf(state, -1.0, 1.0), wp.randf(state, -1.0, 1.0)
        )
    y[i] = p


@case
def rejection(data):
    """Points of a ball by rejection."""
    n = data.size(1 << 16, 1 << 22)
    return Case(rejection_kernel, n, [5], [data.out(n, wp.vec3, False)], n)


@forward_only
def median_kernel(image: wp.array2d(dtype=float), h: int, w: int, out: wp.array2d(dtype=float)):
    i, j = wp.tid()
    v = vec9()
    for a in range(3):
        for b in range(3):
            v[a * 3 + b] = image[wp.clamp(i + a - 1, 0, h - 1), wp.clamp(j + b - 1, 0, w - 1)]
    for a in range(1, 9):
        key = v[a]
        k = a
        while k > 0 and v[wp.max(k - 1, 0)] > key:
            v[k] = v[k - 1]
            k -= 1
        v[k] = key
    out[i, j] = v[4]


@case
def median(data):
    """A median filter: nine numbers sorted in a local array."""
    n = data.size(96, 1 << 10)
    image, out = data.real((n, n), grad=False), data.out((n, n), grad=False)
    return Case(median_kernel, (n, n), [image, n, n], [out], n * n, "pixel")
