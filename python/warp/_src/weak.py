"""Objects that are known as long as somebody else keeps them.

The containers of `weakref` forget an object by a function of Python, in which an interrupt (Ctrl-C)
would be printed and lost. These forget by native code.
"""

from __future__ import annotations

import functools
import weakref

from warp import _native


class WeakValues:
    """Values by key; those that are gone are not there."""

    def __init__(self):
        self._found: dict = {}

    def __setitem__(self, key, value):
        forget = _native.Finalizer(functools.partial(self._found.pop, key, None))
        self._found[key] = weakref.ref(value, forget)

    def get(self, key):
        """The value of a key, or None."""
        found = self._found.get(key)
        return None if found is None else found()

    def pop(self, key) -> None:
        """Forgets a key."""
        self._found.pop(key, None)

    def values(self) -> list:
        """All that are left."""
        found = [one() for one in list(self._found.values())]
        return [one for one in found if one is not None]

    def __bool__(self):
        return bool(self._found)

    @property
    def entries(self) -> dict:
        """The dictionary that is empty if none are left, for those who ask often."""
        return self._found


class WeakObjects(WeakValues):
    """A set of objects, by identity."""

    def add(self, one) -> None:
        """Knows one more."""
        self[id(one)] = one

    def __iter__(self):
        return iter(self.values())
