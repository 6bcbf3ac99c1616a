"""Matrices whose arrays were replaced or written to by the program: errors, and no crash."""

import copy

import numpy as np
import pytest

import warp as wp
import warp.sparse as sp
from sparse_reference import Triplets, dense, vector
from warp.optim import linear

BLOCKS = [(1, 1), (2, 2)]


def made(block, device="cpu"):
    return Triplets(1, 6, 6, block, 14).matrix(device)


def integers(values, device="cpu"):
    return wp.array(values, dtype=int, device=device)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("offsets", None),
        ("offsets", np.zeros(7, np.int32)),
        ("offsets", wp.zeros(7, dtype=wp.int64, device="cpu")),
        ("columns", [0, 1]),
        ("columns", wp.zeros((3, 3), dtype=int, device="cpu")),
        ("columns", wp.zeros(30, dtype=int, device="cpu")[::2]),
        ("row_counts", 3),
        ("values", None),
        ("values", wp.zeros(14, dtype=float, device="cpu")),
        ("values", wp.zeros(14, dtype=wp.vec2d, device="cpu")),
        ("nrow", "6"),
        ("ncol", 2.5),
        ("nnz", None),
        ("nrow", -1),
        ("nnz", -3),
    ],
)
@pytest.mark.parametrize("block", BLOCKS)
def test_attributes_are_checked_when_they_are_set(block, name, value):
    """The error names the attribute; the matrix keeps what it had."""
    A = made(block)
    before = dense(A)
    with pytest.raises((TypeError, ValueError), match=f"'{name}' of a sparse matrix"):
        setattr(A, name, value)
    np.testing.assert_array_equal(dense(A), before)


USES = {
    "A @ x": lambda A, x: A @ x,
    "x @ A": lambda A, x: x @ A,
    "bsr_mv": lambda A, x: sp.bsr_mv(A, x, wp.zeros_like(x), beta=1.0),
    "A @ A": lambda A, x: A @ A,
    "masked": lambda A, x: sp.bsr_mm(A, A, sp.bsr_copy(made(A.block_shape)), topology="masked"),
    "cg": lambda A, x: linear.cg(A, x, wp.zeros_like(x)),
    "tape": lambda A, x: record(A, x),
}
MORE = {
    "A + A.T": lambda A, x: A + A.transpose(),
    "A += B": lambda A, x: sp.bsr_axpy(made(A.block_shape), A),
    "copy": lambda A, x: sp.bsr_copy(A, wp.float32),
    "diagonal": lambda A, x: sp.bsr_get_diag(A),
    "compress": lambda A, x: sp.bsr_compress(A),
    "preconditioner": lambda A, x: linear.preconditioner(A),
    "factors": lambda A, x: linear.preconditioner(A, "fsai"),
    "room": lambda A, x: sp.bsr_copy(A, topology="padded"),
    "rows": lambda A, x: A.uncompress_rows(),
    "triplets": lambda A, x: sp.bsr_set_from_triplets(
        A, integers([0]), integers([1]), wp.zeros(1, A.dtype, device="cpu"), topology="masked"
    ),
}


def record(A, x):
    with wp.Tape():
        sp.bsr_mv(A, x)


def operand(A):
    return vector(np.ones(6 * A.block_shape[0]), A.block_shape[0], "cpu")


@pytest.mark.parametrize("use", [*USES, *MORE])
@pytest.mark.parametrize("block", BLOCKS)
def test_arrays_that_are_too_short(block, use):
    for name, size in (("offsets", 3), ("columns", 2), ("values", 0)):
        A = made(block)
        setattr(A, name, getattr(A, name)[:size] if size else wp.empty(0, A.dtype, device="cpu"))
        with pytest.raises(ValueError, match=f"elements in '{name}', but got {size}"):
            (USES | MORE)[use](A, operand(A))


@pytest.mark.parametrize("use", USES)
@pytest.mark.parametrize("block", BLOCKS)
@pytest.mark.parametrize("column", [10**8, -1, 6, -(2**31)])
def test_columns_outside_of_the_matrix(block, use, column):
    A = made(block)
    A.columns[2:3].fill_(column)
    with pytest.raises(IndexError, match=rf"block 2 .* in column {column}, but there are 6"):
        USES[use](A, operand(A))


@pytest.mark.parametrize("use", [*USES, "diagonal", "factors", "room", "triplets"])
@pytest.mark.parametrize("block", BLOCKS)
@pytest.mark.parametrize("offsets", [[0, 2, 4, 6, 8, 10, 10**8], [0, 5, 4, 6, 7, 8, 9], [-9] * 7])
def test_rows_outside_of_the_arrays(block, use, offsets):
    A = made(block)
    A.offsets = integers(offsets)
    with pytest.raises(IndexError, match=r"row \d of a sparse matrix has the blocks"):
        (USES | MORE)[use](A, operand(A))


def test_counts_beyond_the_room_of_a_row():
    A = sp.bsr_zeros(6, 6, wp.float64, device="cpu", row_capacity=2)
    A.row_counts.fill_(3)
    with pytest.raises(IndexError, match=r"row 0 .* room for 2 blocks, but row_counts\[0\] is 3"):
        A @ operand(A)


def test_a_number_of_rows_or_blocks_that_is_not_there():
    # Products with vectors go by the offsets, and have no use for an upper bound.
    for name, uses in (("nrow", USES | MORE), ("nnz", MORE)):
        for use in uses.values():
            A = made((1, 1))
            setattr(A, name, 10**8)
            with pytest.raises(ValueError, match="expects at least|sizes|number of rows|square"):
                use(A, operand(A))
    for topology in ("masked", "padded"):
        A = sp.bsr_copy(made((1, 1)), topology="padded")
        A.nnz = 0
        with pytest.raises(IndexError, match="but there are 0"):
            sp.bsr_assign(A, made((1, 1)), topology=topology)


def test_what_is_not_in_use_may_hold_anything():
    """Room between rows and behind the last block is not looked at."""
    A = sp.bsr_copy(made((1, 1)))
    B = sp.bsr_zeros(6, 6, wp.float64, device="cpu", row_capacity=6)
    B.columns.fill_(10**8)
    B += A
    x = operand(A)
    for matrix in (B, 2.0 * B):
        np.testing.assert_allclose((matrix @ x).numpy(), dense(matrix.eval()) @ np.ones(6))
    np.testing.assert_allclose(dense(B @ B), dense(A) @ dense(A), atol=1e-12)
    longer = wp.full(20, 10**8, dtype=int, device="cpu")
    wp.copy(longer, A.columns, count=int(A.offsets.numpy()[-1]))
    A.columns = longer
    np.testing.assert_allclose((A @ x).numpy(), dense(A) @ np.ones(6))


def test_arrays_may_be_replaced_by_others():
    """A matrix with another topology, set piece by piece; and copies note for themselves."""
    A = made((1, 1))
    A.nnz = 3
    A.offsets, A.columns = integers([0, 1, 2, 3, 3, 3, 3]), integers([5, 0, 2])
    A.values = wp.array([1.0, 2.0, 3.0], dtype=wp.float64, device="cpu")
    other = copy.copy(A)
    np.testing.assert_array_equal((A @ operand(A)).numpy(), [1, 2, 3, 0, 0, 0])
    other.columns = integers([5, 0, 9])
    for _ in range(2):
        with pytest.raises(IndexError, match="column 9"):
            other @ operand(A)
    np.testing.assert_array_equal((A @ operand(A)).numpy(), [1, 2, 3, 0, 0, 0])
