"""Quaternions and rigid transforms against formulas in float64 and 40-digit arithmetic."""

import numpy as np
import pytest

import warp as wp
from builtin_values import MANTISSA_BITS, apply, rounded

mp = pytest.importorskip("mpmath")

DTYPES = [wp.float32, wp.float64]
KINDS = {
    wp.float32: (wp.vec3f, wp.quatf, wp.mat33f, wp.transformf, wp.mat44f),
    wp.float64: (wp.vec3d, wp.quatd, wp.mat33d, wp.transformd, wp.mat44d),
}


def unit_roundoff(dtype):
    return 2.0 ** -(MANTISSA_BITS[dtype] + 1)


def random_quats(dtype, count=100, seed=1):
    q = np.random.default_rng(seed).normal(size=(count, 4))
    return rounded(q / np.linalg.norm(q, axis=1)[:, None], dtype)


def random_vectors(dtype, count=100, seed=2):
    return rounded(np.random.default_rng(seed).normal(size=(count, 3)), dtype)


def product(a, b):
    u, w = a[..., :3], a[..., 3:]
    v, z = b[..., :3], b[..., 3:]
    vector = w * v + z * u + np.cross(u, v)
    return np.concatenate([vector, w * z - (u * v).sum(-1, keepdims=True)], -1)


def conjugate(q):
    return q * [-1, -1, -1, 1]


def rotated(q, v):
    pure = np.concatenate([v, np.zeros_like(v[..., :1])], -1)
    return product(product(q, pure), conjugate(q))[..., :3]


def matrix(q):
    return np.stack([rotated(q, np.broadcast_to(e, q[..., :3].shape)) for e in np.eye(3)], -1)


def assert_close(actual, expected, dtype, units):
    limit = units * unit_roundoff(dtype) * max(1.0, np.abs(expected).max())
    np.testing.assert_allclose(actual, expected, rtol=0, atol=limit)


@pytest.mark.parametrize("dtype", DTYPES)
def test_products_and_rotations(device, dtype):
    vec, quat, mat, _, mat44 = KINDS[dtype]
    a, b, v = random_quats(dtype), random_quats(dtype, seed=3), random_vectors(dtype)
    assert_close(apply(wp.mul, [a, b], [quat, quat], quat, device), product(a, b), dtype, 8)
    result = apply(wp.quat_rotate, [a, v], [quat, vec], vec, device)
    assert_close(result, rotated(a, v), dtype, 12)
    result = apply(wp.quat_rotate_inv, [a, v], [quat, vec], vec, device)
    assert_close(result, rotated(conjugate(a), v), dtype, 12)
    assert_close(apply(wp.quat_inverse, [a], [quat], quat, device), conjugate(a), dtype, 0)
    assert_close(apply(wp.quat_to_matrix, [a], [quat], mat, device), matrix(a), dtype, 8)


@pytest.mark.parametrize("dtype", DTYPES)
def test_from_matrix_for_every_largest_component(device, dtype):
    """Half turns about each axis and their neighbours, where a naive formula divides by zero."""
    _, quat, mat, _, mat44 = KINDS[dtype]
    q = np.concatenate([np.eye(4), np.eye(4) + 1e-3, random_quats(dtype)])
    q /= np.linalg.norm(q, axis=1)[:, None]
    m = rounded(matrix(q), dtype)
    result = apply(wp.quat_from_matrix, [m], [mat], quat, device)
    sign = np.sign((result * q).sum(1))[:, None]
    assert_close(result * sign, q, dtype, 16)
    affine = np.zeros((len(m), 4, 4))
    affine[:, :3, :3], affine[:, :, 3] = m, [5, 6, 7, 1]
    again = apply(wp.quat_from_matrix, [affine], [mat44], quat, device)
    np.testing.assert_array_equal(again, result)


def axis_angle(axes, angles, dtype, device):
    vec, quat, *_ = KINDS[dtype]
    return apply(wp.quat_from_axis_angle, [axes, angles], [vec, dtype], quat, device)


def to_axis_angle(q, dtype, device):
    vec, quat, *_ = KINDS[dtype]

    @wp.kernel
    def split(q: wp.array(dtype=quat), axis: wp.array(dtype=vec), angle: wp.array(dtype=dtype)):
        i = wp.tid()
        a, b = wp.quat_to_axis_angle(q[i])
        axis[i] = a
        angle[i] = b

    source = wp.array(q, dtype=quat, device=device)
    axis = wp.zeros(len(q), dtype=vec, device=device)
    angle = wp.zeros(len(q), dtype=dtype, device=device)
    wp.launch(split, dim=len(q), inputs=[source], outputs=[axis, angle], device=device)
    return axis.numpy().astype(np.float64), angle.numpy().astype(np.float64)


@pytest.mark.parametrize("dtype", DTYPES)
def test_axis_angle_near_zero_and_pi(device, dtype):
    """The angle keeps its relative accuracy down to 1e-30."""
    angles = rounded([1e-30, 1e-12, 1e-7, 1e-3, 1.0, 3.0, np.pi - 1e-3, np.pi - 1e-6], dtype)
    axes = rounded(np.tile([[0.6, 0.0, 0.8]], (len(angles), 1)), dtype)
    q = axis_angle(axes, angles, dtype, device)
    axis, angle = to_axis_angle(q, dtype, device)
    error = np.abs(angle - angles)
    assert np.all(error <= 8 * unit_roundoff(dtype) * np.maximum(angles, (angles > 3) * np.pi))
    assert_close(axis, axes, dtype, 8)


