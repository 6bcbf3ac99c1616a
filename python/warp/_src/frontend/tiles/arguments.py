"""What translating a builtin for tiles begins with: its arguments, checked."""

from __future__ import annotations

import ast

from warp._src.frontend.bindings import INT32, Value
from warp._src.frontend.context import Part
from warp._src.types import dtypes

# What a threads' block holds is named by this option alone; the layout is the compiler's.
_STORAGE = ("register", "shared")


class TileTopic(Part):
    """A topic of the translation of tiles."""

    def make(self, name, operands, node=None, **options):
        """The result of `warp.tile_<name>`; None of one that only writes."""
        if node is not None:
            self.context.at(node)
        results = self.context.session.tiles.make(name, operands, **options)
        return results[0] if results else None

    def bind(self, node, name, parameters, tiles=0, **defaults):
        """Arguments of a call by parameter; a parameter without a default has to be given.

        tiles: how many of the first ones are tiles, which are given as values.
        """
        arguments, keywords = self.context.constructors.arguments(node)
        if len(arguments) > len(parameters) or set(keywords) - set(parameters):
            raise self.context.type_error(
                node, f"'{name}' expects the arguments ({', '.join(parameters)})"
            )
        given = dict(zip(parameters, arguments, strict=False))
        twice = set(given) & set(keywords)
        if twice:
            raise self.context.type_error(node, f"'{name}' got '{twice.pop()}' twice")
        given.update(keywords)
        for parameter in parameters:
            if parameter not in given and parameter not in defaults:
                raise self.context.type_error(
                    node,
                    f"{name}() missing required keyword argument '{parameter}'"
                    if name.startswith("tile")
                    else f"'{name}' expects the argument '{parameter}'",
                )
        self.check_storage(given.get("storage", "register"), node, name)
        found = [given.get(parameter, defaults.get(parameter)) for parameter in parameters]
        return [self.tile(one, node, name) for one in found[:tiles]] + found[tiles:]

    def check_storage(self, storage, node, name):
        if storage not in _STORAGE:
            raise self.context.value_error(
                node, f"{name}() storage must be 'register' or 'shared', got {storage!r}"
            )

    def known(self, binding):
        """A number known at compile time, or None."""
        if type(binding) is Value:
            return binding.constant()
        return getattr(binding, "value", binding)

    def extents(self, binding, node, name):
        """A shape as ints."""
        parts = self.parts(binding)
        found = [self.known(extent) for extent in parts]
        if not all(isinstance(extent, int) and type(extent) is not bool for extent in found):
            raise self.context.value_error(
                node,
                f"{name}() expects a shape of compile time constants",
                also="shape must be a tuple of constants",
            )
        if not 1 <= len(found) <= 4 or min(found) < 1:
            raise self.context.value_error(
                node,
                f"{name}() expects 1 to 4 positive extents, but got {tuple(found)}",
                also=f"{name}() output must have between one and four dimensions, got {len(found)}",
            )
        return [int(extent) for extent in found]

    def parts(self, binding):
        """The entries of a tuple or vector; a number is one."""
        if type(binding) is tuple:
            return list(binding)
        if isinstance(binding, dtypes.Composite):
            return list(binding)
        if type(binding) is Value and binding.type.kind == "vec":
            return [
                self.builder.extract(binding, [self.builder.constant(INT32, i)])
                for i in range(binding.type.shape[0])
            ]
        return [binding]

    def indices(self, binding, rank, node, name):
        """Offsets as values; none given are zero."""
        if binding is None:
            return [self.builder.constant(INT32, 0)] * rank
        found = [self.context.materialize(part, node) for part in self.parts(binding)]
        if len(found) != rank:
            raise self.context.value_error(
                node,
                f"{name}() offset argument must have the same number of dimensions as the array "
                f"to load from, got {len(found)} indices for an array with {rank} dimensions"
                if "load" in name
                else f"{name}() expects {rank} offsets, but got {len(found)}",
            )
        for one in found:
            if one.type.kind != "int":
                raise self.context.type_error(
                    node, f"{name}() expects integers as offsets, but got '{one.type.python_name}'"
                )
        return found

    def tile(self, binding, node, name):
        """The value of a tile; an error for anything else."""
        value = self.context.materialize(binding, node)
        if value.type.kind != "tile":
            raise self.context.type_error(
                node, f"{name}() expects a tile, but got '{value.type.python_name}'"
            )
        return value

    def same_shape(self, a, b, node, name):
        if a.type.shape != b.type.shape:
            raise self.context.value_error(
                node,
                f"{name}() expects tiles of one shape, got {tuple(a.type.shape)} and "
                f"{tuple(b.type.shape)}",
            )

    def convert(self, value, dtype, node, name):
        """A value as another type; numbers convert, as in NumPy, others have to be of it."""
        if dtype is None:
            return self.context.materialize(value, node)
        native = self.context.constructors.native(dtype, node)
        scalars = ("int", "float", "bool")
        self.context.at(node)
        if type(value) in (int, float, bool) and native.kind in scalars:
            return self.builder.constant(native, value)
        value = self.context.materialize(value, node)
        if value.type == native:
            return value
        self.context.at(node)
        if value.type.kind in scalars and native.kind in scalars:
            return self.builder.cast(value, native)
        if value.type.kind in scalars and native.kind in ("vec", "mat"):
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

    def mapped(self, operands, function, node):
        """The tile of what a function gives for corresponding elements."""
        tiles = self.context.session.tiles
        self.context.at(node)
        result = function(*tiles.begin_function(operands))
        results = result if type(result) is tuple else (result,)
        results = tiles.end_function([self.context.materialize(one, node) for one in results])
        return results[0] if type(result) is not tuple else tuple(results)


def is_slice(node) -> bool:
    """Whether a node of the syntax tree is a call of `slice`."""
    return isinstance(node, ast.Call) and getattr(node.func, "id", None) == "slice"
