"""Sums of matrices, and products with numbers."""

import functools

import warp as wp
from warp._src.sparse import sums
from warp._src.sparse.assignment import bsr_copy
from warp._src.sparse.checks import check_storage
from warp._src.sparse.entries import check_topology, collect, fresh_values
from warp._src.sparse.expressions import matrix_and_factor
from warp._src.sparse.matrix import BsrMatrix, new_matrix
from warp.extend import checked, types_equal
from warp.extend.kinds import NUMBER, SPARSE, TEXT


class bsr_axpy_work_arrays:
    """Accepted by `bsr_axpy` for compatibility: memory comes from the device's pool."""


@functools.cache
def _scale_kernel(scalar):
    @sums.kernel_for(scalar)
    def scale(values: wp.array3d(dtype=scalar), factor: scalar, result: wp.array3d(dtype=scalar)):
        block, i, j = wp.tid()
        result[block, i, j] = factor * values[block, i, j]

    return scale


@checked(x=SPARSE, alpha=NUMBER)
def bsr_scale(x, alpha) -> BsrMatrix:
    """Multiplies a matrix by a number, in place, and returns it. Differentiable."""
    matrix, factor = matrix_and_factor(x)
    if matrix is not x:
        return bsr_copy(x * alpha)
    if alpha * factor != 1.0:
        blocks = matrix.scalar_values
        if matrix.requires_grad:
            fresh_values(matrix, [matrix.values])
        sums.launch(_scale_kernel(matrix.scalar_type), matrix, blocks, alpha)
    return matrix


def check_operands(*matrices) -> None:
    """Checks that matrices are on one device and have numbers of one type.

    Raises:
        ValueError: they do not.
    """
    first = matrices[0]
    for other in matrices[1:]:
        if other.device != first.device:
            raise ValueError(
                f"All arguments must reside on the same device, got {first.device} and "
                f"{other.device}"
            )
        if not types_equal(other.scalar_type, first.scalar_type):
            raise ValueError(
                "All arguments must have the same scalar type, got "
                f"{first.scalar_type.__name__} and {other.scalar_type.__name__}"
            )


@checked(x=SPARSE, y=SPARSE, topology=TEXT)
def bsr_axpy(
    x,
    y: BsrMatrix | None = None,
    alpha=1.0,
    beta=1.0,
    work_arrays: bsr_axpy_work_arrays | None = None,
    topology: str | None = None,
) -> BsrMatrix:
    """Sets `y` to `alpha * x + beta * y` and returns it. Differentiable.

    Args:
        x: a matrix; may be `y`.
        y: the other operand and the result; a new matrix, as if of zeros, by default.
        alpha, beta: factors.
        work_arrays: accepted for compatibility.
        topology: "compact" (all blocks of both), "masked" (the blocks of `y`) or "padded" (within
            the room of the rows of `y`; its `status_sync()` says whether that sufficed).

    Raises:
        ValueError: shapes, types or devices do not fit.
    """
    x, factor = matrix_and_factor(x)
    alpha = alpha * factor
    topology = check_topology(y, topology)
    if y is None:
        if topology != "compact":
            raise ValueError("Left-hand-side 'y' matrix must be provided for this topology policy")
        y, beta = new_matrix(x.nrow, x.ncol, x.dtype, x.device), 0.0
        y.values.requires_grad = x.requires_grad
    check_operands(x, y)
    check_storage(y)
    if x.block_shape != y.block_shape:
        raise ValueError(
            f"Matrices must have the same block shape, got {x.block_shape} and {y.block_shape}"
        )
    if (x.nrow, x.ncol) != (y.nrow, y.ncol):
        raise ValueError(
            "Matrices must have the same number of rows and columns, got "
            f"({x.nrow}, {x.ncol}) and ({y.nrow}, {y.ncol})"
        )
    if x is y:
        return bsr_scale(y, alpha + beta)
    places = [_places(x)] + ([_places(y)] if beta else [])
    rows, columns = (joined(parts) for parts in zip(*places, strict=True))
    x_count, old, values = x.nnz, y.scalar_values, y.values
    entries = collect(y, rows, columns, topology)
    # Even without `y` in the sum its memory may be that of `x`.
    fresh_values(y, [x.values] + ([values] if beta else []))
    order = (entries.order, entries.begins, entries.ends)
    kernel = sums.add_kernel(y.scalar_type)
    sums.launch(kernel, y, x.scalar_values, alpha, x_count, old, beta, *order)
    return y


def _places(matrix):
    return matrix.uncompress_rows(), matrix.columns[: matrix.nnz]


def joined(parts):
    """One array of the elements of several, which it does not share memory with."""
    if len(parts) == 1:
        return wp.clone(parts[0])
    result = wp.empty(sum(part.size for part in parts), dtype=int, device=parts[0].device)
    offset = 0
    for part in parts:
        if part.size:
            wp.copy(result, part, dest_offset=offset, count=part.size)
        offset += part.size
    return result
