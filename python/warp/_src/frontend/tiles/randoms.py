"""Tiles of random numbers.

Element e is draw e div B of thread e mod B, which begins with the hash of its number within the
block plus the state that it gives: the sequences of the peer, whatever the layout.
"""

from __future__ import annotations

import math

from warp._src.frontend.bindings import FLOAT32, INT32, NativeType
from warp._src.frontend.tiles.arguments import TileTopic

_UINT32 = NativeType.parse("ui32")


class TileRandoms(TileTopic):
    """Translates what draws random numbers for all elements."""

    def builtin_tile_randi(self, node):
        return self.drawn(node, "tile_randi", "randi", INT32, int)

    def builtin_tile_randf(self, node):
        return self.drawn(node, "tile_randf", "randf", FLOAT32, float)

    def drawn(self, node, name, draw, native, kind):
        names = ("shape", "rng", "min", "max", "storage")
        shape, state, low, high, _ = self.bind(
            node, name, names, min=None, max=None, storage="register"
        )
        if isinstance(low, str) and high is None:
            # The third argument of the overload without bounds.
            self.check_storage(low, node, name)
            low = None
        shape = self.extents(shape, node, name)
        state = self.context.convert_constant(state, _UINT32, node)
        if state.type != _UINT32:
            raise self.context.type_error(
                node,
                f"{name}() expects 'uint32' as state, but got '{state.type.python_name}'",
                "use `wp.rand_init(...)`",
            )
        bounds = self.bounds(low, high, native, kind, node, name)
        states = self.states(state, math.prod(shape), node)
        made = self.mapped([states, *bounds], lambda *values: self.call(draw, *values), node)
        return self.make("reshape", [made], node, shape=shape)

    def call(self, name, *operands):
        return self.builder.builtin(name, list(operands))[0][0]

    def bounds(self, low, high, native, kind, node, name):
        """Both bounds as values, or none."""
        if (low is None) != (high is None):
            raise self.context.error(node, f"{name}() expects 'min' and 'max' together, or neither")
        if low is None:
            return []
        low, high = self.known(low), self.known(high)
        if type(low) is not kind or type(high) is not kind:
            raise self.context.type_error(
                node,
                f"{name}() expects constants of type '{kind.__name__}' as 'min' and 'max'",
                also=f"{name}() 'min' and 'max' must both be "
                f"{'integers' if kind is int else 'floats'}",
            )
        if kind is int and not all(-(2**31) <= one < 2**31 for one in (low, high)):
            raise self.context.value_error(
                node, f"{name}() min and max must be representable as int32"
            )
        values = [self.builder.constant(native, one) for one in (low, high)]
        if not values[0].constant() < values[1].constant():
            raise self.context.value_error(node, f"{name}() max must be greater than min")
        return values

    def states(self, state, count, node):
        """The states before the draws of as many elements, in one dimension."""
        threads = self.context.session.block_threads()
        self.context.at(node)
        given = self.make("from_threads", [state], node, shape=[threads], element=_UINT32)
        zero, one = (self.builder.constant(_UINT32, number) for number in (0, 1))
        numbers = self.make("iota", [zero, one], node, shape=[threads], element=_UINT32)
        # One draw is the hash of the state, and the next state.
        states = self.mapped(
            [numbers, given], lambda i, x: self.call("randu", self.call("add", i, x)), node
        )
        draws = -(-count // threads)
        if draws > 1:
            row = self.make("reshape", [states], node, shape=[1, threads])
            rows = self.make("broadcast", [row], node, shape=[draws, threads])
            tiles = self.context.session.tiles
            before, _ = tiles.begin_function([rows], True)
            following = self.call("randu", before)
            (rows,) = tiles.end_function([following], axis=0, flag=True)
            states = self.make("reshape", [rows], node, shape=[draws * threads])
        if draws * threads == count:
            return states
        first = self.builder.constant(INT32, 0)
        return self.make("slice", [states, first], node, shape=[count], axes=[1])
