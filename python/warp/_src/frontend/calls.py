"""Calls: builtins, conversions, constructors and functions of the user.

The Python object that is called decides the meaning of a call. Operations of the registry go to
the builder as they are; names whose records have a call go to the binder; the few whose arguments
are more than bindings have a method named `builtin_<name>`.
"""

from __future__ import annotations

import ast
import inspect

from warp._src import errors
from warp._src.builtin_calls import CALLS
from warp._src.derivatives.functions import FACTORIES, FunctionDerivative
from warp._src.frontend import address, names
from warp._src.frontend.bindings import Record, Value, is_table
from warp._src.frontend.context import Part
from warp._src.frontend.indexed import array_of
from warp._src.frontend.names import BuiltinRef
from warp._src.frontend.updates import references_of
from warp._src.kernels import declared, statics
from warp._src.kernels.descriptions import Description, Operator
from warp._src.kernels.function import Function, NativeFunction
from warp._src.language.builtins import lookup
from warp._src.types import dtypes

_PYTHON_FUNCTIONS = {
    abs: "abs",
    min: "min",
    max: "max",
    round: "round",
    pow: "pow",
    len: "len",
    print: "print",
}
# Hints for Python's functions that kernels lack.
_INSTEAD = {
    "zeros": "for a few numbers of a thread use `wp.types.vector(n, float)()` or "
    "`wp.types.matrix((n, m), float)()`, which variables may index; else pass an array",
}


def _makes_types(function) -> bool:
    factories = (dtypes.vector, dtypes.matrix, dtypes.quaternion, dtypes.transformation)
    return any(function is factory for factory in factories)


class Shaped:
    """Stands in `wp.static(len(v))` for a composite: known are its extents, not its components."""

    def __init__(self, native):
        self.shape = tuple(native.shape or [4 if native.kind == "quat" else 7])
        self.dtype = dtypes.dtype_of(native.element)

    def __len__(self):
        return self.shape[0]


