"""Vectors and matrices against float64, 60-digit arithmetic where that is not enough."""

import numpy as np
import pytest

import warp as wp
from builtin_values import FLOATS, MANTISSA_BITS, apply, assert_ulps, rounded

mp = pytest.importorskip("mpmath")

SHAPES = [2, 3, 4]


def unit_roundoff(dtype):
    return 2.0 ** -(MANTISSA_BITS[dtype] + 1)


def vec(n, dtype):
    return wp.types.vector(length=n, dtype=dtype)


def mat(rows, cols, dtype):
    return wp.types.matrix(shape=(rows, cols), dtype=dtype)


def normal(shape, dtype, seed=5):
    return rounded(np.random.default_rng(seed).normal(size=shape), dtype)


@pytest.mark.parametrize("dtype", FLOATS)
@pytest.mark.parametrize("n", [2, 3, 4, 6])
def test_products_of_vectors(device, dtype, n):
    a, b = normal((200, n), dtype, 1), normal((200, n), dtype, 2)
    types = [vec(n, dtype)] * 2
    tolerance = 2 * n * unit_roundoff(dtype)
    magnitude = np.abs(a * b).sum(1)
    result = apply(wp.dot, [a, b], types, dtype, device)
    assert np.all(np.abs(result - (a * b).sum(1)) <= tolerance * magnitude)
    result = apply(wp.outer, [a, b], types, mat(n, n, dtype), device)
    assert_ulps(result, a[:, :, None] * b[:, None, :], dtype, 0.5)
    result = apply(wp.cw_mul, [a, b], types, types[0], device)
    assert_ulps(result, a * b, dtype, 0.5)
    result = apply(wp.cw_div, [a, b], types, types[0], device)
    assert_ulps(result, a / b, dtype, 0.5)
    if n == 3:
        result = apply(wp.cross, [a, b], types, types[0], device)
        bound = np.abs(a)[:, [1, 2, 0]] * np.abs(b)[:, [2, 0, 1]]
        bound += np.abs(a)[:, [2, 0, 1]] * np.abs(b)[:, [1, 2, 0]]
        assert np.all(np.abs(result - np.cross(a, b)) <= 3 * unit_roundoff(dtype) * bound)


@pytest.mark.parametrize("dtype", FLOATS)
@pytest.mark.parametrize("shape", [(2, 2, 2), (3, 3, 3), (2, 3, 4), (4, 4, 1)])
def test_products_of_matrices(device, dtype, shape):
    m, k, n = shape
    a, b = normal((50, m, k), dtype, 1), normal((50, k, n), dtype, 2)
    result = apply(wp.mul, [a, b], [mat(m, k, dtype), mat(k, n, dtype)], mat(m, n, dtype), device)
    bound = 2 * k * unit_roundoff(dtype) * (np.abs(a) @ np.abs(b))
    assert np.all(np.abs(result - a @ b) <= bound)
    v = normal((50, k), dtype, 3)
    result = apply(wp.mul, [a, v], [mat(m, k, dtype), vec(k, dtype)], vec(m, dtype), device)
    bound = 2 * k * unit_roundoff(dtype) * np.einsum("ijk,ik->ij", np.abs(a), np.abs(v))
    assert np.all(np.abs(result - np.einsum("ijk,ik->ij", a, v)) <= bound)


# Lengths whose squares overflow, vanish or lose digits: (3, 4) scaled by these.
SCALES = {
    wp.float16: [2.0**-20, 1e-3, 1.0, 1e4],
    wp.bfloat16: [1e-38, 1e-25, 1.0, 1e25, 5e37],
    wp.float32: [2.0**-149, 1e-38, 1e-23, 1e-10, 1.0, 1e10, 1e19, 1e25, 6e37],
    wp.float64: [2.0**-1074, 1e-308, 1e-200, 1e-100, 1.0, 1e100, 1e200, 3e307],
}


@pytest.mark.parametrize("dtype", FLOATS)
def test_length_without_overflow_or_underflow(device, dtype):
    v = rounded([[3 * s, 4 * s, 0] for s in SCALES[dtype]] + [[0, 0, 0]], dtype)
    exact = [float(mp.sqrt(sum(mp.mpf(x) ** 2 for x in row))) for row in v]
    result = apply(wp.length, [v], [vec(3, dtype)], dtype, device)
    assert_ulps(result, exact, dtype, 2)
    result = apply(wp.normalize, [v], [vec(3, dtype)], vec(3, dtype), device)
    assert not result[-1].any()
    exact = [[float(x / mp.sqrt(sum(mp.mpf(y) ** 2 for y in row))) for x in row] for row in v[:-1]]
    assert_ulps(result[:-1], exact, dtype, 3)


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
def test_length_of_nan_and_infinity(device, dtype):
    v = [[np.nan, 1.0], [np.inf, 1.0], [-np.inf, np.inf]]
    result = apply(wp.length, [v], [vec(2, dtype)], dtype, device)
    np.testing.assert_array_equal(result, [np.nan, np.inf, np.inf])


