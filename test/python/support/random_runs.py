"""Number of random programs that the tests make.

WARP_TEST_RUNS=50 makes 50 times as many, most of them new ones: a long run by hand.
"""

import os

from hypothesis import HealthCheck, settings

_RUNS = int(os.environ.get("WARP_TEST_RUNS", "1"))
# From here on, seeds are those of long runs.
_NEW = 10_000


def examples(count):
    """Hypothesis' settings for `count` examples, the same ones each time."""
    return settings(
        max_examples=count * _RUNS,
        deadline=None,
        suppress_health_check=list(HealthCheck),
        derandomize=_RUNS == 1,
    )


def seeds(count, first=0):
    """`count` seeds from `first` on."""
    new = _NEW + first
    return [*range(first, first + count), *range(new, new + count * (_RUNS - 1))]
