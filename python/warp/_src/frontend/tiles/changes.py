"""Builtins that change elements of a variable's tile."""

from __future__ import annotations

from warp._src.frontend.tiles.arguments import TileTopic

_NUMBERS = {"bool", "int", "float"}


class TileChanges(TileTopic):
    """Translates assignments to parts, and to elements by each thread."""

    def builtin_tile_assign(self, node):
        tile, source, offset = self.bind(
            node, "tile_assign", ("dst", "src", "offset"), tiles=2, offset=None
        )
        source = self.of_element(source, tile, node, "tile_assign")
        if len(tile.type.shape) != len(source.type.shape):
            raise self.context.value_error(
                node,
                "tile_assign() destination and source tiles must have the same rank, got "
                f"{len(tile.type.shape)} and {len(source.type.shape)}",
            )
        if any(a > b for a, b in zip(source.type.shape, tile.type.shape, strict=True)):
            raise self.context.value_error(
                node,
                f"tile_assign() source tile of shape {tuple(source.type.shape)} does not fit "
                f"into a destination of shape {tuple(tile.type.shape)}",
            )
        offsets = self.indices(offset, len(tile.type.shape), node, "tile_assign")
        made = self.make("insert", [source, tile, *offsets], node, axes=[1] * len(offsets))
        self.context.slots.write_back(node.args[0], made, node)

    def of_element(self, source, tile, node, name):
        """A tile with elements of another one's type; numbers convert."""
        native = tile.type.element
        if source.type.element != native and {source.type.element.kind, native.kind} <= _NUMBERS:
            return self.mapped([source], lambda x: self.builder.cast(x, native), node)
        self.same_element(tile, source, node, name)
        return source

    def same_element(self, a, b, node, name):
        if a.type.element != b.type.element:
            raise self.context.type_error(
                node,
                f"{name}() expects tiles of the same dtype, got {a.type.element.python_name} and "
                f"{b.type.element.python_name}",
                "use `wp.tile_astype(...)`",
            )

    def builtin_tile_extract(self, node):
        arguments, keywords = self.context.constructors.arguments(node)
        tile, *indices = (*arguments, *keywords.values())
        tile = self.tile(tile, node, "tile_extract")
        rank = len(tile.type.shape)
        inner = {"vec": 1, "mat": 2}.get(tile.type.element.kind, 0)
        if len(indices) not in (rank, rank + inner):
            raise self.context.value_error(
                node,
                f"tile_extract: incorrect number of indices ({len(indices)}) for tile shape "
                f"{tuple(tile.type.shape)}",
            )
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

    def builtin_tile_scatter_add(self, node):
        self.scattered(node, "tile_scatter_add", "add")

    def builtin_tile_scatter_masked(self, node):
        self.scattered(node, "tile_scatter_masked", "assign")

    def scattered(self, node, name, kind):
        """`(a, i, ..., value, has_value)`: each thread changes an element, if it has a value."""
        arguments, keywords = self.context.constructors.arguments(node)
        tile = self.tile(arguments[0], node, name)
        rank = len(tile.type.shape)
        rest = dict(zip(("value", "has_value", "atomic"), arguments[1 + rank :], strict=False))
        rest.update(keywords)
        if len(arguments) < 1 + rank or "value" not in rest:
            raise self.context.value_error(
                node,
                f"{name}: incorrect number of indices ({len(arguments) - 1}) for tile shape "
                f"{tuple(tile.type.shape)}",
            )
        value = self.context.convert_constant(rest["value"], tile.type.element, node)
        if value.type != tile.type.element:
            raise self.context.type_error(
                node,
                f"{name}() 'value' type must match tile dtype, got {value.type.python_name} and "
                f"tile dtype {tile.type.element.python_name}",
            )
        indices = self.places(tile, arguments[1 : 1 + rank], node, name)
        where = self.context.expressions.truth(rest.get("has_value", True), node)
        operands = [value, tile, *indices]
        if where is not True:
            operands.append(self.context.materialize(where, node))
        made = self.make("set", operands, node, kind=kind, flag=where is not True)
        self.context.slots.write_back(node.args[0], made, node)

    def builtin_tile_axpy(self, node):
        """`dest += alpha * src`."""
        alpha, source, target = self.bind(node, "tile_axpy", ("alpha", "src", "dest"))
        source = self.tile(source, node, "tile_axpy")
        target = self.tile(target, node, "tile_axpy")
        self.same_shape(source, target, node, "tile_axpy")
        element = source.type.element
        scalar = element.element or element
        alpha = self.context.convert_constant(alpha, scalar, node)

        def step(factor, x, y):
            product = self.builder.builtin("mul", [x, factor])[0][0]
            return self.builder.builtin("add", [y, product])[0][0]

        by_name = (one.value for one in node.keywords if one.arg == "dest")
        place = node.args[2] if len(node.args) > 2 else next(by_name)
        slot = self.context.slots.changed(place)
        if slot is None:
            return
        if self.context.tiles.views.repeats(slot):

            def product(factor, x):
                return self.builder.builtin("mul", [x, factor])[0][0]

            made = self.mapped([alpha, source], product, node)
            self.context.slots.write(slot, made, node, "add")
            return
        self.context.slots.write(slot, self.mapped([alpha, source, target], step, node), node)
