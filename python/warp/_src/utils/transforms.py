"""Rigid transforms from flat numbers."""

from __future__ import annotations

from warp._src.argument_kinds import LIST
from warp._src.arguments import checked
from warp._src.types.dtypes import transformf


@checked(t=LIST)
def transform_expand(t):
    """The transform of seven numbers: a position, then a quaternion with its real part last.

    Raises:
        ValueError: there are more or fewer.
    """
    if len(t) != 7:
        raise ValueError(f"expects 7 numbers for a transform, but got {len(t)}")
    return transformf(*(float(number) for number in t))
