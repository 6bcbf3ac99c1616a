"""Parts of tiles: what indices, slices and views select, reading and replacing it."""

from __future__ import annotations

import ast
import itertools
import math

from warp._src.frontend.bindings import INT32, TileView
from warp._src.frontend.tiles.arguments import TileTopic, is_slice
from warp._src.types import dtypes


class Selection:
    """Where a part lies: offsets and steps per dimension, its shape with all dimensions, and the
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

    def part(self, native, items, node):
        """What indices and slices select, and its type: of an element, or a tile."""
        shape = native.shape
        if len(items) > len(shape):
            raise self.context.value_error(
                node,
                f"tile indexing specified too many indices {len(items)} > {len(shape)}",
            )
        offsets, steps, full, seen = [], [], [], []
        for axis, extent in enumerate(shape):
            item = items[axis] if axis < len(items) else ast.Slice()
            if isinstance(item, ast.Slice):
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
        offsets = [
            self.from_the_end(offset, extent, item, node)
            for offset, extent, item in itertools.zip_longest(offsets, shape, items)
        ]
        return self.selection(native, offsets, steps, full, seen)

    def from_the_end(self, offset, extent, item, node):
        """Where a row lies: its index, known at run time, may count from the end of an axis.

        Offsets that `tile_view` got as values count from the beginning.
        """
        if not isinstance(item, ast.AST) or offset.constant() is not None:
            return offset
        self.context.at(node)
        return self.builder.position(offset, extent)

    def index(self, item, extent, axis, node, what="tile_view() integer offset"):
        binding = self.context.expressions.expr(item) if isinstance(item, ast.AST) else item
        known = self.known(binding)
        if isinstance(known, int) and type(known) is not bool:
            if not -extent <= known < extent:
                raise self.context.value_error(
                    node,
                    f"{what} {known} is out of bounds for axis {axis} with size {extent}",
                )
            return self.builder.constant(INT32, known % extent)
        value = self.context.materialize(binding, node)
        if value.type.kind != "int":
            raise self.context.type_error(
                node,
                f"expects an integer as index of a tile, but got '{value.type.python_name}'",
                also="tile indices must be integers or slices",
            )
        return value

    def selected(self, item, extent, node):
        """First index, step and count of a slice."""
        bounds = []
        for part in (item.lower, item.upper, item.step):
            if part is None:
                bounds.append(None)
                continue
            binding = self.context.expressions.expr(part) if isinstance(part, ast.AST) else part
            known = self.known(binding)
            if not isinstance(known, int):
                raise self.context.value_error(
                    node,
                    "tile_view() slice bounds must be compile-time constants.",
                )
            bounds.append(known)
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
            known = offset.constant()
            extent = native.shape[axis]
            if known is not None and not 0 <= known <= extent - shape[axis]:
                raise self.context.value_error(
                    node,
                    f"tile_view() of {shape[axis]} elements at offset {known} is out of bounds for "
                    f"axis {axis} with size {extent}",
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
                value = self.convert(value, dtypes.dtype_of(element), node, "tile_assign")
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
            known = self.known(offset)
            if isinstance(known, int) and not 0 <= known < extent:
                raise self.context.value_error(
                    node,
                    f"tile_view() integer offset {known} is out of bounds for axis {axis} with "
                    f"size {extent}",
                )

    def sliced(self, node):
        """A call of `tile_view` without its offset, and that as indices and slices, if one is."""
        written = [*node.args[1:2], *(k.value for k in node.keywords if k.arg == "offset")]
        items = [one for value in written for one in getattr(value, "elts", [value])]
        if not any(map(is_slice, items)):
            return node, None
        rest = [k for k in node.keywords if k.arg != "offset"]
        rest += [ast.keyword("shape", one) for one in node.args[2:3]]
        call = ast.copy_location(ast.Call(node.func, node.args[:1], rest), node)
        return call, [self.as_slice(one) if is_slice(one) else one for one in items]

    def as_slice(self, call):
        """`slice(a, b, c)` as what stands between brackets."""
        if call.keywords or not 1 <= len(call.args) <= 3:
            raise self.context.type_error(call, "'slice' expects 1 to 3 arguments")
        parts = [None, *call.args] if len(call.args) == 1 else call.args
        bounds = [None if _is_none(one) else one for one in (*parts, None, None)[:3]]
        return ast.copy_location(ast.Slice(*bounds), call)

    def builtin_tile_view(self, node):
        call, offsets = self.sliced(node)
        binding, offset, shape = self.bind(
            call,
            "tile_view",
            ("t", "offset", "shape"),
            shape=None,
            **({"offset": 0} if offsets else {}),
        )
        tile = self.tile(binding, node, "tile_view")
        native = tile.type
        if offsets and shape is not None:
            raise self.context.value_error(
                node,
                "tile_view() takes the extents from slices, so no shape",
                also="tile_view() cannot take 'shape' together with a slice",
            )
        if offsets is None:
            offsets = self.parts(offset)
            self.check_offsets(native, offsets, node)
        if len(offsets) > len(native.shape):
            raise self.context.value_error(
                node,
                f"tile_view() specified too many indices {len(offsets)} > {len(native.shape)}",
            )
        if shape is None:
            part, selected = self.part(native, offsets, node)
            if part.full is None:
                part, selected = self.whole_part(native, offsets, [1] * len(offsets), node)
        else:
            shape = self.extents(shape, node, "tile_view")
            if len(shape) != len(native.shape):
                raise self.context.value_error(
                    node,
                    "tile_view() if shape is specified it must have same number of dimensions as "
                    f"source tile, expected {len(native.shape)}, got {len(shape)}",
                )
            part, selected = self.whole_part(native, offsets, shape, node)
        target = node.args[0] if node.args else node.keywords[0].value
        slot = self.context.tiles.views.of(binding, target)
        if slot is None:
            return self.read(tile, part, node)
        return self.context.tiles.views.placed(slot.extended(("tile", part), selected), node)


def _is_none(node) -> bool:
    return node is None or (isinstance(node, ast.Constant) and node.value is None)