@pytest.mark.parametrize("dtype", DTYPES)
def test_axis_angle_takes_the_short_way(device, dtype):
    q = random_quats(dtype)
    axis, angle = to_axis_angle(q, dtype, device)
    assert np.all((angle >= 0) & (angle <= np.pi * (1 + unit_roundoff(dtype))))
    half = angle[:, None] / 2
    rebuilt = np.concatenate([axis * np.sin(half), np.cos(half)], 1)
    sign = np.sign((rebuilt * q).sum(1))[:, None]
    assert_close(rebuilt * sign, q, dtype, 12)
    axis, angle = to_axis_angle(np.array([[0.0, 0, 0, 1], [0, 0, 0, -1]]), dtype, device)
    assert not axis.any() and not angle.any()


@pytest.mark.parametrize("dtype", DTYPES)
def test_roll_pitch_yaw(device, dtype):
    quat = KINDS[dtype][1]
    angles = rounded(np.random.default_rng(4).uniform(-3, 3, (3, 50)), dtype)
    result = apply(wp.quat_rpy, list(angles), [dtype] * 3, quat, device)
    turns = []
    for axis, angle in zip(np.eye(3), angles):
        half = angle[:, None] / 2
        turns.append(np.concatenate([axis * np.sin(half), np.cos(half)], 1))
    assert_close(result, product(turns[2], product(turns[1], turns[0])), dtype, 8)


def exact_slerp(a, b, t):
    a, b = [mp.mpf(x) for x in a], [mp.mpf(x) for x in b]
    if sum(x * y for x, y in zip(a, b)) < 0:
        b = [-x for x in b]
    norm = lambda v: mp.sqrt(sum(x * x for x in v))  # noqa: E731
    angle = 2 * mp.atan2(norm([y - x for x, y in zip(a, b)]), norm([y + x for x, y in zip(a, b)]))
    if angle == 0:
        return a
    weights = mp.sin((1 - t) * angle) / mp.sin(angle), mp.sin(t * angle) / mp.sin(angle)
    return [weights[0] * x + weights[1] * y for x, y in zip(a, b)]


@pytest.mark.parametrize("dtype", DTYPES)
def test_slerp(device, dtype):
    """Far apart, on both sides of the sphere, nearly parallel and equal."""
    mp.mp.dps = 40
    quat = KINDS[dtype][1]
    a = random_quats(dtype, 40)
    b = random_quats(dtype, 40, seed=8)
    for i, distance in enumerate([0.0, 1e-12, 1e-7, 1e-4, 3e-4, 1e-3, 1e-2]):
        b[i] = a[i] + distance * conjugate(b[i])
        b[i] /= np.linalg.norm(b[i])
    b = rounded(b, dtype)
    t = rounded(np.random.default_rng(9).uniform(0, 1, 40), dtype)
    result = apply(wp.quat_slerp, [a, b, t], [quat, quat, dtype], quat, device)
    expected = [[float(x) for x in exact_slerp(*row)] for row in zip(a, b, t)]
    assert_close(result, np.array(expected), dtype, 16)


@pytest.mark.parametrize("dtype", DTYPES)
def test_rigid_transforms(device, dtype):
    vec, quat, _, transform, mat44 = KINDS[dtype]
    p, q, v = random_vectors(dtype), random_quats(dtype), random_vectors(dtype, seed=6)
    r, s = random_vectors(dtype, seed=7), random_quats(dtype, seed=8)
    a, b = np.concatenate([p, q], 1), np.concatenate([r, s], 1)
    both = [transform, transform]
    expected = np.concatenate([p + rotated(q, r), product(q, s)], 1)
    for name in (wp.mul, wp.transform_multiply):
        assert_close(apply(name, [a, b], both, transform, device), expected, dtype, 16)
    result = apply(wp.transform_point, [a, v], [transform, vec], vec, device)
    assert_close(result, p + rotated(q, v), dtype, 16)
    result = apply(wp.transform_vector, [a, v], [transform, vec], vec, device)
    assert_close(result, rotated(q, v), dtype, 16)
    result = apply(wp.transform_inverse, [a], [transform], transform, device)
    expected = np.concatenate([-rotated(conjugate(q), p), conjugate(q)], 1)
    assert_close(result, expected, dtype, 16)
    affine = np.zeros((len(p), 4, 4))
    affine[:, :3, :3], affine[:, :3, 3], affine[:, 3, 3] = rounded(matrix(q), dtype), p, 1
    result = apply(wp.transform_point, [affine, v], [mat44, vec], vec, device)
    assert_close(result, p + rotated(q, v), dtype, 16)
    np.testing.assert_array_equal(
        apply(wp.transform_get_translation, [a], [transform], vec, device), p
    )
    np.testing.assert_array_equal(
        apply(wp.transform_get_rotation, [a], [transform], quat, device), q
    )


@pytest.mark.parametrize("dtype", DTYPES)
def test_normalize(device, dtype):
    quat = KINDS[dtype][1]
    q = np.array([[0, 0, 0, 0], [1, 2, 3, 4], [1e-30, 0, 0, 1e-30]], float)
    result = apply(wp.normalize, [q], [quat], quat, device)
    expected = np.array([[0, 0, 0, 1], q[1] / np.sqrt(30), [0.5**0.5, 0, 0, 0.5**0.5]])
    assert_close(result, expected, dtype, 4)
