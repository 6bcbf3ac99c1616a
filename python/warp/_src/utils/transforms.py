"""Rigid transforms from flat numbers."""

from __future__ import annotations

from warp.extend import checked
from warp.extend.kinds import LIST
from warp.types import transformf


@checked(t=LIST)
def transform_expand(t):
    """The transform of seven numbers: a position, then a quaternion with its real part last.

    Raises:
        ValueError: there are more or fewer.
    """
    if len(t) != 7:
        raise ValueError(f"expects 7 numbers for a transform, but got {len(t)}")
    return transformf(*(float(number) for number in t))
