"""Functions of symmetric matrices, and linear systems, against 40 digits."""

import numpy as np
import pytest

import warp as wp
from builtin_values import MANTISSA_BITS, apply, rounded

mp = pytest.importorskip("mpmath")

PRECISE = [wp.float32, wp.float64]


def unit_roundoff(dtype):
    return 2.0 ** -(MANTISSA_BITS[dtype] + 1)


def with_eigenvalues(values, dtype, count=20):
    q = np.linalg.qr(np.random.default_rng(3).normal(size=(count, 3, 3)))[0]
    a = q * np.array(values) @ q.transpose(0, 2, 1)
    return rounded((a + a.transpose(0, 2, 1)) / 2, dtype)


def exactly(function, a):
    """The function of the eigenvalues, in 40 digits."""
    mp.mp.dps = 40
    results = []
    for matrix in a:
        d, q = mp.eigsy(mp.matrix(matrix.tolist()))
        values = mp.diag([function(x) for x in d])
        results.append(np.array((q * values * q.T).tolist(), dtype=float).reshape(3, 3))
    return np.array(results)


@pytest.mark.parametrize("dtype", PRECISE)
@pytest.mark.parametrize("values", [(1, 1, 1), (2, 2, 1), (3, 0.5, 0.25), (1, 1 + 1e-5, 2)])
@pytest.mark.parametrize("name", ["sqrt", "log", "exp"])
def test_functions_of_symmetric_matrices(dtype, values, name):
    a = with_eigenvalues(values, dtype)
    mat = wp.types.matrix((3, 3), dtype)
    result = apply(getattr(wp, f"sym_{name}3"), [a], [mat], mat, "cpu")
    exact = exactly(getattr(mp, name), a)
    error = np.abs(result - exact).max() / max(1.0, np.abs(exact).max())
    assert error <= 40 * unit_roundoff(dtype)
    np.testing.assert_array_equal(result, result.transpose(0, 2, 1))


@pytest.mark.parametrize("dtype", PRECISE)
def test_root_of_singular_matrix(dtype):
    a = with_eigenvalues((1, 1e-9 if dtype is wp.float32 else 1e-18, 0), dtype)
    mat = wp.types.matrix((3, 3), dtype)
    root = apply(wp.sym_sqrt3, [a], [mat], mat, "cpu")
    assert np.abs(root @ root - a).max() <= 20 * unit_roundoff(dtype)
    negative = with_eigenvalues((1, 0.5, -0.5), dtype, 1)
    assert np.isnan(apply(wp.sym_sqrt3, [negative], [mat], mat, "cpu")).any()


@pytest.mark.parametrize("dtype", PRECISE)
@pytest.mark.parametrize("n", [2, 3, 4])
@pytest.mark.parametrize("condition", [1e1, 1e3, 1e6])
@pytest.mark.parametrize("scale", [1.0, 1e-30, 1e30])
def test_backward_error_of_linear_systems(dtype, n, condition, scale):
    rng = np.random.default_rng(n)
    left, right = (np.linalg.qr(rng.normal(size=(200, n, n)))[0] for _ in range(2))
    a = rounded(left * np.geomspace(1, 1 / condition, n) @ right * scale, dtype)
    b = rounded(rng.normal(size=(200, n)), dtype)
    types = [wp.types.matrix((n, n), dtype), wp.types.vector(n, dtype)]
    x = apply(getattr(wp, f"solve{n}"), [a, b], types, types[1], "cpu")
    residual = np.linalg.norm(np.einsum("kij,kj->ki", a, x) - b, axis=1)
    size = np.linalg.norm(a, axis=(1, 2)) * np.linalg.norm(x, axis=1) + np.linalg.norm(b, axis=1)
    assert (residual / size).max() <= 4 * unit_roundoff(dtype)


@pytest.mark.parametrize("n", [2, 3, 4])
def test_singular_and_permuted_systems(n):
    types = [wp.types.matrix((n, n), wp.float32), wp.types.vector(n, wp.float32)]
    b = np.arange(1.0, n + 1)
    rows = np.roll(np.eye(n), 1, axis=0)
    singular = np.outer(b, b)
    x = apply(getattr(wp, f"solve{n}"), [[rows, singular, 0 * rows], [b, b, b]], types, types[1],
              "cpu")  # fmt: skip
    np.testing.assert_array_equal(x, [rows.T @ b, 0 * b, 0 * b])
