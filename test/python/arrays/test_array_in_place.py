"""Random programs of operators in place on arrays and their views, beside NumPy's."""

import operator

import numpy as np
import pytest

import warp as wp
from random_runs import seeds

N = 6
OPERATORS = [operator.iadd, operator.isub, operator.imul]


def views(base, device, seed):
    """Pairs of the same view of an array here and of NumPy's, some of them of other views."""
    rng = np.random.default_rng(seed)
    a, b = wp.array(base, device=device), base.copy()
    pairs = [(a, b), (a.flatten(), b.reshape(-1)), (a.transpose(), b.T)]
    for _ in range(4):
        one, two = pairs[rng.integers(len(pairs))]
        keys = []
        for extent in one.shape:
            low = int(rng.integers(0, (extent + 1) // 2))
            keys.append(slice(low, int(rng.integers(low + 1, extent + 1)), int(rng.integers(1, 3))))
        pairs.append((one[tuple(keys)], two[tuple(keys)]))
    row, column = (rng.permutation(N)[:3] for _ in range(2))
    indices = [wp.array(which, dtype=int, device=device) for which in (row, column)]
    return pairs, (wp.indexedarray(a, indices), b, np.ix_(row, column))


def fitting(shape, pairs, rng):
    """A view that broadcasts to a shape, or a number."""
    found = [pair for pair in pairs if broadcasts(pair[1].shape, shape)]
    if not found or rng.integers(4) == 0:
        number = float(rng.integers(-3, 4))
        return number, number
    return found[rng.integers(len(found))]


def broadcasts(shape, to):
    tail = to[len(to) - len(shape) :] if len(shape) <= len(to) else None
    return tail is not None and all(a in (1, b) for a, b in zip(shape, tail, strict=True))


@pytest.mark.parametrize("seed", seeds(25))
def test_random_programs(device, seed):
    """Every view and the array itself have NumPy's numbers after each step."""
    rng = np.random.default_rng(seed)
    base = rng.integers(-4, 5, (N, N)).astype(np.float64)
    pairs, (some, whole, places) = views(base, device, seed)
    for _ in range(12):
        change = OPERATORS[rng.integers(len(OPERATORS))]
        if rng.integers(4) == 0:
            ours, theirs = fitting((3, 3), pairs, rng)
            assert change(some, ours) is some
            whole[places] = change(whole[places], theirs)
        else:
            target, expected = pairs[rng.integers(len(pairs))]
            ours, theirs = fitting(expected.shape, pairs, rng)
            assert change(target, ours) is target
            change(expected, theirs)
        # The same numbers in any order of sums: all are integers.
        if np.abs(whole).max() > 2**40:
            break
        for one, two in pairs:
            np.testing.assert_array_equal(one.numpy(), two)
        np.testing.assert_array_equal(some.numpy(), whole[places])
