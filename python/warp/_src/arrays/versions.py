"""Versions of memory: finds out when something that a tape has to read again is overwritten.

A recorded launch asks for the current version of each array it was given. Whatever writes to
memory says so beforehand, and thereby ends the versions of all arrays that share bytes with it. A
version that has ended knows who did it; one that is to be kept has a copy of the contents.

Arrays are compared as boxes of bytes, so rows, columns and components of one allocation have
versions of their own. A version whose memory is lent to NumPy on the CPU gets a checksum, which
tells later whether somebody wrote there. Other ways past the package are not seen.
"""

from __future__ import annotations

import bisect
import os
import typing
import weakref
import zlib

from warp._src.arrays.boxes import Box
from warp._src.version import calling_frame


class Event(typing.NamedTuple):
    """Who did something, and where in the user's program."""

    what: str
    file: str
    line: int

    def __str__(self):
        return f"{self.what} at {os.path.basename(self.file)}:{self.line}"


def event(what: str) -> Event:
    """An event at the innermost line of the program that is not this package's."""
    frame = calling_frame()
    return Event(what, frame.f_code.co_filename, frame.f_lineno)


class Version:
    """What an array held between two writes.

    Attributes:
        array: holds the memory.
        ended: the event that overwrote it, or None.
        copy: the contents with the array's strides, if they were kept.
        readers: recorded launches that want them kept.
        listeners: recorded launches that want to be told who overwrites it.
        lent: the event that lent the memory to others and the checksum at that time, or None.
    """

    __slots__ = (
        *("__weakref__", "_copy_of", "array", "copy", "ended"),
        *("lent", "listeners", "readers"),
    )

    def __init__(self, array, copy_of):
        self.array = array
        self._copy_of = copy_of
        self.ended = self.copy = self.lent = None
        self.readers: list = []
        self.listeners: tuple = ()

    def tell(self, reader) -> None:
        """Calls `reader.overwriting` before the memory is overwritten."""
        self.listeners += (weakref.ref(reader),)

    def keep_for(self, reader) -> None:
        """Asks for a copy before the memory is overwritten, if `reader.needs` it then."""
        self.readers.append(weakref.ref(reader))

    def end(self, by: Event) -> None:
        """Called before the memory is overwritten."""
        self._keep()
        for listener in self.listeners:
            reader = listener()
            if reader is not None:
                reader.overwriting(self, by)
        self.ended = by

    def lend(self) -> None:
        """Called when others get to see the memory."""
        if self.lent is None:
            self._keep()
            self.lent = event("writer of what was lent to NumPy"), _checksum(self.array)

    def _keep(self) -> None:
        readers = [reader() for reader in self.readers]
        if any(reader is not None and reader.needs(self) for reader in readers):
            self.copy = self._copy_of(self.array)
        self.readers = []

    def overwriter(self) -> Event | None:
        """Who has overwritten the memory, None if nobody has."""
        if self.ended is None and self.lent is not None and self.lent[1] != _checksum(self.array):
            self.ended = self.lent[0]
        return self.ended


def _checksum(array) -> int:
    import numpy

    return zlib.crc32(numpy.ascontiguousarray(array._host_view()).reshape(-1).view(numpy.uint8))


class _Region:
    """Memory of which a version is known."""

    __slots__ = ("box", "current", "neighbours")

    def __init__(self, box):
        self.box = box
        self.current = lambda: None
        self.neighbours: list = []

    def end(self, by) -> None:
        version = self.current()
        if version is not None:
            version.end(by)
            self.current = lambda: None


class Memory:
    """All regions, by layout and by address.

    Args:
        copy_of: makes a copy of an array whose elements have the same offsets.
    """

    def __init__(self, copy_of):
        self._copy_of = copy_of
        self.regions: dict = {}
        # Starts and regions in order, by the number of bits of the size.
        self.sorted: dict = {}
        # Number of regions at which those without a version are forgotten.
        self.limit = 4096

    def clear(self) -> None:
        self.regions.clear()
        self.sorted.clear()

    def observe(self, array) -> Version:
        """The current version of an array."""
        key = (array.descriptor(), array.item_size)
        region = self.regions.get(key)
        if region is None:
            if len(self.regions) >= self.limit:
                self._prune()
            region = self.regions[key] = self._add(_Region(Box(array)))
        version = region.current()
        lent = version is not None and version.overwriter() is not None
        if version is None or lent:
            version = Version(array, self._copy_of)
            region.current = weakref.ref(version)
            if lent:
                version.lend()
        return version

    def writing(self, array, by) -> None:
        """Says that an array is about to be written; `by.event` is made if it is wanted."""
        region = self.regions.get((array.descriptor(), array.item_size))
        if region is None:
            if not self.regions:
                return
            box = Box(array)
            for other in self._near(box):
                if other.current() is not None and box.overlaps(other.box):
                    other.end(by.event)
            return
        if region.current() is not None:
            region.end(by.event)
        for other in region.neighbours:
            if other.current() is not None:
                other.end(by.event)

    def lend(self, array) -> None:
        """Says that others get to see, and may write, an array on the CPU."""
        if not self.regions or array.pinned or not array.size:
            return
        box = Box(array)
        for region in self._near(box):
            version = region.current()
            if version is not None and box.overlaps(region.box):
                version.lend()

    def _prune(self) -> None:
        """Forgets regions that nobody has a version of."""
        living = {key: one for key, one in self.regions.items() if one.current() is not None}
        self.clear()
        for key, region in living.items():
            region.neighbours = []
            self.regions[key] = self._add(region)
        self.limit = max(4096, 2 * len(living))

    def _add(self, region):
        box = region.box
        for other in self._near(box):
            if box.overlaps(other.box):
                region.neighbours.append(other)
                other.neighbours.append(region)
        starts, regions = self.sorted.setdefault((box.stop - box.start).bit_length(), ([], []))
        place = bisect.bisect(starts, box.start)
        starts.insert(place, box.start)
        regions.insert(place, region)
        return region

    def _near(self, box):
        """Regions whose range of addresses meets that of the box."""
        for bits, (starts, regions) in list(self.sorted.items()):
            first = bisect.bisect(starts, box.start - (1 << bits))
            for region in regions[first : bisect.bisect_left(starts, box.stop)]:
                if region.box.stop > box.start:
                    yield region
