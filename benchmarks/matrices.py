"""Sparse matrices for libraries.py."""

import numpy as np

import warp as wp
import warp.sparse


def laplacian(side, block, device):
    """The matrix of a five-point stencil, in blocks."""
    side //= block
    n = side * side
    i = np.arange(n)
    x, y = i % side, i // side
    rows, columns, values = [i], [i], [np.full(n, 4.01)]
    for inside, step in ((x > 0, -1), (x < side - 1, 1), (y > 0, -side), (y < side - 1, side)):
        rows.append(i[inside])
        columns.append(i[inside] + step)
        values.append(np.full(inside.sum(), -1.0))
    rows, columns, values = map(np.concatenate, (rows, columns, values))
    numbers = values.astype(np.float32)
    if block > 1:
        numbers = numbers[:, None, None] * np.eye(block, dtype=np.float32) + np.float32(1e-3)
    parts = [wp.array(a, dtype=int, device=device) for a in (rows, columns)]
    data = wp.array(numbers, dtype=wp.float32, device=device)
    matrix = wp.sparse.bsr_from_triplets(n, n, *parts, data)
    matrix.nnz_sync()
    return matrix


def random_matrix(lengths, rng, device):
    """A matrix of float32 whose rows have so many numbers, anywhere."""
    rows = np.repeat(np.arange(lengths.size), lengths)
    columns = rng.integers(0, lengths.size, rows.size)
    numbers = rng.random(rows.size, dtype=np.float32)
    parts = [wp.array(a, dtype=int, device=device) for a in (rows, columns)]
    data = wp.array(numbers, dtype=wp.float32, device=device)
    matrix = wp.sparse.bsr_from_triplets(lengths.size, lengths.size, *parts, data)
    matrix.nnz_sync()
    return matrix
