"""Statements, and the body of a function."""

from __future__ import annotations

import ast

from warp._src import errors
from warp._src.frontend.bindings import LocalArray, Value
from warp._src.frontend.context import Part
from warp._src.frontend.control import RESULT, RETURNED, name_of
from warp._src.frontend.functions import Parameter
from warp._src.frontend.names import BuiltinRef
from warp._src.kernels import declared
from warp._src.types import dtypes
from warp._src.types.native import ArrayType


def _array_in(value, place):
    """The place of a struct's first array, by the names of fields; None if there is none."""
    for name, dtype in value._wp_fields_.items():
        if isinstance(dtype, ArrayType):
            return place
        if dtypes.is_struct(dtype):
            found = _array_in(value._inner(name), f"{place}.{name}")
            if found is not None:
                return found
    return None


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
_HINTS = {
    "FunctionDef": "define it with `@wp.func` outside the kernel",
    "Match": "use `if` and `elif`",
    "Raise": "use `assert`, which debug mode checks",
    "Try": "test with `if` what can fail",
    "Import": "import at the top of the file",
    "ImportFrom": "import at the top of the file",
}


class Statements(Part):
    """Methods named after the statement they translate."""

    def body(self):
        """Translates the function's body; gives the binding it returns.

        A path that ends without `return` gives zero, and in debug mode an error.
        """
        plan = self.context.source.plan
        self.context.env[RETURNED] = False
        self.context.branches.block(plan.body)
        if not plan.returns_value:
            return None
        returned = self.context.env[RETURNED]
        if RESULT not in self.context.env:
            # A return of a value was left out at compile time.
            return None
        if not plan.always_returns and returned is not True:
            self.context.at(self.context.source.tree.body[-1])
            name = self.context.source.name
            self.builder.assertion(
                self.context.materialize(returned, self.context.source.tree),
                f"'{name}' ends without the value that it returns elsewhere, zero is taken",
            )
        return self.context.env[RESULT]

    def statement(self, node):
        method = getattr(self, "statement_" + type(node).__name__, None)
        if method is None:
            name = type(node).__name__
            what = _UNSUPPORTED.get(name, f"`ast.{name}`")
            raise self.context.unsupported(node, what, _HINTS.get(name))
        self.context.node = node
        method(node)

    def statement_Pass(self, node):
        pass

    def statement_Expr(self, node):
        if not isinstance(node.value, ast.Constant):
            found = self.context.expressions.expr(node.value)
            if isinstance(node.value, ast.Call) and name_of(node.value.func) == "static":
                self.check_static(found, node)

    def check_static(self, found, node):
        """Refuses a static expression that nothing uses and that is no value of kernels.

        The node that follows it may be meant to make such a value.
        """
        kind = type(found)
        if found is None:
            what = "None is returned"
        elif dtypes.type_is_array(kind):
            what = "a Warp array cannot be created inside Warp kernels"
        elif dtypes.type_is_struct(kind):
            place = _array_in(found, kind.__name__)
            if place is None:
                return
            what = (
                "the returned Warp struct contains a data type that cannot be constructed inside "
                f"Warp kernels: a Warp array cannot be created inside Warp kernels at {place}"
            )
        elif kind.__module__.startswith(("builtins", "types", "warp._src", "warp.types")):
            return
        else:
            what = f"value of type {kind.__qualname__}"
        raise self.context.error(
            node,
            f"a static expression that stands alone gives '{kind.__name__}', which kernels have "
            "no value for",
            code="static-value",
            facts={"what": what},
        )

    def statement_Assign(self, node):
        first = node.targets[0]
        if isinstance(first, (ast.Tuple, ast.List)) and self.is_tid(node.value):
            self.context.at(node.value)
            binding = tuple(self.context.calls.tid(len(first.elts), node.value))
        else:
            binding = self.context.expressions.expr(node.value)
        for target in node.targets:
            self.context.targets.assign_target(target, binding, node)

    def is_tid(self, node):
        """True if a call is that of `wp.tid`, by whatever name."""
        if not isinstance(node, ast.Call) or node.args or node.keywords:
            return False
        if not isinstance(node.func, (ast.Attribute, ast.Name)):
            return False
        function = self.context.expressions.expr(node.func)
        return isinstance(function, BuiltinRef) and function.name == "tid"

    def statement_AnnAssign(self, node):
        if node.value is None:
            return
        binding = self.context.expressions.expr(node.value)
        wanted = self.annotated(node.annotation)
        if wanted is not None:
            if wanted.native is not None and type(binding) is not LocalArray:
                binding = self.context.convert_constant(binding, wanted.native, node.value)
            if not wanted.accepts(self.context, binding):
                raise self.context.type_error(
                    node.value,
                    f"annotation says '{wanted.type_name}', but got "
                    f"'{self.context.type_name(binding)}'",
                )
        self.context.targets.assign_target(node.target, binding, node)

    def annotated(self, node) -> Parameter | None:
        """The annotation of a variable; None if it is a string that names nothing."""
        is_text = isinstance(node, ast.Constant) and isinstance(node.value, str)
        try:
            found = None if is_text else self.context.expressions.expr(node)
        except errors.WarpError:
            found = None
        try:
            if not isinstance(found, type):
                # Such as `wp.array(dtype=float)`, which Python alone knows as a type.
                text = node.value if is_text else ast.unparse(node)
                found = eval(text, declared.names_of(self.context.function))
            return Parameter("", found, None)
        except Exception:
            if is_text:
                return None
            raise self.context.type_error(node, "annotation is not a type of kernels") from None

    def statement_AugAssign(self, node):
        self.context.targets.augmented(node)

    def statement_Assert(self, node):
        condition = self.context.materialize(
            self.context.expressions.truth(self.context.expressions.expr(node.test), node.test),
            node.test,
        )
        message = "assertion failed"
        if node.msg is not None:
            text = self.context.expressions.expr(node.msg)
            if not isinstance(text, str):
                raise self.context.type_error(node.msg, "expects a string as the message")
            message = text
        self.context.at(node)
        self.builder.assertion(condition, message)

    def return_statement(self, node):
        if self.context.is_kernel and node.value is not None:
            raise self.kernel_returns(node)
        if node.value is None:
            if self.context.source.plan.returns_value:
                raise self.context.error(
                    node, f"'{self.context.source.name}' returns a value elsewhere"
                )
            return
        binding = self.context.expressions.expr(node.value)
        values = []
        shape = self.context.flatten(binding, node.value, values)
        binding = self.context.unflatten(shape, iter(values))
        self.context.returned.append(
            (self.context.source.line(node), self.context.type_name(binding))
        )
        self.check_result(binding, node)
        self.context.env[RESULT] = binding

    def kernel_returns(self, node):
        return self.context.type_error(
            node,
            "a kernel cannot return a value",
            "store it in an array",
            code="kernel-return",
        )

    def check_result(self, binding, node):
        """The declared result type, if any."""
        wanted = self.context.result_type
        if wanted is None:
            return
        given = binding if type(binding) is tuple else (binding,)
        matches = len(given) == len(wanted) and all(
            native is None or part == native or (type(part) is Value and part.type == native)
            for part, native in zip(given, wanted, strict=False)
        )
        if not matches:
            shown = ", ".join("Any" if t is None else t.python_name for t in wanted)
            shown = f"tuple({shown})" if len(wanted) > 1 else shown
            raise self.context.type_error(
                node,
                f"'{self.context.source.name}' is annotated to return '{shown}', "
                f"but returns '{self.context.type_name(binding)}'",
                code="result-type",
                facts={
                    "function": self.context.source.name,
                    "written": self.context.function.__annotations__.get("return"),
                    "wanted": wanted,
                    "names": [self.context.type_name(part) for part in given],
                    "is_local_array": type(given[0]) is LocalArray,
                },
            )