def test_place_of_extremum_passes_over_nan(device):
    nan = np.nan
    v = [[3.0, 1.0, 1.0], [nan, 2.0, 5.0], [2.0, nan, 1.0], [nan, nan, nan], [nan, nan, 7.0]]
    types = [vec(3, wp.float32)]
    result = apply(wp.argmin, [v], types, wp.uint32, device)
    np.testing.assert_array_equal(result, [1, 1, 2, 0, 2])
    result = apply(wp.argmax, [v], types, wp.uint32, device)
    np.testing.assert_array_equal(result, [0, 2, 0, 0, 2])
    result = apply(wp.min, [v], types, wp.float32, device)
    np.testing.assert_array_equal(result, [1, 2, 1, nan, 7])


def exact_determinant(m):
    return mp.det(mp.matrix(m.tolist()))


@pytest.mark.parametrize("dtype", FLOATS)
@pytest.mark.parametrize("n", SHAPES)
def test_determinant_and_inverse(device, dtype, n):
    mp.mp.dps = 60
    m = normal((60, n, n), dtype, n)
    u = unit_roundoff(dtype)
    result = apply(wp.determinant, [m], [mat(n, n, dtype)], dtype, device)
    size = np.array([np.prod(np.linalg.norm(x, axis=1)) for x in m])
    exact = np.array([float(exact_determinant(x)) for x in m])
    assert np.all(np.abs(result - exact) <= 8 * u * size)
    result = apply(wp.inverse, [m], [mat(n, n, dtype)], mat(n, n, dtype), device)
    for x, inverse in zip(m, result):
        exact = np.array((mp.matrix(x.tolist()) ** -1).tolist(), dtype=float)
        condition = np.linalg.norm(x) * np.linalg.norm(exact)
        assert np.linalg.norm(inverse - exact) <= 8 * u * condition * np.linalg.norm(exact)


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
@pytest.mark.parametrize("n", SHAPES)
def test_inverse_at_every_scale(device, dtype, n):
    scales = [1e-15, 1e15, 1e-30, 1e20, 2.0**-120]
    m = np.array([np.eye(n) * s for s in scales])
    result = apply(wp.inverse, [m], [mat(n, n, dtype)], mat(n, n, dtype), device)
    exact = np.array([np.eye(n) / x[0, 0] for x in rounded(m, dtype)])
    assert_ulps(result, exact, dtype, 3)


@pytest.mark.parametrize("n", SHAPES)
def test_inverse_of_singular_matrix_is_zero(device, n):
    rank_one = np.outer(np.arange(1, n + 1), np.arange(2, n + 2))
    counted = np.arange(n * n).reshape(n, n) if n > 2 else np.ones((2, 2))
    m = np.array([np.zeros((n, n)), rank_one, counted], float)
    result = apply(wp.inverse, [m], [mat(n, n, wp.float32)], mat(n, n, wp.float32), device)
    assert not result.any()


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
def test_hilbert_matrix(device, dtype):
    h = rounded([[1 / (i + j + 1) for j in range(3)] for i in range(3)], dtype)
    exact = float(exact_determinant(h))
    result = apply(wp.determinant, [h[None]], [mat(3, 3, dtype)], dtype, device)
    assert_ulps(result, [exact], dtype, 60)


@pytest.mark.parametrize("dtype", [wp.int32, wp.float32])
def test_rearrangements(device, dtype):
    m = np.arange(12).reshape(1, 3, 4)
    result = apply(wp.transpose, [m], [mat(3, 4, dtype)], mat(4, 3, dtype), device)
    np.testing.assert_array_equal(result[0], m[0].T)
    square = np.arange(9).reshape(1, 3, 3)
    assert apply(wp.trace, [square], [mat(3, 3, dtype)], dtype, device)[0] == 12
    result = apply(wp.get_diag, [square], [mat(3, 3, dtype)], vec(3, dtype), device)
    np.testing.assert_array_equal(result[0], [0, 4, 8])
    result = apply(wp.diag, [[[1, 2, 3]]], [vec(3, dtype)], mat(3, 3, dtype), device)
    np.testing.assert_array_equal(result[0], np.diag([1, 2, 3]))
    result = apply(wp.skew, [[[1, 2, 3]]], [vec(3, dtype)], mat(3, 3, dtype), device)
    np.testing.assert_array_equal(result[0], [[0, -3, 2], [3, 0, -1], [-2, 1, 0]])
