"""Functions that keep their digits, against 40-digit arithmetic."""

import numpy as np
import pytest

import warp as wp
from builtin_values import FLOATS, apply, assert_ulps, rounded

mp = pytest.importorskip("mpmath")

PRECISE = [wp.float32, wp.float64]
# Where plain formulas cancel, overflow or divide by zero.
HARD = [0.0, 1e-30, 1e-10, 1e-4, 1e-3, 0.1, 0.5, 1.0, 3.0, 20.0, 80.0, 700.0, 1e4]


@pytest.fixture(autouse=True)
def digits():
    with mp.workdps(40):
        yield


def exact(function, *operands):
    return [float(function(*(mp.mpf(float(x)) for x in row))) for row in zip(*operands)]


def softplus(x):
    return mp.log1p(mp.exp(x)) if x < 0 else x + mp.log1p(mp.exp(-x))


@pytest.mark.parametrize("dtype", FLOATS)
def test_functions_of_one_number(device, dtype):
    x = rounded(HARD + [-v for v in HARD], dtype)
    cases = {
        "softplus": (softplus, x, 4),
        "sinc": (mp.sinc, x[np.abs(x) <= 100], 6),
        "expm1": (mp.expm1, x[x < 80], 2),
        "log1p": (mp.log1p, x[x > -1], 2),
    }
    for name, (reference, operands, limit) in cases.items():
        result = apply(getattr(wp, name), [operands], [dtype], dtype, device)
        assert_ulps(result, exact(reference, operands), dtype, limit)


def test_softplus_of_infinity_and_nan(device):
    x = [np.inf, -np.inf, np.nan]
    result = apply(wp.softplus, [x], [wp.float32], wp.float32, device)
    np.testing.assert_array_equal(result, [np.inf, 0, np.nan])


@pytest.mark.parametrize("dtype", PRECISE)
def test_hypot(device, dtype):
    huge = 1e38 if dtype is wp.float32 else 1e308
    x = rounded([3.0, 3e-30, 3e25, 0.0, huge, 1e-40], dtype)
    y = rounded([4.0, 4e-30, 4e25, 0.0, huge, 0.0], dtype)
    result = apply(wp.hypot, [x, y], [dtype, dtype], dtype, device)
    assert_ulps(result, exact(mp.hypot, x, y), dtype, 2)


@pytest.mark.parametrize("dtype", PRECISE)
def test_logsumexp(device, dtype):
    x = [[0, 0, 0], [1e4, 1e4, -1e4], [-1e4, -1e4 + 1, -1e4], [0, -30, -31], [5, 5, 2], [-9, 3, 3]]
    x = rounded(x, dtype)
    vec = wp.types.vector(3, dtype)
    result = apply(wp.logsumexp, [x], [vec], dtype, device)
    reference = [float(mp.log(sum(mp.exp(mp.mpf(v)) for v in row))) for row in x]
    assert_ulps(result, reference, dtype, 4)
    x = [[np.inf, 0, np.inf], [-np.inf] * 3, [-np.inf, 1.0, -np.inf], [0.0, np.nan, 1.0]]
    result = apply(wp.logsumexp, [x], [vec], dtype, device)
    np.testing.assert_array_equal(result, [np.inf, -np.inf, 1.0, np.nan])


@pytest.mark.parametrize("dtype", PRECISE)
@pytest.mark.parametrize("n", [2, 3, 4])
def test_angle_between(device, dtype, n):
    rng = np.random.default_rng(n)
    angles = np.array([1e-12, 1e-6, 1e-3, 0.5, 1.57, 3.0, 3.14159])
    a = rng.normal(size=(len(angles), n))
    away = np.linalg.qr(np.stack([a, rng.normal(size=a.shape)], axis=2))[0][:, :, 1]
    unit = a / np.linalg.norm(a, axis=1, keepdims=True)
    b = np.cos(angles)[:, None] * unit + np.sin(angles)[:, None] * away
    a = rounded(np.concatenate([a, 1e-18 * a]), dtype)
    b = rounded(np.concatenate([b, 1e18 * b]), dtype)
    reference = []
    for p, q in zip(a, b):
        p, q = ([mp.mpf(x) for x in v] for v in (p, q))
        minors = [p[i] * q[j] - p[j] * q[i] for i in range(n) for j in range(i)]
        sine = mp.sqrt(sum(m**2 for m in minors))
        reference.append(float(mp.atan2(sine, sum(x * y for x, y in zip(p, q)))))
    vec = wp.types.vector(n, dtype)
    result = apply(wp.angle_between, [a, b], [vec, vec], dtype, device)
    np.testing.assert_allclose(result, reference, rtol=1e-6 if dtype is wp.float32 else 2e-15)
    zero = apply(wp.angle_between, [0 * a, b], [vec, vec], dtype, device)
    assert not zero.any()


@pytest.mark.parametrize("dtype", PRECISE)
def test_rotation_vectors(device, dtype):
    quat = {wp.float32: wp.quatf, wp.float64: wp.quatd}[dtype]
    vec = wp.types.vector(3, dtype)
    tolerance = 1e-6 if dtype is wp.float32 else 1e-15
    axes = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    angles = [0.0, 1e-20, 1e-12, 1e-5, 2e-4, 1e-3, 0.5, 2.0, 3.1, np.pi - 1e-5]
    v = rounded([angle * axis for angle in angles for axis in axes], dtype)
    q = apply(wp.quat_exp, [v], [vec], quat, device)
    angle = np.linalg.norm(v, axis=1)
    factor = np.where(angle < 1e-9, 0.5, np.sin(angle / 2) / np.maximum(angle, 1e-300))
    np.testing.assert_allclose(q[:, :3], factor[:, None] * v, rtol=4 * tolerance)
    np.testing.assert_allclose(q[:, 3], np.cos(angle / 2), rtol=tolerance, atol=tolerance)
    for scale in (1.0, -1.0, 2.0, -1e-15, 1e15):
        back = apply(wp.quat_log, [scale * q], [quat], vec, device)
        np.testing.assert_allclose(back, v, rtol=4 * tolerance, atol=1e-38)
    nothing = apply(wp.quat_log, [np.zeros((1, 4))], [quat], vec, device)
    assert not nothing.any()
