"""Results at singular points: limits along random paths, where all paths agree."""

import mpmath as mp

from warp.report.search._judge import NoReferenceError

#: The distance from the point, in sizes of the operands; the tolerance, in sizes of the results.
NEAR, SAME, ZERO = mp.mpf(10) ** -15, mp.mpf(10) ** -6, mp.mpf(10) ** -12
PATHS = 6


def limit_of(function, size, random):
    """A function that has the limits of another one.

    Args:
        function: of a list of numbers, gives a list of numbers, or None where there is none.
        size: how many numbers it takes.
        random: NumPy's generator, for the paths, which are the same in every call.

    Returns:
        The function; it gives None where the paths do not agree.
    """
    ahead = random.normal(size=(PATHS, size))
    paths = [*ahead, *-ahead]

    def limit(numbers):
        largest = max(map(abs, numbers)) or mp.mpf(1)
        found = []
        for path in paths:
            moved = [x + mp.mpf(d) * largest * NEAR for x, d in zip(numbers, path, strict=True)]
            found.append(function(moved))
        if any(one is None for one in found):
            return None
        # Operands there are of size one, and so is what results next to a zero of theirs.
        size = max(mp.mpf(1), *(abs(x) for one in found for x in one))
        for values in zip(*found, strict=True):
            if max(values) - min(values) > SAME * size:
                return None
        return [x if abs(x) > ZERO * size else mp.mpf(0) for x in found[0]]

    return limit


def with_limits(function, size, random):
    """The function, and its limits where it raises `NoReferenceError`."""
    limit = limit_of(function, size, random)

    def apply(numbers):
        try:
            return function(numbers)
        except NoReferenceError:
            return limit(numbers)

    return apply
