"""Mip chains: coarser and coarser levels of a texture, on the host."""

from __future__ import annotations

# As many has a texture of the largest extent.
MOST_LEVELS = 16


def numpy():
    """NumPy, which is imported when a texture is made."""
    import numpy as module

    return module


def count_of(extents, wanted) -> int:
    """The number of levels.

    Args:
        extents: of the texture.
        wanted: 0 for as many as there can be.

    Raises:
        ValueError: there are not so many.
    """
    most = min(max(extents).bit_length(), MOST_LEVELS)
    if not 0 <= wanted <= most:
        raise ValueError(
            f"num_mip_levels of a texture {tuple(extents)} is 0 to {most}, not {wanted}"
        )
    return wanted or most


def chain_of(values, rank, levels) -> list:
    """Levels of a texture, the finest first; extents are halved, but for those of 1.

    A texel is the mean of the two, four or eight that it covers, in float64 and rounded to their
    type; the last one of an odd extent is left out.

    Args:
        values: NumPy array with `rank` dimensions, and perhaps one for channels.
    """
    chain = [values]
    while len(chain) < levels:
        level = chain[-1].astype("f8")
        for axis in range(rank):
            half = level.shape[axis] // 2
            if half:
                pairs = numpy().moveaxis(level, axis, 0)[: 2 * half]
                level = numpy().moveaxis(0.5 * pairs[0::2] + 0.5 * pairs[1::2], 0, axis)
        if values.dtype.kind in "iu":
            level = numpy().rint(level)
        chain.append(level.astype(values.dtype))
    return chain
