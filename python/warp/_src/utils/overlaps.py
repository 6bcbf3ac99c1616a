"""Arrays that share memory."""

from __future__ import annotations

from warp.extend import errors


def _range(array, count) -> tuple:
    """Addresses within which the first elements of an array are."""
    start = array.ptr or 0
    if array.is_contiguous:
        return start, start + count * array.item_size
    shape = (count,) if array.ndim == 1 else array.shape
    ends = [(n - 1) * step for n, step in zip(shape, array.strides, strict=True)]
    low = start + sum(end for end in ends if end < 0)
    return low, start + sum(end for end in ends if end > 0) + array.item_size


def overlap(a, b) -> bool:
    """True if two arrays share memory without being the same view."""
    if a.device != b.device or (a.ptr, a.strides) == (b.ptr, b.strides):
        return False
    one, other = _range(a, a.size), _range(b, b.size)
    return one[0] < other[1] and other[0] < one[1]


def check_apart(what, *parts) -> None:
    """Checks arrays of one device, of each of which the first elements are used."""
    ranges = [_range(array, count) for array, count in parts if count]
    for i, one in enumerate(ranges):
        for other in ranges[:i]:
            if one[0] < other[1] and other[0] < one[1]:
                raise errors.WarpError(
                    f"{what}() requires arrays that do not overlap, but got bytes "
                    f"[{other[0]:#x}, {other[1]:#x}) and [{one[0]:#x}, {one[1]:#x})"
                )
