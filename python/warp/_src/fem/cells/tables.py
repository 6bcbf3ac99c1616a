"""Constant tables of kernels - numbers known before a kernel is translated."""

from __future__ import annotations

import numpy as np

import warp as wp


def table(values, dtype):
    """A constant that functions of kernels index as `T[i]` or `T[i, j]`, rounded to `dtype` once.

    Args:
        values: (n,) or (n, m) numbers; more than two dimensions are an error.
    """
    values = np.asarray(values)
    if values.ndim == 1:
        return wp.types.vector(length=len(values), dtype=dtype)(values.tolist())
    rows, columns = values.shape
    return wp.types.matrix(shape=(rows, columns), dtype=dtype)(values.reshape(-1).tolist())
