"""Arguments of a launch that are one array, or overlap.

Derivatives use one argument in the place of all that are one array: what a thread reads by one name
and writes by another follows from the order of its accesses, as with one name. If only parts of
arrays meet, a derivative would not know what it reads, so that is an error.
"""

from __future__ import annotations

from warp import _native
from warp._src import errors
from warp._src.kernels.call import Call


def meetings(call: Call) -> list[tuple[int, int]]:
    """Pairs (written, other) of arrays of a launch of which elements meet, by number.

    Which elements a kernel with tiles touches is not known, so all of its arrays count.
    """
    leaves = [leaf for _, leaf in call.leaves]
    if not _native.shares_elements([leaf for leaf in leaves if leaf is not None]):
        return []
    if call.regions is not None:
        return call.regions.meetings()
    if not call.signature.has_source:
        return []
    regions = [leaf if leaf is None else _native.Region(leaf) for leaf in leaves]
    return [
        (i, j)
        for i in call.signature.written
        for j, other in enumerate(regions)
        if i != j and regions[i] is not None and other is not None and regions[i].overlaps(other)
    ]


def check_overlap(call: Call, active, what: str) -> tuple[int, ...]:
    """Rejects a launch that writes elements of one array by another one, if one is active.

    Returns:
        The facts of `same_arrays` about arguments that are one array.

    Raises:
        WarpGradientError: there are such arrays.
    """
    pairs = [(i, j) for i, j in meetings(call) if active[i] or active[j]]
    same = same_arrays(call, pairs)
    for i, j in pairs:
        if not same or same[i] != same[j]:
            raise errors.WarpGradientError(
                f"launch('{call.kernel.key}'{what}): arguments "
                f"'{call.leaves[i][0]}', which is written, and '{call.leaves[j][0]}' overlap, "
                f"give the kernel one array for both, or write to another array"
            )
    return same


def same_arrays(call: Call, pairs) -> tuple[int, ...]:
    """For each array of a launch the number of the first one that is the same array.

    Args:
        call: the launch.
        pairs: arrays of which elements meet, by number.

    Returns:
        An empty tuple if no pair is one array.
    """
    leaves = [leaf for _, leaf in call.leaves]
    if not any(_is_same(leaves[i], leaves[j]) for i, j in pairs):
        return ()
    same = []
    for i, leaf in enumerate(leaves):
        earlier = (j for j in same if _is_same(leaves[j], leaf))
        same.append(next(earlier, i))
    return tuple(same)


def notes_of(call: Call, same) -> tuple[str, ...]:
    """The part of an error about a derivative for arguments that are one array."""
    names = [name for name, _ in call.leaves]
    groups: dict = {}
    for i, first in enumerate(same):
        groups.setdefault(first, []).append(f"'{names[i]}'")
    return tuple(
        f"arguments {', '.join(group)} are one array" for group in groups.values() if len(group) > 1
    )


def _is_same(one, other) -> bool:
    """True if two arrays have the same elements, in memory and in kind, and the same gradient."""
    if one is other or one is None or other is None:
        return one is other and one is not None
    kinds = type(one) is type(other) and one.dtype is other.dtype
    return kinds and _lies_as(one, other) and _has_same_gradient(one, other)


def _has_same_gradient(one, other) -> bool:
    if one.requires_grad != other.requires_grad:
        return False
    return not one.requires_grad or _lies_as(one.grad, other.grad)


def _lies_as(one, other) -> bool:
    return (one.ptr, one.shape, one.strides) == (other.ptr, other.shape, other.strides)
