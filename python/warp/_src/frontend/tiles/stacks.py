"""Stacks that the threads of a block have together.

A stack is a tile of elements and a tile with their number. Values are pushed in the order of
its threads; what it pops comes from the top, thread 0 first.
"""

from __future__ import annotations

import ast

from warp._src.frontend.bindings import INT32, TileStack
from warp._src.frontend.parameters import known
from warp._src.frontend.tiles.arguments import TileTopic
from warp._src.types import dtypes
from warp._src.types.tiles import TileStackType


class TileStacks(TileTopic):
    """Translates stacks."""

    def empty(self, node, capacity, native):
        capacity = known(capacity)
        if type(capacity) is not int or capacity < 1:
            raise self.context.value_error(
                node,
                "tile_stack() requires capacity to be a positive integer that is known at compile "
                f"time, got {capacity!r}",
                code="tile-stack-capacity",
            )
        self.context.at(node)
        zero = self.builder.zero(native)
        elements = self.make("splat", [zero], node, shape=[capacity], element=native)
        kind = TileStackType(capacity, dtypes.dtype_of(native))
        return TileStack(kind, [elements, self.number(0, node)])

    def number(self, count, node):
        """A tile with one number."""
        count = self.builder.constant(INT32, count)
        return self.make("splat", [count], node, shape=[1], element=INT32)

    def write(self, place, stack, node):
        """Gives the variable that holds a stack another one."""
        if not isinstance(place, ast.Name) or place.id not in self.context.env:
            raise self.context.type_error(place, "expects a variable that holds a stack")
        self.context.env[place.id] = stack
        self.context.tiles.changed.add(place.id)
        self.context.lines[place.id] = self.context.source.line(node)

    def count(self, node, stack):
        self.context.at(node)
        zero = self.builder.constant(INT32, 0)
        return self.make("get", [stack.parts[1], zero], node)

    def pushed(self, node, stack, value, wanted):
        """The slot of each thread's value, and the stack with them."""
        elements, count = stack.parts
        wanted = self.context.materialize(wanted, node)
        self.context.at(node)
        pushes = self.of_threads(self.builder.cast(wanted, INT32), node)
        before = self.make("scan", [pushes], node, kind="add", exclusive=True)
        slot = self.call(
            "add",
            self.count(node, stack),
            self.make("to_threads", [before], node, element=INT32),
        )
        capacity = self.builder.constant(INT32, stack.type.capacity)
        pushed = self.call("bit_and", wanted, self.call("lt", slot, capacity))
        elements = self.make(
            "set", [value, elements, slot, pushed], node, kind="assign", where=True
        )
        pushes = self.make("reduce", [pushes], node, kind="add")
        count = self.mapped(
            [count, pushes],
            lambda a, b: self.call("min", self.call("add", a, b), capacity),
            node,
        )
        none = self.builder.constant(INT32, -1)
        made = TileStack(stack.type, [elements, count])
        return self.call("where", pushed, slot, none), made

    def popped(self, node, stack):
        """A value for each thread with its slot, and the stack without them."""
        elements, count = stack.parts
        threads = self.context.session.block_threads()
        self.context.at(node)
        zero, one = (self.builder.constant(INT32, number) for number in (0, 1))
        numbers = self.make("iota", [one, one], node, shape=[threads], element=INT32)
        number = self.make("to_threads", [numbers], node, element=INT32)
        slot = self.call("sub", self.count(node, stack), number)
        # Elements outside of the tile are zero.
        slots = self.of_threads(slot, node)
        popped = self.make("gather", [elements, slots], node)
        value = self.make("to_threads", [popped], node, element=elements.type.element)
        width = self.builder.constant(INT32, threads)
        count = self.mapped(
            [count], lambda a: self.call("max", self.call("sub", a, width), zero), node
        )
        none = self.builder.constant(INT32, -1)
        made = TileStack(stack.type, [elements, count])
        return (value, self.call("max", slot, none)), made

    def cleared(self, node, stack):
        return TileStack(stack.type, [stack.parts[0], self.number(0, node)])
