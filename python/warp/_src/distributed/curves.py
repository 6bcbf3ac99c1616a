"""Hilbert curve: keys of points, so that near keys are near points."""

from __future__ import annotations

import numpy as np

# Bits of a coordinate, by the number of coordinates: keys have 63 bits.
_BITS = {1: 62, 2: 31, 3: 21}


def hilbert_keys(points, low=None, high=None) -> np.ndarray:
    """The place of each point along a Hilbert curve, as unsigned integers.

    After Skilling, "Programming the Hilbert curve" (2004): coordinates are transposed to the bits
    of the key by exchanges and inversions from the highest bit down.

    Args:
        points: one row of 1 to 3 coordinates for each.
        low, high: bounds, by default those of the points; points outside count as at the border.
    """
    points = np.asarray(points, float)
    points = points.reshape(len(points), -1)
    count, ndim = points.shape
    if not count:
        return np.zeros(0, np.uint64)
    bits = _BITS[ndim]
    low = points.min(0) if low is None else np.asarray(low, float)
    high = points.max(0) if high is None else np.asarray(high, float)
    span = np.where(high > low, high - low, 1.0)
    scaled = np.clip((points - low) / span, 0.0, 1.0) * (2.0 ** min(bits, 52) - 1)
    x = scaled.astype(np.uint64).T.copy()
    if bits > 52:
        x <<= np.uint64(bits - 52)
    one = np.uint64(1)
    place = one << np.uint64(bits - 1)
    while place > one:
        below = place - one
        for axis in range(ndim):
            has = (x[axis] & place) != 0
            exchanged = np.where(has, np.uint64(0), (x[0] ^ x[axis]) & below)
            x[0] ^= np.where(has, below, exchanged)
            x[axis] ^= exchanged
        place >>= one
    for axis in range(1, ndim):
        x[axis] ^= x[axis - 1]
    turned = np.zeros(count, np.uint64)
    place = one << np.uint64(bits - 1)
    while place > one:
        turned ^= np.where((x[ndim - 1] & place) != 0, place - one, np.uint64(0))
        place >>= one
    x ^= turned
    keys = np.zeros(count, np.uint64)
    for bit in range(bits - 1, -1, -1):
        for axis in range(ndim):
            keys = (keys << one) | ((x[axis] >> np.uint64(bit)) & one)
    return keys
