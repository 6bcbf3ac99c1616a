"""Parts of tiles: what indices, slices and views select, reading and replacing it."""

from __future__ import annotations

import ast
import math

from warp._src.frontend.bindings import INT32, TileView
from warp._src.frontend.parameters import known, parts
from warp._src.frontend.tiles.arguments import TileTopic


class Selection:
    """The place of a part: offsets and steps per dimension, its shape with all dimensions, and the
    shape it is seen in; None for both shapes for one element."""

    __slots__ = ("full", "offsets", "shape", "steps")

    def __init__(self, offsets, steps=None, full=None, shape=None):
        self.offsets, self.steps, self.full, self.shape = offsets, steps, full, shape


class TilePlaces(TileTopic):
    """Translates subscripts and views."""

    def selection(self, native, offsets, steps, full, seen):
        """A part of a tile and its type."""
        text = "x".join(map(str, seen))
        kind = type(native).parse(f"!warp.tile<{text} x {native.element}>")
        return Selection(offsets, steps, full, seen), kind

    def part(self, native, items, node, counts_back=True):
        """The selection by indices and slices, and its type: of an element, or a tile.

        items: syntax or bindings. counts_back: indices may count from the end of an axis.
        """
        shape = native.shape
        if len(items) > len(shape):
            raise self.context.value_error(
                node,
                f"tile indexing specified too many indices {len(items)} > {len(shape)}",
            )
        offsets, steps, full, seen = [], [], [], []
        for axis, extent in enumerate(shape):
            item = items[axis] if axis < len(items) else slice(None)
            if isinstance(item, (ast.Slice, slice)):
                first, step, count = self.selected(item, extent, node)
                offsets.append(self.builder.constant(INT32, first))
                steps.append(step)
                full.append(count)
                seen.append(count)
                continue
            offsets.append(self.index(item, extent, axis, node))
            steps.append(1)
            full.append(1)
        if not seen:
            return Selection(offsets), native.element
        if counts_back:
            offsets = [self.from_the_end(*one, node) for one in zip(offsets, shape, strict=True)]
        return self.selection(native, offsets, steps, full, seen)

    def from_the_end(self, offset, extent, node):
        """The place of a row: its index, known at run time, may count from the end of an axis."""
        if offset.constant() is not None:
            return offset
        self.context.at(node)
        return self.builder.position(offset, extent)

    def index(self, item, extent, axis, node, what="tile_view() integer offset"):
        binding = self.context.expressions.expr(item) if isinstance(item, ast.AST) else item
        number = known(binding)
        if isinstance(number, int) and type(number) is not bool:
            if not -extent <= number < extent:
                raise self.context.value_error(
                    node,
                    f"{what} {number} is out of bounds for axis {axis} with size {extent}",
                )
            return self.builder.constant(INT32, number % extent)
        value = self.context.materialize(binding, node)
        if value.type.kind != "int":
            raise self.context.type_error(
                node,
                f"expects an integer as index of a tile, but got '{value.type.python_name}'",
                code="tile-index",
            )
        return value

    def selected(self, item, extent, node):
        """First index, step and count of a slice."""
        bounds = []
        if isinstance(item, slice):
            given = (item.start, item.stop, item.step)
        else:
            given = (item.lower, item.upper, item.step)
        for part in given:
            if part is None:
                bounds.append(None)
                continue
            binding = self.context.expressions.expr(part) if isinstance(part, ast.AST) else part
            number = known(binding)
            if not isinstance(number, int):
                raise self.context.value_error(
                    node,
                    "tile_view() slice bounds must be compile-time constants.",
                )
            bounds.append(number)
        if bounds[2] == 0:
            raise self.context.value_error(node, "tile_view() slice step cannot be zero.")
        chosen = range(*slice(*bounds).indices(extent))
        if not chosen:
            raise self.context.value_error(
                node,
                f"tile_view() slice produced an empty tile of an axis of {extent} elements",
            )
        return chosen.start, chosen.step, len(chosen)

    def whole_part(self, native, offsets, shape, node):
        offsets = [self.context.materialize(offset, node) for offset in offsets]
        offsets += [self.builder.constant(INT32, 0)] * (len(shape) - len(offsets))
        steps = [1] * len(shape)
        for axis, offset in enumerate(offsets):
            number = offset.constant()
            extent = native.shape[axis]
            if number is not None and not 0 <= number <= extent - shape[axis]:
                raise self.context.value_error(
                    node,
                    f"tile_view() of {shape[axis]} elements at offset {number} is out of bounds "
                    f"for axis {axis} with size {extent}",
                )
        return self.selection(native, offsets, steps, shape, shape)

    def read(self, tile, part, node):
        """An element or a part of a tile."""
        if type(part) is not Selection:
            return self.context.tiles.views.read(tile, part, node)
        if part.full is None:
            return self.make("get", [tile, *part.offsets], node)
        whole = self.make("slice", [tile, *part.offsets], node, shape=part.full, axes=part.steps)
        if part.shape == part.full:
            return whole
        return self.make("reshape", [whole], node, shape=part.shape)

    def written(self, tile, part, value, node, kind="assign"):
        """A tile with an element or a part replaced."""
        if part.full is None:
            element = tile.type.element
            if value.type != element and value.type.kind in ("int", "float", "bool"):
                value = self.convert(value, element, node, "tile_assign")
            return self.make("set", [value, tile, *part.offsets], node, kind=kind)
        if value.type.kind != "tile":
            value = self.make("splat", [value], node, shape=part.full, element=tile.type.element)
        elif list(value.type.shape) != part.full:
            if math.prod(value.type.shape) != math.prod(part.full):
                raise self.context.value_error(
                    node,
                    f"tile_assign() source tile of shape {tuple(value.type.shape)} does not fit "
                    f"the selected part of shape {tuple(part.shape)}",
                )
            value = self.make("reshape", [value], node, shape=part.full)
        return self.make("insert", [value, tile, *part.offsets], node, axes=part.steps)

    def changed(self, tile, element, path, value, node, kind="assign"):
        """A tile with a part of an element replaced, which leaves other parts to other threads."""
        wanted = tile.type.element
        steps, components = [], []
        for step, key in path:
            self.context.at(node)
            if step == "index":
                wanted = self.builder.part_type(wanted, key)
                steps.append(str(len(key)))
                components += key
            else:
                wanted = self.field_type(wanted, step, key)
                steps.append(key)
        value = self.context.convert_constant(value, wanted, node)
        if value.type != wanted:
            raise self.context.type_error(
                node,
                f"expects '{wanted.python_name}' for this part of the element, but got "
                f"'{value.type.python_name}'",
            )
        operands = [value, tile, *element.offsets, *components]
        return self.make("set", operands, node, kind=kind, path=steps)

    def field_type(self, native, step, name):
        """Type of a field of a struct, or of the vector or the quaternion of a transform."""
        if step == "field":
            return dict(native.fields)[name]
        family = "vec<3 x " if name == "p" else "quat<"
        return type(native).parse(f"!warp.{family}{native.element}>")

    def subscript(self, base, items, node):
        """`t[...]` of a tile: an element, or a view of the variable that holds it."""
        slot = self.context.tiles.views.of(base, node.value)
        native = base.type
        picked = self.context.tiles.gathers.picked(native, items, node)
        if picked is not None:
            return self.context.tiles.gathers.gathered(
                self.context.materialize(base, node), *picked, node
            )
        part, selected = self.part(native, items, node)
        if slot is not None and part.full is not None:
            return TileView(slot.extended(("tile", part), selected))
        return self.read(self.context.materialize(base, node), part, node)

    def check_offsets(self, native, offsets, node):
        """Offsets count from the beginning, unlike indices."""
        for axis, (offset, extent) in enumerate(zip(offsets, native.shape, strict=False)):
            number = known(offset)
            if isinstance(number, int) and not 0 <= number < extent:
                raise self.context.value_error(
                    node,
                    f"tile_view() integer offset {number} is out of bounds for axis {axis} with "
                    f"size {extent}",
                )

    def view(self, node, tile, given, offset, shape):
        """A part of a tile at an offset, or selected by slices; a view if a variable holds it.

        given: the argument that the tile is, as binding and syntax.
        """
        native = tile.type
        offsets = parts(self.context, offset)
        has_slices = any(isinstance(one, slice) for one in offsets)
        if has_slices and shape is not None:
            raise self.context.value_error(
                node,
                "tile_view() takes the extents from slices, so no shape",
                code="tile-view-shape",
            )
        if not has_slices:
            self.check_offsets(native, offsets, node)
        if len(offsets) > len(native.shape):
            raise self.context.value_error(
                node,
                f"tile_view() specified too many indices {len(offsets)} > {len(native.shape)}",
            )
        if shape is None:
            part, selected = self.part(native, offsets, node, has_slices)
            if part.full is None:
                part, selected = self.whole_part(native, offsets, [1] * len(offsets), node)
        else:
            if len(shape) != len(native.shape):
                raise self.context.value_error(
                    node,
                    "tile_view() if shape is specified it must have same number of dimensions as "
                    f"source tile, expected {len(native.shape)}, got {len(shape)}",
                )
            part, selected = self.whole_part(native, offsets, shape, node)
        slot = self.context.tiles.views.of(*given)
        if slot is None:
            return self.read(tile, part, node)
        return self.context.tiles.views.placed(slot.extended(("tile", part), selected), node)
