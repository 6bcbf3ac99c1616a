"""State shared by the parts of the translator of one function: names, errors.

The translator has no type rules. It asks the builder, and turns what the builder reports into an
error at the syntax node it was working on.
"""

from __future__ import annotations

import enum

from warp._src import errors
from warp._src.frontend import names
from warp._src.frontend.bindings import (
    FLOAT32,
    LocalArray,
    Record,
    TileStack,
    TileView,
    Value,
    is_table,
)
from warp._src.frontend.session import Session
from warp._src.frontend.values import Values
from warp._src.types import dtypes

_MISSING = object()


def is_constant(binding) -> bool:
    """True if it is a Python object that stands for a value of kernels with a type of its own: a
    number of a Warp type, a composite or a struct."""
    if isinstance(binding, dtypes.Composite):
        return bool(binding._length_)
    return isinstance(binding, dtypes.scalar_base) or dtypes.is_struct(type(binding))


# Kinds of types whose scalars literals follow.
_OF_FLOATS = frozenset(("float", "vec", "mat", "quat", "transform"))


class Context(Values):
    """State that the parts of a translator of one function share.

    `Translator`, which is what there is, has the parts too, under the names of their files.
    """

    def __init__(self, session: Session, function, source, is_kernel: bool):
        self.session = session
        self.builder = session.builder
        self.function = function
        self.source = source
        self.is_kernel = is_kernel
        self.env = {}
        # Line of the last assignment of each name, for messages.
        self.lines = {}
        # By identity of constants that variables hold: the constant, and the number as written.
        self.literals: dict = {}
        # Type of constants that are written as `float`.
        self.literal_type = FLOAT32
        # Loops around the place that is being translated, outermost first.
        self.frames = []
        self.node = source.tree
        self.captured = {}
        # Native types of the declared results, and the returns so far as (line, type).
        self.result_type = None
        self.returned = []

    # Places and errors.

    def at(self, node):
        """Operations that the builder makes next get the location of this node."""
        self.node = node
        self.builder.set_location(
            self.source.encoded_file, node.lineno + self.source.line_offset, node.col_offset + 1
        )

    def error(self, node, message, hint=None, kind=errors.WarpCodegenError, notes=(), **coded):
        """The exception for a message about a node; `coded`: its `code` and `facts`."""
        return kind(message, hint=hint, notes=notes, **coded, **self.source.place(node))

    def type_error(self, node, message, hint=None, notes=(), **coded):
        return self.error(node, message, hint, errors.WarpCodegenTypeError, notes, **coded)

    def value_error(self, node, message, hint=None, **coded):
        return self.error(node, message, hint, errors.WarpCodegenValueError, **coded)

    def unsupported(self, node, what, hint=None, **coded):
        return self.error(node, f"{what} is not supported in kernels", hint, **coded)

    def locate(self, error: errors.WarpError):
        """Completes an error of the builder with the place in the source."""
        if error.end_column:
            return error
        place = self.source.place(self.node)
        # The first line says what is wrong, and after `; ` the fix; overloads follow.
        message, _, details = error.message.partition("\n")
        message, _, fix = message.partition("; use ")
        hint = f"use {fix}" if fix else error.hint
        notes = (*error.notes, details.strip()) if details else error.notes
        located = type(error)(message, hint=hint, notes=notes, **place)
        return located.coded(error.code, **error.facts)

    # Names.

    def assign_name(self, name, binding, node):
        if type(binding) is int and not -(2**31) <= binding < 2**31:
            self.integer(binding, getattr(node, "value", node))
        if type(binding) is float:
            number, binding = binding, self.builder.constant(self.literal_type, binding)
            self.literals[id(binding)] = binding, number
        if not self.can_be_bound(binding):
            raise self.type_error(
                node,
                f"{names.describe(binding)} cannot be a variable of a kernel",
                "kernels can capture numbers, vectors, matrices, structs, functions and tuples",
            )
        if type(binding) is TileView and binding.slot.name == name:
            # The variable is no longer that of the whole tile.
            binding = self.materialize(binding, node)
        if name in self.source.plan.changed_names and is_constant(binding):
            # Writes go to a value of the variable's own, which loops and branches carry.
            binding = self.materialize(binding, node)
        old = self.env.get(name)
        if old is not None:
            self.check_same_type(name, old, binding, node)
            if type(old) is Value and old.type.kind == "tile":
                self.tiles.views.keep(name)
        self.env[name] = binding
        self.lines[name] = self.source.line(node)

    def literal(self, binding):
        """The number that was assigned to a variable, before it became a `float32`; or None."""
        value, number = self.literals.get(id(binding), (None, None))
        return number if value is binding else None

    def follow(self, operands, node):
        """Operands, with literals in the scalar type of the others; see `literals_follow`."""
        if not self.literals_follow:
            return operands
        numbers = [self.written(one) for one in operands]
        found = {
            element
            for one, number in zip(operands, numbers, strict=True)
            if number is None and type(one) is Value
            for element in (one.type.element or one.type,)
            if one.type.kind in _OF_FLOATS and element.kind == "float"
        }
        if len(found) > 1:
            found -= {FLOAT32}
        if len(found) != 1:
            return operands
        (element,) = found
        self.at(node)
        return [
            one if number is None else self.builder.constant(element, number)
            for one, number in zip(operands, numbers, strict=True)
        ]

    @property
    def literals_follow(self) -> bool:
        """True if literals take the scalar type of the operands beside them.

        Only in functions with the attribute `_wp_literals_follow_`, which are written once for
        float32 and float64; elsewhere a literal is a float32. The attribute names a parameter:
        literals without such operands have the type of the numbers of its struct.
        """
        return hasattr(self.function, "_wp_literals_follow_")

    def find_literal_type(self):
        """Sets the type of literals from the arguments."""
        if not self.literals_follow:
            return
        binding = self.env.get(self.function._wp_literals_follow_)
        for _, native in getattr(getattr(binding, "type", None), "fields", ()):
            if native.kind == "float":
                self.literal_type = native

    def written(self, binding):
        """The number that a literal, or a variable that holds one, was written as; or None."""
        return binding if type(binding) is float else self.literal(binding)

    def literal_as(self, native, binding, node):
        """A literal in the scalar type of a place, if literals follow; else the binding."""
        number = self.written(binding) if self.literals_follow else None
        element = None if native is None else native.element or native
        if number is None or native.kind not in _OF_FLOATS or element.kind != "float":
            return binding
        self.at(node)
        return self.builder.constant(element, number)

    @staticmethod
    def can_be_bound(binding):
        if isinstance(binding, (Value, bool, int, float, str, tuple, enum.Enum)):
            return True
        if is_table(binding):
            return True
        kinds = (
            *(dtypes.scalar_base, dtypes.Composite, names.BuiltinRef),
            *(LocalArray, TileView, TileStack, Record),
        )
        return isinstance(binding, kinds) or callable(binding) or dtypes.is_struct(type(binding))

    def check_same_type(self, name, old, binding, node):
        """A variable keeps its type."""
        before, after = self.static_type(old), self.static_type(binding)
        if {LocalArray, TileStack} & {type(old), type(binding)}:
            before, after = old, binding
            if type(before) is not type(after) or before != after:
                raise self.type_error(
                    node,
                    f"'{name}' is '{self.type_name(old)}' and cannot become "
                    f"'{self.type_name(binding)}'",
                    "use another name",
                )
        if before == after or before is None or after is None:
            return
        if before.kind == after.kind == "array" and before.element == after.element:
            return
        before, after = before.python_name, after.python_name
        hint = None
        if (before, after) == ("int32", "float32"):
            hint = f"declare it as `{name} = float(...)`"
        if before == "float32" and after == "int32":
            hint = "use `float(...)`"
        raise self.type_error(
            node,
            f"'{name}' is '{before}' and cannot become '{after}'",
            hint or "use another name",
            notes=[f"'{name}' is '{before}' at line {self.lines[name]}"],
        )

    def read_name(self, name, node):
        binding = self.env.get(name, _MISSING)
        if binding is not _MISSING:
            return binding
        if name in self.source.plan.local_names:
            hint = None
            if any(name in loop.pending for loop in self.frames):
                hint = "assign it before the loop"
            raise self.error(
                node, f"'{name}' is used before it is assigned", hint, errors.WarpCodegenKeyError
            )
        if name not in self.captured:
            self.captured[name] = self.capture(names.resolve(self, name, node), node)
        return self.captured[name]


class Part:
    """A part of a translator, for one topic.

    Attributes:
        context: the translator.
        builder: its builder.
    """

    __slots__ = ("builder", "context")

    def __init__(self, context):
        self.context = context
        self.builder = context.builder
