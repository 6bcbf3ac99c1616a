"""Constant tables of kernels - numbers known before a kernel is translated."""

from __future__ import annotations

import numpy as np

from warp._src.types.matrices import matrix
from warp._src.types.vectors import vector


def table(values, dtype):
    """A constant that functions of kernels index as `T[i]` or `T[i, j]`, rounded to `dtype` once.

    Args:
        values: (n,) or (n, m) numbers; more than two dimensions are an error.
    """
    values = np.asarray(values)
    if values.ndim == 1:
        return vector(length=len(values), dtype=dtype)(values.tolist())
    rows, columns = values.shape
    return matrix(shape=(rows, columns), dtype=dtype)(values.reshape(-1).tolist())
