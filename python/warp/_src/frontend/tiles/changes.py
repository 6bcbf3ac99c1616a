"""Builtins that change elements of a variable's tile."""

from __future__ import annotations

from warp._src.frontend.binder import Update
from warp._src.frontend.tiles.arguments import TileTopic

_NUMBERS = {"bool", "int", "float"}


class TileChanges(TileTopic):
    """Translates assignments to parts, and to elements by each thread."""

    def of_element(self, node, source, native):
        """The source of an assignment with elements of a type; numbers convert."""
        if source.type.element != native and {source.type.element.kind, native.kind} <= _NUMBERS:
            return self.mapped([source], lambda x: self.builder.cast(x, native), node)
        if source.type.element != native:
            raise self.context.type_error(
                node,
                f"tile_assign() expects tiles of the same dtype, got {native.python_name} and "
                f"{source.type.element.python_name}",
                "use `wp.tile_astype(...)`",
            )
        return source

    def extracted(self, node, tile, indices):
        """An element of a tile, or a component of one."""
        rank = len(tile.type.shape)
        places = self.places(tile, indices[:rank], node, "tile_extract")
        element = self.make("get", [tile, *places], node)
        values = [self.context.materialize(index, node) for index in indices[rank:]]
        return self.builder.extract(element, values) if values else element

    def places(self, tile, indices, node, name):
        """Indices of an element, those that are known counted from the beginning."""
        of = self.context.tiles.places.index
        return [
            of(index, extent, axis, node, f"{name}() index")
            for axis, (index, extent) in enumerate(zip(indices, tile.type.shape, strict=True))
        ]

    def scattered(self, node, kind, tile, indices, value, where):
        """A tile in which each thread has changed an element, if it has a value."""
        name = {"add": "tile_scatter_add", "assign": "tile_scatter_masked"}[kind]
        value = self.context.convert_constant(value, tile.type.element, node)
        if value.type != tile.type.element:
            raise self.context.type_error(
                node,
                f"{name}() 'value' type must match tile dtype, got {value.type.python_name} and "
                f"tile dtype {tile.type.element.python_name}",
            )
        indices = self.places(tile, indices, node, name)
        operands = [value, tile, *indices]
        if where is not True:
            operands.append(self.context.materialize(where, node))
        return self.make("set", operands, node, kind=kind, where=where is not True)

    def axpy(self, node, alpha, source, target, place):
        """`target + alpha source`; of elements that a view repeats, what is to be added."""
        element = source.type.element
        alpha = self.context.convert_constant(alpha, element.element or element, node)
        slot = self.context.slots.changed(place)
        if slot is not None and self.context.tiles.views.repeats(slot):
            made = self.mapped([alpha, source], lambda a, x: self.call("mul", x, a), node)
            return Update(made, "add")

        def step(factor, x, y):
            return self.call("add", y, self.call("mul", x, factor))

        return self.mapped([alpha, source, target], step, node)
