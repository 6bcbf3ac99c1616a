"""Quotients of 64-bit integers by lanes are those of integers, against Python's."""

import numpy as np
import pytest

import warp as wp

EDGES = [0, 1, 2, 3, 7, 10, 2**31, 2**32, 2**52 + 1, 2**53 - 1, 2**53, 2**53 + 1, 2**61 - 1]
EDGES += [2**62, 2**62 + 1, 2**63 - 513, 2**63 - 512, 2**63 - 1]
EDGES += [-number for number in EDGES] + [-(2**63)]


def numbers(random, count):
    """Integers of all lengths."""
    magnitudes = random.integers(0, 2**63 - 1, count) >> random.integers(0, 63, count)
    return magnitudes * random.choice([-1, 1], count)


def dividends_and_divisors():
    """Extremes by extremes, integers of all lengths, multiples and what is next to them."""
    random = np.random.default_rng(5)
    a = [np.repeat(EDGES, len(EDGES)), numbers(random, 20000)]
    b = [np.tile(EDGES, len(EDGES)), numbers(random, 20000)]
    factors = [int(k) for k in random.integers(1, 1000, 20000)]
    near = np.array(numbers(random, 20000), dtype=object)
    multiples = near * factors + random.integers(-1, 2, 20000)
    a.append(np.clip(multiples, -(2**63), 2**63 - 1).astype(np.int64))
    b.append(near.astype(np.int64))
    a, b = np.concatenate(a).astype(np.int64), np.concatenate(b).astype(np.int64)
    used = (b != 0) & (b != -1)
    return a[used], b[used]


@pytest.mark.parametrize("lanes", [1, 8, 16])
def test_long_quotients(lanes):
    @wp.kernel(module="unique", module_options={"cpu_lanes": lanes})
    def divide(
        a: wp.array(dtype=wp.int64), b: wp.array(dtype=wp.int64), q: wp.array2d(dtype=wp.int64)
    ):
        i = wp.tid()
        q[0, i] = a[i] / b[i]
        q[1, i] = a[i] % b[i]
        q[2, i] = a[i] // b[i]

    a, b = dividends_and_divisors()
    q = wp.zeros((3, len(a)), dtype=wp.int64, device="cpu")
    given = [wp.array(one, dtype=wp.int64, device="cpu") for one in (a, b)]
    wp.launch(divide, len(a), given, [q], device="cpu")
    floors = [int(x) // int(y) for x, y in zip(a, b, strict=True)]
    rests = [int(x) - int(y) * f for x, y, f in zip(a, b, floors, strict=True)]
    towards_zero = [
        f + (r != 0 and (x < 0) != (y < 0)) for f, r, x, y in zip(floors, rests, a, b, strict=True)
    ]
    remainders = [int(x) - int(y) * t for x, y, t in zip(a, b, towards_zero, strict=True)]
    for got, want in zip(q.numpy(), (towards_zero, remainders, floors), strict=True):
        assert got.tolist() == want
