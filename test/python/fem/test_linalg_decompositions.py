"""QR, Hessenberg form, inverse and parts of tensors in kernels, against NumPy in float64."""

import numpy as np
import pytest

import warp as wp
from warp.fem import linalg


def matrices(n):
    rng = np.random.default_rng(n)
    x = rng.normal(size=(12, n, n))
    x[3] *= 1e-200
    x[4] *= 1e150
    x[5] = np.triu(x[5])
    return x


def run(name, inputs, count_of_results, n):
    matrix, vector = wp.types.matrix((n, n), wp.float64), wp.types.vector(n, wp.float64)
    function = getattr(linalg, name)

    @wp.kernel(module="unique")
    def two(a: wp.array(dtype=matrix), x: wp.array(dtype=matrix), y: wp.array(dtype=matrix)):
        i = wp.tid()
        x[i], y[i] = function(a[i])

    @wp.kernel(module="unique")
    def one(a: wp.array(dtype=matrix), x: wp.array(dtype=matrix), y: wp.array(dtype=matrix)):
        i = wp.tid()
        x[i] = function(a[i])

    a = wp.array(inputs, dtype=matrix, device="cpu")
    x, y = wp.zeros_like(a), wp.zeros_like(a)
    wp.launch({1: one, 2: two}[count_of_results], len(a), [a, x, y], device="cpu")
    return (x.numpy(), y.numpy()) if vector and count_of_results == 2 else x.numpy()


@pytest.mark.parametrize("n", [2, 3, 5])
@pytest.mark.parametrize("name", ["householder_qr_decomposition", "householder_make_hessenberg"])
def test_orthogonal_decompositions(name, n):
    a = matrices(n)
    Q, R = run(name, a, 2, n)
    scale = np.abs(a).max(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(Q @ Q.transpose(0, 2, 1), np.tile(np.eye(n), (12, 1, 1)), atol=1e-14)
    product = Q @ R if "qr" in name else Q @ R @ Q.transpose(0, 2, 1)
    np.testing.assert_allclose(product / scale, a / scale, atol=4e-14)
    below = -1 if "qr" in name else -2
    np.testing.assert_allclose(np.tril(R / scale, below), 0.0, atol=4e-15)


@pytest.mark.parametrize("n", [2, 4])
def test_inverse(n):
    a = matrices(n)
    a[4] = np.eye(n)
    np.testing.assert_allclose(run("inverse_qr", a, 1, n) @ a, [np.eye(n)] * 12, atol=1e-11)


def test_parts_of_a_tensor():
    @wp.kernel(module="unique")
    def parts(a: wp.array(dtype=wp.mat33), x: wp.array(dtype=wp.mat33), w: wp.array(dtype=wp.vec3)):
        x[0] = linalg.symmetric_part(a[0])
        x[1] = linalg.spherical_part(a[0])
        w[0] = linalg.skew_part(a[0])
        w[1] = linalg.generalized_inner(a[0], wp.vec3(1.0, 2.0, 3.0))
        x[2] = linalg.generalized_outer(w[0], w[1])
        w[2] = linalg.generalized_outer(2.0, w[1])

    a = np.arange(9.0).reshape(3, 3) ** 2
    x, w = (wp.zeros(3, dtype=t, device="cpu") for t in (wp.mat33, wp.vec3))
    wp.launch(parts, 1, [wp.array(a[None], dtype=wp.mat33, device="cpu"), x, w], device="cpu")
    skew = 0.5 * np.array([a[2, 1] - a[1, 2], a[0, 2] - a[2, 0], a[1, 0] - a[0, 1]])
    inner = np.array([1, 2, 3]) @ a
    np.testing.assert_allclose(x.numpy()[0], (a + a.T) / 2)
    np.testing.assert_allclose(x.numpy()[1], np.trace(a) / 3 * np.eye(3), rtol=1e-6)
    np.testing.assert_allclose(w.numpy(), [skew, inner, 2 * inner])
    np.testing.assert_allclose(x.numpy()[2], np.outer(skew, inner))


def test_eigenvalues_of_a_tridiagonal_matrix():
    n = 4
    matrix, vector = wp.types.matrix((n, n), wp.float64), wp.types.vector(n, wp.float64)

    @wp.kernel(module="unique")
    def eigen(d: vector, low: vector, out: wp.array(dtype=vector), rows: wp.array(dtype=matrix)):
        one = wp.identity(n=4, dtype=wp.float64)
        values, vectors = linalg.tridiagonal_symmetric_eigenvalues_qr(d, low, one, wp.float64(0.0))
        out[0] = values
        rows[0] = vectors

    d, low = [2.0, -1.0, 0.5, 3.0], [1.0, 0.25, 2.0, 0.0]
    out, rows = (wp.zeros(1, dtype=t, device="cpu") for t in (vector, matrix))
    wp.launch(eigen, 1, [vector(*d), vector(*low), out, rows], device="cpu")
    A = np.diag(d) + np.diag(low[:3], 1) + np.diag(low[:3], -1)
    P = rows.numpy()[0]
    np.testing.assert_allclose(P.T @ np.diag(out.numpy()[0]) @ P, A, atol=1e-13)
