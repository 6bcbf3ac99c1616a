"""Builtins that are written in the kernel language itself.

The front end calls them under their public names; in Python they run as they are.
"""

from warp._src.annotations import ArrayType
from warp._src.function import Function
from warp._src.types import Scalar


def _lower_bound(arr: ArrayType(Scalar), begin: int, end: int, value: Scalar):
    low = int(begin)
    high = int(end - 1)
    while low < high:
        middle = low + (high - low) // 2
        if arr[middle] < value:
            low = middle + 1
        else:
            high = middle
    return low


LOWER_BOUND = Function(_lower_bound, "lower_bound")
