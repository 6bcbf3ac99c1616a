"""Topology of sparse matrices: triplets, padded rows, compression, captures, wrong arguments."""

import numpy as np
import pytest

import warp as wp
import warp.sparse as sp
from sparse_reference import Triplets, dense


def ints(values, device):
    return wp.array(values, dtype=int, device=device)


def reals(values, device):
    return wp.array(values, dtype=wp.float64, device=device)


@pytest.mark.parametrize("block", [(1, 1), (3, 3), (2, 3), (5, 1)])
def test_duplicates_are_summed(device, block):
    a = Triplets(1, 9, 8, block, 40)
    A = a.matrix(device)
    np.testing.assert_allclose(dense(A), a.dense, atol=1e-12)
    assert A.nnz == 40
    assert A.nnz_sync() == len(set(zip(a.rows, a.columns, strict=True)))
    assert A.shape == a.dense.shape and A.block_shape == block
    rows = A.uncompress_rows().numpy()
    np.testing.assert_array_equal(np.bincount(rows, minlength=9), np.diff(A.offsets.numpy()))


def test_what_lies_outside_or_is_zero_is_left_out(device):
    rows = ints([0, -1, 1, 2, 1, 0], device)
    columns = ints([0, 0, 1, 0, 7, 2], device)
    values = reals([1.0, 2.0, 3.0, 4.0, 5.0, 0.0], device)
    A = sp.bsr_from_triplets(2, 3, rows, columns, values)
    assert A.nnz_sync() == 2
    np.testing.assert_array_equal(dense(A), [[1, 0, 0], [0, 3, 0]])
    A = sp.bsr_from_triplets(2, 3, rows, columns, values, prune_numerical_zeros=False)
    assert A.nnz_sync() == 3
    sp.bsr_set_from_triplets(A, rows, columns, values, count=ints([1], device))
    np.testing.assert_array_equal(dense(A), [[1, 0, 0], [0, 0, 0]])


def test_empty_matrices(device):
    for size in ((0, 3), (3, 0), (0, 0), (4, 5)):
        A = sp.bsr_zeros(*size, wp.float64, device)
        none = ints([], device)
        sp.bsr_set_from_triplets(A, none, none, reals([], device))
        assert A.nnz_sync() == 0 and dense(A.transpose()).shape == size[::-1]
        y = A @ wp.ones(size[1], dtype=wp.float64, device=device)
        np.testing.assert_array_equal(y.numpy(), np.zeros(size[0]))
        assert sp.bsr_mm(A, A.transpose()).nnz_sync() == 0


def test_large_sizes_need_wide_keys(device):
    n = 2_000_000_000
    A = sp.bsr_from_triplets(
        5, n, ints([4, 0, 4], device), ints([n - 1, 7, n - 1], device), reals([1, 2, 3], device)
    )
    assert A.nnz_sync() == 2
    np.testing.assert_array_equal(A.columns.numpy()[:2], [7, n - 1])
    np.testing.assert_array_equal(A.values.numpy()[:2], [2, 4])


def test_padded_rows(device):
    a, b = Triplets(2, 6, 5, (2, 2), 14), Triplets(3, 6, 5, (2, 2), 9)
    P = sp.bsr_zeros(6, 5, wp.mat22d, device, row_capacity=5)
    sp.bsr_set_from_triplets(P, *a.arrays(device))
    assert P.row_counts is not None and P.nnz == 30
    np.testing.assert_allclose(dense(P), a.dense, atol=1e-12)
    sp.bsr_axpy(b.matrix(device), P, 2.0, 3.0)
    np.testing.assert_allclose(dense(P), 2 * b.dense + 3 * a.dense, atol=1e-12)
    np.testing.assert_allclose(dense(P.transpose()), dense(P).T)
    x = np.arange(10.0)
    y = P @ wp.array(x.reshape(5, 2), dtype=wp.vec2d, device=device)
    np.testing.assert_allclose(y.numpy().ravel(), dense(P) @ x)
    assert P.status_sync() == sp.BSR_STATUS_SUCCESS
    narrow = sp.bsr_zeros(6, 5, wp.mat22d, device, row_capacity=ints([1] * 6, device))
    sp.bsr_assign(narrow, P)
    assert narrow.status_sync() == sp.BSR_STATUS_ROW_CAPACITY_EXCEEDED
    assert narrow.status_message() == "row capacity exceeded"


def test_rows_of_a_transposed_matrix_are_whole_or_empty(device):
    values = np.array([[1.0, 0.0, 2.0], [0.0, 3.0, 4.0]])
    rows, columns = np.nonzero(values)
    arrays = ints(rows, device), ints(columns, device), reals(values[rows, columns], device)
    A = sp.bsr_from_triplets(2, 3, *arrays)
    for room, kept in ((2, [1, 1, 2]), (1, [1, 1, 0])):
        At = sp.bsr_zeros(3, 2, wp.float64, device, row_capacity=room)
        sp.bsr_set_transpose(At, A, topology="padded")
        assert At.row_counts.numpy().tolist() == kept
        expected = values.T.copy()
        expected[np.array(kept) == 0] = 0.0
        np.testing.assert_array_equal(dense(At), expected)
        assert At.status_sync() == (room == 1)


