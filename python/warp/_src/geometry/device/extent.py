"""Where primitives are: the bounds of all, and the scale of coordinates that goes with them."""

from __future__ import annotations

import warp as wp
from warp._src.geometry.device.refit import is_finite

# Threads that look for the bounds of all.
PARTS = 16384
_GATHERERS = wp.constant(256)


@wp.kernel(enable_backward=False, module="unique")
def _bound_parts(
    first: wp.array(dtype=wp.vec3),
    second: wp.array(dtype=wp.vec3),
    boxes: bool,
    parts: wp.array2d(dtype=wp.vec3),
    whole: wp.array(dtype=wp.vec3),
):
    """Bounds of every so-manieth point, or box."""
    i = wp.tid()
    low = wp.vec3(wp.inf, wp.inf, wp.inf)
    high = -low
    if i == 0:
        whole[0] = low
        whole[1] = high
    for k in range(i, len(first), parts.shape[0]):
        a = first[k]
        b = a
        proper = is_finite(a)
        if boxes:
            b = second[k]
            proper = proper and is_finite(b) and a[0] <= b[0] and a[1] <= b[1] and a[2] <= b[2]
        if proper:
            low = wp.min(low, a)
            high = wp.max(high, b)
    parts[i, 0] = low
    parts[i, 1] = high


@wp.kernel(enable_backward=False, module="unique")
def _bound_whole(parts: wp.array2d(dtype=wp.vec3), whole: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    low = parts[i, 0]
    high = parts[i, 1]
    for k in range(i, parts.shape[0], _GATHERERS):
        low = wp.min(low, parts[k, 0])
        high = wp.max(high, parts[k, 1])
    wp.atomic_min(whole, 0, low)
    wp.atomic_max(whole, 1, high)


@wp.func
def scale_of(low: wp.vec3, high: wp.vec3):
    """A power of two that brings the extent near 1, as lib/Geometry/Scale.cpp has it."""
    size = wp.float64(0.0)
    for axis in range(3):
        a = wp.float64(low[axis])
        b = wp.float64(high[axis])
        far = wp.max(wp.abs(a), wp.abs(b))
        size = wp.max(size, wp.max(b - a, far * wp.float64(1.0 / 1048576.0)))
    exponent = int(wp.cast(size, wp.uint64) >> wp.uint64(52)) - 1023
    scale = float(1.0)
    if low[0] <= high[0] and size > wp.float64(0.0):
        bits = 127 - wp.clamp(exponent, -126, 126)
        scale = wp.cast(wp.uint32(bits) << wp.uint32(23), float)
    return scale


def find_extent(first, second, parts, whole) -> None:
    """Writes two corners that hold all finite points, or all proper boxes.

    Args:
        first, second: points and None, or lower and upper corners of boxes.
        parts: pairs of vec3, one for each of `PARTS` threads.
        whole: the corners; +infinity and -infinity without any.
    """
    boxes = second is not None
    inputs = [first, second if boxes else first, boxes, parts, whole]
    wp.launch(_bound_parts, len(parts), inputs=inputs, device=whole.device)
    wp.launch(_bound_whole, _GATHERERS, inputs=[parts, whole], device=whole.device)
