"""Tiles and arrays: loads, stores, atomic sums."""

from __future__ import annotations

from warp._src.frontend.tiles.arguments import TileTopic


class TileMemory(TileTopic):
    """Translates what moves elements between tiles and arrays."""

    def array(self, binding, node, name):
        value = self.context.materialize(binding, node)
        if value.type.kind != "array":
            raise self.context.type_error(
                node, f"{name}() expects an array, but got '{value.type.python_name}'"
            )
        return value

    def builtin_tile_load(self, node):
        array, shape, offset, _, checked, _ = self.bind(
            node,
            "tile_load",
            ("a", "shape", "offset", "storage", "bounds_check", "aligned"),
            offset=None,
            storage="register",
            bounds_check=True,
            aligned=False,
        )
        array = self.array(array, node, "tile_load")
        shape = self.extents(shape, node, "tile_load")
        self.check_rank(array, shape, node, "tile_load")
        offsets = self.indices(offset, array.type.rank, node, "tile_load")
        return self.make(
            "load", [array, *offsets], node, shape=shape, checked=bool(self.known(checked))
        )

    def check_rank(self, array, shape, node, name):
        if len(shape) != array.type.rank:
            raise self.context.value_error(
                node,
                f"{name}() array argument must have same number of dimensions as the tile shape, "
                f"trying to perform an {len(shape)} dimensional load from an array with "
                f"{array.type.rank} dimensions.",
            )

    def picked_along(self, indices, axis, rank, node, name):
        """The tile of indices and the dimension that they are along."""
        indices = self.tile(indices, node, name)
        if len(indices.type.shape) != 1:
            raise self.context.value_error(
                node,
                f"{name}() indices argument must be a 1D tile, got {len(indices.type.shape)} "
                "dimensions instead.",
            )
        axis = self.known(axis)
        if not isinstance(axis, int) or not 0 <= axis < rank:
            raise self.context.value_error(
                node,
                f"{name}() axis argument must be valid axis of the array, got {axis}.",
            )
        return indices, axis

    def builtin_tile_load_indexed(self, node):
        name = "tile_load_indexed"
        array, indices, shape, offset, axis, _ = self.bind(
            node,
            name,
            ("a", "indices", "shape", "offset", "axis", "storage"),
            offset=None,
            axis=0,
            storage="register",
        )
        array = self.array(array, node, name)
        shape = self.extents(shape, node, name)
        self.check_rank(array, shape, node, name)
        indices, axis = self.picked_along(indices, axis, array.type.rank, node, name)
        if indices.type.shape[0] != shape[axis]:
            raise self.context.value_error(
                node,
                f"{name}() indices and shape disagree along axis {axis}: "
                f"{indices.type.shape[0]} and {shape[axis]}",
            )
        offsets = self.indices(offset, array.type.rank, node, name)
        return self.make(
            "load", [array, *offsets, indices], node, shape=shape, axis=axis, flag=True
        )

    def stored(self, array, tile, offset, node, name):
        """The operands of a store."""
        array = self.array(array, node, name)
        tile = self.tile(tile, node, name)
        rank = array.type.rank
        if offset is not None and len(self.parts(offset)) != rank:
            raise self.context.value_error(
                node,
                f"{name}() 'a' argument must have {len(self.parts(offset))} dimensions, got {rank}",
            )
        if len(tile.type.shape) != rank:
            raise self.context.value_error(
                node,
                f"{name}() 'a' argument must have the same number of dimensions as the 't' "
                f"argument, got {rank} and {len(tile.type.shape)}",
            )
        if tile.type.element != array.type.element:
            raise self.context.type_error(
                node,
                f"{name}() 'a' and 't' arguments must have the same dtype, got "
                f"{array.type.element.python_name} and {tile.type.element.python_name}",
            )
        return [tile, array, *self.indices(offset, rank, node, name)]

    def builtin_tile_store(self, node):
        array, tile, offset, checked, _ = self.bind(
            node,
            "tile_store",
            ("a", "t", "offset", "bounds_check", "aligned"),
            offset=None,
            bounds_check=True,
            aligned=False,
        )
        operands = self.stored(array, tile, offset, node, "tile_store")
        self.make("store", operands, node, checked=bool(self.known(checked)))

    def builtin_tile_atomic_add(self, node):
        array, tile, offset, checked = self.bind(
            node,
            "tile_atomic_add",
            ("a", "t", "offset", "bounds_check"),
            offset=None,
            bounds_check=True,
        )
        operands = self.stored(array, tile, offset, node, "tile_atomic_add")
        checked = bool(self.known(checked))
        return self.make("atomic", operands, node, kind="add", checked=checked)

    def builtin_tile_store_indexed(self, node):
        self.stored_indexed(node, "tile_store_indexed", "store")

    def builtin_tile_atomic_add_indexed(self, node):
        return self.stored_indexed(node, "tile_atomic_add_indexed", "atomic")

    def stored_indexed(self, node, name, operation):
        array, indices, tile, offset, axis = self.bind(
            node, name, ("a", "indices", "t", "offset", "axis"), offset=None, axis=0
        )
        operands = self.stored(array, tile, offset, node, name)
        indices, axis = self.picked_along(indices, axis, operands[1].type.rank, node, name)
        return self.make(operation, [*operands, indices], node, kind="add", axis=axis, flag=True)
