"""Copies of what is about to be overwritten, and arrays as they were.

A `Piece` is the contents of a region of memory before a write, packed. A tape's `Budget` limits
how much it keeps. `Images` puts pieces back to where they were: into a copy of an array, which is
taken back in time piece by piece while a backward pass goes through its records.
"""

from __future__ import annotations

from warp import _native
from warp._src.arrays import hooks
from warp._src.arrays.layout import bytes_spanned
from warp._src.devices import allocators
from warp._src.types.scalars import uint8

# True if elements are what the runtime copies, so that it may make the copies that are kept.
natively = True


class Budget:
    """How much a tape may keep.

    Args:
        max_bytes: the limit; None stands for a quarter of the memory of the device.

    Attributes:
        used: bytes that are kept.
        costs: bytes and number of copies by the operation that made them necessary.
        refused: bytes that a copy would have needed, 0 if there was room for all.
    """

    def __init__(self, max_bytes=None):
        self.max_bytes = max_bytes
        self.used = self.refused = 0
        self.costs: dict = {}

    def take(self, size, by, device) -> bool:
        """Makes room for a copy; False if there is none."""
        limit = self.max_bytes
        if limit is None:
            limit = self.max_bytes = device.total_memory // 4
        if self.used + size > limit:
            self.refused = size
            return False
        self.used += size
        cost = self.costs.setdefault(by, [0, 0])
        cost[0] += size
        cost[1] += 1
        return True

    def give_back(self, size) -> None:
        """Called when a copy dies."""
        self.used -= size

    def forget(self) -> None:
        """Begins anew, but for copies that are still there."""
        self.refused = 0
        self.costs.clear()

    def report(self) -> str:
        """The regions that have cost most."""
        dearest = sorted(self.costs.items(), key=lambda item: -item[1][0])[:3]
        named = ", ".join(f"the {by} ({size} bytes in {count})" for by, (size, count) in dearest)
        return f"copies may have {self.max_bytes} bytes and {self.refused} more were needed; " + (
            f"most was kept because of {named}" if named else "none was kept"
        )


class Piece(_native.Finalized):
    """The contents of a region.

    Attributes:
        region: where it was.
        copies: the contents of each of its blocks.
    """

    __slots__ = ("__weakref__", "_budget", "_size", "copies", "region")

    def __init__(self, region, copies, budget, size):
        self.region, self.copies = region, copies
        self._budget, self._size = budget, size

    def _release(self):
        budget, self._budget = self._budget, None
        if budget is not None:
            budget.give_back(self._size)


def blocks(region, one) -> list:
    """The blocks of a region as views of an array that has them."""
    start = one.ptr or 0
    return [
        one._view(address - start, shape, strides) for address, shape, strides in region.parts()
    ]


def empty_like(one, shape, strides, size):
    """An array of so many bytes with elements like those of another one."""
    memory = hooks.plain_array(shape=size, dtype=uint8, device=one.device)
    return memory._view(0, shape, strides, one.dtype)


def _packed(one, copy):
    strides, step = [], one.item_size
    for extent in reversed(one.shape):
        strides.insert(0, step)
        step *= extent
    result = empty_like(one, one.shape, strides, step)
    copy(result, one)
    return result


def keep(region, one, copy, budget=None) -> Piece:
    """The contents of a region of an array. `copy(dest, src)` copies elements."""
    copies = None
    if natively and not allocators.special:
        copies = _native.keep_blocks(region, one, hooks.plain_array)
    if copies is None:
        copies = [_packed(part, copy) for part in blocks(region, one)]
    return Piece(region, copies, budget, region.bytes)


class Images:
    """Arrays as they were before what has been done since, for one backward pass.

    Args:
        copy: copies elements.
    """

    # The image of so many regions is taken further back when an older version is asked for.
    MOST = 4

    def __init__(self, copy):
        self._copy = copy
        self._made: dict = {}

    def of(self, version, one):
        """The contents of a version as an array with the layout of `one`, which it is of."""
        if version.complete and len(version.pieces) == 1:
            piece = version.pieces[0]
            if one.is_contiguous and piece.region == _native.Region(one):
                return piece.copies[0]._view(0, one.shape, one.strides, one.dtype)
        chain, image, complete = [], None, False
        step = version
        while step is not None and image is None:
            image = self._made.pop((id(step), one.ptr, one.shape, one.strides), (None, None))[1]
            if image is None:
                chain.append(step)
                complete = step.complete
                step = None if complete else step.successor
        if image is None:
            image = self._blank(one)
            if not complete:
                self._put(image, one, blocks(version.region, one))
        for later in reversed(chain):
            for piece in reversed(later.pieces):
                target = self._places(image, one, piece.region)
                for place, contents in zip(target, piece.copies, strict=True):
                    self._copy(place, contents)
        if not complete:
            # The version is held, so that no other one gets its identity.
            self._made[id(version), one.ptr, one.shape, one.strides] = version, image
            while len(self._made) > self.MOST:
                del self._made[next(iter(self._made))]
        return image

    def _blank(self, one):
        return empty_like(one, one.shape, one.strides, bytes_spanned(one))

    def _places(self, image, one, region) -> list:
        start = one.ptr or 0
        return [
            image._view(address - start, shape, strides)
            for address, shape, strides in region.parts()
        ]

    def _put(self, image, one, parts) -> None:
        for part in parts:
            place = image._view((part.ptr or 0) - (one.ptr or 0), part.shape, part.strides)
            self._copy(place, part)
