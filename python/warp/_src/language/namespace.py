"""The meaning of `wp` in the functions of the kernel language that are part of the package.

They are imported by `warp`, so they cannot import it. This has the types and the builtins.
"""

from __future__ import annotations

from warp._src.language.builtins import lookup
from warp._src.language.checks import CHECKS
from warp._src.language.constructors import CONSTRUCTORS
from warp._src.types import dtypes


class array:
    """`wp.array(ptr=, shape=, dtype=)` in a kernel: a packed array at an address."""

    _wp_array_ = True


def find(name: str):
    """The constructor, check or builtin of a name, or None."""
    return CONSTRUCTORS.get(name) or CHECKS.get(name) or lookup(name)


def __getattr__(name):
    # Factories of types come last: `vector` makes a value here.
    found = find(name) or getattr(dtypes, name, None)
    if found is None:
        raise AttributeError(f"the kernel language has no '{name}'")
    return found
