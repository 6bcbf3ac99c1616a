"""`+= -= *= /= @=` of sparse matrices beside NumPy's, under all names of the matrix."""

import operator

import numpy as np
import pytest

import warp as wp
import warp.sparse as sp
from random_runs import seeds
from sparse_reference import Triplets, dense, vector
from warp.optim import linear

BLOCKS = [(1, 1), (2, 2), (3, 3)]


class Holder:
    def __init__(self, matrix):
        self.matrix = matrix


def test_every_name_sees_the_new_value(device):
    """Aliases, arguments, elements of lists and attributes are the matrix that was changed."""

    def add(k, parts):
        for part in parts:
            k += part
        k -= 0.5 * sp.bsr_identity(4, wp.float64, device=device)

    a, b = Triplets(1, 4, 4, (1, 1), 7), Triplets(2, 4, 4, (1, 1), 9)
    A, expected = a.matrix(device), a.dense + 2 * b.dense - 0.5 * np.eye(4)
    same, held, listed = A, Holder(A), [A]
    add(A, [b.matrix(device), b.matrix(device)])
    held.matrix *= 3.0
    listed[0] /= 2.0
    for found in (A, same, held.matrix, listed[0]):
        assert found is A
        np.testing.assert_allclose(dense(found), 1.5 * expected, atol=1e-12)


@pytest.mark.parametrize("block", BLOCKS)
def test_values_stay_where_they_are(device, block):
    """A product with a number changes the numbers in their memory."""
    a = Triplets(3, 5, 5, block, 11)
    A = a.matrix(device)
    values = A.values
    for factor in (2, np.float32(0.5), wp.float64(3.0), np.array(2.0), True):
        A *= factor
    A /= np.int64(4)
    assert A.values is values
    np.testing.assert_allclose(dense(A), 1.5 * a.dense, atol=1e-12)


@pytest.mark.parametrize("block", BLOCKS)
def test_the_matrix_itself_on_the_right(device, block):
    a = Triplets(4, 5, 5, block, 12)
    cases = [
        (operator.iadd, lambda A: A, 2 * a.dense),
        (operator.isub, lambda A: A, 0 * a.dense),
        (operator.iadd, lambda A: 2.0 * A, 3 * a.dense),
        (operator.isub, lambda A: A.transpose(), a.dense - a.dense.T),
        (operator.iadd, lambda A: -A / 4.0 + A, 1.75 * a.dense),
        (operator.imatmul, lambda A: A, a.dense @ a.dense),
        (operator.imatmul, lambda A: 0.5 * A.transpose(), 0.5 * a.dense @ a.dense.T),
        (operator.imatmul, lambda A: A @ A, a.dense @ a.dense @ a.dense),
    ]
    for change, other, expected in cases:
        A = a.matrix(device)
        assert change(A, other(A)) is A
        np.testing.assert_allclose(dense(A), expected, atol=1e-12)


@pytest.mark.parametrize("block", BLOCKS)
def test_random_programs(device, block):
    """Any order of operators and names leaves in each matrix what NumPy has, and no other alias."""
    for seed in seeds(8):
        rng = np.random.default_rng(seed)
        own = [Triplets(10 * seed + i, 4, 4, block, 3 + 4 * i).matrix(device) for i in range(3)]
        names = own + [own[0], own[2]]
        model = [dense(A).copy() for A in own]
        models = model + [model[0], model[2]]
        for _ in range(12):
            i, j = rng.integers(len(names), size=2)
            kind, factor = rng.integers(6), float(rng.uniform(-1.5, 1.5)) or 1.0
            if kind == 0:
                names[i] += names[j]
                models[i] += models[j]
            elif kind == 1:
                names[i] -= factor * names[j]
                models[i] -= factor * models[j]
            elif kind == 2:
                names[i] *= factor
                models[i] *= factor
            elif kind == 3:
                names[i] /= factor
                models[i] /= factor
            elif kind == 4:
                names[i] @= names[j] / 4.0
                models[i][:] = models[i] @ models[j] / 4
            else:
                names[i] += names[j].transpose() - names[i]
                models[i] += models[j].T - models[i]
            scale = max(np.abs(m).max() for m in model)
            for A, expected in zip(own, model, strict=True):
                np.testing.assert_allclose(dense(A), expected, atol=1e-9 * scale)
            if scale > 1e6:
                break


