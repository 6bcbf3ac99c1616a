"""Rotations by quaternions of any length are q v q*, in values, matrices, transforms, gradients."""

import numpy as np
import pytest

import warp as wp

QUAT = {wp.float32: wp.quatf, wp.float64: wp.quatd}
VEC = {wp.float32: wp.vec3f, wp.float64: wp.vec3d}
MAT = {wp.float32: wp.mat33f, wp.float64: wp.mat33d}
TRANSFORM = {wp.float32: wp.transformf, wp.float64: wp.transformd}
ROUNDOFF = {wp.float32: 6e-8, wp.float64: 1.2e-16}


def product(a, b):
    """Hamilton's product of x, y, z, w."""
    u, w, v, s = a[..., :3], a[..., 3:], b[..., :3], b[..., 3:]
    real = w * s - (u * v).sum(-1, keepdims=True)
    return np.concatenate([w * v + s * u + np.cross(u, v), real], -1)


def conjugate(q):
    return q * [-1.0, -1.0, -1.0, 1.0]


def rotated(q, v):
    pure = np.concatenate([v, np.zeros_like(v[..., :1])], -1)
    return product(product(q, pure), conjugate(q))[..., :3]


def numbers(dtype, n=500):
    """Quaternions of lengths from 0.1 to 10, one of them 0, and vectors."""
    rng = np.random.default_rng(4)
    q = rng.normal(size=(n, 4))
    q *= (10 ** rng.uniform(-1, 1, n) / np.linalg.norm(q, axis=1))[:, None]
    q[0] = 0
    kind = np.float32 if dtype is wp.float32 else np.float64
    return q.astype(kind), rng.normal(size=(n, 3)).astype(kind)


def make_all(dtype):
    quat, vec, mat, transform = QUAT[dtype], VEC[dtype], MAT[dtype], TRANSFORM[dtype]

    @wp.kernel
    def all_ways(q: wp.array(dtype=quat), v: wp.array(dtype=vec), out: wp.array2d(dtype=vec)):
        i = wp.tid()
        zero = vec()
        t = wp.transformation(v[i], q[i])
        out[i, 0] = wp.quat_rotate(q[i], v[i])
        out[i, 1] = wp.quat_to_matrix(q[i]) * v[i]
        out[i, 2] = wp.transform_vector(t, v[i])
        out[i, 3] = wp.transform_point(t, v[i]) - v[i]
        m = wp.transform_to_matrix(t)
        out[i, 4] = wp.transform_vector(m, v[i])
        out[i, 5] = wp.transform_vector(
            wp.transform_compose(zero, q[i], vec(dtype(1.0), dtype(1.0), dtype(1.0))), v[i]
        )
        out[i, 6] = wp.quat_rotate_inv(wp.quat_inverse(q[i]), v[i])
        out[i, 7] = wp.quat_rotate_inv(q[i], v[i])
        # One product turns as its factors, one after the other.
        out[i, 8] = wp.quat_rotate(q[i] * q[i], v[i])
        out[i, 9] = wp.transform_vector(t * t, v[i])

    return all_ways


@pytest.mark.parametrize("dtype", QUAT)
def test_all_ways_to_rotate(device, dtype):
    q, v = numbers(dtype)
    out = wp.zeros((len(q), 10), dtype=VEC[dtype], device=device)
    given = (wp.array(one, dtype=kind[dtype], device=device) for one, kind in ((q, QUAT), (v, VEC)))
    wp.launch(make_all(dtype), len(q), inputs=[*given, out], device=device)
    found, q, v = out.numpy().astype(np.float64), q.astype(np.float64), v.astype(np.float64)
    forth, back = rotated(q, v), rotated(conjugate(q), v)
    twice = rotated(q, forth)
    square = (q * q).sum(1) * np.linalg.norm(v, axis=1)
    for i in range(10):
        exact = twice if i >= 8 else back if i == 7 else forth
        scale = square * (q * q).sum(1) if i >= 8 else square
        # A displacement of a point is a difference of points.
        scale = scale + np.linalg.norm(v, axis=1) if i == 3 else scale
        error = np.abs(found[:, i] - exact).max(1)
        assert (error <= 24 * ROUNDOFF[dtype] * scale).all(), i


def make_scalar(which):
    @wp.kernel
    def scalar(
        q: wp.array(dtype=wp.quatd),
        v: wp.array(dtype=wp.vec3d),
        g: wp.array(dtype=wp.vec3d),
        out: wp.array(dtype=wp.float64),
    ):
        i = wp.tid()
        turned = wp.quat_rotate(q[i], v[i])
        if wp.static(which == "quat_rotate_inv"):
            turned = wp.quat_rotate_inv(q[i], v[i])
        elif wp.static(which == "quat_to_matrix"):
            turned = wp.quat_to_matrix(q[i]) * v[i]
        elif wp.static(which == "transform_vector"):
            turned = wp.transform_vector(wp.transformation(v[i], q[i]), v[i])
        out[i] = wp.dot(g[i], turned)

    return scalar


@pytest.mark.parametrize(
    "which", ["quat_rotate", "quat_rotate_inv", "quat_to_matrix", "transform_vector"]
)
def test_gradients(device, which):
    """The adjoint is that of q v q*: by v it rotates back, by q it is a difference quotient."""
    q, v = numbers(wp.float64, 40)
    g = np.random.default_rng(7).normal(size=v.shape)
    arrays = [
        wp.array(one, dtype=kind, device=device, requires_grad=True)
        for one, kind in ((q, wp.quatd), (v, wp.vec3d))
    ]
    out = wp.zeros(len(q), dtype=wp.float64, device=device, requires_grad=True)
    fixed = wp.array(g, dtype=wp.vec3d, device=device)
    with wp.Tape() as tape:
        wp.launch(make_scalar(which), len(q), inputs=[*arrays, fixed, out], device=device)
    tape.backward(grads={out: wp.ones_like(out)})
    of_q, of_v = (tape.gradients[one].numpy() for one in arrays)
    turned = conjugate(q) if which == "quat_rotate_inv" else q
    np.testing.assert_allclose(of_v, rotated(conjugate(turned), g), rtol=1e-12, atol=1e-12)

    def value(q):
        return (g * rotated(conjugate(q) if which == "quat_rotate_inv" else q, v)).sum(1)

    for k in range(4):
        step = np.zeros(4)
        step[k] = 1.0
        # A polynomial of degree two in q, so the difference is exact but for rounding.
        exact = (value(q + step) - value(q - step)) / 2
        np.testing.assert_allclose(of_q[:, k], exact, rtol=1e-11, atol=1e-11)
