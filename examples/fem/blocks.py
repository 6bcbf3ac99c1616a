"""Systems of several fields: one matrix of numbers from sparse ones of blocks, and its solution."""

import numpy as np

import warp as wp
from warp.optim import linear


def scalars(matrix, row=0, column=0, transposed=False):
    """(rows, columns, values) of the numbers of a matrix of blocks, from a row and a column on."""
    offsets = matrix.offsets.numpy()[: matrix.nrow + 1]
    (r, c), nnz = matrix.block_shape, int(offsets[-1])
    i, j = np.divmod(np.arange(r * c), c)
    rows = np.repeat(np.arange(matrix.nrow), np.diff(offsets))[:, None] * r + i
    columns = matrix.columns.numpy()[:nnz, None] * c + j
    rows, columns = (columns, rows) if transposed else (rows, columns)
    values = matrix.values.numpy()[:nnz].reshape(-1)
    return rows.ravel() + row, columns.ravel() + column, values


def solve(parts, right, fixed):
    """The solution of a system, 0 where it is fixed.

    Args:
        parts: of the matrix, as `scalars` gives them; those of one place are added.
        right: the right-hand side, in NumPy.
        fixed: numbers of fixed unknowns.
    """
    rows, columns, values = (np.concatenate(p) for p in zip(*parts, strict=True))
    is_fixed = np.zeros(len(right), bool)
    is_fixed[fixed] = True
    values = np.where(is_fixed[rows] | is_fixed[columns], 0.0, values)
    k = np.flatnonzero(is_fixed)
    rows, columns = (wp.array(np.append(a, k), dtype=int) for a in (rows, columns))
    values = wp.array(np.append(values, np.ones(len(k))), dtype=wp.float64)
    A = wp.sparse.bsr_from_triplets(len(right), len(right), rows, columns, values)
    b = wp.array(np.where(is_fixed, 0.0, right), dtype=wp.float64)
    return linear.lu(A).solve(b).numpy()
