"""Tiles and arrays, parts of tiles: the builtins that move elements."""

from __future__ import annotations

import ast
import math

from warp._src import errors
from warp._src.frontend.context import INT32, Part, TileView
from warp._src.frontend.tiles import TilePart

# Position of the argument that a builtin changes.
UPDATED = {
    "tile_assign": (0,),
    "tile_scatter_add": (0,),
    "tile_scatter_masked": (0,),
    "tile_axpy": (2,),
    "tile_sort": (0, 1),
    "tile_fft": (0,),
    "tile_ifft": (0,),
    "tile_cholesky_inplace": (0,),
    "tile_cholesky_solve_inplace": (1,),
    "tile_lower_solve_inplace": (1,),
    "tile_upper_solve_inplace": (1,),
    "tile_matmul": (2,),
}


class TileMoves(Part):
    """Translates loads, stores, views and assignments of tiles."""

    @property
    def tiles(self):
        return self.context.tiles

    # Arrays.

    def array(self, binding, node, name):
        value = self.context.materialize(binding, node)
        if value.type.kind != "array":
            raise self.context.type_error(
                node, f"{name}() expects an array, but got '{value.type.python_name}'"
            )
        return value

    def builtin_tile_load(self, node):
        array, shape, offset, _, checked, _ = self.tiles.bind(
            node,
            "tile_load",
            ("a", "shape", "offset", "storage", "bounds_check", "aligned"),
            offset=None,
            storage="register",
            bounds_check=True,
            aligned=False,
        )
        array = self.array(array, node, "tile_load")
        shape = self.tiles.extents(shape, node, "tile_load")
        self.check_rank(array, shape, node, "tile_load")
        offsets = self.tiles.indices(offset, array.type.rank, node, "tile_load")
        return self.tiles.make(
            "load", [array, *offsets], node, shape=shape, checked=bool(self.tiles.known(checked))
        )[0]

    def check_rank(self, array, shape, node, name):
        if len(shape) != array.type.rank:
            raise self.context.error(
                node,
                f"{name}() array argument must have same number of dimensions as the tile shape, "
                f"trying to perform an {len(shape)} dimensional load from an array with "
                f"{array.type.rank} dimensions.",
                kind=errors.WarpCodegenValueError,
            )

    def picked(self, indices, axis, rank, node, name):
        """The tile of indices and the dimension that they are along."""
        indices = self.tiles.tile(indices, node, name)
        if len(indices.type.shape) != 1:
            raise self.context.error(
                node,
                f"{name}() indices argument must be a 1D tile, got {len(indices.type.shape)} "
                "dimensions instead.",
                kind=errors.WarpCodegenValueError,
            )
        axis = self.tiles.known(axis)
        if not isinstance(axis, int) or not 0 <= axis < rank:
            raise self.context.error(
                node,
                f"{name}() axis argument must be valid axis of the array, got {axis}.",
                kind=errors.WarpCodegenValueError,
            )
        return indices, axis

    def builtin_tile_load_indexed(self, node):
        name = "tile_load_indexed"
        array, indices, shape, offset, axis, _ = self.tiles.bind(
            node,
            name,
            ("a", "indices", "shape", "offset", "axis", "storage"),
            offset=None,
            axis=0,
            storage="register",
        )
        array = self.array(array, node, name)
        shape = self.tiles.extents(shape, node, name)
        self.check_rank(array, shape, node, name)
        indices, axis = self.picked(indices, axis, array.type.rank, node, name)
        if indices.type.shape[0] != shape[axis]:
            raise self.context.error(
                node,
                f"{name}() indices and shape disagree along axis {axis}: "
                f"{indices.type.shape[0]} and {shape[axis]}",
                kind=errors.WarpCodegenValueError,
            )
        offsets = self.tiles.indices(offset, array.type.rank, node, name)
        return self.tiles.make(
            "load", [array, *offsets, indices], node, shape=shape, axis=axis, flag=True
        )[0]

    def stored(self, array, tile, offset, node, name):
        """The operands of a store."""
        array = self.array(array, node, name)
        tile = self.tiles.tile(tile, node, name)
        rank = array.type.rank
        if offset is not None and len(self.tiles.parts(offset)) != rank:
            raise self.context.error(
                node,
                f"{name}() 'a' argument must have {len(self.tiles.parts(offset))} dimensions, "
                f"got {rank}",
                kind=errors.WarpCodegenValueError,
            )
        if len(tile.type.shape) != rank:
            raise self.context.error(
                node,
                f"{name}() 'a' argument must have the same number of dimensions as the 't' "
                f"argument, got {rank} and {len(tile.type.shape)}",
                kind=errors.WarpCodegenValueError,
            )
        if tile.type.element != array.type.element:
            raise self.context.type_error(
                node,
                f"{name}() 'a' and 't' arguments must have the same dtype, got "
                f"{array.type.element.python_name} and {tile.type.element.python_name}",
            )
        return [tile, array, *self.tiles.indices(offset, rank, node, name)]

    def builtin_tile_store(self, node):
        array, tile, offset, checked, _ = self.tiles.bind(
            node,
            "tile_store",
            ("a", "t", "offset", "bounds_check", "aligned"),
            offset=None,
            bounds_check=True,
            aligned=False,
        )
        operands = self.stored(array, tile, offset, node, "tile_store")
        self.tiles.make("store", operands, node, checked=bool(self.tiles.known(checked)))

    def builtin_tile_atomic_add(self, node):
        array, tile, offset, checked = self.tiles.bind(
            node,
            "tile_atomic_add",
            ("a", "t", "offset", "bounds_check"),
            offset=None,
            bounds_check=True,
        )
        operands = self.stored(array, tile, offset, node, "tile_atomic_add")
        checked = bool(self.tiles.known(checked))
        return self.tiles.make("atomic", operands, node, kind="add", checked=checked)[0]

    def builtin_tile_store_indexed(self, node):
        self.stored_indexed(node, "tile_store_indexed", "store")

    def builtin_tile_atomic_add_indexed(self, node):
        return self.stored_indexed(node, "tile_atomic_add_indexed", "atomic")[0]

    def stored_indexed(self, node, name, operation):
        array, indices, tile, offset, axis = self.tiles.bind(
            node, name, ("a", "indices", "t", "offset", "axis"), offset=None, axis=0
        )
        operands = self.stored(array, tile, offset, node, name)
        indices, axis = self.picked(indices, axis, operands[1].type.rank, node, name)
        return self.tiles.make(
            operation, [*operands, indices], node, kind="add", axis=axis, flag=True
        )

    # Shapes.

    def builtin_tile_transpose(self, node):
        (binding,) = self.tiles.bind(node, "tile_transpose", ("a",))
        tile = self.tiles.tile(binding, node, "tile_transpose")
        if len(tile.type.shape) != 2:
            raise self.context.error(
                node,
                "tile_transpose() expects a tile of two dimensions",
                kind=errors.WarpCodegenValueError,
            )
        shape = list(reversed(tile.type.shape))
        return self.tiles.make("transpose", [tile], node, shape=shape, axes=[1, 0])[0]

    def builtin_tile_broadcast(self, node):
        binding, shape = self.tiles.bind(node, "tile_broadcast", ("a", "shape"))
        tile = self.tiles.tile(binding, node, "tile_broadcast")
        shape = self.tiles.extents(shape, node, "tile_broadcast")
        old = tile.type.shape
        fits = len(old) <= len(shape) and all(
            a in (1, b) for a, b in zip(reversed(old), reversed(shape), strict=False)
        )
        if not fits:
            raise self.context.error(
                node,
                f"tile_broadcast() cannot broadcast shape {tuple(old)} to {tuple(shape)}",
                kind=errors.WarpCodegenValueError,
            )
        return self.tiles.make("broadcast", [tile], node, shape=shape)[0]

    def builtin_tile_reshape(self, node):
        binding, shape = self.tiles.bind(node, "tile_reshape", ("t", "shape"))
        tile = self.tiles.tile(binding, node, "tile_reshape")
        known = [self.tiles.known(extent) for extent in self.tiles.parts(shape)]
        count = math.prod(tile.type.shape)
        if known.count(-1) == 1:
            rest = -math.prod(known)
            known[known.index(-1)] = count // rest if rest > 0 else 0
        if any(not isinstance(extent, int) for extent in known) or math.prod(known) != count:
            raise self.context.error(
                node,
                f"tile_reshape() cannot make shape {tuple(known)} of shape "
                f"{tuple(tile.type.shape)}",
                kind=errors.WarpCodegenValueError,
            )
        return self.tiles.make("reshape", [tile], node, shape=known)[0]

    def builtin_tile_squeeze(self, node):
        binding, axis = self.tiles.bind(node, "tile_squeeze", ("t", "axis"), axis=None)
        tile = self.tiles.tile(binding, node, "tile_squeeze")
        shape = list(tile.type.shape)
        given = range(len(shape)) if axis is None else self.tiles.parts(axis)
        axes = set()
        for one in map(self.tiles.known, given):
            if not -len(shape) <= one < len(shape):
                raise self.context.error(
                    node,
                    f"tile_squeeze() axis {one} is out of bounds for tile with {len(shape)} "
                    "dimensions",
                    kind=errors.WarpCodegenValueError,
                )
            if axis is not None and shape[one] != 1:
                raise self.context.error(
                    node,
                    f"tile_squeeze() cannot remove axis {one}, whose extent is {shape[one]}",
                    kind=errors.WarpCodegenValueError,
                )
            if shape[one] == 1:
                axes.add(one % len(shape))
        kept = [extent for i, extent in enumerate(shape) if i not in axes] or [1]
        return self.tiles.make("reshape", [tile], node, shape=kept)[0]

    def builtin_tile_astype(self, node):
        binding, dtype = self.tiles.bind(node, "tile_astype", ("t", "dtype"))
        tile = self.tiles.tile(binding, node, "tile_astype")
        native = self.context.constructors.native(dtype, node)
        return self.tiles.mapped([tile], lambda x: self.builder.cast(x, native), node)

    # Parts.

    def builtin_tile_view(self, node):
        binding, offset, shape = self.tiles.bind(
            node, "tile_view", ("t", "offset", "shape"), shape=None
        )
        tile = self.tiles.tile(binding, node, "tile_view")
        native = tile.type
        offsets = self.tiles.parts(offset)
        if len(offsets) > len(native.shape):
            raise self.context.error(
                node,
                f"tile_view() specified too many indices {len(offsets)} > {len(native.shape)}",
                kind=errors.WarpCodegenValueError,
            )
        if shape is None:
            part, selected = self.tiles.part(native, offsets, node)
            if part.full is None:
                part, selected = self.whole_part(native, offsets, [1] * len(offsets), node)
        else:
            shape = self.tiles.extents(shape, node, "tile_view")
            if len(shape) != len(native.shape):
                raise self.context.error(
                    node,
                    "tile_view() if shape is specified it must have same number of dimensions as "
                    f"source tile, expected {len(native.shape)}, got {len(shape)}",
                    kind=errors.WarpCodegenValueError,
                )
            part, selected = self.whole_part(native, offsets, shape, node)
        slot = binding.slot if type(binding) is TileView else None
        target = node.args[0] if node.args else node.keywords[0].value
        if slot is None and isinstance(target, ast.Name):
            slot = self.context.targets.slot(target)
        if slot is None or slot.name is None:
            return self.tiles.read(tile, part, node)
        return TileView(slot.extended(("tile", part), selected))

    def whole_part(self, native, offsets, shape, node):
        offsets = [self.context.materialize(offset, node) for offset in offsets]
        offsets += [self.builder.constant(INT32, 0)] * (len(shape) - len(offsets))
        text = "x".join(map(str, shape))
        steps = [1] * len(shape)
        for axis, offset in enumerate(offsets):
            known = offset.constant()
            extent = native.shape[axis]
            if known is not None and not 0 <= known <= extent - shape[axis]:
                raise self.context.error(
                    node,
                    f"tile_view() of {shape[axis]} elements at offset {known} is out of bounds for "
                    f"axis {axis} with size {extent}",
                    kind=errors.WarpCodegenValueError,
                )
        return (
            TilePart(offsets, steps, shape, shape),
            type(native).parse(f"!warp.tile<{text} x {native.element}>"),
        )

    def builtin_tile_assign(self, node):
        target, source, offset = self.tiles.bind(
            node, "tile_assign", ("dst", "src", "offset"), offset=None
        )
        tile = self.tiles.tile(target, node, "tile_assign")
        source = self.tiles.tile(source, node, "tile_assign")
        self.same_element(tile, source, node, "tile_assign")
        if len(tile.type.shape) != len(source.type.shape):
            raise self.context.error(
                node,
                "tile_assign() destination and source tiles must have the same rank, got "
                f"{len(tile.type.shape)} and {len(source.type.shape)}",
                kind=errors.WarpCodegenValueError,
            )
        if any(a > b for a, b in zip(source.type.shape, tile.type.shape, strict=True)):
            raise self.context.error(
                node,
                f"tile_assign() source tile of shape {tuple(source.type.shape)} does not fit "
                f"into a destination of shape {tuple(tile.type.shape)}",
                kind=errors.WarpCodegenValueError,
            )
        offsets = self.tiles.indices(offset, len(tile.type.shape), node, "tile_assign")
        made = self.tiles.make("insert", [source, tile, *offsets], node, axes=[1] * len(offsets))
        self.tiles.write_back(node.args[0], made[0], node)

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
        tile = self.tiles.tile(tile, node, "tile_extract")
        rank = len(tile.type.shape)
        inner = {"vec": 1, "mat": 2}.get(tile.type.element.kind, 0)
        if len(indices) not in (rank, rank + inner):
            raise self.context.error(
                node,
                f"tile_extract: incorrect number of indices ({len(indices)}) for tile shape "
                f"{tuple(tile.type.shape)}",
                kind=errors.WarpCodegenValueError,
            )
        values = [self.context.materialize(index, node) for index in indices]
        element = self.tiles.make("get", [tile, *values[:rank]], node)[0]
        return self.builder.extract(element, values[rank:]) if values[rank:] else element

    def builtin_tile_scatter_add(self, node):
        self.scattered(node, "tile_scatter_add", "add")

    def builtin_tile_scatter_masked(self, node):
        self.scattered(node, "tile_scatter_masked", "assign")

    def scattered(self, node, name, kind):
        """`(a, i, ..., value, has_value)`: each thread changes an element, if it has a value."""
        arguments, keywords = self.context.constructors.arguments(node)
        tile = self.tiles.tile(arguments[0], node, name)
        rank = len(tile.type.shape)
        rest = dict(zip(("value", "has_value", "atomic"), arguments[1 + rank :], strict=False))
        rest.update(keywords)
        if len(arguments) < 1 + rank or "value" not in rest:
            raise self.context.error(
                node,
                f"{name}: incorrect number of indices ({len(arguments) - 1}) for tile shape "
                f"{tuple(tile.type.shape)}",
                kind=errors.WarpCodegenValueError,
            )
        value = self.context.convert_constant(rest["value"], tile.type.element, node)
        if value.type != tile.type.element:
            raise self.context.type_error(
                node,
                f"{name}() 'value' type must match tile dtype, got {value.type.python_name} and "
                f"tile dtype {tile.type.element.python_name}",
            )
        indices = [self.context.materialize(one, node) for one in arguments[1 : 1 + rank]]
        where = self.context.expressions.truth(rest.get("has_value", True), node)
        operands = [value, tile, *indices]
        if where is not True:
            operands.append(self.context.materialize(where, node))
        made = self.tiles.make("set", operands, node, kind=kind, flag=where is not True)[0]
        self.tiles.write_back(node.args[0], made, node)
