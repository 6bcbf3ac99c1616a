"""New tiles: of one value, of numbers in a row, of what each thread has."""

from __future__ import annotations

import fractions
import math

import numpy as np

from warp._src.frontend.bindings import FLOAT32, INT32, Value
from warp._src.frontend.tiles.arguments import TileTopic

_FLOATS = {"float16": np.float16, "float32": np.float32}


# Elements of a tile.
_MOST = 2**31 - 1


def _least(native) -> int:
    """The least number of an integer type."""
    return -(2 ** (native.width - 1)) if native.signed else 0


class TileValues(TileTopic):
    """Translates what makes tiles."""

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
        return self.make("splat", [value], node, shape=shape, element=native)

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
        return self.make("splat", [value], node, shape=shape, element=value.type)

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
        names = ("stop",) if len(numbers) == 1 else ("start", "stop", "step")
        for name, number in zip(names, numbers, strict=False):
            if not isinstance(number, (int, float)):
                raise self.context.error(
                    node,
                    f"tile_arange() arguments must be compile time constants, but {name} is not",
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
        given = (0, numbers[0], 1) if len(numbers) == 1 else (*numbers, 1)[:3]
        names = ("start", "stop", "step")
        start, stop, step = (
            self.exact(*one, native, node) for one in zip(names, given, strict=True)
        )
        if step == 0:
            raise self.context.value_error(node, "tile_arange() step cannot be zero")
        count = math.ceil((stop - start) / step)
        # The last may reach the end when it is rounded.
        if count > 1 and native.kind == "float":
            last = self.exact("stop", start + (count - 1) * step, native, node)
            count -= last >= stop if step > 0 else last <= stop
        if count > _MOST:
            raise self.context.value_error(
                node,
                f"tile_arange() from {given[0]} to {given[1]} by {given[2]} has {count} elements, "
                f"but a tile has at most {_MOST}",
                also="tile_arange() spans more elements than can be counted",
            )
        if count < 1:
            raise self.context.value_error(
                node,
                f"tile_arange() requires a non-empty range, but start={given[0]}, "
                f"stop={given[1]}, step={given[2]} has no elements",
            )
        self.context.at(node)
        real = int if native.kind == "int" else float
        operands = [self.builder.constant(native, real(one)) for one in (start, step)]
        return self.make("iota", operands, node, shape=[count], element=native)

    def exact(self, name, number, native, node):
        """A bound, or the step, as elements of a type hold it."""
        if isinstance(number, int) and not -(2**63) <= number < 2**64:
            raise self.context.value_error(
                node,
                f"tile_arange() {name}={number} is too wide to use as an integer bound",
                f"write `{float(number)!r}`",
            )
        if not math.isfinite(number):
            raise self.context.value_error(node, "tile_arange() requires finite bounds")
        if native.kind == "float":
            given = number
            if isinstance(number, int):
                # Rounded once, not to a double first.
                number = (np.int64 if number < 2**63 else np.uint64)(number)
            with np.errstate(over="ignore"):
                number = float(_FLOATS.get(native.python_name, float)(number))
            if not math.isfinite(number):
                raise self.context.value_error(
                    node,
                    f"tile_arange() {name}={given} is out of range of {native.python_name}",
                )
        elif number != int(number):
            raise self.context.value_error(
                node,
                f"tile_arange() of {native.python_name} expects integers, but got {number}",
                also=f"tile_arange() {name}={number} has a fractional part",
            )
        elif not _least(native) <= number <= _least(native) + 2**native.width - 1:
            raise self.context.value_error(
                node, f"tile_arange() {name}={number} is out of range of {native.python_name}"
            )
        return fractions.Fraction(number)

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
        return self.make("from_threads", [value], node, shape=shape, element=element)

    def builtin_untile(self, node):
        (value,) = self.bind(node, "untile", ("a",), tiles=1)
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
            raise self.context.value_error(
                node,
                f"untile() argument must have {threads} elements in its last dimension, one for "
                f"each thread of the block, but has {shape[-1]}",
            )
        return self.make("to_threads", [value], node, element=native)

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
        if threads == 1:
            # The only one there is.
            index = self.builder.constant(INT32, 0)
        elif known is not None and not 0 <= known < threads:
            raise self.context.value_error(
                node,
                f"tile_from_thread() thread_idx={known} is outside of a block of {threads} threads",
            )
        each = self.make("from_threads", [value], node, shape=[threads], element=value.type)
        chosen = self.make("get", [each, index], node)
        return self.make("splat", [chosen], node, shape=shape, element=value.type)
