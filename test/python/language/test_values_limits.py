"""Minima and maxima are IEEE 754-2019's minimumNumber and maximumNumber wherever they are made."""

import itertools
import math

import numpy as np
import pytest

import warp as wp

VALUES = (math.nan, -0.0, 0.0, math.inf, -math.inf, 1.0, -1.0)
PAIRS = np.array(list(itertools.product(VALUES, VALUES)))


def limits(a, b):
    """The smaller and the larger number; -0 lies below +0."""
    given = [x for x in (a, b) if not math.isnan(x)]
    ordered = sorted(given, key=lambda x: (x, math.copysign(1.0, x)))
    return (ordered[0], ordered[-1]) if given else (math.nan, math.nan)


EXPECTED = np.array([limits(a, b) for a, b in PAIRS.tolist()])


def bits(values):
    """Numbers with the sign of zero, NaN without."""
    values = np.asarray(values, np.float64)
    return [("nan" if math.isnan(x) else (x, math.copysign(1.0, x))) for x in values.ravel()]


@pytest.mark.parametrize("real", [wp.float16, wp.float32, wp.float64])
def test_scalars_and_vectors(device, real):
    vec2 = wp.types.vector(2, real)

    @wp.kernel
    def select(ab: wp.array(dtype=vec2), out: wp.array2d(dtype=real)):
        i = wp.tid()
        v = ab[i]
        w = vec2(v[1], v[0])
        out[i, 0], out[i, 1] = wp.min(v[0], v[1]), wp.max(v[0], v[1])
        low, high = wp.min(v, w), wp.max(v, w)
        out[i, 2], out[i, 3] = low[1], high[0]
        out[i, 4], out[i, 5] = wp.min(v), wp.max(v)

    out = wp.zeros((len(PAIRS), 6), dtype=real, device=device)
    wp.launch(select, len(PAIRS), [wp.array(PAIRS, dtype=vec2, device=device), out], device=device)
    found = out.numpy()
    for first in (0, 2, 4):
        assert bits(found[:, first]) == bits(EXPECTED[:, 0])
        assert bits(found[:, first + 1]) == bits(EXPECTED[:, 1])


@pytest.mark.parametrize("real", [wp.float32, wp.float64])
@pytest.mark.parametrize("count", [1, 40])
def test_atomics(device, real, count):
    @wp.kernel
    def update(x: wp.array(dtype=real), low: wp.array(dtype=real), high: wp.array(dtype=real)):
        for k in range(1):
            wp.atomic_min(low, k, x[wp.tid()])
            wp.atomic_max(high, k, x[wp.tid()])

    @wp.kernel
    def scatter(x: wp.array(dtype=real), at: wp.array(dtype=int), low: wp.array(dtype=real)):
        i = wp.tid()
        # The result in use keeps each update an instruction of its own.
        low[1] = wp.atomic_min(low, at[i], x[i])

    for (a, b), (least, most) in zip(PAIRS.tolist(), EXPECTED.tolist()):
        x = wp.full(count, b, dtype=real, device=device)
        low, high = (wp.array([a, a], dtype=real, device=device) for _ in range(2))
        wp.launch(update, count, [x, low, high], device=device)
        assert bits(low.numpy()[:1]) == bits([least]), (a, b)
        assert bits(high.numpy()[:1]) == bits([most]), (a, b)
        low = wp.array([a, 0.0], dtype=real, device=device)
        at = wp.zeros(count, dtype=int, device=device)
        wp.launch(scatter, count, [x, at, low], device=device)
        assert bits(low.numpy()[:1]) == bits([least]), (a, b)


@wp.kernel(module_options={"cpu_lanes": 1})
def largest_of_wanted(
    wanted: wp.array(dtype=int), x: wp.array(dtype=int), largest: wp.array(dtype=float)
):
    i = wp.tid()
    if wanted[i] == 0:
        return
    wp.atomic_max(largest, 0, wp.float32(x[i]))


@pytest.mark.parametrize("count", [1, 2, 3, 40])
def test_extrema_of_what_cannot_be_nan(count, device):
    """A combination over threads begins without a number; a converted integer is one."""
    numbers = np.arange(count) * 3 + 7
    wanted, x = (wp.array(one, dtype=int, device=device) for one in (numbers > 6, numbers))
    largest = wp.zeros(1, dtype=float, device=device)
    wp.launch(largest_of_wanted, count, [wanted, x, largest], device=device)
    assert largest.numpy()[0] == numbers[-1]
