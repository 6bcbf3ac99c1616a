"""Records and functions of kernels - worked out once, and found by name."""

from __future__ import annotations

from types import SimpleNamespace

import warp as wp


class Functions(SimpleNamespace):
    """Structs and functions of kernels by name."""

    def add(self, function):
        """Decorates a function of kernels, as `wp.func` does, that is found under its name."""
        made = wp.func(function)
        setattr(self, function.__name__, made)
        return made


def hashed(cls):
    """Decorates a frozen dataclass: its hash is worked out once per instance."""
    of_fields = cls.__hash__

    def kept_hash(self):
        found = self.__dict__.get("_hash")
        if found is None:
            found = of_fields(self)
            object.__setattr__(self, "_hash", found)
        return found

    cls.__hash__ = kept_hash
    return cls


def record_of(owner):
    """The record of a domain, quadrature or space, made once per object."""
    found = owner.__dict__.get("_kept_record")
    if found is None:
        found = owner.__dict__["_kept_record"] = owner.record
    return found
