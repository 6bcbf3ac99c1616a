"""Expressions: syntax nodes to bindings."""

from __future__ import annotations

import ast
import operator

from warp._src import errors
from warp._src.frontend import names
from warp._src.frontend.access import COMPONENTS
from warp._src.frontend.bindings import BOOL, INT32, Value
from warp._src.frontend.context import Part
from warp._src.frontend.functions import overload_of
from warp._src.frontend.indexed import array_of
from warp._src.kernels.function import Function
from warp._src.types import dtypes

_BINARY = {
    ast.Add: "add",
    ast.Sub: "sub",
    ast.Mult: "mul",
    ast.MatMult: "mul",
    ast.Div: "div",
    ast.FloorDiv: "floordiv",
    ast.Mod: "mod",
    ast.Pow: "pow",
    ast.LShift: "lshift",
    ast.RShift: "rshift",
    ast.BitAnd: "bit_and",
    ast.BitOr: "bit_or",
    ast.BitXor: "bit_xor",
}
_COMPARE = {
    ast.Lt: ("lt", operator.lt),
    ast.LtE: ("le", operator.le),
    ast.Gt: ("gt", operator.gt),
    ast.GtE: ("ge", operator.ge),
    ast.Eq: ("eq", operator.eq),
    ast.NotEq: ("ne", operator.ne),
}
_COMPARE_WORDS = {ast.Is: "is", ast.IsNot: "is not", ast.In: "in", ast.NotIn: "not in"}
# Operators of Python's integers that give what kernels give.
_FOLD = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.FloorDiv: lambda a, b: a // b if b else 0,
    ast.Div: lambda a, b: _truncated(a, b) if b else 0,
    ast.Mod: lambda a, b: a - b * _truncated(a, b) if b else 0,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.BitXor: operator.xor,
}
# Operations on literals whose results stay literals.
_FOLD_FLOATS = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: lambda a, b: a / b if b else None,
}
_NUMBERS = (int, float, bool)
_UNSUPPORTED = {
    "JoinedStr": "an f-string",
    "Lambda": "a lambda",
    "Dict": "a dictionary",
    "Set": "a set",
    "ListComp": "a list comprehension",
    "SetComp": "a set comprehension",
    "DictComp": "a dictionary comprehension",
    "GeneratorExp": "a generator expression",
    "NamedExpr": "an assignment expression (`:=`)",
    "Await": "`await`",
    "Yield": "`yield`",
    "YieldFrom": "`yield from`",
    "Starred": "`*` outside a call",
}
_HINTS = {
    "JoinedStr": 'use `wp.printf`, which formats as C does: `wp.printf("%d\\n", i)`',
    "Lambda": "define a function with `@wp.func` outside the kernel",
    "Dict": "use a `@wp.struct` for fields with names",
    "ListComp": "use a loop, and `wp.zeros(shape, dtype)` for an array of the thread",
    "GeneratorExp": "use a loop",
    "NamedExpr": "assign in a statement before this one",
}


def _truncated(a, b):
    quotient = abs(a) // abs(b)
    return quotient if (a < 0) == (b < 0) else -quotient