def test_rows_with_spare_room(device):
    """A padded matrix stays one; what finds no room sets its status."""
    a, b = Triplets(5, 4, 4, (1, 1), 6), Triplets(6, 4, 4, (1, 1), 5)
    A = sp.bsr_zeros(4, 4, wp.float64, device=device, row_capacity=4)
    A += a.matrix(device)
    A += b.matrix(device)
    A *= 2.0
    assert A.row_counts is not None and A.status_sync() == sp.BSR_STATUS_SUCCESS
    np.testing.assert_allclose(dense(A), 2 * (a.dense + b.dense), atol=1e-12)


@pytest.mark.parametrize("requires_grad", [False, True])
def test_tapes_record_them(device, requires_grad):
    """d/da of w^T (2 (A + B) - A^T) x, and of the product with B, by the analytic values."""
    a, b = Triplets(7, 3, 3, (1, 1), 8), Triplets(8, 3, 3, (1, 1), 8)
    rng = np.random.default_rng(9)
    x, w = rng.standard_normal(3), rng.standard_normal(3)
    rows, columns, values = a.arrays(device, requires_grad=True)
    B = b.matrix(device)
    if requires_grad:
        B.values.requires_grad = True
    with wp.Tape() as tape:
        A = sp.bsr_from_triplets(3, 3, rows, columns, values)
        T = A.transpose()
        A += B
        A *= 2.0
        A -= T
        A @= B
        y = sp.bsr_mv(A, vector(x, 1, device))
    tape.backward(grads={y: vector(w, 1, device)})
    expected = (2 * (a.dense + b.dense) - a.dense.T) @ b.dense
    np.testing.assert_allclose(dense(A), expected, atol=1e-12)
    z = b.dense @ x
    i, j = rows.numpy(), columns.numpy()
    np.testing.assert_allclose(values.grad.numpy(), 2 * w[i] * z[j] - w[j] * z[i], atol=1e-12)


def test_solvers_take_the_result(device):
    """A matrix that was changed in place, and one times a number, are left-hand sides."""
    a = Triplets(11, 6, 6, (1, 1), 20)
    A = a.matrix(device)
    A @= A.transpose()
    A += 6.0 * sp.bsr_identity(6, wp.float64, device=device)
    full = a.dense @ a.dense.T + 6 * np.eye(6)
    b = np.arange(1.0, 7.0)
    for matrix, factor in ((A, 1.0), (2.0 * A, 2.0), (-A, -1.0)):
        x = wp.zeros(6, dtype=wp.float64, device=device)
        linear.cg(matrix, vector(b, 1, device), x, tol=1e-12, M=linear.preconditioner(matrix))
        np.testing.assert_allclose(x.numpy(), np.linalg.solve(factor * full, b), atol=1e-9)


def test_what_does_not_fit_is_an_error_and_changes_nothing(device):
    a = Triplets(12, 4, 4, (2, 2), 7)
    A = a.matrix(device)
    single = sp.bsr_identity(4, wp.types.matrix((2, 2), wp.float32), device=device)
    cases = [
        (operator.iadd, Triplets(1, 5, 4, (2, 2), 7).matrix(device), "same number of rows"),
        (operator.isub, Triplets(1, 4, 4, (1, 1), 7).matrix(device), "same block shape"),
        (operator.iadd, single, "same scalar type"),
        (operator.imatmul, Triplets(1, 4, 5, (2, 2), 7).matrix(device), "number of rows/columns"),
        (operator.imatmul, Triplets(1, 4, 4, (2, 3), 7).matrix(device), "block sizes"),
        (operator.imatmul, wp.zeros(8, dtype=wp.float64, device=device), "BsrMatrix, got 'array'"),
        (operator.iadd, 3.0, "BsrMatrix, got 'float'"),
        (operator.imul, "2", "unsupported operand"),
        (operator.imul, A, "unsupported operand"),
        (operator.imul, wp.zeros(8, dtype=wp.float64, device=device), "unsupported operand"),
        (operator.itruediv, None, "unsupported operand"),
        (operator.imul, 2j, "real number"),
        (operator.itruediv, 0, "division by zero"),
    ]
    for change, other, message in cases:
        with pytest.raises((ValueError, TypeError, ZeroDivisionError), match=message):
            change(A, other)
        np.testing.assert_array_equal(dense(A), a.dense)
