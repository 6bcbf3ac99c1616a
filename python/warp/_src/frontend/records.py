"""Records: compile-time descriptions with run-time parts, and the operators that libraries define.

A library calls a `Description` in a kernel with the parts that belong to it (structs of arrays,
numbers); the result is a record. `f(s)` and `operator(f, s)` on a record resolve to what the
description gives for the operator: a function of kernels, called with the parts and the arguments,
or a value known at compile time. Records are passed to functions by specialising on the description
and passing the parts, as tuples are.
"""

from __future__ import annotations

from warp._src import errors
from warp._src.frontend.bindings import Record
from warp._src.frontend.context import Part
from warp._src.kernels.descriptions import OnField, Operator, Recast, Static
from warp._src.kernels.function import Function

CALL = Operator("()")


class Records(Part):
    """Translates calls of descriptions, of records and of operators."""

    def make(self, description, node):
        arguments, keywords = self.context.constructors.arguments(node)
        if keywords:
            raise self.context.type_error(node, f"'{description}' expects its parts in order")
        return Record(description, tuple(arguments))

    def call(self, record, node):
        """`f(s)`."""
        arguments, keywords = self.context.constructors.arguments(node)
        return self.apply(CALL, record, arguments, keywords, node)

    def call_operator(self, operator, node):
        """`operator(f, s)`."""
        arguments, keywords = self.context.constructors.arguments(node)
        if not arguments or type(arguments[0]) is not Record:
            shown = self.context.type_name(arguments[0]) if arguments else "nothing"
            raise self.context.type_error(
                node, f"'{operator.name}' expects a field or domain first, but got '{shown}'"
            )
        return self.apply(operator, arguments[0], arguments[1:], keywords, node)

    def apply(self, operator, record, arguments, keywords, node):
        try:
            found = record.description.operation(operator.name, len(arguments) + len(keywords))
        except (TypeError, ValueError) as problem:
            raise self.not_defined(operator, node, str(problem)) from None
        if isinstance(found, Static):
            return self.context.capture(found.value, node)
        calls, parts = self.context.user_calls, record.parts
        if isinstance(found, Recast):
            if found.function is not None:
                made = calls.call_function(found.function, list(parts), {}, node)
                parts = made if type(made) is tuple else (made,)
            return Record(found.description, parts)
        if isinstance(found, OnField):
            self.context.at(node)
            parts = (self.builder.struct_get(parts[0], found.field),)
            found = found.function
        if not isinstance(found, Function):
            message = f"'{operator.name}' is not defined for '{record.description}'"
            raise self.not_defined(operator, node, message)
        try:
            return calls.call_function(found, [*parts, *arguments], keywords, node)
        except errors.WarpCodegenTypeError as problem:
            if not problem.notes or operator is CALL:
                raise
            problem.notes = (*problem.notes, f"operator '{operator.name}' of {record.description}")
            raise

    def not_defined(self, operator, node, message):
        """The error for an operator that a description does not have, or not for its values."""
        return self.context.type_error(
            node, message, code="operator", facts={"name": operator.name}
        )
