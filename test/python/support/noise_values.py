"""Noise by its definition, in float64."""

import numpy as np

PRIMES = (73856093, 19349663, 53471161, 10000019)
STATE = 12345


def advance(state):
    """PCG-RXS-M-XS on 32 bits."""
    state = np.asarray(state, np.uint32)
    with np.errstate(over="ignore"):
        following = state * np.uint32(747796405) + np.uint32(2891336453)
        word = (following >> ((following >> np.uint32(28)) + np.uint32(4))) ^ following
        word = word * np.uint32(277803737)
    return (word >> np.uint32(22)) ^ word


def corner_gradient(corner):
    """A random direction per corner; its hash adds the state to the last axis only."""
    with np.errstate(over="ignore"):
        parts = [c.astype(np.uint32) * np.uint32(p) for c, p in zip(corner.T, PRIMES)]
        state = parts[-1] + np.uint32(STATE)
        for part in parts[:-1]:
            state = state ^ part
    draws = []
    for _ in parts:
        state = advance(state)
        draws.append((state >> np.uint32(8)) * 2.0**-24 - 0.5)
    gradient = np.stack(draws, axis=1)
    if len(parts) == 1:
        return 2 * gradient
    return gradient / np.linalg.norm(gradient, axis=1, keepdims=True)


def noise(points, period=None):
    n = points.shape[1]
    cell = np.floor(points).astype(np.int64)
    t = points - cell
    weight = t**3 * (t * (t * 6 - 15) + 10)
    total = np.zeros(len(points))
    for bits in np.ndindex(*[2] * n):
        corner = cell + bits
        wrapped = corner if period is None else corner % period
        share = np.where(bits, weight, 1 - weight).prod(axis=1)
        total += share * (corner_gradient(wrapped) * (t - bits)).sum(axis=1)
    return total
