"""Parameters by reference, `x: wp.ref[float]`: what the function assigns to them, the caller gets.

A function returns the last values of such parameters behind its results, as far as it assigns to
them, and the call stores these in the places that were passed. So values stay values, and
derivatives need nothing of their own. A place is found once, before the call.
"""

from __future__ import annotations

import ast

from warp._src.frontend.bindings import LocalArray
from warp._src.frontend.context import Part
from warp._src.frontend.functions import NOTHING, is_static


class References(Part):
    """Translates calls of functions that have parameters by reference."""

    def call_by_reference(self, function, references, node):
        """A call of a function with parameters at these positions and of these names."""
        arguments, keywords, slots = [], {}, {}
        for position, argument in enumerate(node.args):
            if isinstance(argument, ast.Starred):
                raise self.context.unsupported(argument, f"`*` in a call of '{function.key}'")
            arguments.append(self.argument(argument, position, references, slots))
        for keyword in node.keywords:
            value = self.argument(keyword.value, keyword.arg, references, slots)
            keywords[keyword.arg] = value
        overload, bound = self.context.user_calls.select(
            function, arguments, keywords, node, by_reference=True
        )
        made = self.context.user_calls.specialize(overload, bound, node)
        values = []
        for binding in bound:
            if not is_static(binding):
                self.context.flatten(binding, node, values)
        self.context.at(node)
        results = iter(self.builder.call(made.symbol, values))
        result = None if made.shape is NOTHING else self.context.unflatten(made.shape, results)
        for position, name, shape in made.updated:
            value = self.context.unflatten(shape, results)
            if type(value) is LocalArray:
                self.context.local_arrays.update(node, position, name, value)
                continue
            place = slots.get(position) or slots.get(name)
            # The default of a parameter is nobody's.
            if place is not None:
                self.update(place, value)
        return result

    def argument(self, node, key, references, slots):
        """An argument's binding; that of a reference is read from its place, which is kept."""
        by_reference = key in references
        if not by_reference or not isinstance(node, (ast.Name, ast.Attribute, ast.Subscript)):
            binding = self.context.expressions.expr(node)
            slot = None
        else:
            self.check_variable(node)
            slot = self.context.slots.of(node)
            binding = self.context.slots.read(slot, node)
            if node not in self.context.source.plan.updated:
                raise self.context.type_error(
                    node,
                    "an argument is passed by reference to a function that is not known before "
                    "its call",
                    "call the function by its own name",
                )
        if by_reference:
            slots[key] = slot, node
        return binding

    def check_variable(self, node):
        """Rejects a name that stands for a number known at compile time."""
        number = self.context.env.get(node.id) if isinstance(node, ast.Name) else None
        if isinstance(number, (bool, int)):
            made = f"wp.{self.context.type_name(number)}({number})"
            raise self.context.type_error(
                node,
                f"'{node.id}' is the constant {number} and cannot be passed by reference",
                f"declare it as `{node.id} = {made}`",
            )

    def update(self, place, value):
        """Stores what a function has assigned to a parameter."""
        slot, node = place
        if slot is None or (slot.name is None and slot.array is None):
            raise self.context.type_error(
                node,
                "expects a variable or an element of an array, to pass by reference",
                "assign the value to a variable before",
            )
        self.context.slots.write(slot, value, node)
