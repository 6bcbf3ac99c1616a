"""Public names of the peer that this package has nothing for yet.

Packages name them at import: in annotations, as defaults, to look for subclasses. So they exist,
and say what is missing when they are used. A name goes from here when the thing comes.
"""

from __future__ import annotations

from warp._src import errors

_CLASSES = frozenset((*("GLTextureResource", "RegisteredGLBuffer"),))


class _Absent(type):
    """Metaclass of the classes that are not there."""

    _wp_absent_ = True

    def __call__(cls, *args, **kwargs):
        raise _error(cls._wp_missing_)

    def __getitem__(cls, params):
        return cls

    def struct_with(cls, name, field):
        """A stand-in for a struct that has a field of this class."""
        about = {"_wp_missing_": f"{cls._wp_missing_}, field '{field}' of struct '{name}',"}
        return _Absent(name, (), about)


def _error(name):
    return errors.WarpError(f"{name} is not in this package yet")


def absent_class(name):
    """A class that stands for one that is not there."""
    about = {"__module__": "warp", "__doc__": "Not in this package yet."}
    return _Absent(name, (), about | {"_wp_missing_": f"'wp.{name}'"})


def find(name):
    """The stand-in for a missing name; None if nobody knows the name."""
    if name not in _CLASSES:
        return None
    return _made.setdefault(name, absent_class(name))


_made: dict = {}
