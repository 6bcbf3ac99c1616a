"""Gradients of sparse operations and of solutions, beside differences and analytic ones."""

import numpy as np
import pytest

import warp as wp
import warp.sparse as sp
from sparse_reference import Triplets, dense, place, vector
from warp.optim import linear


def differences(function, x, step=1e-6):
    result = np.zeros_like(x)
    for i in np.ndindex(x.shape):
        kept = x[i]
        x[i] = kept + step
        above = function()
        x[i] = kept - step
        result[i] = (above - function()) / (2 * step)
        x[i] = kept
    return result


def matrix(triplets, device):
    rows, columns, values = triplets.arrays(device, requires_grad=True)
    return (rows, columns, values)


def test_products_and_sums(device):
    a, b = Triplets(1, 4, 5, (2, 3), 9), Triplets(2, 5, 3, (3, 2), 8)
    rng = np.random.default_rng(3)
    x, weights = rng.standard_normal(6), rng.standard_normal(8)
    left, right = matrix(a, device), matrix(b, device)
    X = vector(x, 2, device, requires_grad=True)
    with wp.Tape() as tape:
        A = sp.bsr_from_triplets(4, 5, *left)
        B = sp.bsr_from_triplets(5, 3, *right)
        product = sp.bsr_mm(2.0 * A, B)
        twice = sp.bsr_axpy(product, sp.bsr_transposed(sp.bsr_transposed(product)), 0.5, 3.0)
        y = sp.bsr_mv(twice, X)
    tape.backward(grads={y: vector(weights, 2, device)})

    def loss():
        return weights @ (7 * a.add_up(a.values) @ b.add_up(b.values) @ x)

    np.testing.assert_allclose(left[2].grad.numpy(), differences(loss, a.values), atol=1e-6)
    np.testing.assert_allclose(right[2].grad.numpy(), differences(loss, b.values), atol=1e-6)
    np.testing.assert_allclose(X.grad.numpy().ravel(), differences(loss, x), atol=1e-6)


def test_the_blocks_that_there_are_and_the_transposed_vector(device):
    a, c = Triplets(4, 4, 4, (2, 2), 7), Triplets(5, 4, 4, (2, 2), 6)
    rng = np.random.default_rng(6)
    x, weights = rng.standard_normal(8), rng.standard_normal(8)
    left = matrix(a, device)
    X = vector(x, 2, device, requires_grad=True)
    C = c.matrix(device)
    C.values.requires_grad = True
    mask = np.kron(np.abs(dense(C)).reshape(4, 2, 4, 2).sum(axis=(1, 3)) > 0, np.ones((2, 2)))
    with wp.Tape() as tape:
        A = sp.bsr_from_triplets(4, 4, *left)
        sp.bsr_mm(A, A, C, 1.0, 0.0, topology="masked")
        y = sp.bsr_mv(C, X, transpose=True)
    tape.backward(grads={y: vector(weights, 2, device)})

    def loss():
        A = a.add_up(a.values)
        return weights @ ((mask * (A @ A)).T @ x)

    np.testing.assert_allclose(left[2].grad.numpy(), differences(loss, a.values), atol=1e-6)
    np.testing.assert_allclose(X.grad.numpy().ravel(), differences(loss, x), atol=1e-6)


@pytest.mark.parametrize("solver", [linear.cg, linear.cr, linear.bicgstab, linear.gmres])
def test_solutions_of_dense_systems(device, solver):
    rng = np.random.default_rng(7)
    C, b, weights = rng.standard_normal((9, 9)), rng.standard_normal(9), rng.standard_normal(9)
    symmetric = solver in (linear.cg, linear.cr)
    A = C @ C.T + 9 * np.eye(9) if symmetric else C + 8 * np.eye(9)
    a, right, x = (
        wp.array(v, dtype=wp.float64, device=device, requires_grad=True) for v in (A, b, 0 * b)
    )
    with wp.Tape() as tape:
        solver(a, right, x, tol=1e-13, maxiter=200, M=linear.preconditioner(a))
    tape.backward(grads={x: wp.array(weights, device=device)})
    adjoint = np.linalg.solve(A.T, weights)
    np.testing.assert_allclose(right.grad.numpy(), adjoint, rtol=1e-9)
    expected = -np.outer(adjoint, np.linalg.solve(A, b))
    np.testing.assert_allclose(a.grad.numpy(), expected, rtol=1e-8, atol=1e-12)


def test_solutions_of_sparse_systems(device):
    a = Triplets(8, 4, 4, (3, 3), 14)
    for k in range(4):
        a.rows[k] = a.columns[k] = k
    a.values[:4] = 12 * np.eye(3)
    rng = np.random.default_rng(9)
    b, weights = rng.standard_normal(12), rng.standard_normal(12)
    parts = matrix(a, device)
    right = vector(b, 3, device, requires_grad=True)
    x = vector(0 * b, 3, device, requires_grad=True)
    with wp.Tape() as tape:
        linear.gmres(sp.bsr_from_triplets(4, 4, *parts), right, x, tol=1e-13, maxiter=100)
    tape.backward(grads={x: vector(weights, 3, device)})
    A = a.add_up(a.values)
    adjoint = np.linalg.solve(A.T, weights)
    whole = -np.outer(adjoint, np.linalg.solve(A, b))
    blocks = [whole[place(i, 3), place(j, 3)] for i, j in zip(a.rows, a.columns, strict=True)]
    np.testing.assert_allclose(parts[2].grad.numpy(), blocks, atol=1e-10)
    np.testing.assert_allclose(right.grad.numpy().ravel(), adjoint, rtol=1e-9)


def test_an_operator_made_by_hand_has_no_transposed_one(device):
    b = wp.ones(3, dtype=wp.float64, device=device, requires_grad=True)
    x = wp.zeros_like(b)
    matrix = linear.aslinearoperator(wp.array(np.eye(3), device=device))
    own = linear.LinearOperator(matrix.shape, matrix.dtype, matrix.device, matrix.matvec)
    with wp.Tape() as tape:
        linear.bicgstab(own, b, x)
    with pytest.raises(NotImplementedError, match="transposed system"):
        tape.backward(grads={x: wp.ones_like(b)})
