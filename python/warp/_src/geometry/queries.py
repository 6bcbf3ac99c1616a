"""Functions that advance the queries of loops."""

from __future__ import annotations

import sys

# Modules with queries that loops are over: each has `NEXT`, pairs of a compiler's type and a
# function.
_MODULES = ("grid_queries", "tree_queries")


def next_of(native):
    """The function that gives (found, index, query) for a query of a compiler's type, or None."""
    for name in _MODULES:
        # Who has a query has loaded its module.
        if module := sys.modules.get(f"warp._src.geometry.{name}"):
            for kind, function in module.NEXT:
                if kind == native:
                    return function
    return None
