"""Orders primitives along a Hilbert curve.

The curve goes through a grid of 1024 cells along the longest axis; primitives within one cell stay
in the order of their numbers.
"""

from __future__ import annotations

import warp as wp

_BITS = 10
_FINE = wp.constant(1 << _BITS)
# What is not finite comes behind all others.
_LAST = wp.constant(wp.uint32(0xFFFFFFFF))


@wp.func
def _spread(x: wp.uint32):
    """Ten bits, two bits apart."""
    x = (x | (x << wp.uint32(16))) & wp.uint32(0x030000FF)
    x = (x | (x << wp.uint32(8))) & wp.uint32(0x0300F00F)
    x = (x | (x << wp.uint32(4))) & wp.uint32(0x030C30C3)
    return (x | (x << wp.uint32(2))) & wp.uint32(0x09249249)


@wp.func
def _along_curve(x: wp.uint32, y: wp.uint32, z: wp.uint32):
    """Where a Hilbert curve meets a cell (Skilling, "Programming the Hilbert curve", 2004)."""
    q = wp.uint32(1 << (_BITS - 1))
    while q > wp.uint32(1):
        p = q - wp.uint32(1)
        if (x & q) != wp.uint32(0):
            x = x ^ p
        if (y & q) != wp.uint32(0):
            x = x ^ p
        else:
            t = (x ^ y) & p
            x = x ^ t
            y = y ^ t
        if (z & q) != wp.uint32(0):
            x = x ^ p
        else:
            t = (x ^ z) & p
            x = x ^ t
            z = z ^ t
        q = q >> wp.uint32(1)
    y = y ^ x
    z = z ^ y
    t = wp.uint32(0)
    q = wp.uint32(1 << (_BITS - 1))
    while q > wp.uint32(1):
        if (z & q) != wp.uint32(0):
            t = t ^ (q - wp.uint32(1))
        q = q >> wp.uint32(1)
    return (_spread(x ^ t) << wp.uint32(2)) | (_spread(y ^ t) << wp.uint32(1)) | _spread(z ^ t)


@wp.func
def _cell(x: float):
    return wp.uint32(wp.clamp(int(x), 0, _FINE - 1))


@wp.kernel(enable_backward=False, module="unique")
def _number(
    centers: wp.array(dtype=wp.vec3),
    whole: wp.array(dtype=wp.vec3),
    keys: wp.array(dtype=wp.uint32),
):
    """Where centers are along the curve."""
    i = wp.tid()
    center = centers[i]
    key = _LAST
    if center[0] == center[0]:
        low = 0.5 * whole[0]
        fine = float(_FINE) / wp.max(wp.max(0.5 * whole[1] - low), 1.0e-37)
        at = (0.5 * center - low) * fine
        key = _along_curve(_cell(at[0]), _cell(at[1]), _cell(at[2]))
    keys[i] = key


def sort_along_curve(centers, whole, keys, order) -> None:
    """Orders primitives.

    Args:
        centers: vec3 of each primitive, NaN for those that are to be last.
        whole: two corners that hold all centers.
        keys, order: memory for `wp.utils.radix_sort_pairs`; the order is read and written.
    """
    count = len(centers)
    wp.launch(_number, count, inputs=[centers, whole, keys], device=centers.device)
    wp.utils.radix_sort_pairs(keys, order, count)
