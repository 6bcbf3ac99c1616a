"""Versions of memory: finds out when something that a tape has to read again is overwritten.

A recorded launch asks for the current version of the region it touches of each array. Whatever
writes to memory says so beforehand, and thereby ends the versions of all regions that share bytes
with it, or has the shared part kept (`kept`). A version that has ended knows who did it.

The versions of a region form a chain: a version has the pieces that were overwritten before the
next version of the same region was asked for, and that one the rest, until all is kept or memory
itself has it. So each byte that is overwritten is copied once, however many versions it was in.

Regions are boxes of elements, so rows, columns and components of one allocation have versions of
their own. A version whose memory is lent to NumPy on the CPU gets a checksum, which tells later
whether somebody wrote there. Other ways past the package are not seen.
"""

from __future__ import annotations

import os
import typing
import weakref
import zlib

from warp import _native
from warp._src.arrays.kept import Images, blocks, keep
from warp._src.version import PACKAGE, calling_frame


class Event(typing.NamedTuple):
    """Who did something, and where in the user's program."""

    what: str
    file: str
    line: int

    def __str__(self):
        return f"{self.what} at {os.path.basename(self.file)}:{self.line}"


_native.set_package_folder(PACKAGE)


def event(what: str) -> Event:
    """An event at the innermost line of the program that is not this package's."""
    frame = calling_frame()
    return Event(what, frame.f_code.co_filename, frame.f_lineno)


def event_of(place) -> Event:
    """The event of a launch at a `_native.Place`."""
    return Event(f"launch of '{place.kernel.key}'", place.code.co_filename, place.line)


class Version(_native.Version):
    """The contents of a region of memory between two writes.

    Attributes:
        array: has the memory.
        region: which elements of it, once it matters.
        pieces: what was kept before writes, the oldest first.
        complete: whether pieces are all there was.
        successor: the next version of the same region; what is not in pieces is as it says.
        refused: the budget that had no room for it, or None.
        lent: the event that lent the memory to others and the checksum at that time, or None.
    """

    __slots__ = ()

    @property
    def ended(self) -> Event | None:
        """The write that overwrote an unkept part, or None."""
        found = self._ended
        if type(found) is _native.Place:
            found = self._ended = event_of(found)
        return found

    @ended.setter
    def ended(self, by):
        self._ended = by

    def tell(self, reader) -> None:
        """Calls `reader.overwriting` before the memory is overwritten."""
        self._listeners.append(weakref.ref(reader))

    # Writes.

    def end(self, region, by: Event, known) -> bool:
        """Called before a region is overwritten that meets this one.

        Args:
            known: pieces that the same write has made.

        Returns:
            True if later writes are of no concern.
        """
        if self.complete or self.ended is not None:
            return True
        part = self.region.shared(region)
        if not part or any(part.is_within(piece.region) for piece in self.pieces):
            return False
        for listener in self._listeners:
            reader = listener()
            if reader is not None:
                reader.overwriting(self, by)
        if not self._keep(part, by, known):
            self.ended = by
            return True
        return self.complete

    def lend(self) -> None:
        """Called when others get to see the memory."""
        if self.lent is not None or self.complete:
            return
        # A version that was overwritten in part is to have no new readers.
        checksum = None if self.pieces else self._checksum()
        self.lent = event("writer of what was lent to NumPy"), checksum
        self._keep(self.region, self.lent[0], [])

    def _keep(self, part, by, known) -> bool:
        """Keeps a part if anybody needs it and there is room."""
        wanted, budget = self._wanted()
        if not wanted:
            return False
        dtype = self.array.dtype
        piece = next((one for kind, one in known if kind is dtype and one.region == part), None)
        if piece is None:
            if budget is not None and not budget.take(part.bytes, by, self.array.device):
                self.refused = budget
                return False
            piece = keep(part, self.array, self._copy, budget)
            known.append((dtype, piece))
        if not any(part.overlaps(other.region) for other in self.pieces):
            self._rest = (self.region.bytes if not self.pieces else self._rest) - part.bytes
            self.complete = self._rest <= 0
        self.pieces.append(piece)
        self.complete = self.complete or self.region.is_within(part)
        return True

    def _checksum(self) -> int:
        import numpy

        value = 0
        for part in blocks(self.region, self.array):
            contents = numpy.ascontiguousarray(part._host_view()).reshape(-1)
            value = zlib.crc32(contents.view(numpy.uint8), value)
        return value

    def adopt(self, by: Event) -> None:
        """Keeps what the memory holds now in place of what it held, if anybody wants to."""
        self.pieces.clear()
        self.complete, self.ended = False, None
        if not self._keep(self.region, by, []):
            self.ended = by

    # Reading.

    @property
    def changed(self) -> bool:
        """True if the memory may hold something else now."""
        if self.lent is not None:
            return self.lent[1] != self._checksum()
        return bool(self.pieces) or self.ended is not None

    def overwriter(self) -> Event | None:
        """Who has overwritten what was not kept, None if nobody has."""
        step = self
        while step is not None and not step.complete:
            if step.ended is None and step.lent is not None and step.changed:
                step.ended = step.lent[0]
            if step.ended is not None:
                self.refused = self.refused or step.refused
                return step.ended
            step = step.successor
        return None

    def contents(self, images=None, like=None):
        """An array with what the region held, None if the memory still does.

        Args:
            images: of the backward pass that asks.
            like: has the layout that is asked for, by default that of `array`.
        """
        like = like or self.array
        if not self.pieces:
            return None
        return (images or Images(self._copy)).of(self, like)


class Memory(_native.VersionMap):
    """The current versions of all regions.

    Args:
        copy: copies the elements of an array (dest, src).
    """

    def __init__(self, copy):
        super().__init__(copy)
        self._copy = copy

    def observe(self, array, launch=None, leaf=0, reads=False) -> Version:
        """The current version of an array, or of what a launch touches (or reads) of it."""
        if launch is None:
            region = _native.Region(array)
        else:
            region = launch.read(leaf) if reads else launch.touched(leaf)
        return self.observe_region(array, region)

    def _renew(self, before, array, region) -> Version:
        """The version after one that has ended, of the same region."""
        version = Version(array, self._copy)
        if not before.complete:
            before.successor, version.predecessor = version, weakref.ref(before)
        if before.lent is not None:
            version.region = region
            version.lent = before.lent[0], version._checksum()
        return version

    def writing(self, array, by) -> None:
        """Says that an array is about to be written; `by.event` is made if it is wanted."""
        if len(self):
            self.end([_native.Region(array)], by)

    def launching(self, call) -> None:
        """The same of what a launch writes."""
        if not len(self):
            return
        if call.regions is None:
            for array in call.written:
                self.writing(array, call)
        else:
            self.end(call.regions.all_written(), call)

    def lend(self, array) -> None:
        """Says that others get to see, and may write, an array on the CPU."""
        if not len(self) or array.pinned or not array.size:
            return
        for version in self.meeting(_native.Region(array)):
            version.lend()


_native.set_version_type(Version)
