"""Norms, twists of rotations, and matrices of transforms."""

import numpy as np
import pytest
from test_values_rotations import (
    KINDS,
    assert_close,
    matrix,
    product,
    random_quats,
    random_vectors,
    unit_roundoff,
)

import warp as wp
from builtin_values import apply, assert_ulps, rounded

DTYPES = [wp.float32, wp.float64]


@pytest.mark.parametrize("dtype", DTYPES)
def test_norms(device, dtype):
    vec = KINDS[dtype][0]
    v = np.concatenate([random_vectors(dtype), np.zeros((1, 3))])
    norm = np.linalg.norm(v, axis=1)
    delta = rounded(np.full(len(v), 0.7), dtype)
    huber = np.where(norm <= delta, norm**2 / 2, delta * (norm - delta / 2))
    for name, types, operands, expected in (
        ("norm_l1", [vec], [v], np.abs(v).sum(1)),
        ("norm_l2", [vec], [v], norm),
        ("length_sq", [vec], [v], norm**2),
        ("norm_huber", [vec, dtype], [v, delta], huber),
        ("norm_pseudo_huber", [vec, dtype], [v, delta], np.hypot(norm, delta)),
    ):
        result = apply(getattr(wp, name), operands, types, dtype, device)
        assert_ulps(result, expected, dtype, 6)
    result = apply(wp.smooth_normalize, [v, delta], [vec, dtype], vec, device)
    assert_close(result, v / np.hypot(norm, delta)[:, None], dtype, 6)


@pytest.mark.parametrize("dtype", DTYPES)
def test_twist_and_swing(device, dtype):
    vec, quat, *_ = KINDS[dtype]
    q, axis = random_quats(dtype), random_vectors(dtype)
    axis = rounded(axis / np.linalg.norm(axis, axis=1)[:, None], dtype)
    along = (axis * q[:, :3]).sum(1)
    twist = np.concatenate([axis * along[:, None], q[:, 3:]], 1)
    twist /= np.linalg.norm(twist, axis=1)[:, None]
    result = apply(wp.quat_twist, [axis, q], [vec, quat], quat, device)
    # Where the turn is nearly half a turn about another axis, the twist is ill-conditioned.
    good = np.hypot(along, q[:, 3]) > 0.1
    assert_close(result[good], twist[good], dtype, 100)
    for name, expected in (
        ("quat_twist_angle", 2 * np.arctan2(np.abs(along), q[:, 3])),
        ("quat_twist_angle_signed", 2 * np.arctan2(along, q[:, 3])),
    ):
        result = apply(getattr(wp, name), [axis, q], [vec, quat], dtype, device)
        assert_close(result[good], expected[good], dtype, 100)


@pytest.mark.parametrize("dtype", DTYPES)
def test_roll_pitch_yaw_and_back(device, dtype):
    """Also where the pitch is nearly a right angle, where arc sine loses half of the digits."""
    vec, quat, *_ = KINDS[dtype]
    angles = np.random.default_rng(4).uniform(-1.5, 1.5, (50, 3))
    angles[:4, 1] = [1.57, -1.57, 1.5705, -1.5705]
    turns = [
        np.concatenate([e * np.sin(a[:, None] / 2), np.cos(a[:, None] / 2)], 1)
        for e, a in zip(np.eye(3), angles.T)
    ]
    q = rounded(product(turns[2], product(turns[1], turns[0])), dtype)
    result = apply(wp.quat_to_rpy, [q], [quat], vec, device)
    limit = 16 * unit_roundoff(dtype) / np.cos(angles[:, 1])
    assert np.all(np.abs(result - angles).max(1) <= limit + 4 * unit_roundoff(dtype))


def compose(p, q, s):
    m = np.zeros((len(p), 4, 4))
    m[:, :3, :3], m[:, :3, 3], m[:, 3, 3] = matrix(q) * s[:, None, :], p, 1
    return m


@pytest.mark.parametrize("dtype", DTYPES)
def test_matrices_of_transforms(device, dtype):
    vec, quat, _, transform, mat44 = KINDS[dtype]
    p, q = random_vectors(dtype), random_quats(dtype)
    q *= np.sign(q[:, 3:])
    s = rounded(np.random.default_rng(1).uniform(0.5, 2, (len(p), 3)), dtype)
    result = apply(wp.transform_compose, [p, q, s], [vec, quat, vec], mat44, device)
    assert_close(result, compose(p, q, s), dtype, 8)
    t, one = np.concatenate([p, q], 1), np.ones_like(s)
    result = apply(wp.transform_to_matrix, [t], [transform], mat44, device)
    assert_close(result, compose(p, q, one), dtype, 8)
    m = rounded(compose(p, q, one), dtype)
    result = apply(wp.transform_from_matrix, [m], [mat44], transform, device)
    result[:, 3:] *= np.sign((result[:, 3:] * q).sum(1))[:, None]
    assert_close(result, t, dtype, 16)


@pytest.mark.parametrize("dtype", DTYPES)
def test_decompose(device, dtype):
    vec, quat, _, _, mat44 = KINDS[dtype]

    @wp.kernel
    def take_apart(
        m: wp.array(dtype=mat44),
        p: wp.array(dtype=vec),
        q: wp.array(dtype=quat),
        s: wp.array(dtype=vec),
    ):
        i = wp.tid()
        a, b, c = wp.transform_decompose(m[i])
        p[i] = a
        q[i] = b
        s[i] = c

    position, rotation = random_vectors(dtype), random_quats(dtype)
    scale = np.random.default_rng(1).uniform(0.5, 2, position.shape)
    m = rounded(compose(position, rotation, scale), dtype)
    source = wp.array(m, dtype=mat44, device=device)
    p, q, s = (wp.zeros(len(m), dtype=kind, device=device) for kind in (vec, quat, vec))
    wp.launch(take_apart, dim=len(m), inputs=[source], outputs=[p, q, s], device=device)
    np.testing.assert_array_equal(p.numpy(), position)
    assert_close(s.numpy(), scale, dtype, 8)
    sign = np.sign((q.numpy() * rotation).sum(1))[:, None]
    assert_close(q.numpy() * sign, rotation, dtype, 16)


@pytest.mark.parametrize("dtype", DTYPES)
def test_product_of_matrix_components(device, dtype):
    mat = KINDS[dtype][2]
    a, b = (rounded(np.random.default_rng(i).normal(size=(50, 3, 3)), dtype) for i in (1, 2))
    result = apply(wp.ddot, [a, b], [mat, mat], dtype, device)
    bound = 18 * unit_roundoff(dtype) * np.abs(a * b).sum((1, 2))
    assert np.all(np.abs(result - (a * b).sum((1, 2))) <= bound)
