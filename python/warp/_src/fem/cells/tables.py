"""Constant tables of kernels - numbers known before a kernel is translated."""

from __future__ import annotations

import numpy as np

import warp as wp

_TYPES = {wp.float32: np.float32, wp.float64: np.float64, wp.int32: np.int32}


def table(values, dtype) -> np.ndarray:
    """A constant that functions of kernels index as `T[i]` or `T[i, j]`, rounded to `dtype` once.

    Args:
        values: numbers.
        dtype: `wp.float32`, `wp.float64` or `wp.int32`.
    """
    made = np.ascontiguousarray(values, dtype=_TYPES[dtype])
    made.flags.writeable = False
    return made
