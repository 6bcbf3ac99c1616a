"""Sparse matrices from bad or odd input: what is dropped, what is shared, what a graph refuses."""

import numpy as np
import pytest

import warp as wp
import warp.sparse as sp
from warp.optim import linear


def ints(values, device):
    return wp.array(values, dtype=int, device=device)


def matrix(A, device, dtype=wp.float64):
    rows, cols = np.nonzero(A)
    values = wp.array(A[rows, cols], dtype=dtype, device=device)
    return sp.bsr_from_triplets(*A.shape, ints(rows, device), ints(cols, device), values)


def dense(matrix):
    offsets, columns = matrix.offsets.numpy(), matrix.columns.numpy()
    result = np.zeros(matrix.shape)
    for row in range(matrix.nrow):
        here = slice(offsets[row], offsets[row + 1])
        result[row, columns[here]] = matrix.values.numpy()[here]
    return result


# Row and column 1 are empty.
GAPS = np.array([[2.0, 0, 0, 1], [0, 0, 0, 0], [0, 0, -1, 4], [0, 0, 3, 5]])


def test_triplets_outside_are_dropped_and_equal_places_are_summed(device):
    rows, cols = [0, -1, 2, 3, 2, 0, 2], [0, 0, 5, 1, 1, -7, 1]
    values = wp.array(np.arange(1.0, 8.0), dtype=wp.float64, device=device)
    A = sp.bsr_from_triplets(3, 4, ints(rows, device), ints(cols, device), values)
    assert A.nnz_sync() == 2
    np.testing.assert_array_equal(dense(A), [[1, 0, 0, 0], [0, 0, 0, 0], [0, 12, 0, 0]])


def test_triplets_beyond_the_matrix_are_errors_in_debug_mode(device, monkeypatch):
    monkeypatch.setattr(wp.config, "mode", "debug")
    values = wp.ones(4, dtype=wp.float64, device=device)
    A = sp.bsr_zeros(3, 4, wp.float64, device=device)
    rows, cols = ints([0, -1, 2, 3], device), ints([0, 9, 4, 1], device)
    with pytest.raises(IndexError, match="triplet 1 is at row -1 and column 9.*3 x 4.*2 others"):
        sp.bsr_set_from_triplets(A, rows, cols, values)
    rows, cols = ints([0, -1, 2, 3], device), ints([0, -9, 3, 1], device)
    sp.bsr_set_from_triplets(A, rows, cols, values, count=ints([3], device))
    assert A.nnz_sync() == 2


def test_captures_do_not_look_for_triplets_beyond_the_matrix(monkeypatch):
    monkeypatch.setattr(wp.config, "mode", "debug")
    values = wp.ones(2, dtype=wp.float64, device="cpu")
    A = sp.bsr_zeros(3, 4, wp.float64, device="cpu")
    with wp.ScopedCapture("cpu") as capture:
        sp.bsr_set_from_triplets(A, ints([0, 3], "cpu"), ints([0, 1], "cpu"), values)
    wp.capture_launch(capture.graph)
    assert A.nnz_sync() == 1


def test_no_triplets(device):
    none = ints([], device)
    A = sp.bsr_from_triplets(3, 2, none, none, wp.empty(0, dtype=wp.float64, device=device))
    x = wp.ones(2, dtype=wp.float64, device=device)
    np.testing.assert_array_equal(sp.bsr_mv(A, x).numpy(), np.zeros(3))
    assert sp.bsr_transposed(A).shape == (2, 3) and A.nnz_sync() == 0


def test_empty_rows_and_columns(device):
    A, x = matrix(GAPS, device), np.array([1.0, 2.0, 3.0, 4.0])
    vector = wp.array(x, dtype=wp.float64, device=device)
    np.testing.assert_array_equal(sp.bsr_mv(A, vector).numpy(), GAPS @ x)
    np.testing.assert_array_equal(sp.bsr_mv(A, vector, transpose=True).numpy(), GAPS.T @ x)
    np.testing.assert_array_equal(dense(sp.bsr_mm(A, A)), GAPS @ GAPS)
    np.testing.assert_array_equal(dense(sp.bsr_transposed(A)), GAPS.T)
    np.testing.assert_array_equal(sp.bsr_get_diag(A).numpy(), np.diag(GAPS))


def test_the_result_may_be_an_operand(device):
    A, x = matrix(GAPS, device), np.array([1.0, 2.0, 3.0, 4.0])
    vector = wp.array(x, dtype=wp.float64, device=device)
    sp.bsr_mv(A, vector, vector, 1.0, 0.0)
    np.testing.assert_array_equal(vector.numpy(), GAPS @ x)
    sp.bsr_axpy(A, A, 2.0, 1.0)
    np.testing.assert_array_equal(dense(A), 3 * GAPS)
    sp.bsr_set_transpose(A, A)
    np.testing.assert_array_equal(dense(A), 3 * GAPS.T)
    sp.bsr_mm(A, A, A)
    np.testing.assert_array_equal(dense(A), 9 * GAPS.T @ GAPS.T)


def test_what_is_no_number_goes_where_it_is_multiplied(device):
    x = wp.array([1.0, np.nan, 3.0, np.inf], dtype=wp.float64, device=device)
    expected = np.array([np.inf, 0.0, np.inf, np.inf])
    # Row 1 has no entries, and so nothing of the NaN.
    np.testing.assert_array_equal(sp.bsr_mv(matrix(GAPS, device), x).numpy(), expected)


@pytest.mark.parametrize("solver", [linear.cg, linear.gmres])
def test_a_matrix_with_an_empty_row_is_singular(device, solver):
    A = np.diag([2.0, 0.0, 3.0, 4.0])
    b = wp.ones(4, dtype=wp.float64, device=device)
    x = wp.zeros(4, dtype=wp.float64, device=device)
    state = solver.__name__
    with pytest.warns(UserWarning, match=rf"{state}: breakdown in iteration \d+: .*singular"):
        _, error, atol = solver(matrix(A, device), b, x, tol=1e-10, maxiter=40)
    true = np.linalg.norm(A @ x.numpy() - 1.0)
    assert error > atol and error == pytest.approx(true)


@pytest.mark.parametrize("solver", [linear.cg, linear.cr, linear.bicgstab, linear.gmres])
def test_the_solution_may_be_where_the_right_hand_side_is(device, solver):
    A = np.diag([2.0, 4.0, 8.0])
    b = wp.array([2.0, 4.0, 8.0], dtype=wp.float64, device=device)
    x = wp.clone(b)
    iterations, error, atol = solver(matrix(A, device), b, x, tol=1e-12, maxiter=30)
    np.testing.assert_allclose(x.numpy(), 1.0, rtol=1e-10)
    assert error <= atol and iterations <= 30


def test_graphs_and_the_host(device):
    """A graph holds what allocates, and refuses what the host has to read."""
    A = matrix(GAPS, device)
    x = wp.ones(4, dtype=wp.float64, device=device)
    sp.bsr_mv(A, x)
    with wp.ScopedCapture(device=device) as capture:
        with pytest.raises(RuntimeError, match="device-to-host readback"):
            A.nnz_sync()
        y = sp.bsr_mv(A, x)
        z = wp.clone(y)
    for factor in (1.0, -2.0):
        x.fill_(factor)
        wp.capture_launch(capture.graph)
        np.testing.assert_array_equal(z.numpy(), factor * GAPS.sum(1))