class Calls(Part):
    """Translates call expressions."""

    def expr_Call(self, node):
        function = self.callee(node.func)
        if isinstance(function, BuiltinRef):
            return self.call_builtin(function.name, node)
        if isinstance(function, type):
            return self.context.constructors.call_type(function, node)
        if isinstance(function, NativeFunction):
            from warp._src.frontend.native_calls import call_native

            return call_native(self.context, function, node)
        if isinstance(function, Function):
            if function.handle is not None:
                self.context.geometry.note_handle(function, node)
            references = references_of(function)
            if references:
                return self.context.references.call_by_reference(function, references, node)
            return self.context.user_calls.call_function(
                function, *self.context.constructors.arguments(node), node
            )
        if type(function) is Record:
            return self.context.records.call(function, node)
        if isinstance(function, Operator):
            return self.context.records.call_operator(function, node)
        if isinstance(function, Description):
            return self.context.records.make(function, node)
        if isinstance(function, FunctionDerivative):
            return self.context.derivative_calls.call_derivative(function, node)
        if any(function is factory for factory in FACTORIES):
            return self.call_at_compile_time(function, node)
        try:
            name = _PYTHON_FUNCTIONS.get(function)
        except TypeError:
            name = None
        if name is not None:
            return self.call_builtin(name, node)
        return self.call_other(function, node)

    def callee(self, node):
        """The callee; in `wp.types.vector(5, float)(...)` it is made here."""
        if isinstance(node, ast.Call):
            factory = self.context.expressions.expr(node.func)
            if _makes_types(factory) or any(factory is one for one in FACTORIES):
                return self.call_at_compile_time(factory, node)
        return self.context.expressions.expr(node)

    def call_other(self, function, node):
        """Objects that cannot be called, and constructors under the names of type factories."""
        if _makes_types(function):
            return self.call_builtin(function.__name__, node)
        if callable(function) and getattr(function, "__module__", "").startswith("warp."):
            name = getattr(function, "__name__", None)
            if name and (name in names.SPECIAL_BUILTINS or self.builder.has_builtin(name)):
                return self.call_builtin(name, node)
        if hasattr(function, "specializations"):
            raise self.context.error(
                node,
                f"kernel '{function.key}' cannot be called from a kernel",
                "make it a `@wp.func`",
            )
        if inspect.isfunction(function) and function.__module__.partition(".")[0] == "warp":
            raise self.context.error(
                node,
                f"'{function.__name__}' can be called in Python only",
                _INSTEAD.get(function.__name__),
            )
        if inspect.isfunction(function):
            raise self.context.error(
                node,
                f"'{function.__name__}' is a plain Python function",
                "decorate it with `@wp.func`",
                errors.WarpCodegenKeyError,
            )
        what = (
            f"'{self.context.type_name(function)}'"
            if type(function) is Value
            else names.describe(function)
        )
        raise self.context.type_error(node, f"{what} cannot be called in a kernel")

    def call_at_compile_time(self, function, node):
        arguments, keywords = self.context.constructors.arguments(node)
        for binding in (*arguments, *keywords.values()):
            if type(binding) is Value:
                raise self.context.type_error(
                    node, f"'{function.__name__}' expects arguments known at compile time"
                )
        try:
            return function(*arguments, **keywords)
        except Exception as problem:
            raise self.context.type_error(node, str(problem)) from problem

    # Builtins.

    def call_builtin(self, name, node):
        if name in CALLS:
            return self.context.binder.call(name, node)
        special = self.context.methods.get(name) or self.context.method(name)
        if special is not None:
            return special(node)
        arguments, keywords = self.context.constructors.arguments(node)
        places = list(node.args)
        if keywords:
            order = self.keyword_order(name, len(arguments), keywords, node)
            arguments += [keywords[parameter] for parameter in order]
            written = {keyword.arg: keyword.value for keyword in node.keywords}
            places += [written[parameter] for parameter in order]
        if name in ("min", "max") and len(arguments) > 2:
            return self.fold_call(name, arguments, node)
        if name == "stop_gradient" and [*map(_kind, arguments)] == ["tile"]:
            return self.context.tiles.elements.constant(arguments[0], node)
        if name == "where" and arguments:
            arguments[0] = self.context.expressions.truth(arguments[0], places[0])
        return self.apply_builtin(name, arguments, node, places)

    def apply_builtin(self, name, arguments, node, places=()):
        """Calls a builtin; what it updates is written back to the arguments at `places`."""
        arguments = self.context.follow(arguments, node)
        values = [self.context.materialize(argument, node) for argument in arguments]
        self.context.at(node)
        try:
            results, updated = self.builder.builtin(name, values)
        except errors.WarpCodegenTypeError as problem:
            shown = [value.type.python_name for value in values]
            problem.coded("builtin-types", name=name, types=shown)
            raise
        for position, value in updated:
            if position < len(places):
                self.context.slots.write_back(places[position], value, places[position])
        if not results:
            return None
        return results[0] if len(results) == 1 else tuple(results)

    def fold_call(self, name, arguments, node):
        result = arguments[0]
        for argument in arguments[1:]:
            result = self.apply_builtin(name, [result, argument], node)
        return result

    def keyword_order(self, name, count, keywords, node):
        """Names of a builtin's keyword arguments in the order of an overload that has them all."""
        overloads = self.builder.parameter_names(name)
        for parameters in overloads:
            wanted = parameters[count : count + len(keywords)]
            if set(wanted) == set(keywords):
                return wanted
        known = {one for parameters in overloads for one in parameters}
        unknown = next((one for one in keywords if one not in known), None)
        if unknown is not None:
            place = next(one.value for one in node.keywords if one.arg == unknown)
            raise self.context.type_error(
                place, f"{name}() has no parameter '{unknown}'", names.proposal(unknown, known)
            )
        shown = ", ".join(keywords)
        raise self.context.type_error(node, f"'{name}' has no overload with the keywords: {shown}")

    def tid(self, count, node):
        self.context.at(node)
        if not 1 <= count <= 4:
            raise self.context.error(
                node, f"tid gives 1 to 4 indices, but got {count} names",
                kind=errors.WarpCodegenValueError,
            )  # fmt: skip
        return self.builder.tid(count)

    def builtin_len(self, node):
        (binding,) = self.context.constructors.exactly(node, 1, "len")
        if type(binding) is tuple:
            return len(binding)
        if isinstance(binding, dtypes.Composite) or is_table(binding):
            return len(binding)
        if type(binding) is Value:
            native = binding.type
            if array_of(native) is not None:
                return self.context.indexed.extents(binding, node)[0]
            if native.kind in ("vec", "mat"):
                return native.shape[0]
            if native.kind in ("quat", "transform"):
                return 4 if native.kind == "quat" else 7
        raise self.context.type_error(node, f"'{self.context.type_name(binding)}' has no length")

    def builtin_static(self, node):
        """`wp.static(expr)`: Python's value of an expression."""
        given = [*node.args, *(one.value for one in node.keywords)]
        if len(given) != 1:
            raise self.context.type_error(node, "static expects 1 argument")
        try:
            value = self.static_value(node.func, given[0])
            self.context.session.statics.append(
                statics.Evaluated(self.context.function, given[0], self.context.env, value)
            )
            return self.context.capture(value, node)
        except errors.WarpError:
            raise
        except Exception as problem:
            raise self.context.error(
                node,
                f"static expression failed: {problem}",
                code="static-failed",
                facts={"problem": str(problem)},
            ) from problem

    def static_value(self, callee, expression):
        """The value of an expression where its function was declared, or else its value now."""
        source = self.context.source
        place = callee.end_lineno + source.line_offset, callee.end_col_offset
        found = declared.at(self.context.function, place)
        if found is not None and found[0] == ast.unparse(expression):
            return found[1]
        space = declared.names_of(self.context.function)
        for name in source.plan.local_names:
            space.pop(name, None)
        space.update(
            (name, Shaped(binding.type) if type(binding) is Value else binding)
            for name, binding in self.context.env.items()
            if type(binding) is not Value or (binding.type.element and binding.type.kind != "array")
        )
        return eval(compile(ast.Expression(expression), source.file, "eval"), space)

    def builtin_address_of(self, node):
        """`address_of(a[i])`: where an element of an array, or a part of it, lies."""
        if len(node.args) != 1 or node.keywords:
            raise self.context.type_error(node, "'address_of' expects an element of an array")
        address.check_constant(self.context, node.args[0])
        slot = self.context.slots.of(node.args[0])
        if slot.array is None:
            raise self.context.type_error(
                node,
                "'address_of' expects an element of an array; variables have no address",
                "put the value into an array",
            )
        part = self.context.slots.view(slot)
        self.context.at(node)
        for axis, index in enumerate(slot.indices):
            part = self.builder.slice(part, axis, index, None, None)
        return self.builder.pointer(part)

    def builtin_select(self, node):
        """`select(condition, if_false, if_true)`, the older spelling of `where`."""
        condition, no, yes = self.context.constructors.exactly(node, 3, "select")
        condition = self.context.expressions.truth(condition, node.args[0])
        return self.apply_builtin("where", [condition, yes, no], node)

    def lower_bound(self, node, array, value, begin=0, end=None):
        from warp._src.language.library import LOWER_BOUND

        if end is None:
            self.context.at(node)
            end = self.builder.dim(array, 0)
        arguments = [array, begin, end, value]
        return self.context.user_calls.call_function(LOWER_BOUND, arguments, {}, node)

    def sample_cdf(self, node, state, cdf):
        (draw,), ((_, state),) = self.builder.builtin("randf", [state])
        return self.lower_bound(node, cdf, draw), state

    def poisson(self, node, state, lam):
        from warp._src.language.random_functions import POISSON

        return self.context.user_calls.call_function(POISSON, [state, lam], {}, node)

    def builtin_sym_fn3(self, node):
        """`sym_fn3(A, f)`, whose second argument is a function."""
        from warp._src.language.symmetric import matrix_function

        if len(node.args) != 2 or node.keywords:
            raise self.context.type_error(node, "'sym_fn3' expects a matrix and a function")
        value, function = (
            self.context.expressions.expr(node.args[0]),
            self.context.expressions.expr(node.args[1]),
        )
        if isinstance(function, BuiltinRef):
            function = lookup(function.name)
        elif not isinstance(function, Function):
            raise self.context.type_error(
                node.args[1],
                f"'sym_fn3' expects a builtin or a `@wp.func`, but got {names.describe(function)}",
            )
        return self.context.user_calls.call_function(matrix_function(function), [value], {}, node)

    def builtin_load(self, node):
        array, *indices = self.element_arguments(node, "load", 0)
        return self.builder.load(array, indices)

    def builtin_store(self, node):
        array, *indices, value = self.element_arguments(node, "store", 1)
        self.builder.store(array, indices, value)

    def element_arguments(self, node, name, extra):
        arguments, keywords = self.context.constructors.arguments(node)
        if keywords or len(arguments) < 2 + extra:
            raise self.context.type_error(
                node, f"'{name}' expects an array, indices and values in order"
            )
        values = [self.context.materialize(argument, node) for argument in arguments]
        last = len(values) - extra
        array, indices = self.context.indexed.resolved(values[0], values[1:last], node)
        self.context.at(node)
        return [array, *indices, *values[last:]]

    def atomic(self, node, kind, array, indices, value):
        array, indices = self.context.indexed.resolved(array, indices, node)
        self.context.at(node)
        return self.builder.atomic(kind, array, indices, value)

    def atomic_cas(self, node, array, indices, expected, value):
        array, indices = self.context.indexed.resolved(array, indices, node)
        self.context.at(node)
        return self.builder.atomic_cas(array, indices, expected, value)


def _kind(binding) -> str:
    """The kind of a value's type; empty for what is no value."""
    return getattr(getattr(binding, "type", None), "kind", "")
