"""Tiles of random numbers.

Element e is draw e div B of thread e mod B, which begins with the hash of its number within the
block plus the state that it gives: the sequences of the peer, whatever the layout.
"""

from __future__ import annotations

import math

from warp._src.frontend.bindings import FLOAT32, INT32, NativeType
from warp._src.frontend.parameters import known
from warp._src.frontend.tiles.arguments import TileTopic

_UINT32 = NativeType.parse("ui32")


class TileRandoms(TileTopic):
    """Translates what draws random numbers for all elements."""

    def drawn(self, node, draw, shape, state, *bounds):
        """A tile of draws by `randi` or `randf`, in bounds if there are some."""
        native, kind = {"randi": (INT32, int), "randf": (FLOAT32, float)}[draw]
        bounds = self.bounds(*bounds, native, kind, node, f"tile_{draw}") if bounds else []
        states = self.states(state, math.prod(shape), node)
        made = self.mapped([states, *bounds], lambda *values: self.call(draw, *values), node)
        return self.make("reshape", [made], node, shape=shape)

    def bounds(self, low, high, native, kind, node, name):
        """Both bounds as values."""
        low, high = known(low), known(high)
        if type(low) is not kind or type(high) is not kind:
            raise self.context.type_error(
                node,
                f"{name}() expects constants of type '{kind.__name__}' as 'min' and 'max'",
                code="random-bounds",
                facts={"name": name, "kinds": "integers" if kind is int else "floats"},
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
        given = self.of_threads(state, node)
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
            (rows,) = tiles.end_function([following], axis=0, partials=True)
            states = self.make("reshape", [rows], node, shape=[draws * threads])
        if draws * threads == count:
            return states
        first = self.builder.constant(INT32, 0)
        return self.make("slice", [states, first], node, shape=[count], axes=[1])
