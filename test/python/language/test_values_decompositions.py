"""Decompositions against what defines them, in float64: reconstruction, orthogonality, order."""

import numpy as np
import pytest

import warp as wp
from builtin_values import MANTISSA_BITS, rounded, to_numpy

PRECISE = [wp.float32, wp.float64]


def unit_roundoff(dtype):
    return 2.0 ** -(MANTISSA_BITS[dtype] + 1)


def matrices(dtype, n=3, count=300):
    """Matrices of every kind: random, near and at degenerate ones, of extreme scale."""
    rng = np.random.default_rng(n)

    def normal():
        return rng.normal(size=(count, n, n))

    def with_values(*values):
        left, right = np.linalg.qr(normal())[0], np.linalg.qr(normal())[0]
        return left * np.array(values[-n:]) @ right

    eye = np.broadcast_to(np.eye(n), (count, n, n))
    signs = rng.integers(-1, 2, size=(count, n, n)).astype(float)
    families = [
        *(normal(), eye + 1e-4 * normal(), eye + 1e-7 * normal(), 1 + 1e-7 * normal()),
        *(with_values(1, 1, 1), with_values(2, 2, 1), with_values(2, 1, 1), with_values(1, 1, -1)),
        *(with_values(1, 0, 0), with_values(1, 1, 0), with_values(1, 1e-6, 1e-12)),
        *(signs, signs * 10.0 ** rng.integers(-30, 1, size=signs.shape)),
        *(normal() * scale for scale in (1e-36, 1e-20, 1e-10, 1e-15, 1e12, 1e15, 1e19, 1e35)),
        *(eye[:4], 0 * eye[:1], 1 + 0 * eye[:1], np.diag([1.0, 1, 0][-n:])[None], -eye[:1]),
        *([np.diag(d)[None] for d in ([1e-4, 1e-5, 1e-6][-n:], [1.0, -1, 1][-n:])]),
    ]
    if dtype is wp.float64:
        families += [normal() * 1e-150, normal() * 1e150, normal() * 1e-300]
    return rounded(np.concatenate(families), dtype)


def run(function, operands, types, results):
    """Results of a builtin with several results."""
    count = len(operands[0])
    arrays = [wp.array(x, dtype=t) for x, t in zip(operands, types)]
    outputs = [wp.zeros(count, dtype=t) for t in results]
    if len(results) == 2:
        first, second = results

        @wp.kernel
        def two(a: wp.array(dtype=types[0]), x: wp.array(dtype=first), y: wp.array(dtype=second)):
            i = wp.tid()
            p, q = function(a[i])
            x[i] = p
            y[i] = q

        wp.launch(two, dim=count, inputs=arrays, outputs=outputs)
        return [to_numpy(x) for x in outputs]
    first, second, third = results

    @wp.kernel
    def three(
        a: wp.array(dtype=types[0]),
        x: wp.array(dtype=first),
        y: wp.array(dtype=second),
        z: wp.array(dtype=third),
    ):
        i = wp.tid()
        p, q, r = function(a[i])
        x[i] = p
        y[i] = q
        z[i] = r

    wp.launch(three, dim=count, inputs=arrays, outputs=outputs)
    return [to_numpy(x) for x in outputs]


def transposed(m):
    return m.transpose(0, 2, 1)


def off_by(product, m, dtype):
    """Largest distance of products from matrices, in unit roundoffs of the norm."""
    largest = np.abs(m).max(axis=(1, 2), keepdims=True)
    largest[largest == 0] = 1.0
    distance = np.linalg.norm((product - m) / largest, axis=(1, 2))
    norm = np.linalg.norm(m / largest, axis=(1, 2))
    return (distance / np.maximum(norm, 1.0)).max() / unit_roundoff(dtype)


def skewness(q, dtype):
    """How far from orthonormal the columns are, in unit roundoffs."""
    return np.abs(transposed(q) @ q - np.eye(q.shape[1])).max() / unit_roundoff(dtype)


def types_of(dtype, n):
    return wp.types.matrix((n, n), dtype), wp.types.vector(n, dtype)


@pytest.mark.parametrize("dtype", PRECISE)
def test_svd3(dtype):
    a = matrices(dtype)
    mat, vec = types_of(dtype, 3)
    u, s, v = run(wp.svd3, [a], [mat], [mat, vec, mat])
    assert off_by(u * s[:, None, :] @ transposed(v), a, dtype) <= 12
    assert skewness(u, dtype) <= 12 and skewness(v, dtype) <= 12
    assert np.all(np.linalg.det(u) > 0) and np.all(np.linalg.det(v) > 0)
    slack = 12 * unit_roundoff(dtype) * s[:, 0]
    assert np.all(s[:, 0] + slack >= s[:, 1]) and np.all(s[:, 1] + slack >= np.abs(s[:, 2]))
    assert np.all(s[:, 1] >= 0)


