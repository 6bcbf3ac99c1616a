"""Diagonals: of a matrix, and matrices made of one."""

import functools

import warp as wp
from warp._src.sparse import sums
from warp._src.sparse.checks import check_contents
from warp._src.sparse.entries import make_compact
from warp._src.sparse.expressions import matrix_and_factor
from warp._src.sparse.lookup import bsr_block_index
from warp._src.sparse.matrix import BsrMatrix, as_blocks, bsr_matrix_t, new_matrix
from warp.extend import checked, is_array, type_is_matrix, type_repr, types_equal
from warp.extend.kinds import ARRAY, COUNT, MATRIX, SPARSE
from warp.types import is_scalar, is_value


@functools.cache
def _diagonal_kernel(scalar):
    @sums.kernel_for(scalar)
    def read_diagonal(
        offsets: wp.array(dtype=int),
        columns: wp.array(dtype=int),
        row_counts: wp.array(dtype=int),
        factor: scalar,
        values: wp.array3d(dtype=scalar),
        result: wp.array3d(dtype=scalar),
    ):
        row, i, j = wp.tid()
        block = bsr_block_index(row, row, offsets, columns, row_counts)
        if block >= 0:
            result[row, i, j] = factor * values[block, i, j]
        else:
            result[row, i, j] = scalar(0.0)

    return read_diagonal


@checked(A=SPARSE, out=ARRAY)
def bsr_get_diag(A, out=None):
    """The blocks of the diagonal, zeros where there is none. Differentiable.

    Args:
        A: a matrix.
        out: gets the blocks, by default a new array of them.

    Raises:
        ValueError: `out` does not fit.
    """
    matrix, factor = matrix_and_factor(A)
    check_contents(matrix, columns=False)
    count = min(matrix.nrow, matrix.ncol)
    if out is None:
        out = wp.empty(
            count, dtype=matrix.dtype, device=matrix.device, requires_grad=matrix.requires_grad
        )
    elif not types_equal(out.dtype, matrix.dtype):
        raise ValueError(f"Output array must have type {matrix.dtype}, got {out.dtype}")
    elif out.device != matrix.device:
        raise ValueError(f"Output array must reside on device {matrix.device}, got {out.device}")
    elif out.shape[0] < count:
        raise ValueError(f"Output array must be of length at least {count}, got {out.shape[0]}")
    inputs = [matrix.offsets, matrix.columns, matrix._counts(), factor, matrix.scalar_values]
    blocks = as_blocks(out)
    kernel, dim = _diagonal_kernel(matrix.scalar_type), (count, *matrix.block_shape)
    wp.launch(kernel, dim, inputs, [blocks], device=matrix.device)
    return out


@wp.kernel(enable_backward=False)
def _place_diagonal(count: int, offsets: wp.array(dtype=int), columns: wp.array(dtype=int)):
    row = wp.tid()
    offsets[row] = wp.min(row, count)
    if row < count:
        columns[row] = row


@checked(A=MATRIX, rows_of_blocks=COUNT, cols_of_blocks=COUNT)
def bsr_set_diag(
    A: BsrMatrix, diag, rows_of_blocks: int | None = None, cols_of_blocks: int | None = None
) -> None:
    """Makes a matrix one that has blocks on its diagonal only.

    Args:
        A: the matrix.
        diag: an array of its blocks, one block for all of them, or None for undefined ones.
        rows_of_blocks, cols_of_blocks: its size; if one is given, the other is the same. By
            default that of `diag`, or what it was.

    Raises:
        ValueError: there are fewer blocks than rows and columns, or they have another type.
    """
    if rows_of_blocks is None and cols_of_blocks is not None:
        rows_of_blocks = cols_of_blocks
    elif cols_of_blocks is None and rows_of_blocks is not None:
        cols_of_blocks = rows_of_blocks
    many = is_array(diag)
    if many and rows_of_blocks is None:
        rows_of_blocks = cols_of_blocks = diag.shape[0]
    if rows_of_blocks is not None:
        A.nrow, A.ncol = int(rows_of_blocks), int(cols_of_blocks)
    count = min(A.nrow, A.ncol)
    if many and (diag.shape[0] < count or not types_equal(diag.dtype, A.dtype)):
        raise ValueError(
            f"expects {count} blocks of type {type_repr(A.dtype)}, "
            f"got {diag.shape[0]} of {type_repr(diag.dtype)}"
        )
    make_compact(A, count)
    inputs = [count, A.offsets, A.columns]
    wp.launch(_place_diagonal, A.nrow + 1, inputs, device=A.device)
    if diag is None or count == 0:
        return
    if many:
        if diag.requires_grad and not A.requires_grad:
            A.values = wp.empty_like(A.values, requires_grad=True)
        wp.copy(A.values, diag, count=count)
    elif is_scalar(diag) and type_is_matrix(A.dtype):
        rows, cols = A.block_shape
        A.values.fill_(
            A.dtype([float(diag) if i == j else 0.0 for i in range(rows) for j in range(cols)])
        )
    else:
        A.values.fill_(diag)


@checked(rows_of_blocks=COUNT, cols_of_blocks=COUNT)
def bsr_diag(
    diag=None,
    rows_of_blocks: int | None = None,
    cols_of_blocks: int | None = None,
    block_type=None,
    device=None,
) -> BsrMatrix:
    """A matrix that has blocks on its diagonal only; arguments as for `bsr_set_diag`.

    Args:
        block_type: type of the blocks if `diag` is None or a number.
        device: where the matrix is to be if `diag` is no array.

    Raises:
        ValueError: size or type of blocks are not known.
    """
    if is_array(diag):
        block_type, device = diag.dtype, diag.device
        size = diag.shape[0]
    else:
        size = None
        if rows_of_blocks is None and cols_of_blocks is None:
            raise ValueError(
                "rows_of_blocks and/or cols_of_blocks must be provided for constructing a matrix "
                "with uniform diagonal"
            )
        if block_type is None:
            if diag is None or not is_value(diag):
                raise ValueError("Either `diag` or `block_type` needs to be provided")
            block_type = type(diag)
    rows = rows_of_blocks if rows_of_blocks is not None else cols_of_blocks
    cols = cols_of_blocks if cols_of_blocks is not None else rows_of_blocks
    rows, cols = (size if n is None else n for n in (rows, cols))
    result = new_matrix(rows, cols, bsr_matrix_t(block_type)._block_type, device)
    bsr_set_diag(result, diag, rows, cols)
    return result


@checked(A=MATRIX, rows_of_blocks=COUNT)
def bsr_set_identity(A: BsrMatrix, rows_of_blocks: int | None = None) -> None:
    """Makes a matrix the identity.

    Args:
        A: the matrix; its blocks are square.
        rows_of_blocks: its number of rows and columns, by default what it was.

    Raises:
        ValueError: the blocks are not square.
    """
    rows, cols = A.block_shape
    if rows != cols:
        raise ValueError(f"expects square blocks for the identity, got {A.block_shape}")
    bsr_set_diag(A, A.scalar_type(1), rows_of_blocks, rows_of_blocks)


@checked(rows_of_blocks=COUNT)
def bsr_identity(rows_of_blocks: int, block_type, device=None) -> BsrMatrix:
    """The identity of `rows_of_blocks` square blocks."""
    result = new_matrix(rows_of_blocks, rows_of_blocks, block_type, device)
    bsr_set_identity(result)
    return result
