"""Tiles: elements that a block of threads holds together.

A tile is a value. A change, such as `t[i] = x` or `wp.tile_assign(t, ...)`, makes another
value and binds the variable to it. A view (`t[2:4]`, `t[i]`, `wp.tile_view(t, ...)`, a
transposed, reshaped or broadcast tile) of a variable keeps the place in it, so that assigning to
the view changes the variable.

Builtins are bound and checked by their records (`binder`); what a record's call needs beyond one
operation is in the topics: arguments (what all share), values (new tiles), shapes, places (parts of
tiles), views, gathers, changes, elements (functions of elements, reductions), randoms, stacks,
printing, algebra. Loaded when a kernel names one of these builtins.
"""

from __future__ import annotations

import math

from warp._src import errors
from warp._src.frontend import struct_classes
from warp._src.frontend.tiles.algebra import TileAlgebra
from warp._src.frontend.tiles.changes import TileChanges
from warp._src.frontend.tiles.elements import TileElements
from warp._src.frontend.tiles.gathers import TileGathers
from warp._src.frontend.tiles.places import TilePlaces
from warp._src.frontend.tiles.printing import TilePrinting
from warp._src.frontend.tiles.randoms import TileRandoms
from warp._src.frontend.tiles.shapes import TileShapes
from warp._src.frontend.tiles.stacks import TileStacks
from warp._src.frontend.tiles.values import TileValues
from warp._src.frontend.tiles.views import TileViews
from warp._src.types import dtypes

_TOPICS = {
    "algebra": TileAlgebra,
    "changes": TileChanges,
    "elements": TileElements,
    "gathers": TileGathers,
    "places": TilePlaces,
    "printing": TilePrinting,
    "randoms": TileRandoms,
    "shapes": TileShapes,
    "stacks": TileStacks,
    "values": TileValues,
    "views": TileViews,
}


class Tiles:
    """The part of a translator that is about tiles: its topics, and what they share.

    Attributes:
        placed: the places that calls made views of, by the call.
        changed: variables whose tiles were changed, rather than replaced by another tile.
    """

    def __init__(self, context):
        self.context = context
        self.changed = set()
        self.placed = {}
        for name, kind in _TOPICS.items():
            setattr(self, name, kind(context))

    def attribute(self, native, name, node):
        """`shape`, `dtype`, `ndim`, `size` of a tile's type."""
        if name == "shape":
            return tuple(native.shape)
        if name == "dtype":
            return struct_classes.dtype_of(self.context, native.element, node)
        if name == "ndim":
            return len(native.shape)
        if name == "size":
            return math.prod(native.shape)
        raise self.context.error(
            node,
            f"'{native.python_name}' has no attribute '{name}'",
            kind=errors.WarpCodegenAttributeError,
        )