@pytest.mark.parametrize("dtype", PRECISE)
def test_singular_values_are_those_of_lapack(dtype):
    a = matrices(dtype)
    mat, vec = types_of(dtype, 3)
    _, s, _ = run(wp.svd3, [a], [mat], [mat, vec, mat])
    norm = np.abs(a).max(axis=(1, 2)) + (np.abs(a).max(axis=(1, 2)) == 0)
    exact = np.linalg.svd(a / norm[:, None, None], compute_uv=False) * norm[:, None]
    error = np.abs(np.abs(s) - exact).max(axis=1) / norm
    # LAPACK in float64 is a reference of 60 roundoffs itself.
    assert error.max() <= (12 if dtype is wp.float32 else 64) * unit_roundoff(dtype)


def test_small_singular_values_keep_their_digits():
    a = np.array([np.diag([1.0, 1e-9, 1e-15]), [[1, 1e-9, 0], [0, 1e-9, 0], [0, 0, 1e-18]]])
    mat, vec = types_of(wp.float32, 3)
    _, s, _ = run(wp.svd3, [a], [mat], [mat, vec, mat])
    np.testing.assert_allclose(s, [[1, 1e-9, 1e-15], [1, 1e-9, 1e-18]], rtol=4e-7)


@pytest.mark.parametrize("dtype", PRECISE)
def test_svd2(dtype):
    a = matrices(dtype, 2)
    mat, vec = types_of(dtype, 2)
    u, s, v = run(wp.svd2, [a], [mat], [mat, vec, mat])
    assert off_by(u * s[:, None, :] @ transposed(v), a, dtype) <= 8
    assert skewness(u, dtype) <= 8 and skewness(v, dtype) <= 8
    slack = 1 + 8 * unit_roundoff(dtype)
    assert np.all(s[:, 0] * slack >= s[:, 1]) and np.all(s >= 0)


@pytest.mark.parametrize("dtype", PRECISE)
def test_qr3(dtype):
    a = matrices(dtype)
    mat, _ = types_of(dtype, 3)
    q, r = run(wp.qr3, [a], [mat], [mat, mat])
    assert off_by(q @ r, a, dtype) <= 20
    assert skewness(q, dtype) <= 18
    assert np.all(np.linalg.det(q) > 0)
    assert not np.tril(r, -1).any()
    assert np.all(r[:, 0, 0] >= 0) and np.all(r[:, 1, 1] >= 0)


@pytest.mark.parametrize("dtype", PRECISE)
def test_eig3(dtype):
    a = matrices(dtype)
    a = rounded((a + transposed(a)) / 2, dtype)
    mat, vec = types_of(dtype, 3)
    q, d = run(wp.eig3, [a], [mat], [mat, vec])
    assert off_by(q * d[:, None, :] @ transposed(q), a, dtype) <= 12
    assert skewness(q, dtype) <= 12
    assert np.all(np.linalg.det(q) > 0)
    assert np.all(np.diff(d, axis=1) <= 0)


@pytest.mark.parametrize("dtype", PRECISE)
def test_polar(dtype):
    a = matrices(dtype)
    mat, _ = types_of(dtype, 3)
    r, s = run(wp.polar, [a], [mat], [mat, mat])
    assert off_by(r @ s, a, dtype) <= 12
    assert skewness(r, dtype) <= 8
    assert np.all(np.linalg.det(r) > 0)
    np.testing.assert_array_equal(s, transposed(s))


def test_identity_is_exact():
    r, s = wp.polar(wp.mat33(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))
    assert list(r) == list(s) == [wp.vec3(1.0, 0.0, 0.0), wp.vec3(0.0, 1.0, 0.0), wp.vec3(0, 0, 1)]
    _, sigma, _ = wp.svd3(r)
    assert list(sigma) == [1.0, 1.0, 1.0]


def test_results_as_parameters():
    a = rounded([[[1, 2, 3], [4, 5, 6], [7, 8, 10]]], wp.float32)

    @wp.kernel
    def decompose(
        a: wp.array(dtype=wp.mat33), m: wp.array(dtype=wp.mat33), s: wp.array(dtype=wp.vec3)
    ):
        u, v, q, r, p = wp.mat33(), wp.mat33(), wp.mat33(), wp.mat33(), wp.mat33()
        sigma, d = wp.vec3(), wp.vec3()
        wp.svd3(a[0], u, sigma, v)
        m[0] = u * wp.diag(sigma) * wp.transpose(v)
        wp.qr3(a[0], q, r)
        m[1] = q * r
        wp.polar(a[0], r, p)
        m[2] = r * p
        wp.eig3(p, q, d)
        m[3] = r * q * wp.diag(d) * wp.transpose(q)
        s[0] = sigma
        s[1] = d

    m, s = wp.zeros(4, dtype=wp.mat33), wp.zeros(2, dtype=wp.vec3)
    wp.launch(decompose, dim=1, inputs=[wp.array(a, dtype=wp.mat33)], outputs=[m, s])
    np.testing.assert_allclose(m.numpy(), np.repeat(a, 4, axis=0), rtol=2e-5)
    np.testing.assert_allclose(np.abs(s.numpy()[0]), np.sort(np.abs(s.numpy()[1]))[::-1], rtol=1e-4)
