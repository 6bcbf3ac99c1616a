"""Functions of elements: operators, maps, reductions, scans, sorting."""

from __future__ import annotations

from warp._src.frontend.names import BuiltinRef
from warp._src.frontend.tiles.arguments import TileTopic
from warp._src.kernels.function import Function

# Functions that reductions know by themselves.
_REDUCTIONS = {"add": "add", "min": "min", "max": "max"}


class TileElements(TileTopic):
    """Translates what is computed of elements one by one, or in an order."""

    def operator(self, node, name, operands):
        """An operator between tiles, or a tile and a value, element by element."""
        shapes = {tuple(one.type.shape) for one in operands if one.type.kind == "tile"}
        if len(shapes) != 1:
            shown = " and ".join(f"'{one.type.python_name}'" for one in operands)
            raise self.context.type_error(
                node,
                f"tiles have to have the same shape, but got {shown}",
                "use `wp.tile_broadcast(...)`",
                code="tile-shapes",
            )
        kinds = [getattr(one.type.element, "kind", None) for one in operands]
        if "struct" in kinds:
            return self.mapped(operands, lambda *e: self.of_fields(node, name, *e), node)
        self.check_factors(node, name, operands)
        apply = self.context.expressions.operator
        return self.mapped(operands, lambda *elements: apply(node, name, *elements), node)

    def check_factors(self, node, name, operands):
        """Vectors have no product, nor quotient, element by element."""
        kinds = [
            (one.type.element if one.type.kind == "tile" else one.type).kind for one in operands
        ]
        if name not in ("mul", "div") or kinds != ["vec", "vec"]:
            return
        verb = "multiply" if name == "mul" else "divide"
        names = [
            f"tile<{one.type.element}>" if one.type.kind == "tile" else one.type.python_name
            for one in operands
        ]
        both = all(one.type.kind == "tile" for one in operands)
        raise self.context.type_error(
            node,
            f"cannot {verb} '{operands[0].type.python_name}' by '{operands[1].type.python_name}'",
            "use `wp.tile_map(wp.cw_mul, ...)`, or `wp.cw_div`",
            code="tile-scalars" if both else "tile-operands",
            facts={"verb": verb, "left": names[0], "right": names[1]},
        )

    def of_fields(self, node, name, *elements):
        """An operator between structs, field by field: sums and differences."""
        a = elements[0]
        if a.type.kind != "struct":
            if a.type.kind == "bool" or (a.type.kind == "int" and a.type.width < 32):
                return a
            return self.context.expressions.operator(node, name, *elements)
        own = isinstance(self.context.function.__globals__.get(name), Function)
        if own or name not in ("add", "sub") or any(one.type != a.type for one in elements):
            return self.context.expressions.operator(node, name, *elements)
        get = self.builder.struct_get
        parts = [
            self.of_fields(node, name, *(get(one, field) for one in elements))
            for field, _ in a.type.fields
        ]
        return self.builder.struct_create(a.type, parts)

    def function(self, binding, node, name):
        """A function of elements, as one of values."""
        if isinstance(binding, BuiltinRef):
            return lambda *values: self.context.calls.apply_builtin(
                binding.name, list(values), node
            )
        if isinstance(binding, Function):
            return lambda *values: self.context.user_calls.call_function(
                binding, list(values), {}, node
            )
        raise self.context.type_error(
            node,
            f"{name}() expects a builtin or a `@wp.func`, but got "
            f"'{self.context.type_name(binding)}'",
        )

    def constant(self, tile, node):
        """`stop_gradient` of all elements."""
        return self.mapped([tile], self.function(BuiltinRef("stop_gradient"), node, ""), node)

    def converted(self, node, tile, native):
        """A tile with elements converted to a type."""
        return self.mapped([tile], lambda x: self.builder.cast(x, native), node)

    def map(self, node, operation, values):
        """A function of corresponding elements; what is no tile is the same for all."""
        tiles = [value.type for value in values if value.type.kind == "tile"]
        if not tiles:
            raise self.context.type_error(node, "tile_map() expects a tile")
        for other in tiles[1:]:
            if other.shape != tiles[0].shape:
                raise self.context.value_error(
                    node,
                    f"tile_map() expects tiles of one shape, got {tuple(tiles[0].shape)} and "
                    f"{tuple(other.shape)}",
                    "use `wp.tile_broadcast(...)`",
                )
        return self.mapped(values, self.function(operation, node, "tile_map"), node)

    # Reductions.

    def summed(self, node, tile, axis):
        if tile.type.element.kind == "struct":
            return self.sum_of_fields(tile, axis, node)
        return self.make("reduce", [tile], node, kind="add", axis=axis)

    def inner(self, node, a, b):
        """Products of elements; of composites, their inner products."""
        kind = a.type.element.kind
        product = {"vec": "dot", "quat": "dot", "mat": "ddot"}.get(kind, "mul")
        return self.mapped([a, b], lambda x, y: self.call(product, x, y), node)

    def reduced(self, node, operation, tile, axis):
        """Elements combined by a function, which may be one that reductions know."""
        known = _REDUCTIONS.get(getattr(operation, "name", None))
        is_number = tile.type.element.kind in ("int", "float")
        if isinstance(operation, BuiltinRef) and known and (known == "add" or is_number):
            return self.make("reduce", [tile], node, kind=known, axis=axis)
        if isinstance(operation, BuiltinRef) and tile.type.element.kind == "struct":
            raise self.context.type_error(
                node,
                f"tile_reduce() operator '{operation.name}' has no overload for elements that are "
                "a Warp struct",
                "use a `@wp.func` of two of them",
            )
        return self.folded(tile, axis, self.function(operation, node, "tile_reduce"), node)

    def folded(self, tile, axis, function, node):
        """Elements joined two by two by a function."""
        tiles = self.context.session.tiles
        self.context.at(node)
        result = self.context.materialize(function(*tiles.begin_function([tile], True)), node)
        if result.type != tile.type.element:
            raise self.context.type_error(
                node,
                "tile_reduce() operator must return the tile element type "
                f"{tile.type.element.python_name}, but gives {result.type.python_name}",
            )
        return tiles.end_function([result], axis=axis)[0]

    def sum_of_fields(self, tile, axis, node):
        """The sum of structs, field by field; bits and small numbers are those of the first."""
        leaves = []

        def take_apart(value):
            if value.type.kind != "struct":
                leaves.append(value.type)
                return [value]
            fields = [self.builder.struct_get(value, name) for name, _ in value.type.fields]
            return [leaf for field in fields for leaf in take_apart(field)]

        def put_together(native, values):
            if native.kind != "struct":
                return next(values)
            parts = [put_together(field, values) for _, field in native.fields]
            return self.builder.struct_create(native, parts)

        def first(a, _):
            return a

        parts = self.mapped([tile], lambda value: tuple(take_apart(value)), node)
        sums = []
        for native, part in zip(leaves, parts, strict=True):
            if native.kind == "bool" or (native.kind == "int" and native.width < 32):
                sums.append(self.folded(part, axis, first, node))
            else:
                sums.append(self.make("reduce", [part], node, kind="add", axis=axis))
        native = tile.type.element
        return self.mapped(sums, lambda *values: put_together(native, iter(values)), node)

    def sorted(self, keys, values):
        """Keys in order, and values along with them."""
        positions = self.make("sort", [keys])
        return tuple([self.make("gather", [tile, positions]) for tile in (keys, values)])
