"""Transposed matrices."""

from __future__ import annotations

import warp as wp
from warp._src.sparse import sums
from warp._src.sparse.checks import check_storage
from warp._src.sparse.entries import check_topology, collect, fresh_values
from warp._src.sparse.expressions import matrix_and_factor
from warp._src.sparse.matrix import BsrMatrix, new_matrix
from warp.extend import checked
from warp.extend.kinds import MATRIX, SPARSE, TEXT


@checked(dest=MATRIX, src=SPARSE, topology=TEXT)
def bsr_set_transpose(dest: BsrMatrix, src, topology: str | None = None) -> None:
    """Makes a matrix the transposed of another one. Differentiable.

    Args:
        dest: the target.
        src: the matrix to transpose.
        topology: "compact", "masked" (the blocks that `dest` has) or "padded" (within the room
            of its rows; one that has not enough stays empty, and `dest.status_sync()` says so).

    Raises:
        ValueError: shapes, types or devices do not fit.
    """
    src, factor = matrix_and_factor(src)
    topology = check_topology(dest, topology)
    check_storage(dest)
    if dest.device != src.device:
        raise ValueError(
            f"All arguments must reside on the same device, got {dest.device} and {src.device}"
        )
    if dest.scalar_type != src.scalar_type:
        raise ValueError(
            "All arguments must have the same scalar type, got "
            f"{dest.scalar_type} and {src.scalar_type}"
        )
    if dest.block_shape != src.block_shape[::-1]:
        raise ValueError(
            f"Destination block shape must be {src.block_shape[::-1]}, got {dest.block_shape}"
        )
    if topology == "compact":
        dest.nrow, dest.ncol = src.ncol, src.nrow
    elif (dest.nrow, dest.ncol) != (src.ncol, src.nrow):
        raise ValueError(
            f"Destination matrix must have {src.ncol} rows and {src.nrow} columns, got "
            f"{dest.nrow} and {dest.ncol}"
        )
    rows, columns = src.uncompress_rows(), src.columns[: src.nnz]
    if dest.columns.ptr == src.columns.ptr:
        columns = wp.clone(columns)
    blocks, values = src.scalar_values, src.values
    entries = collect(dest, columns, rows, topology, keeps_parts=False)
    fresh_values(dest, [values])
    kernel = sums.transpose_kernel(dest.scalar_type)
    sums.launch(kernel, dest, blocks, factor, entries.order, entries.begins, entries.ends)


@checked(A=SPARSE)
def bsr_transposed(A) -> BsrMatrix:
    """The transposed of a matrix, a copy."""
    source, _ = matrix_and_factor(A)
    shape = source.block_shape[::-1]
    dtype = source.dtype
    if shape != source.block_shape:
        dtype = wp.types.matrix(shape, source.scalar_type)
    result = new_matrix(source.ncol, source.nrow, dtype, source.device)
    result.values.requires_grad = source.requires_grad
    bsr_set_transpose(result, A)
    return result
