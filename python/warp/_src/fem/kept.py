"""Records and functions of kernels - worked out once, and found by name."""

from __future__ import annotations

import functools
import re
from types import SimpleNamespace

import warp as wp
from warp import extend


class Functions(SimpleNamespace):
    """Structs and functions of kernels by name."""

    def add(self, function):
        """Decorates a function of kernels, as `wp.func` does, that is found under its name."""
        made = wp.func(function)
        setattr(self, function.__name__, made)
        return made

    def add_missing(self, function):
        """As `add`, unless there is a function of that name, which is the result then."""
        return vars(self).get(function.__name__) or self.add(function)


def function_of_text(text: str, names: dict, module: str):
    """A function of Python from text, which knows those of the names that are in it."""
    words = set(re.findall(r"\w+", text))
    known = {name: value for name, value in names.items() if name in words}
    return extend.function_from_text(text, known, module=module)


class Record:
    """Base of records, frozen dataclasses, that functions of kernels depend on."""

    @property
    def functions(self) -> SimpleNamespace:
        """Structs and functions of kernels: made once for equal records."""
        return _functions(self)

    def make_functions(self) -> SimpleNamespace:
        """Makes the structs and functions of kernels."""
        raise NotImplementedError


@functools.cache
def _functions(record):
    return record.make_functions()


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
