"""Tiles in another shape or element type."""

from __future__ import annotations

import math

from warp._src.frontend.tiles.arguments import TileTopic


class TileShapes(TileTopic):
    """Translates transposes, broadcasts, reshapes and conversions."""

    def builtin_tile_transpose(self, node):
        (binding,) = self.bind(node, "tile_transpose", ("a",))
        tile = self.tile(binding, node, "tile_transpose")
        if len(tile.type.shape) != 2:
            raise self.context.value_error(
                node,
                "tile_transpose() expects a tile of two dimensions",
            )
        shape = list(reversed(tile.type.shape))
        seen = self.context.tiles.views.seen
        return seen(binding, node, "tile_transpose", "transpose", shape, [1, 0])

    def builtin_tile_broadcast(self, node):
        binding, shape = self.bind(node, "tile_broadcast", ("a", "shape"))
        tile = self.tile(binding, node, "tile_broadcast")
        shape = self.extents(shape, node, "tile_broadcast")
        old = tile.type.shape
        fits = len(old) <= len(shape) and all(
            a in (1, b) for a, b in zip(reversed(old), reversed(shape), strict=False)
        )
        if not fits:
            raise self.context.value_error(
                node,
                f"tile_broadcast() cannot broadcast shape {tuple(old)} to {tuple(shape)}",
            )
        return self.context.tiles.views.seen(binding, node, "tile_broadcast", "broadcast", shape)

    def builtin_tile_reshape(self, node):
        binding, shape = self.bind(node, "tile_reshape", ("t", "shape"))
        tile = self.tile(binding, node, "tile_reshape")
        known = [self.known(extent) for extent in self.parts(shape)]
        count = math.prod(tile.type.shape)
        if known.count(-1) == 1:
            rest = -math.prod(known)
            known[known.index(-1)] = count // rest if rest > 0 else 0
        if any(not isinstance(extent, int) for extent in known) or math.prod(known) != count:
            raise self.context.value_error(
                node,
                f"tile_reshape() cannot make shape {tuple(known)} of shape "
                f"{tuple(tile.type.shape)}",
            )
        return self.context.tiles.views.seen(binding, node, "tile_reshape", "reshape", known)

    def builtin_tile_squeeze(self, node):
        binding, axis = self.bind(node, "tile_squeeze", ("t", "axis"), axis=None)
        tile = self.tile(binding, node, "tile_squeeze")
        shape = list(tile.type.shape)
        given = range(len(shape)) if axis is None else self.parts(axis)
        axes = set()
        for one in map(self.known, given):
            if not -len(shape) <= one < len(shape):
                raise self.context.value_error(
                    node,
                    f"tile_squeeze() axis {one} is out of bounds for tile with {len(shape)} "
                    "dimensions",
                )
            if axis is not None and shape[one] != 1:
                raise self.context.value_error(
                    node,
                    f"tile_squeeze() cannot remove axis {one}, whose extent is {shape[one]}",
                )
            if shape[one] == 1:
                axes.add(one % len(shape))
        kept = [extent for i, extent in enumerate(shape) if i not in axes] or [1]
        return self.context.tiles.views.seen(binding, node, "tile_squeeze", "reshape", kept)

    def builtin_tile_astype(self, node):
        tile, dtype = self.bind(node, "tile_astype", ("t", "dtype"), tiles=1)
        native = self.context.constructors.native(dtype, node)
        return self.mapped([tile], lambda x: self.builder.cast(x, native), node)