class Expressions(Part):
    """Methods named after the syntax node they translate."""

    def expr(self, node):
        """Binding of an expression."""
        method = self.context.methods.get(type(node)) or self.context.method(type(node))
        if method is None:
            kind = type(node).__name__
            what, hint = _UNSUPPORTED.get(kind, f"`ast.{kind}`"), _HINTS.get(kind)
            raise self.context.unsupported(node, what, hint, code="construct", facts={"kind": kind})
        return method(node)

    def value(self, node):
        """SSA value of an expression."""
        binding = self.expr(node)
        if type(binding) is Value:
            return binding
        return self.context.materialize(binding, node)

    def expr_Name(self, node):
        return self.context.read_name(node.id, node)

    def expr_Constant(self, node):
        value = node.value
        if value is Ellipsis or isinstance(value, (bytes, complex)):
            raise self.context.unsupported(node, f"a '{type(value).__name__}' literal")
        return value

    def expr_Tuple(self, node):
        parts = []
        for item in node.elts:
            if isinstance(item, ast.Starred):
                parts.extend(self.context.spreads.spread(item))
            else:
                parts.append(self.expr(item))
        return tuple(parts)

    def expr_List(self, node):
        raise self.context.unsupported(
            node,
            "a list",
            "use a vector, or `wp.zeros(shape, dtype)` for an array of the thread",
            code="list",
        )

    # Operators.

    def expr_BinOp(self, node):
        left = self.expr(node.left)
        right = self.expr(node.right)
        return self.binary(node, node.op, left, right)

    def binary(self, node, op, left, right):
        kind = type(op)
        if type(left) is int and type(right) is int and kind in _FOLD:
            return _FOLD[kind](left, right)
        if type(left) is tuple and type(right) is tuple and kind is ast.Add:
            return left + right
        if self.context.literals_follow:
            numbers = [self.context.written(one) for one in (left, right)]
            if None not in numbers:
                folded = _FOLD_FLOATS.get(kind, lambda a, b: None)(*numbers)
                if folded is not None:
                    return folded
        left, right = self.context.follow((left, right), node)
        left = self.context.materialize(left, node)
        right = self.context.materialize(right, node)
        try:
            return self.operator(node, _BINARY[kind], left, right)
        except errors.WarpCodegenTypeError as problem:
            if kind in (ast.Mult, ast.MatMult):
                self.explain_product(problem, kind, (left.type, right.type))
            raise

    @staticmethod
    def explain_product(problem, kind, types):
        """Names the operator that was written, and what there is for two vectors or matrices."""
        if kind is ast.MatMult:
            problem.message = problem.message.replace("overload of '*'", "overload of '@'", 1)
        kinds = [native.kind for native in types]
        if kinds == ["vec", "vec"]:
            ways = "`wp.dot(a, b)`, `wp.cross(a, b)`, `wp.outer(a, b)` or `wp.cw_mul(a, b)`"
            problem.hint = problem.hint or f"use {ways}"
        elif kinds == ["quat", "vec"]:
            problem.hint = problem.hint or "use `wp.quat_rotate(q, v)`"
        elif kinds == ["transform", "vec"]:
            problem.hint = problem.hint or "use `wp.transform_point(t, v)`"

    def operator(self, node, name, *operands):
        """Applies an operator; functions of that name go before it, and extend it to structs."""
        kinds = [operand.type.kind for operand in operands]
        if "tile" in kinds:
            return self.context.tiles.elements.operator(node, name, operands)
        own = self.own_operator(name, operands, node)
        if own is not None:
            return self.context.user_calls.call_function(own, list(operands), {}, node)
        if "struct" in kinds:
            return self.user_operator(node, name, operands)
        self.context.at(node)
        if name in ("eq", "ne") and operands[0].type.shape and operands[0].type.element == BOOL:
            # The registry compares composites of numbers.
            wide = self.context.access.composite_type(list(operands[0].type.shape), INT32)
            operands = [
                self.builder.cast(one, wide) if one.type == operands[0].type else one
                for one in operands
            ]
        try:
            return self.builder.builtin(name, operands)[0][0]
        except errors.WarpCodegenTypeError as problem:
            shown = [operand.type.python_name for operand in operands]
            composite = all(operand.type.element is not None for operand in operands)
            exactly = "exactly " if composite else ""
            problem.coded("operator-types", name=name, exactly=exactly, types=shown)
            raise

    @staticmethod
    def name_of(op) -> str:
        """The builtin that a binary operator of the syntax tree is."""
        return _BINARY[type(op)]

    def own_operator(self, name, operands, node):
        """The function of an operator's name in the kernel's module that takes the operands, or
        None. Within itself the operator is what it always is."""
        function = self.context.function
        own = function.__globals__.get(name)
        if not isinstance(own, Function) or own.func.__module__.startswith("warp."):
            return None
        if function in own.overloads:
            return None
        for overload in map(overload_of, own.overloads):
            if (
                not overload.references
                and type(overload.bind(self.context, list(operands), {}, node)) is list
            ):
                return own
        return None

    def user_operator(self, node, name, operands):
        function = self.context.function.__globals__.get(name)
        if not isinstance(function, Function):
            shown = " and ".join(f"'{self.context.type_name(v)}'" for v in operands)
            raise self.context.type_error(
                node,
                f"operator '{name}' is not defined for {shown}",
                f"define `@wp.func def {name}(...)`",
                code="tile-struct-operator" if name.startswith("bit_") else None,
                facts={"name": name},
            )
        return self.context.user_calls.call_function(function, list(operands), {}, node)

    def expr_UnaryOp(self, node):
        operand = self.expr(node.operand)
        kind = type(node.op)
        if kind is ast.Not:
            operand = self.truth(operand, node.operand)
            if type(operand) is bool:
                return not operand
            self.context.at(node)
            return self.builder.builtin("unot", [operand])[0][0]
        if type(operand) in (int, float):
            if kind is ast.USub:
                return -operand
            if kind is ast.UAdd:
                return operand
            if type(operand) is int:
                return ~operand
        name = {ast.USub: "neg", ast.UAdd: "pos", ast.Invert: "invert"}[kind]
        return self.operator(node, name, self.context.materialize(operand, node))

    def expr_Compare(self, node):
        left = self.expr(node.left)
        return self.compare(node, left, node.left, node.ops, node.comparators)

    def compare(self, node, left, left_node, ops, comparators):
        """One comparison of a chain; the others follow if it holds."""
        right_node = comparators[0]
        right = self.expr(right_node)
        first = self.compare_one(node, ops[0], left, right)
        if len(ops) == 1 or first is False:
            return first

        def rest():
            return self.compare(node, right, right_node, ops[1:], comparators[1:])

        if first is True:
            return rest()
        pure = all(self.is_cheap(item) for item in comparators[1:])
        return self.both(node, first, rest, pure)

    def compare_one(self, node, op, left, right):
        kind = type(op)
        if kind not in _COMPARE:
            raise self.context.unsupported(node, f"the operator `{_COMPARE_WORDS[kind]}`")
        name, fold = _COMPARE[kind]
        static = type(left) is not Value and type(right) is not Value
        if static and type(left) in _NUMBERS and type(right) in _NUMBERS:
            return fold(left, right)
        whole = not isinstance(left, dtypes.Composite) or not len(left)
        if static and kind in (ast.Eq, ast.NotEq) and whole:
            return fold(left, right)
        left, right = self.context.follow((left, right), node)
        left, right = self.context.materialize(left, node), self.context.materialize(right, node)
        self.context.at(node)
        if left.type == BOOL and right.type.kind in ("int", "float"):
            # As a number it is 0 or 1.
            left = self.builder.cast(left, right.type)
        elif right.type == BOOL and left.type.kind in ("int", "float"):
            right = self.builder.cast(right, left.type)
        return self.operator(node, name, left, right)

    # Logic.

    def truth(self, binding, node):
        """A Python bool if known at compile time, else a boolean value."""
        if type(binding) is Value:
            native = binding.type
            if native == BOOL:
                known = binding.constant()
                return binding if known is None else bool(known)
            if array_of(native) is not None:
                # A null array, as `None` at a launch gives, has no extent.
                extent = self.context.indexed.extents(binding, node)[0]
                return self.operator(node, "ne", extent, self.context.materialize(0, node))
            if native.kind not in ("int", "float"):
                raise self.context.type_error(
                    node, f"expects a condition, but got '{native.python_name}'"
                )
            self.context.at(node)
            return self.builder.cast(binding, BOOL)
        if isinstance(binding, (bool, int, float, str, dtypes.scalar_base)) or binding is None:
            return bool(binding)
        raise self.context.type_error(
            node, f"expects a condition, but got {names.describe(binding)}"
        )

    def expr_BoolOp(self, node):
        return self.logic(node, node.values, isinstance(node.op, ast.And))

    def logic(self, node, operands, is_and):
        first = self.truth(self.expr(operands[0]), operands[0])
        rest = operands[1:]
        if not rest:
            return first
        if type(first) is bool:
            return self.logic(node, rest, is_and) if first is is_and else first
        pure = all(self.is_cheap(operand) for operand in rest)
        combine = self.both if is_and else self.either
        return combine(node, first, lambda: self.logic(node, rest, is_and), pure)

    def both(self, node, first, rest, pure):
        """`first and rest()`."""
        if pure:
            return self.combine(node, "bit_and", first, rest())
        return self.context.branches.branch_value(node, first, rest, lambda: False)

    def either(self, node, first, rest, pure):
        """`first or rest()`."""
        if pure:
            return self.combine(node, "bit_or", first, rest())
        return self.context.branches.branch_value(node, first, lambda: True, rest)

    def combine(self, node, name, first, second):
        if type(second) is bool:
            return first if second is (name == "bit_and") else second
        self.context.at(node)
        return self.builder.builtin(name, [first, second])[0][0]

    def expr_IfExp(self, node):
        condition = self.truth(self.expr(node.test), node.test)
        if type(condition) is bool:
            return self.expr(node.body if condition else node.orelse)
        pure = self.is_cheap(node.body) and self.is_cheap(node.orelse)
        return self.choose(
            node, condition, lambda: self.expr(node.body), lambda: self.expr(node.orelse), pure
        )

    def choose(self, node, condition, then, orelse, pure):
        """One of two bindings; only the chosen side is evaluated unless both are pure."""
        if not pure:
            return self.context.branches.branch_value(node, condition, then, orelse)
        left, right = then(), orelse()
        if type(left) is type(right) and type(left) in (bool, int, float) and left == right:
            return left
        if type(left) is tuple or type(right) is tuple:
            raise self.context.unsupported(node, "a choice between tuples")
        left, right = self.context.materialize(left, node), self.context.materialize(right, node)
        self.context.at(node)
        if left.type != right.type:
            raise self.branch_types_differ(node, left, right)
        return self.builder.builtin("where", [condition, left, right])[0][0]

    def branch_types_differ(self, node, left, right):
        return self.context.type_error(
            node,
            f"expects both sides of a choice to have one type, but got "
            f"'{self.context.type_name(left)}' and '{self.context.type_name(right)}'",
        )

    def is_cheap(self, node) -> bool:
        """True if evaluating a node always is harmless and costs next to nothing."""
        budget = 6
        stack = [node]
        while stack:
            item = stack.pop()
            kind = type(item)
            budget -= 1
            if budget < -6:
                return False
            if kind is ast.BinOp:
                stack += (item.left, item.right)
            elif kind is ast.UnaryOp:
                stack.append(item.operand)
            elif kind is ast.Compare:
                stack += (item.left, *item.comparators)
            elif kind is ast.BoolOp:
                stack += item.values
            elif kind is ast.Attribute and item.attr in COMPONENTS:
                stack.append(item.value)
            elif kind is ast.Name:
                bound = self.context.env.get(item.id)
                if type(bound) is Value and bound.type.kind not in ("bool", "int", "float"):
                    return False
            elif kind is not ast.Constant:
                return False
        return True
