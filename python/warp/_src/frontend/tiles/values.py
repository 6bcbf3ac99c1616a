"""New tiles: of one value, of numbers in a row, of what each thread has."""

from __future__ import annotations

import fractions
import math

import numpy as np

from warp._src.frontend.bindings import FLOAT32, INT32, Value
from warp._src.frontend.parameters import known
from warp._src.frontend.tiles.arguments import TileTopic
from warp._src.types.scalars import fits_64_bits

_FLOATS = {"float16": np.float16, "float32": np.float32}


# Elements of a tile.
_MOST = 2**31 - 1


def _least(native) -> int:
    """The least number of an integer type."""
    return -(2 ** (native.width - 1)) if native.signed else 0


class TileValues(TileTopic):
    """Translates what makes tiles."""

    def full(self, node, shape, value, native):
        """A tile of a value, converted to a type if there is one."""
        if native is None:
            value = self.context.materialize(value, node)
        else:
            value = self.convert(value, native, node, "tile_full")
        return self.make("splat", [value], node, shape=shape, element=value.type)

    def arange(self, node, arguments, native):
        if not 1 <= len(arguments) <= 3:
            raise self.context.type_error(
                node,
                "tile_arange() requires at least one positional argument specifying the range"
                if not arguments
                else f"tile_arange() accepts at most 3 positional arguments, got {len(arguments)}",
            )
        numbers = [known(argument) for argument in arguments]
        names = ("stop",) if len(numbers) == 1 else ("start", "stop", "step")
        for name, number in zip(names, numbers, strict=False):
            if not isinstance(number, (int, float)):
                raise self.context.error(
                    node,
                    f"tile_arange() arguments must be compile time constants, but {name} is not",
                )
        if native is None:
            typed = [a.type for a in arguments if type(a) is Value]
            plain = FLOAT32 if any(isinstance(n, float) for n in numbers) else INT32
            native = typed[0] if typed else plain
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
                code="tile-arange-count",
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
        if isinstance(number, int) and not fits_64_bits(number):
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
                code="tile-arange-fraction",
                facts={"name": name, "number": number},
            )
        elif not _least(native) <= number <= _least(native) + 2**native.width - 1:
            raise self.context.value_error(
                node, f"tile_arange() {name}={number} is out of range of {native.python_name}"
            )
        return fractions.Fraction(number)

    # Threads.

    def from_threads(self, node, value, whole):
        """The tile of what each thread has; vectors become columns unless they stay whole."""
        native = value.type
        if native.kind not in ("vec", "mat") or whole:
            return self.of_threads(value, node)
        shape = [*native.shape, self.context.session.block_threads()]
        return self.make("from_threads", [value], node, shape=shape, element=native.element)

    def of_thread(self, element, shape):
        """The type of what each thread has of a tile."""
        if len(shape) == 1:
            return element
        return self.context.access.composite_type(list(shape[:-1]), element)

    def from_thread(self, node, shape, value, index):
        """The value of one thread in all elements."""
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
        chosen = self.make("get", [self.of_threads(value, node), index], node)
        return self.make("splat", [chosen], node, shape=shape, element=value.type)
