"""Rows of a tile by a tile of indices."""

from __future__ import annotations

import ast
import math

from warp._src.frontend.bindings import INT32
from warp._src.frontend.tiles.arguments import TileTopic


class TileGathers(TileTopic):
    """Translates subscripts that are tiles."""

    def picked(self, native, items, node):
        """The dimension that a tile of indices selects along, these, and what else is selected."""
        for axis, item in enumerate(items):
            if isinstance(item, (ast.Slice, slice, ast.Constant)) or axis >= len(native.shape):
                continue
            binding = self.context.expressions.expr(item) if isinstance(item, ast.AST) else item
            if getattr(getattr(binding, "type", None), "kind", None) == "tile":
                indices = self.context.materialize(binding, node)
                return axis, indices, [*items[:axis], slice(None), *items[axis + 1 :]]
        return None

    def sliced(self, node, tile, items):
        """`t[indices, :]` for a tile of indices and slices."""
        picked = self.picked(tile.type, items if type(items) is tuple else (items,), node)
        if picked is None:
            raise self.context.value_error(
                node,
                "tile_slice_indexed() expects a 1D tile of integers among the indices",
                code="tile-index-type",
            )
        return self.gathered(tile, *picked, node)

    def gathered(self, tile, axis, indices, items, node):
        """Rows of a tile along one dimension, by a tile of indices: a copy."""
        if len(indices.type.shape) != 1 or indices.type.element.kind != "int":
            raise self.context.value_error(
                node,
                f"tile indexing expects a 1D tile of integers, got '{indices.type.python_name}'",
                code="tile-indices-type",
            )
        extents = list(tile.type.shape)
        count = indices.type.shape[0]
        shape = [*extents[:axis], count, *extents[axis + 1 :]]
        self.context.at(node)
        spread = [1] * len(shape)
        spread[axis] = count
        rows = self.make("reshape", [indices], node, shape=spread)
        strides = [math.prod(extents[d + 1 :]) for d in range(len(extents))]
        stride = self.builder.constant(INT32, strides[axis])
        outside = self.builder.constant(INT32, -1)
        zero = self.builder.constant(INT32, 0)
        call = self.call

        def place(index):
            """The begin of a row; negative indices count from the end."""
            return call("mul", self.builder.position(index, extents[axis]), stride)

        rows = self.make("broadcast", [self.mapped([rows], place, node)], node, shape=shape)
        positions = rows
        for other, step in enumerate(strides):
            if other == axis:
                continue
            numbers = self.make(
                "iota",
                [zero, self.builder.constant(INT32, step)],
                node,
                shape=[extents[other]],
                element=INT32,
            )
            flat = [1] * len(shape)
            flat[other] = extents[other]
            numbers = self.make("reshape", [numbers], node, shape=flat)
            numbers = self.make("broadcast", [numbers], node, shape=shape)
            positions = self.mapped(
                [positions, numbers],
                lambda a, b: call("where", call("lt", a, zero), outside, call("add", a, b)),
                node,
            )
        made = self.make("gather", [tile, positions], node)
        part, _ = self.context.tiles.places.part(made.type, items, node)
        if part.full == shape and part.shape == shape and set(part.steps) == {1}:
            return made
        return self.context.tiles.places.read(made, part, node)
