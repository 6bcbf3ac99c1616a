"""Matrices as dense ones, and random triplets."""

import numpy as np

import warp as wp


def dense(matrix):
    """The numbers of a matrix; checks that columns ascend within rows."""
    rows, cols = matrix.block_shape
    result = np.zeros(matrix.shape)
    offsets, columns = matrix.offsets.numpy(), matrix.columns.numpy()
    values = matrix.values.numpy().reshape(-1, rows, cols)
    counts = np.diff(offsets) if matrix.row_counts is None else matrix.row_counts.numpy()
    for row in range(matrix.nrow):
        blocks = np.arange(offsets[row], offsets[row] + counts[row])
        assert (np.diff(columns[blocks]) > 0).all()
        for block in blocks:
            result[place(row, rows), place(columns[block], cols)] += values[block]
    return result


def place(index, extent):
    return slice(index * extent, (index + 1) * extent)


class Triplets:
    """Random triplets with duplicates, and the dense matrix that they add up to."""

    def __init__(self, seed, nrow, ncol, block, count):
        rng = np.random.default_rng(seed)
        self.size, self.block = (nrow, ncol), block
        self.rows, self.columns = rng.integers(0, nrow, count), rng.integers(0, ncol, count)
        self.values = rng.standard_normal((count, *block))
        self.dense = self.add_up(self.values)

    def add_up(self, values):
        rows, cols = self.block
        result = np.zeros((self.size[0] * rows, self.size[1] * cols))
        for row, column, value in zip(self.rows, self.columns, values, strict=True):
            result[place(row, rows), place(column, cols)] += value
        return result

    def arrays(self, device, dtype=wp.float64, requires_grad=False):
        values = self.values if self.block != (1, 1) else self.values[:, 0, 0]
        return (
            wp.array(self.rows, dtype=int, device=device),
            wp.array(self.columns, dtype=int, device=device),
            wp.array(values, dtype=dtype, device=device, requires_grad=requires_grad),
        )

    def matrix(self, device):
        import warp.sparse

        return warp.sparse.bsr_from_triplets(*self.size, *self.arrays(device))


def vector(values, width, device, requires_grad=False):
    """Numbers as an array of vectors of a width."""
    dtype = wp.float64 if width == 1 else wp.types.vector(width, wp.float64)
    shaped = values if width == 1 else values.reshape(-1, width)
    return wp.array(shaped, dtype=dtype, device=device, requires_grad=requires_grad)
