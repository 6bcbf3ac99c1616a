"""Sums, products and transposed matrices beside NumPy's dense ones."""

import numpy as np
import pytest

import warp as wp
import warp.sparse as sp
from sparse_reference import Triplets, dense, vector

BLOCKS = [(1, 1), (3, 3), (2, 3)]


def check_close(matrix, expected):
    np.testing.assert_allclose(dense(matrix), expected, atol=1e-12)


@pytest.mark.parametrize("block", BLOCKS)
def test_sums_and_factors(device, block):
    a, b = Triplets(1, 7, 5, block, 20), Triplets(2, 7, 5, block, 11)
    A, B = a.matrix(device), b.matrix(device)
    check_close(2.0 * A + B, 2 * a.dense + b.dense)
    check_close(A - 3.0 * B, a.dense - 3 * b.dense)
    check_close((-A / 2.0).eval(), -a.dense / 2)
    assert sp.bsr_axpy(B, A, 0.5, 2.0) is A
    check_close(A, 0.5 * b.dense + 2 * a.dense)
    check_close(sp.bsr_axpy(A, A, 1.0, 1.0), b.dense + 4 * a.dense)
    check_close(sp.bsr_scale(B, 3.0), 3 * b.dense)


@pytest.mark.parametrize("block", BLOCKS)
def test_products_with_vectors(device, block):
    a = Triplets(3, 7, 5, block, 18)
    A = a.matrix(device)
    rng = np.random.default_rng(4)
    x, y = rng.standard_normal(5 * block[1]), rng.standard_normal(7 * block[0])
    X, Y = vector(x, block[1], device), vector(y, block[0], device)
    np.testing.assert_allclose((A @ X).numpy().ravel(), a.dense @ x, atol=1e-12)
    np.testing.assert_allclose((Y @ A).numpy().ravel(), y @ a.dense, atol=1e-12)
    result = sp.bsr_mv(A, X, wp.clone(Y), alpha=2.0, beta=-0.5)
    np.testing.assert_allclose(result.numpy().ravel(), 2 * a.dense @ x - 0.5 * y, atol=1e-12)
    result = sp.bsr_mv(A, Y, wp.clone(X), 2.0, 3.0, transpose=True)
    np.testing.assert_allclose(result.numpy().ravel(), 2 * y @ a.dense + 3 * x, atol=1e-12)


def test_a_result_that_is_not_read_need_not_be_a_number(device):
    a = Triplets(5, 4, 4, (1, 1), 9)
    x = np.arange(4.0)
    y = wp.full(4, np.nan, dtype=wp.float64, device=device)
    sp.bsr_mv(a.matrix(device), vector(x, 1, device), y, beta=0.0)
    np.testing.assert_allclose(y.numpy(), a.dense @ x, atol=1e-12)


def test_the_result_may_be_the_operand(device):
    a = Triplets(6, 6, 6, (2, 2), 14)
    x = np.arange(12.0)
    X = vector(x, 2, device)
    sp.bsr_mv(a.matrix(device), X, X, 1.0, 1.0)
    np.testing.assert_allclose(X.numpy().ravel(), a.dense @ x + x, atol=1e-12)


@pytest.mark.parametrize("block", BLOCKS)
def test_products_of_matrices(device, block):
    rows, cols = block
    a, b = Triplets(7, 7, 5, block, 20), Triplets(8, 5, 6, (cols, rows), 14)
    c = Triplets(9, 7, 6, (rows, rows), 9)
    A, B = a.matrix(device), b.matrix(device)
    check_close(A @ B, a.dense @ b.dense)
    work = sp.bsr_mm_work_arrays()
    C = c.matrix(device)
    sp.bsr_mm(A, B, C, 2.0, 0.5, work_arrays=work)
    check_close(C, 2 * a.dense @ b.dense + 0.5 * c.dense)
    # The blocks of the result stay those that it had.
    C = c.matrix(device)
    mask = dense(C) != 0
    sp.bsr_mm(A, B, C, 1.0, 0.0, topology="masked")
    np.testing.assert_allclose(dense(C)[mask], (a.dense @ b.dense)[mask], atol=1e-12)
    assert C.nnz_sync() == c.matrix(device).nnz_sync()


def test_a_product_with_known_topology(device):
    a = Triplets(10, 6, 6, (2, 2), 12)
    A, work = a.matrix(device), sp.bsr_mm_work_arrays()
    C = sp.bsr_mm(A, A, work_arrays=work)
    sp.bsr_scale(A, 2.0)
    sp.bsr_mm(A, A, C, work_arrays=work, reuse_topology=True)
    check_close(C, 4 * a.dense @ a.dense)
    B = sp.bsr_copy(A)
    sp.bsr_mm(B, B, B)
    check_close(B, 4 * a.dense @ a.dense)


@pytest.mark.parametrize("block", BLOCKS)
def test_transposed(device, block):
    a = Triplets(11, 7, 5, block, 20)
    check_close(a.matrix(device).transpose(), a.dense.T)
    check_close((2.0 * a.matrix(device)).transpose(), 2 * a.dense.T)


def test_other_blocks(device):
    a = Triplets(12, 6, 4, (4, 6), 13)
    A = a.matrix(device)
    for shape in ((2, 3), (1, 1), (8, 12), (8, 3)):
        check_close(sp.bsr_copy(A, block_shape=shape), a.dense)
    half = sp.bsr_copy(A, scalar_type=wp.float32)
    np.testing.assert_allclose(dense(half), a.dense.astype(np.float32))


def test_diagonals(device):
    a = Triplets(13, 5, 5, (3, 3), 16)
    blocks = [a.dense[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] for i in range(5)]
    diagonal = sp.bsr_get_diag(a.matrix(device))
    np.testing.assert_allclose(diagonal.numpy(), blocks)
    check_close(sp.bsr_diag(diagonal), np.where(np.kron(np.eye(5), np.ones((3, 3))), a.dense, 0))
    check_close(sp.bsr_identity(4, wp.mat22, device), np.eye(8))
    check_close(sp.bsr_diag(wp.float64(3.0), 2, 4, device=device), 3 * np.eye(2, 4))
