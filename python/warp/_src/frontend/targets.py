"""Assignments: to names, tuples of them, places and slices, plain and augmented."""

from __future__ import annotations

import ast

from warp._src import errors
from warp._src.derivatives.functions import Gradient
from warp._src.frontend.bindings import INT32, Value
from warp._src.frontend.context import Part
from warp._src.frontend.slots import ATOMIC, has_slice
from warp._src.kernels.function import Function


class Targets(Part):
    """Translates assignments."""

    def assign_target(self, target, binding, node):
        kind = type(target)
        if kind is ast.Name:
            self.context.assign_name(target.id, binding, node)
        elif kind in (ast.Tuple, ast.List):
            self.unpack(target, binding, node)
        elif kind is ast.Subscript and has_slice(target) and not self.is_tile(target.value):
            self.context.slices.assign(target, binding, node)
        elif kind in (ast.Attribute, ast.Subscript):
            self.context.slots.write(self.context.slots.of(target), binding, target)
        else:
            raise self.context.unsupported(target, f"assignment to `ast.{kind.__name__}`")

    def unpack(self, target, binding, node):
        for item in target.elts:
            if isinstance(item, ast.Starred):
                raise self.context.unsupported(item, "unpacking with `*`")
        if type(binding) is not tuple:
            if type(binding) is Value and binding.type.kind in ("vec", "quat"):
                count = (binding.type.shape or [4])[0]
                self.context.at(node)
                binding = tuple(
                    self.builder.extract(binding, [self.builder.constant(INT32, i)])
                    for i in range(count)
                )
            else:
                raise self.context.type_error(
                    target,
                    f"expects a tuple to unpack, but got '{self.context.type_name(binding)}'",
                )
        if len(binding) != len(target.elts):
            raise self.context.error(
                target,
                f"expects {len(target.elts)} values to unpack, but got {len(binding)}",
                kind=errors.WarpCodegenValueError,
            )
        for item, part in zip(target.elts, binding, strict=False):
            self.assign_target(item, part, item)

    def augmented(self, node):
        target, op = node.target, node.op
        if isinstance(target, ast.Name):
            left = self.context.read_name(target.id, target)
            if isinstance(left, Gradient):
                raise self.context.type_error(
                    node,
                    f"'{target.id}' is a derivative, a function, and cannot be changed",
                    code="reassign",
                    facts={"name": target.id},
                )
            if self.is_tile(target, left):
                self.update_whole(node, self.context.slots.of(target))
                return
            self.context.assign_name(
                target.id,
                self.context.expressions.binary(
                    node, op, left, self.context.expressions.expr(node.value)
                ),
                node,
            )
            return
        is_slice = isinstance(target, ast.Subscript) and has_slice(target)
        if is_slice and not self.is_tile(target.value):
            self.context.slices.update(node)
            return
        slot = self.context.slots.of(target)
        right = self.context.expressions.expr(node.value)
        right = self.context.literal_as(slot.type, right, node.value)
        right = self.context.materialize(right, node.value)
        if self.update_by_own(slot, op, right, node):
            return
        if slot.is_atomic(op):
            self.context.at(node)
            self.builder.atomic(
                ATOMIC[type(op)], self.context.slots.view(slot), slot.indices, right
            )
            return
        if slot.name is None and slot.array is None:
            self.context.slots.write(slot, right, node)
        self.update_element(slot, op, right, node)

    def update_element(self, slot, op, right, node):
        """Updates a place: together with other threads that do so, if it is in a tile."""
        if self.update_tile(slot, op, right, node):
            return
        left = self.context.slots.read(slot, node)
        self.context.slots.write(slot, self.context.expressions.binary(node, op, left, right), node)

    def update_by_own(self, slot, op, right, node) -> bool:
        """Updates a place by the user's function for the operator; False if there is none."""
        expressions = self.context.expressions
        name = expressions.name_of(op)
        if not isinstance(self.context.function.__globals__.get(name), Function):
            return False
        operands = [self.context.slots.read(slot, node.target), right]
        own = expressions.own_operator(name, operands, node)
        if own is None:
            return False
        self.context.slots.write(
            slot, self.context.user_calls.call_function(own, operands, {}, node), node
        )
        return True

    def is_tile(self, target, binding=None):
        """True if a name is that of a tile or of a view of one."""
        if not isinstance(target, ast.Name):
            return False
        if binding is None:
            binding = self.context.env.get(target.id)
        return getattr(getattr(binding, "type", None), "kind", None) == "tile"

    def update_whole(self, node, slot):
        """`t += u`: it is the tile that changes, whoever else has it."""
        right = self.context.expressions.expr(node.value)
        if self.context.tiles.views.repeats(slot) and type(node.op) in (ast.Add, ast.Sub):
            self.context.slots.write(slot, right, node, ATOMIC[type(node.op)])
            return
        made = self.context.expressions.binary(
            node, node.op, self.context.slots.read(slot, node), right
        )
        made = self.context.materialize(made, node)
        if made.type != slot.type:
            raise self.context.type_error(
                node,
                f"a tile of type '{slot.type.python_name}' cannot become "
                f"'{made.type.python_name}' in place",
            )
        self.context.slots.write(slot, made, node)

    def update_tile(self, slot, op, right, node):
        """`t[i] += x`, which threads of a block may do to one element; false for other slots."""
        places = [part for step, part in slot.path if step == "tile"]
        if not places or getattr(places[-1], "full", 0) is not None or slot.name is None:
            return False
        if any(step != "tile" for step, _ in slot.path[: len(places)]):
            return False
        if type(op) not in ATOMIC or right.type != slot.type:
            return False
        scalar = slot.type.element or slot.type
        if scalar.kind not in ("int", "bool") and type(op) not in (ast.Add, ast.Sub):
            raise self.context.type_error(
                node,
                f"bits of elements of type '{slot.type.python_name}' cannot be combined",
                code="tile-struct-bits" if scalar.kind == "struct" else None,
            )
        self.context.slots.write(slot, right, node, ATOMIC[type(op)])
        return True
