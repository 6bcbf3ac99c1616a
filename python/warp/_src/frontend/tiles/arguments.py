"""Operations, conversions and functions of elements, for all topics of tiles."""

from __future__ import annotations

from warp._src.frontend.context import Part

_SCALARS = ("int", "float", "bool")


class TileTopic(Part):
    """A topic of the translation of tiles."""

    def make(self, name, operands, node=None, **options):
        """The result of `warp.tile_<name>`; None of one that only writes."""
        if node is not None:
            self.context.at(node)
        results = self.context.session.tiles.make(name, operands, **options)
        return results[0] if results else None

    def call(self, name, *operands):
        """The result of a builtin of the registry."""
        return self.builder.builtin(name, list(operands))[0][0]

    def tile(self, binding, node, name):
        """The value of a tile; an error for anything else."""
        value = self.context.materialize(binding, node)
        if value.type.kind != "tile":
            raise self.context.type_error(
                node, f"{name}() expects a tile, but got '{value.type.python_name}'"
            )
        return value

    def convert(self, value, native, node, name):
        """A value as another type; numbers convert, as in NumPy, others have to be of it."""
        self.context.at(node)
        if type(value) in (int, float, bool) and native.kind in _SCALARS:
            return self.builder.constant(native, value)
        value = self.context.materialize(value, node)
        if value.type == native:
            return value
        self.context.at(node)
        if value.type.kind in _SCALARS and native.kind in _SCALARS:
            return self.builder.cast(value, native)
        if value.type.kind in _SCALARS and native.kind in ("vec", "mat"):
            return self.builder.construct(native, [self.builder.cast(value, native.element)])
        wanted, got = native.python_name, value.type.python_name
        if native.kind == "struct":
            raise self.context.type_error(
                node,
                f"{name}() value must have dtype {wanted} when filling Warp struct tile elements, "
                f"got {got}",
            )
        raise self.context.type_error(
            node,
            f"{name}() cannot convert a composite or Warp struct value of type {got} to {wanted}",
        )

    def of_threads(self, value, node):
        """The tile of what each thread of the block has."""
        threads = self.context.session.block_threads()
        return self.make("from_threads", [value], node, shape=[threads], element=value.type)

    def mapped(self, operands, function, node):
        """The tile of what a function gives for corresponding elements."""
        tiles = self.context.session.tiles
        self.context.at(node)
        result = function(*tiles.begin_function(operands))
        results = result if type(result) is tuple else (result,)
        results = tiles.end_function([self.context.materialize(one, node) for one in results])
        return results[0] if type(result) is not tuple else tuple(results)
