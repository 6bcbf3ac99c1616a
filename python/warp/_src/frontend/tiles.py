"""Tiles: elements that a block of threads holds together.

A tile is a value. What changes one, such as `t[i] = x` or `wp.tile_assign(t, ...)`, makes another
value and binds the variable to it. A view (`t[2:4]`, `t[i]`, `wp.tile_view(t, ...)`) of a variable
keeps the place in it, so that assigning to the view changes the variable.
"""

from __future__ import annotations

import ast
import math

from warp._src import errors
from warp._src.frontend.context import FLOAT32, INT32, Part, TileView, Value
from warp._src.types import dtypes

# What a threads' block holds is named by this option alone; the layout is the compiler's.
_STORAGE = ("register", "shared")


class TilePart:
    """Where a part lies: offsets and steps per dimension, its shape with all dimensions, and the
    shape it is seen in; None for both shapes for one element."""

    __slots__ = ("full", "offsets", "shape", "steps")

    def __init__(self, offsets, steps=None, full=None, shape=None):
        self.offsets, self.steps, self.full, self.shape = offsets, steps, full, shape


class Tiles(Part):
    """Translates what makes, moves and takes apart tiles."""

    __slots__ = ("changed",)

    def __init__(self, context):
        super().__init__(context)
        # Variables whose tiles were changed, rather than replaced by another tile.
        self.changed = set()

    def note_change(self, name):
        self.changed.add(name)

    def is_changed(self, name) -> bool:
        return name in self.changed

    # Calls into the builder.

    def make(self, name, operands, node=None, **options):
        """The results of `warp.tile_<name>`."""
        if node is not None:
            self.context.at(node)
        return self.context.session.tiles.make(name, operands, **options)

    def bind(self, node, name, parameters, **defaults):
        """Arguments of a call by parameter; a parameter without a default has to be given."""
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
        if given.get("storage", "register") not in _STORAGE:
            raise self.context.error(
                node,
                f"{name}() storage must be 'register' or 'shared', got {given['storage']!r}",
                kind=errors.WarpCodegenValueError,
            )
        return [given.get(parameter, defaults.get(parameter)) for parameter in parameters]

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
            raise self.context.error(
                node,
                f"{name}() expects a shape of compile time constants",
                kind=errors.WarpCodegenValueError,
                also="shape must be a tuple of constants",
            )
        if not 1 <= len(found) <= 4 or min(found) < 1:
            raise self.context.error(
                node,
                f"{name}() expects 1 to 4 positive extents, but got {tuple(found)}",
                kind=errors.WarpCodegenValueError,
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
            raise self.context.error(
                node,
                f"{name}() offset argument must have the same number of dimensions as the array "
                f"to load from, got {len(found)} indices for an array with {rank} dimensions"
                if "load" in name
                else f"{name}() expects {rank} offsets, but got {len(found)}",
                kind=errors.WarpCodegenValueError,
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

    def write_back(self, target, value, node):
        """Binds what an argument names to its new value."""
        if isinstance(target, ast.Call):
            return
        self.context.targets.write(self.context.targets.slot(target), value, node)

    # Making tiles.

    def filled(self, node, name, number):
        shape, dtype, _ = self.bind(
            node, name, ("shape", "dtype", "storage"), dtype=float, storage="register"
        )
        shape = self.extents(shape, node, name)
        native = self.context.constructors.native(dtype, node)
        self.context.at(node)
        if number is None:
            value = self.builder.zero(native)
        elif native.kind == "struct":
            raise self.context.type_error(
                node,
                f"{name}() does not support Warp struct dtypes; use tile_full() with an explicit "
                "value",
            )
        else:
            value = self.builder.constant(native, number)
        return self.make("splat", [value], node, shape=shape, element=native)[0]

    def builtin_tile_zeros(self, node):
        return self.filled(node, "tile_zeros", None)

    def builtin_tile_empty(self, node):
        """Zeros, which is as good as anything."""
        return self.filled(node, "tile_empty", None)

    def builtin_tile_ones(self, node):
        return self.filled(node, "tile_ones", 1)

    def builtin_tile_full(self, node):
        shape, value, dtype, _ = self.bind(
            node, "tile_full", ("shape", "value", "dtype", "storage"), dtype=None, storage=""
        ) if len(node.args) > 3 or any(k.arg == "storage" for k in node.keywords) else (
            *self.bind(node, "tile_full", ("shape", "value", "dtype"), dtype=None), None
        )  # fmt: skip
        shape = self.extents(shape, node, "tile_full")
        value = self.convert(value, dtype, node, "tile_full")
        return self.make("splat", [value], node, shape=shape, element=value.type)[0]

    def convert(self, value, dtype, node, name):
        """A value as another type; numbers convert, others have to be of it."""
        if dtype is None:
            return self.context.materialize(value, node)
        native = self.context.constructors.native(dtype, node)
        value = self.context.convert_constant(value, native, node)
        if value.type == native:
            return value
        scalars = ("int", "float", "bool")
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

    def builtin_tile_arange(self, node):
        arguments, keywords = self.context.constructors.arguments(node)
        dtype = keywords.pop("dtype", None)
        keywords.pop("storage", None)
        if keywords or not 1 <= len(arguments) <= 3:
            raise self.context.type_error(
                node,
                "tile_arange() requires at least one positional argument specifying the range"
                if not arguments
                else f"tile_arange() accepts at most 3 positional arguments, got {len(arguments)}",
            )
        numbers = [self.known(argument) for argument in arguments]
        if any(not isinstance(number, (int, float)) for number in numbers):
            raise self.context.error(node, "tile_arange() arguments must be compile time constants")
        start, stop, step = (0, numbers[0], 1) if len(numbers) == 1 else (*numbers, 1)[:3]
        if step == 0:
            raise self.context.error(
                node, "tile_arange() step cannot be zero", kind=errors.WarpCodegenValueError
            )
        count = math.ceil((stop - start) / step)
        if count < 1:
            raise self.context.error(
                node,
                f"tile_arange() requires a non-empty range, but start={start}, stop={stop}, "
                f"step={step} has no elements",
                kind=errors.WarpCodegenValueError,
            )
        if dtype is None:
            typed = [a.type for a in arguments if type(a) is Value]
            plain = FLOAT32 if any(isinstance(n, float) for n in numbers) else INT32
            native = typed[0] if typed else plain
        else:
            native = self.context.constructors.native(dtype, node)
        if native.kind not in ("int", "float"):
            raise self.context.type_error(
                node,
                f"tile_arange() requires a numeric scalar dtype, but got {native.python_name}",
            )
        self.context.at(node)
        operands = [self.builder.constant(native, one) for one in (start, step)]
        return self.make("iota", operands, node, shape=[count], element=native)[0]

    # Threads.

    def builtin_block_dim(self, node):
        self.context.constructors.exactly(node, 0, "block_dim")
        return self.context.session.block_threads()

    def builtin_tile(self, node):
        value, whole = self.bind(node, "tile", ("x", "preserve_type"), preserve_type=False)
        value = self.context.materialize(value, node)
        native = value.type
        threads = self.context.session.block_threads()
        if native.kind == "tile":
            raise self.context.type_error(node, "tile() expects a value of each thread")
        if native.kind in ("vec", "mat") and not self.known(whole):
            shape, element = [*native.shape, threads], native.element
        else:
            shape, element = [threads], native
        return self.make("from_threads", [value], node, shape=shape, element=element)[0]

    def builtin_untile(self, node):
        (binding,) = self.bind(node, "untile", ("a",))
        value = self.tile(binding, node, "untile")
        element, shape = value.type.element, value.type.shape
        if len(shape) == 2:
            native = self.context.access.composite_type([shape[0]], element)
        elif len(shape) == 3:
            native = self.context.access.composite_type(shape[:2], element)
        elif len(shape) == 1:
            native = element
        else:
            raise self.context.type_error(node, "untile() expects at most three dimensions")
        threads = self.context.session.block_threads()
        if shape[-1] != threads:
            raise self.context.error(
                node,
                f"untile() argument must have {threads} elements in its last dimension, one for "
                f"each thread of the block, but has {shape[-1]}",
                kind=errors.WarpCodegenValueError,
            )
        return self.make("to_threads", [value], node, element=native)[0]

    def builtin_tile_from_thread(self, node):
        """The value of one thread in all elements."""
        shape, value, index, _ = self.bind(
            node,
            "tile_from_thread",
            ("shape", "value", "thread_idx", "storage"),
            storage="register",
        )
        shape = self.extents(shape, node, "tile_from_thread")
        value = self.context.materialize(value, node)
        threads = self.context.session.block_threads()
        index = self.context.materialize(index, node)
        known = index.constant()
        if known is not None and not 0 <= known < threads:
            raise self.context.error(
                node,
                f"tile_from_thread() thread_idx={known} is outside of a block of {threads} threads",
                kind=errors.WarpCodegenValueError,
            )
        each = self.make("from_threads", [value], node, shape=[threads], element=value.type)[0]
        chosen = self.make("get", [each, index], node)[0]
        return self.make("splat", [chosen], node, shape=shape, element=value.type)[0]

    # Parts.

    def operator(self, node, name, operands):
        """An operator between tiles, or a tile and a value, element by element."""
        shapes = {tuple(one.type.shape) for one in operands if one.type.kind == "tile"}
        if len(shapes) != 1:
            shown = " and ".join(f"'{one.type.python_name}'" for one in operands)
            raise self.context.type_error(
                node,
                f"tiles have to have the same shape, but got {shown}",
                "use `wp.tile_broadcast(...)`",
                also="Tile arguments to tile operators must have the same shape",
            )
        apply = self.context.expressions.operator
        return self.mapped(operands, lambda *elements: apply(node, name, *elements), node)

    def mapped(self, operands, function, node):
        """The tile of what a function gives for corresponding elements."""
        tiles = self.context.session.tiles
        self.context.at(node)
        result = function(*tiles.begin_function(operands))
        results = result if type(result) is tuple else (result,)
        results = tiles.end_function([self.context.materialize(one, node) for one in results])
        return results[0] if type(result) is not tuple else tuple(results)

    def attribute(self, native, name, node):
        """`shape`, `dtype`, `ndim`, `size` of a tile's type."""
        if name == "shape":
            return tuple(native.shape)
        if name == "dtype":
            return dtypes.dtype_of(native.element)
        if name == "ndim":
            return len(native.shape)
        if name == "size":
            return math.prod(native.shape)
        raise self.context.error(
            node,
            f"'{native.python_name}' has no attribute '{name}'",
            kind=errors.WarpCodegenAttributeError,
        )

    def part(self, native, items, node):
        """What indices and slices select, and its type: of an element, or a tile."""
        shape = native.shape
        if len(items) > len(shape):
            raise self.context.error(
                node,
                f"tile indexing specified too many indices {len(items)} > {len(shape)}",
                kind=errors.WarpCodegenValueError,
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
            return TilePart(offsets), native.element
        text = "x".join(map(str, seen))
        return (
            TilePart(offsets, steps, full, seen),
            type(native).parse(f"!warp.tile<{text} x {native.element}>"),
        )

    def index(self, item, extent, axis, node):
        binding = self.context.expressions.expr(item) if isinstance(item, ast.AST) else item
        known = self.known(binding)
        if isinstance(known, int) and type(known) is not bool:
            if not -extent <= known < extent:
                raise self.context.error(
                    node,
                    f"tile_view() integer offset {known} is out of bounds for axis {axis} with "
                    f"size {extent}",
                    kind=errors.WarpCodegenValueError,
                )
            return self.builder.constant(INT32, known % extent)
        value = self.context.materialize(binding, node)
        if value.type.kind != "int":
            raise self.context.type_error(
                node, f"expects an integer as index of a tile, but got '{value.type.python_name}'"
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
                raise self.context.error(
                    node,
                    "tile_view() slice bounds must be compile-time constants.",
                    kind=errors.WarpCodegenValueError,
                )
            bounds.append(known)
        if bounds[2] == 0:
            raise self.context.error(
                node, "tile_view() slice step cannot be zero.", kind=errors.WarpCodegenValueError
            )
        chosen = range(*slice(*bounds).indices(extent))
        if not chosen:
            raise self.context.error(
                node,
                f"tile_view() slice produced an empty tile of an axis of {extent} elements",
                kind=errors.WarpCodegenValueError,
            )
        return chosen.start, chosen.step, len(chosen)

    def read(self, tile, part, node):
        """An element or a part of a tile."""
        if part.full is None:
            return self.make("get", [tile, *part.offsets], node)[0]
        whole = self.make("slice", [tile, *part.offsets], node, shape=part.full, axes=part.steps)[0]
        if part.shape == part.full:
            return whole
        return self.make("reshape", [whole], node, shape=part.shape)[0]

    def written(self, tile, part, value, node, kind="assign"):
        """A tile with an element or a part replaced."""
        if part.full is None:
            element = tile.type.element
            if value.type != element and value.type.kind in ("int", "float", "bool"):
                value = self.convert(value, dtypes.dtype_of(element), node, "tile_assign")
            return self.make("set", [value, tile, *part.offsets], node, kind=kind)[0]
        if value.type.kind != "tile":
            value = self.make("splat", [value], node, shape=part.full, element=tile.type.element)[0]
        elif list(value.type.shape) != part.full:
            if math.prod(value.type.shape) != math.prod(part.full):
                raise self.context.error(
                    node,
                    f"tile_assign() source tile of shape {tuple(value.type.shape)} does not fit "
                    f"the selected part of shape {tuple(part.shape)}",
                    kind=errors.WarpCodegenValueError,
                )
            value = self.make("reshape", [value], node, shape=part.full)[0]
        return self.make("insert", [value, tile, *part.offsets], node, axes=part.steps)[0]

    def subscript(self, base, items, node):
        """`t[...]` of a tile: an element, or a view of the variable that holds it."""
        slot = base.slot if type(base) is TileView else None
        if slot is None and isinstance(node.value, ast.Name) and node.value.id in self.context.env:
            slot = self.context.targets.slot(node.value)
        native = base.type
        picked = self.picked(native, items, node)
        if picked is not None:
            return self.gathered(self.context.materialize(base, node), *picked, node)
        part, selected = self.part(native, items, node)
        if slot is not None and part.full is not None:
            return TileView(slot.extended(("tile", part), selected))
        return self.read(self.context.materialize(base, node), part, node)

    def picked(self, native, items, node):
        """The dimension that a tile of indices selects along, these, and what else is selected."""
        for axis, item in enumerate(items):
            if isinstance(item, (ast.Slice, ast.Constant)) or axis >= len(native.shape):
                continue
            binding = self.context.expressions.expr(item)
            if getattr(getattr(binding, "type", None), "kind", None) == "tile":
                indices = self.context.materialize(binding, node)
                return axis, indices, [*items[:axis], ast.Slice(), *items[axis + 1 :]]
        return None

    def gathered(self, tile, axis, indices, items, node):
        """Rows of a tile along one dimension, by a tile of indices: a copy."""
        if len(indices.type.shape) != 1 or indices.type.element.kind != "int":
            raise self.context.error(
                node,
                f"tile indexing expects a 1D tile of integers, got '{indices.type.python_name}'",
                kind=errors.WarpCodegenValueError,
            )
        extents = list(tile.type.shape)
        count = indices.type.shape[0]
        shape = [*extents[:axis], count, *extents[axis + 1 :]]
        self.context.at(node)
        spread = [1] * len(shape)
        spread[axis] = count
        rows = self.make("reshape", [indices], node, shape=spread)[0]
        strides = [math.prod(extents[d + 1 :]) for d in range(len(extents))]
        extent = self.builder.constant(INT32, extents[axis])
        stride = self.builder.constant(INT32, strides[axis])
        outside = self.builder.constant(INT32, -1)
        zero = self.builder.constant(INT32, 0)
        call = lambda name, *operands: self.builder.builtin(name, list(operands))[0][0]  # noqa: E731

        def place(index):
            """Where a row begins; negative indices count from the end."""
            index = self.builder.cast(index, INT32)
            counted = call("where", call("lt", index, zero), call("add", index, extent), index)
            return call("mul", counted, stride)

        rows = self.make("broadcast", [self.mapped([rows], place, node)], node, shape=shape)[0]
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
            )[0]
            flat = [1] * len(shape)
            flat[other] = extents[other]
            numbers = self.make("reshape", [numbers], node, shape=flat)[0]
            numbers = self.make("broadcast", [numbers], node, shape=shape)[0]
            positions = self.mapped(
                [positions, numbers],
                lambda a, b: call("where", call("lt", a, zero), outside, call("add", a, b)),
                node,
            )
        made = self.make("gather", [tile, positions], node)[0]
        part, _ = self.part(made.type, items, node)
        if part.full == shape and part.shape == shape and set(part.steps) == {1}:
            return made
        return self.read(made, part, node)
