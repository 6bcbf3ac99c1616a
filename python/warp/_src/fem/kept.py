"""Records that are asked for often - hashes and records that are worked out once."""

from __future__ import annotations


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
