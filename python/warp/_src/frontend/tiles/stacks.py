"""Stacks that the threads of a block have together.

A stack is a tile of elements and a tile with their number. What a block pushes is in the order of
its threads; what it pops comes from the top, thread 0 first.
"""

from __future__ import annotations

import ast

from warp._src.frontend.bindings import INT32, TileStack
from warp._src.frontend.tiles.arguments import TileTopic
from warp._src.types import dtypes
from warp._src.types.tiles import TileStackType


class TileStacks(TileTopic):
    """Translates stacks."""

    def builtin_tile_stack(self, node):
        capacity, dtype = self.bind(node, "tile_stack", ("capacity", "dtype"))
        capacity = self.known(capacity)
        if type(capacity) is not int or capacity < 1:
            raise self.context.value_error(
                node,
                "tile_stack() requires capacity to be a positive integer that is known at compile "
                f"time, got {capacity!r}",
                also="tile_stack() requires capacity to be a compile-time constant",
            )
        native = self.context.constructors.native(dtype, node)
        self.context.at(node)
        zero = self.builder.zero(native)
        elements = self.make("splat", [zero], node, shape=[capacity], element=native)
        kind = TileStackType(capacity, dtypes.dtype_of(native))
        return TileStack(kind, [elements, self.number(0, node)])

    def number(self, count, node):
        """A tile with one number."""
        count = self.builder.constant(INT32, count)
        return self.make("splat", [count], node, shape=[1], element=INT32)

    def call(self, name, *operands):
        return self.builder.builtin(name, list(operands))[0][0]

    def stack(self, binding, node, name):
        if type(binding) is not TileStack:
            raise self.context.type_error(
                node,
                f"{name}() expects a stack, but got '{self.context.type_name(binding)}'",
                "use `wp.tile_stack(capacity=..., dtype=...)`",
            )
        return binding

    def change(self, node, stack, elements, count):
        """Gives the variable that holds the stack another one."""
        place = node.args[0] if node.args else next(k.value for k in node.keywords if k.arg == "s")
        if not isinstance(place, ast.Name) or place.id not in self.context.env:
            raise self.context.type_error(place, "expects a variable that holds a stack")
        self.context.env[place.id] = TileStack(stack.type, [elements, count])
        self.context.tiles.changed.add(place.id)
        self.context.lines[place.id] = self.context.source.line(node)

    def count(self, stack, node):
        zero = self.builder.constant(INT32, 0)
        return self.make("get", [stack.parts[1], zero], node)

    def of_threads(self, value, node):
        """The tile of what each thread has."""
        threads = self.context.session.block_threads()
        return self.make("from_threads", [value], node, shape=[threads], element=value.type)

    def builtin_tile_stack_push(self, node):
        name = "tile_stack_push"
        stack, value, wanted = self.bind(node, name, ("s", "value", "has_value"))
        stack = self.stack(stack, node, name)
        elements, count = stack.parts
        value = self.context.materialize(value, node)
        if value.type != elements.type.element:
            raise self.context.type_error(
                node,
                f"{name}() value of type '{value.type.python_name}' does not match the elements of "
                f"'{stack.python_name}'",
            )
        wanted = self.context.expressions.truth(wanted, node)
        wanted = self.context.materialize(wanted, node)
        self.context.at(node)
        pushes = self.of_threads(self.builder.cast(wanted, INT32), node)
        before = self.make("scan", [pushes], node, kind="add", flag=True)
        slot = self.call(
            "add",
            self.count(stack, node),
            self.make("to_threads", [before], node, element=INT32),
        )
        capacity = self.builder.constant(INT32, stack.type.capacity)
        pushed = self.call("bit_and", wanted, self.call("lt", slot, capacity))
        elements = self.make("set", [value, elements, slot, pushed], node, kind="assign", flag=True)
        pushes = self.make("reduce", [pushes], node, kind="add")
        count = self.mapped(
            [count, pushes],
            lambda a, b: self.call("min", self.call("add", a, b), capacity),
            node,
        )
        self.change(node, stack, elements, count)
        none = self.builder.constant(INT32, -1)
        return self.call("where", pushed, slot, none)

    def builtin_tile_stack_pop(self, node):
        name = "tile_stack_pop"
        (stack,) = self.bind(node, name, ("s",))
        elements, count = self.stack(stack, node, name).parts
        threads = self.context.session.block_threads()
        self.context.at(node)
        zero, one = (self.builder.constant(INT32, number) for number in (0, 1))
        numbers = self.make("iota", [one, one], node, shape=[threads], element=INT32)
        number = self.make("to_threads", [numbers], node, element=INT32)
        slot = self.call("sub", self.count(stack, node), number)
        # What is outside of the tile is zero.
        slots = self.of_threads(slot, node)
        popped = self.make("gather", [elements, slots], node)
        value = self.make("to_threads", [popped], node, element=elements.type.element)
        width = self.builder.constant(INT32, threads)
        count = self.mapped(
            [count], lambda a: self.call("max", self.call("sub", a, width), zero), node
        )
        self.change(node, stack, elements, count)
        none = self.builder.constant(INT32, -1)
        return value, self.call("max", slot, none)

    def builtin_tile_stack_clear(self, node):
        (stack,) = self.bind(node, "tile_stack_clear", ("s",))
        stack = self.stack(stack, node, "tile_stack_clear")
        self.change(node, stack, stack.parts[0], self.number(0, node))

    def builtin_tile_stack_count(self, node):
        (stack,) = self.bind(node, "tile_stack_count", ("s",))
        self.context.at(node)
        return self.count(self.stack(stack, node, "tile_stack_count"), node)
