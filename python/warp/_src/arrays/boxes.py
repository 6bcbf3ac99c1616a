"""The bytes that arrays occupy, and whether arrays share some."""

from __future__ import annotations


class Box:
    """The bytes of an array: all sums of `index * stride`, each followed by an element."""

    __slots__ = ("extents", "item", "start", "stop")

    def __init__(self, array):
        self.item = array.item_size
        self.start = self.stop = array.ptr or 0
        # Extents by stride; repeated elements count once.
        self.extents: dict = {}
        if not array.size:
            return
        self.stop += self.item
        for extent, stride in zip(array.shape, array.strides, strict=True):
            if extent > 1 and stride:
                self.extents[stride] = extent
                self.stop += (extent - 1) * stride

    def overlaps(self, other: Box) -> bool:
        """Whether the boxes share a byte; may say so of layouts that do not nest."""
        if self.stop <= other.start or other.stop <= self.start:
            return False
        strides = sorted(self.extents.keys() | other.extents.keys(), reverse=True)
        base = min(self.start, other.start)
        first, second = self._digits(base, strides), other._digits(base, strides)
        if first is None or second is None:
            return True
        return all(a < d and c < b for (a, b), (c, d) in zip(first, second, strict=True))

    def _digits(self, base, strides):
        """Range of the index along each stride and of the bytes in an element, from `base` on.

        None if an index runs into the next larger stride.
        """
        rest, ranges = self.start - base, []
        room = None
        for stride in strides:
            low, rest = divmod(rest, stride)
            ranges.append((low, low + self.extents.get(stride, 1)))
        ranges.append((rest, rest + self.item))
        for stride, (_, high) in zip([*strides, 1], ranges, strict=True):
            if room is not None and high * stride > room:
                return None
            room = stride
        return ranges
