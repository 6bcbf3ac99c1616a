"""Statements, and the body of a function."""

from __future__ import annotations

import ast

from warp._src import errors
from warp._src.types import dtypes as types
from warp._src.frontend.calls import Calls
from warp._src.frontend.control import RESULT, RETURNED
from warp._src.frontend.emitter import Value
from warp._src.frontend.names import BuiltinRef

_UNSUPPORTED = {
    "FunctionDef": "a nested function",
    "AsyncFunctionDef": "an async function",
    "ClassDef": "a class",
    "Delete": "`del`",
    "AsyncFor": "`async for`",
    "AsyncWith": "`async with`",
    "With": "`with`",
    "Match": "`match`",
    "Raise": "`raise`",
    "Try": "`try`",
    "TryStar": "`try`",
    "Import": "`import`",
    "ImportFrom": "`import`",
    "Global": "`global`",
    "Nonlocal": "`nonlocal`",
}


class Emitter(Calls):
    """The whole translator."""

    def body(self):
        """Translates the function's body; gives the binding it returns."""
        plan = self.source.plan
        self.returned = []
        self.env[RETURNED] = False
        self.block(plan.body)
        if not plan.returns_value:
            return None
        if not plan.always_returns and self.env[RETURNED] is not True:
            raise self.error(
                self.source.tree.body[-1],
                f"'{self.source.name}' does not return a value on every path",
                "end the function with a `return`",
            )
        return self.env[RESULT]

    def statement(self, node):
        method = getattr(self, "statement_" + type(node).__name__, None)
        if method is None:
            name = type(node).__name__
            raise self.unsupported(node, _UNSUPPORTED.get(name, f"`ast.{name}`"))
        self.node = node
        method(node)

    def statement_Pass(self, node):
        pass

    def statement_Expr(self, node):
        if not isinstance(node.value, ast.Constant):
            self.expr(node.value)

    def statement_Assign(self, node):
        first = node.targets[0]
        if isinstance(first, (ast.Tuple, ast.List)) and self.is_tid(node.value):
            self.at(node.value)
            binding = tuple(self.tid(len(first.elts), node.value))
        else:
            binding = self.expr(node.value)
        for target in node.targets:
            self.assign_target(target, binding, node)

    def is_tid(self, node):
        if not isinstance(node, ast.Call) or node.args or node.keywords:
            return False
        name = getattr(node.func, "attr", None) or getattr(node.func, "id", None)
        if name != "tid":
            return False
        function = self.expr(node.func)
        return isinstance(function, BuiltinRef) and function.name == "tid"

    def statement_AnnAssign(self, node):
        if node.value is None:
            return
        binding = self.expr(node.value)
        wanted = self.annotated_type(node.annotation)
        if wanted is not None:
            binding = self.convert_constant(binding, wanted, node.value)
            if binding.type != wanted:
                raise self.type_error(
                    node.value,
                    f"annotation says '{wanted.python_name}', but got '{self.type_name(binding)}'",
                )
        self.assign_target(node.target, binding, node)

    def annotated_type(self, node):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            return None
        try:
            return types.native_type(self.expr(node))
        except TypeError:
            raise self.type_error(node, "annotation is not a type of kernels") from None

    def statement_AugAssign(self, node):
        self.augmented(node)

    def statement_Assert(self, node):
        condition = self.materialize(self.truth(self.expr(node.test), node.test), node.test)
        message = "assertion failed"
        if node.msg is not None:
            text = self.expr(node.msg)
            if not isinstance(text, str):
                raise self.type_error(node.msg, "expects a string as the message")
            message = text
        self.at(node)
        self.builder.assertion(condition, message)

    def return_statement(self, node):
        if node.value is None:
            if self.source.plan.returns_value:
                raise self.error(node, f"'{self.source.name}' returns a value elsewhere")
            return
        if self.is_kernel:
            raise self.error(node, "a kernel cannot return a value", "store it in an array")
        binding = self.expr(node.value)
        values = []
        shape = self.flatten(binding, node.value, values)
        binding = self.unflatten(shape, iter(values))
        self.returned.append((self.source.line(node), self.type_name(binding)))
        self.check_result(binding, node)
        self.env[RESULT] = binding

    def check_result(self, binding, node):
        """The declared result type, if any."""
        wanted = self.result_type
        if wanted is None:
            return
        given = binding if type(binding) is tuple else (binding,)
        matches = len(given) == len(wanted) and all(
            native is None or (type(part) is Value and part.type == native)
            for part, native in zip(given, wanted, strict=False)
        )
        if not matches:
            shown = ", ".join("Any" if t is None else t.python_name for t in wanted)
            shown = f"tuple({shown})" if len(wanted) > 1 else shown
            raise self.error(
                node,
                f"'{self.source.name}' is annotated to return '{shown}', "
                f"but returns '{self.type_name(binding)}'",
                kind=errors.WarpCodegenTypeError,
            )
