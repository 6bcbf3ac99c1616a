"""Shapes of tiles that are seen in another shape."""

from __future__ import annotations

import math

from warp._src.frontend.parameters import known, parts
from warp._src.frontend.tiles.arguments import TileTopic


class TileShapes(TileTopic):
    """Works out the shapes of views."""

    def repeats(self, old, shape) -> bool:
        """True if a shape can be repeated to another one."""
        return len(old) <= len(shape) and all(
            a in (1, b) for a, b in zip(reversed(old), reversed(shape), strict=False)
        )

    def completed(self, node, old, shape):
        """A shape for the elements of another one, in which one extent may be -1."""
        found = [known(extent) for extent in parts(self.context, shape)]
        count = math.prod(old)
        if found.count(-1) == 1:
            rest = -math.prod(found)
            found[found.index(-1)] = count // rest if rest > 0 else 0
        if any(not isinstance(extent, int) for extent in found) or math.prod(found) != count:
            raise self.context.value_error(
                node, f"tile_reshape() cannot make shape {tuple(found)} of shape {old}"
            )
        return found

    def squeezed(self, node, old, axis):
        """A shape without dimensions of extent 1, all or those that are given."""
        given = range(len(old)) if axis is None else parts(self.context, axis)
        axes = set()
        for one in map(known, given):
            if type(one) is not int or not -len(old) <= one < len(old):
                raise self.context.value_error(
                    node,
                    f"tile_squeeze() axis {one} is out of bounds for tile with {len(old)} "
                    "dimensions",
                )
            if axis is not None and old[one] != 1:
                raise self.context.value_error(
                    node,
                    f"tile_squeeze() cannot remove axis {one}, whose extent is {old[one]}",
                )
            if old[one] == 1:
                axes.add(one % len(old))
        return [extent for i, extent in enumerate(old) if i not in axes] or [1]
