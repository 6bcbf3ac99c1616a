"""Conjugate gradients and residuals on negative definite matrices beside numpy.linalg.solve."""

import functools
import warnings

import numpy as np
import pytest

import warp as wp
import warp.sparse as sp
from warp.optim import linear

fused = functools.partial(linear.cg, fused=True)
SOLVERS = [linear.cg, fused, linear.cr]
KINDS = ["id", "diag", "diag_abs", "block_jacobi_direct", "block_jacobi_sequential", "fsai"]


def laplacian(n):
    """The second difference: -2 on the diagonal, so all eigenvalues lie in (-4, 0)."""
    return -2 * np.eye(n) + np.eye(n, k=1) + np.eye(n, k=-1)


def sparse(A, device, dtype=wp.float64, block=1):
    rows, cols = np.nonzero(A)
    values = wp.array(A[rows, cols], dtype=dtype, device=device)
    places = (wp.array(p, dtype=int, device=device) for p in (rows, cols))
    made = sp.bsr_from_triplets(*A.shape, *places, values)
    return made if block == 1 else sp.bsr_copy(made, block_shape=(block, block))


def solve(solver, A, b, device, **options):
    right = wp.array(b, dtype=wp.float64, device=device)
    x = wp.zeros(len(b), dtype=wp.float64, device=device)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        state = solver(A, right, x, run=False, tol=1e-12, **options)
        _, error, atol = state()
    assert error <= atol and state.breakdown is None
    return x.numpy()


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("block", [1, 2])
def test_definite_matrices_of_either_sign(device, solver, kind, sign, block):
    """Any preconditioner and block shape; no warning, and no more steps than for -A."""
    dense = -sign * laplacian(40)
    b = np.random.default_rng(1).standard_normal(40)
    A = sparse(dense, device, block=block)
    # Factors of an inverse are those of a positive definite one.
    M = linear.preconditioner(sign * A if kind == "fsai" else A, kind)
    x = solve(solver, A, b, device, M=M, maxiter=200)
    np.testing.assert_allclose(x, np.linalg.solve(dense, b), rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize("solver", SOLVERS)
def test_dense_matrices_diagonals_and_operators(device, solver):
    dense = laplacian(12) - np.diag(np.arange(12.0))
    diagonal = -np.arange(1.0, 13.0)
    b = np.linspace(-1, 2, 12)
    A = wp.array(dense, dtype=wp.float64, device=device)
    kept = linear.aslinearoperator(A)
    made = linear.LinearOperator(kept.shape, kept.dtype, kept.device, kept.matvec)
    for one in (A, made):
        x = solve(solver, one, b, device, maxiter=100)
        np.testing.assert_allclose(x, np.linalg.solve(dense, b), atol=1e-9)
    x = solve(solver, wp.array(diagonal, dtype=wp.float64, device=device), b, device, maxiter=99)
    np.testing.assert_allclose(x, b / diagonal, atol=1e-10)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("options", [{}, {"restart": 7}, {"check_every": 1}])
def test_each_system_of_a_batch_has_its_own_sign(device, solver, options):
    """The second of three independent systems is negative definite."""
    dense = np.kron(np.diag([1.0, -3.0, 2.0]), -laplacian(10))
    b = np.random.default_rng(2).standard_normal(30)
    offsets = wp.array([0, 10, 20, 30], dtype=int, device=device)
    A = linear.aslinearoperator(sparse(dense, device), offsets, 10)
    x = solve(solver, A, b, device, maxiter=280, **options)
    np.testing.assert_allclose(x, np.linalg.solve(dense, b), atol=1e-9)


def test_a_solver_forgets_the_sign_of_the_last_matrix(device):
    b = np.random.default_rng(3).standard_normal(20)
    dense = laplacian(20)
    right = wp.array(b, dtype=wp.float64, device=device)
    x = wp.zeros_like(right)
    state = linear.cg(sparse(dense, device), right, x, run=False, tol=1e-12, maxiter=99)
    for factor in (1.0, -1.0, 2.0):
        x.zero_()
        state(A=sparse(factor * dense, device))
        assert state.breakdown is None
        np.testing.assert_allclose(x.numpy(), np.linalg.solve(factor * dense, b), atol=1e-9)


def test_the_device_decides_alike(device):
    """Without checks by the host, as in a graph."""
    b = np.random.default_rng(4).standard_normal(20)
    right = wp.array(b, dtype=wp.float64, device=device)
    x = wp.zeros_like(right)
    A = sparse(laplacian(20), device)
    linear.cg(A, right, x, tol=1e-12, maxiter=99, check_every=0)
    np.testing.assert_allclose(x.numpy(), np.linalg.solve(laplacian(20), b), atol=1e-9)


@pytest.mark.parametrize("solver", SOLVERS[:2])
@pytest.mark.parametrize("signs", [(1.0, -1.0), (-1.0, 1.0)])
def test_indefinite_matrices_are_solved_or_named(device, solver, signs):
    """p^T A p changes its sign in the second iteration, whichever sign it had first."""
    diagonal = np.array([5 * signs[0], signs[1]])
    right = wp.array([1.0, 0.9], dtype=wp.float64, device=device)
    A = wp.array(diagonal, dtype=wp.float64, device=device)
    np.testing.assert_allclose(
        solve(solver, A, right.numpy(), device, maxiter=10), right.numpy() / diagonal, rtol=1e-9
    )
    dense = np.diag(np.linspace(-3.0, 4.0, 32))
    b = np.linspace(1.0, 2.0, 32)
    right = wp.array(b, dtype=wp.float64, device=device)
    x = wp.zeros_like(right)
    with pytest.warns(UserWarning, match="cg: breakdown in iteration 6: the matrix is singular"):
        _, error, atol = solver(sparse(dense, device), right, x, tol=1e-12, maxiter=6)
    assert error > atol and np.isfinite(x.numpy()).all()


@pytest.mark.parametrize("solver", SOLVERS[:2])
def test_a_negative_form_with_rows_of_the_identity(device, solver):
    """Fixed values of a negative definite form: two eigenvalues of 1 beside negative ones."""
    dense = laplacian(30)
    fixed = [0, 29]
    b = -dense[:, fixed] @ [1.0, 0.5]
    b[fixed] = [1.0, 0.5]
    dense[fixed, :] = dense[:, fixed] = 0.0
    dense[fixed, fixed] = 1.0
    x = solve(solver, sparse(dense, device), b, device, maxiter=99)
    np.testing.assert_allclose(x, np.linspace(1.0, 0.5, 30), atol=1e-8)