def test_the_blocks_that_there_are(device):
    a, b = Triplets(4, 6, 6, (1, 1), 12), Triplets(5, 6, 6, (1, 1), 20)
    A = a.matrix(device)
    mask = dense(A) != 0
    sp.bsr_set_from_triplets(A, *b.arrays(device), topology="masked")
    np.testing.assert_allclose(dense(A), np.where(mask, b.dense, 0), atol=1e-12)
    sp.bsr_axpy(a.matrix(device), A, topology="masked")
    np.testing.assert_allclose(dense(A), np.where(mask, a.dense + b.dense, 0), atol=1e-12)


def test_compression_sorts_and_sums(device):
    A = sp.bsr_zeros(2, 4, wp.float64, device)
    A.offsets, A.columns = ints([0, 3, 5], device), ints([3, 0, 3, 9, 1], device)
    A.values = reals([1.0, 2.0, 3.0, 4.0, 0.0], device)
    A.notify_nnz_changed(5)
    sp.bsr_compress(A)
    np.testing.assert_array_equal(dense(A), [[2, 0, 0, 4], [0, 0, 0, 0]])
    assert A.nnz_sync() == 2


def test_new_values_for_known_triplets(device):
    a = Triplets(6, 5, 5, (2, 3), 17)
    A = sp.bsr_zeros(5, 5, wp.types.matrix((2, 3), wp.float64), device)
    rows, columns, values = a.arrays(device)
    mapping = sp.bsr_set_from_triplets(
        A, rows, columns, values, prune_numerical_zeros=False, build_mapping=True
    )
    for reduction in ("gather", "atomic"):
        sp.bsr_set_from_mapped_values(A, mapping, reals(3 * a.values, device), reduction)
        np.testing.assert_allclose(dense(A), 3 * a.dense, atol=1e-12)
    with pytest.raises(ValueError, match="differs from that used"):
        mapping.validate(sp.bsr_copy(A))


def test_a_graph_holds_it_all(device):
    a, b = Triplets(7, 6, 6, (2, 2), 12), Triplets(8, 6, 6, (2, 2), 12)
    rows, columns, values = a.arrays(device)
    A, y = sp.bsr_zeros(6, 6, wp.mat22d, device), wp.zeros(6, dtype=wp.vec2d, device=device)
    x = wp.ones(6, dtype=wp.vec2d, device=device)
    with wp.ScopedCapture(device=device) as capture:
        sp.bsr_set_from_triplets(A, rows, columns, values)
        B = sp.bsr_mm(A, sp.bsr_transposed(A), max_new_nnz=12 * 12)
        sp.bsr_mv(B, x, y)
        error = NotImplementedError if device == "cpu" else RuntimeError
        with pytest.raises(error, match="device-to-host readback.*topology update"):
            A.nnz_sync()
    values.assign(b.values)
    wp.copy(rows, ints(b.rows, device))
    wp.copy(columns, ints(b.columns, device))
    wp.capture_launch(capture.graph)
    expected = (b.dense @ b.dense.T).sum(axis=1)
    np.testing.assert_allclose(y.numpy().ravel(), expected, atol=1e-12)


def test_wrong_arguments(device):
    one = reals([1.0], device)
    A = sp.bsr_from_triplets(2, 3, ints([0], device), ints([0], device), one)
    with pytest.raises(TypeError, match="must be of type int32"):
        sp.bsr_from_triplets(2, 2, one, one, one)
    with pytest.raises(ValueError, match="same length"):
        sp.bsr_from_triplets(2, 2, ints([0, 1], device), ints([0, 1], device), one)
    with pytest.raises(ValueError, match="block type must be either"):
        sp.bsr_zeros(2, 2, wp.vec3, device)
    with pytest.raises(ValueError, match="rows and columns"):
        A + sp.bsr_zeros(3, 3, wp.float64, device)
    with pytest.raises(ValueError, match="same scalar type"):
        A + sp.bsr_zeros(2, 3, wp.float32, device)
    with pytest.raises(ValueError, match="Incompatible number of rows/columns"):
        A @ A
    with pytest.raises(ValueError, match="Incompatible 'x' vector"):
        A @ wp.ones(7, dtype=wp.float64, device=device)
    with pytest.raises(ValueError, match="Unsupported topology"):
        sp.bsr_axpy(A, A, topology="loose")
    with pytest.raises(ValueError, match="cannot be interpreted as a BsrMatrix"):
        A + 3.0
