"""Geometry: what its functions of the kernel language are made of, and loops over queries.

`for i in query:` is a loop that carries the query and asks it for its next result, as a loop with
exits carries a counter.
"""

from __future__ import annotations

import ast

from warp._src.frontend.bindings import INT32, Value
from warp._src.frontend.context import Part
from warp._src.frontend.control import Loop


class Geometry(Part):
    """Translates calls of the device library, loops over queries."""

    def builtin__library_call(self, node):
        """`_library_call("symbol", ...)`: a tuple of results, or the only one."""
        symbol = node.args[0].value
        self.context.session.sums_winding |= symbol == "warp_mesh_side_winding"
        arguments = [self.context.expressions.expr(argument) for argument in node.args[1:]]
        values = [self.context.materialize(binding, node) for binding in arguments]
        self.context.at(node)
        values = [part for value in values for part in self._parts(value)]
        results, _ = self.builder.builtin("_" + symbol, values)
        return results[0] if len(results) == 1 else tuple(results)

    def _parts(self, value) -> list:
        """The operands of a value in C: the components of a vector."""
        if value.type.kind != "vec":
            return [value]
        indices = [self.builder.constant(INT32, index) for index in range(value.type.shape[0])]
        return [self.builder.extract(value, [index]) for index in indices]

    def note_handle(self, function, node):
        """Lets launches check an argument of the kernel that goes to a query unchanged."""
        first = node.args[0] if node.args else None
        if not self.context.is_kernel or not isinstance(first, ast.Name):
            return
        given = self.context.session.parameters.get(first.id)
        if given is not None and self.context.env.get(first.id) is given:
            self.context.session.handles[first.id] = function.handle

    def query_of(self, node):
        """The query that a loop is over, and the function that advances it; or None."""
        if isinstance(node, ast.Call):
            callee = self.context.expressions.expr(node.func)
            if callee is range or callee is reversed:
                return None
        elif not isinstance(node, (ast.Name, ast.Attribute)):
            return None
        binding = self.context.expressions.expr(node)
        if type(binding) is not Value or binding.type.kind != "struct":
            return None
        from warp._src.geometry.queries import next_of

        advance = next_of(binding.type)
        return None if advance is None else (binding, advance)

    def query_loop(self, node: Loop, query, advance):
        """A loop over the results of a query."""
        loops, builder, syntax = self.context.loops, self.builder, node.syntax
        frame = loops.open_frame(node, loops.target_names(syntax.target))
        self.context.at(syntax)
        none = builder.constant(INT32, 0)
        _, query, *heads = builder.begin_while([none, query, *frame.inits])
        loops.head_scope(frame, heads)
        more, index, query = self.context.user_calls.call_function(advance, [query], {}, syntax)
        clear = self.context.branches.none_set(node.exits, syntax)
        if clear is not True:
            clear = self.context.materialize(clear, syntax)
            more = builder.builtin("bit_and", [more, clear])[0][0]
        index, query, *heads = builder.while_condition(more, [index, query, *heads])
        loops.body_scope(frame, heads)
        self.context.targets.assign_target(syntax.target, index, syntax.target)
        self.context.branches.block(node.body)
        values, late, names, shapes = loops.final_values(frame)
        results = builder.end_while([index, query, *values], late)
        loops.leave(frame, names, shapes, results[2:])
