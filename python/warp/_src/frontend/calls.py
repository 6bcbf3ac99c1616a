"""Calls: builtins, conversions, constructors and functions of the user.

What a call means is decided by the Python object that is called. Builtins of the registry go to the
builder as they are; the few whose arguments are more than values have a method here, named
`builtin_<name>`.
"""

from __future__ import annotations

import ast
import builtins
import inspect

from warp._src import errors, types
from warp._src.frontend import names
from warp._src.frontend.emitter import FLOAT32, INT32, Value
from warp._src.frontend.expressions import ArrayAttribute
from warp._src.frontend.names import BuiltinRef
from warp._src.frontend.user_calls import UserCalls
from warp._src.kernel import Kernel

_PYTHON_FUNCTIONS = {
    abs: "abs",
    min: "min",
    max: "max",
    round: "round",
    pow: "pow",
    len: "len",
    print: "print",
}
_MISUSED = {range: "a range outside `for`", reversed: "`reversed` outside `for`"}
_FORMATS = {"bool": "%d", "int": "%d", "float": "%g"}


class Calls(UserCalls):
    """Translates call expressions."""

    def expr_Call(self, node):
        function = self.expr(node.func)
        if isinstance(function, BuiltinRef):
            return self.call_builtin(function.name, node)
        if isinstance(function, type):
            return self.call_type(function, node)
        if hasattr(function, "overloads"):
            return self.call_function(function, *self.arguments(node), node)
        try:
            name = _PYTHON_FUNCTIONS.get(function)
        except TypeError:
            name = None
        if name is not None:
            return self.call_builtin(name, node)
        return self.call_other(function, node)

    def call_other(self, function, node):
        """Objects that cannot be called, and helpers that make types."""
        if function in (types.vector, types.matrix, types.quaternion, types.transformation):
            return self.call_at_compile_time(function, node)
        if callable(function) and getattr(function, "__module__", "").startswith("warp."):
            name = getattr(function, "__name__", None)
            if name and (hasattr(self, "builtin_" + name) or self.builder.has_builtin(name)):
                return self.call_builtin(name, node)
        if isinstance(function, Kernel):
            raise self.error(
                node,
                f"kernel '{function.key}' cannot be called from a kernel",
                "make it a `@wp.func`",
            )
        if inspect.isfunction(function):
            raise self.error(
                node,
                f"'{function.__name__}' is a plain Python function",
                "decorate it with `@wp.func`",
                errors.WarpCodegenKeyError,
            )
        what = f"'{self.type_name(function)}'" if type(function) is Value else names.describe(function)
        raise self.type_error(node, f"{what} cannot be called in a kernel")

    def arguments(self, node):
        """Bindings of positional and keyword arguments."""
        positional = []
        for argument in node.args:
            if isinstance(argument, ast.Starred):
                positional += self.spread(argument)
            else:
                positional.append(self.expr(argument))
        keywords = {}
        for keyword in node.keywords:
            if keyword.arg is None:
                raise self.unsupported(keyword.value, "`**` in a call")
            keywords[keyword.arg] = self.expr(keyword.value)
        return positional, keywords

    def call_at_compile_time(self, function, node):
        arguments, keywords = self.arguments(node)
        for binding in (*arguments, *keywords.values()):
            if type(binding) is Value:
                raise self.type_error(
                    node, f"'{function.__name__}' expects arguments known at compile time"
                )
        try:
            return function(*arguments, **keywords)
        except Exception as problem:
            raise self.type_error(node, str(problem)) from problem

    # Builtins.

    def call_builtin(self, name, node):
        special = getattr(self, "builtin_" + name, None)
        if special is not None:
            return special(node)
        arguments, keywords = self.arguments(node)
        if keywords:
            arguments += self.keyword_arguments(name, len(arguments), keywords, node)
        if name in ("min", "max") and len(arguments) > 2:
            return self.fold_call(name, arguments, node)
        if name == "where" and arguments:
            arguments[0] = self.truth(arguments[0], node.args[0])
        return self.apply_builtin(name, arguments, node)

    def apply_builtin(self, name, arguments, node):
        values = [self.materialize(argument, node) for argument in arguments]
        self.at(node)
        results, updated = self.builder.builtin(name, values)
        for position, value in updated:
            if position < len(node.args):
                argument = node.args[position]
                self.write(self.slot(argument), value, argument)
        if not results:
            return None
        return results[0] if len(results) == 1 else tuple(results)

    def fold_call(self, name, arguments, node):
        result = arguments[0]
        for argument in arguments[1:]:
            result = self.apply_builtin(name, [result, argument], node)
        return result

    def keyword_arguments(self, name, count, keywords, node):
        """Keyword arguments of a builtin in the order of an overload that has them all."""
        for parameters in self.builder.parameter_names(name):
            wanted = parameters[count : count + len(keywords)]
            if set(wanted) == set(keywords):
                return [keywords[parameter] for parameter in wanted]
        shown = ", ".join(keywords)
        raise self.type_error(node, f"'{name}' has no overload with the keywords: {shown}")

    def exactly(self, node, count, name):
        arguments, keywords = self.arguments(node)
        if keywords or len(arguments) != count:
            raise self.type_error(
                node,
                f"'{name}' expects {count} argument{'s' if count != 1 else ''}, "
                f"but got {len(arguments) + len(keywords)}",
            )
        return arguments

    def builtin_tid(self, node):
        self.exactly(node, 0, "tid")
        return self.tid(1, node)[0]

    def tid(self, count, node):
        self.at(node)
        if not 1 <= count <= 4:
            raise self.error(
                node, f"tid gives 1 to 4 indices, but got {count} names",
                kind=errors.WarpCodegenValueError,
            )  # fmt: skip
        return self.builder.tid(count)

    def builtin_len(self, node):
        (binding,) = self.exactly(node, 1, "len")
        if type(binding) is tuple:
            return len(binding)
        if isinstance(binding, ArrayAttribute):
            return binding.array.type.rank
        if isinstance(binding, types.Composite):
            return len(binding)
        if type(binding) is Value:
            native = binding.type
            if native.kind == "array":
                self.at(node)
                return self.builder.dim(binding, 0)
            if native.kind in ("vec", "mat"):
                return native.shape[0]
            if native.kind in ("quat", "transform"):
                return 4 if native.kind == "quat" else 7
        raise self.type_error(node, f"'{self.type_name(binding)}' has no length")

    def builtin_printf(self, node):
        arguments, keywords = self.arguments(node)
        if keywords or not arguments or not isinstance(arguments[0], str):
            raise self.type_error(node, "printf expects a format string first")
        values = [self.materialize(argument, node) for argument in arguments[1:]]
        self.at(node)
        self.builder.printf(arguments[0], values)

    def builtin_print(self, node):
        """`print(x)`: components separated by spaces, and a new line."""
        (binding,) = self.exactly(node, 1, "print")
        if isinstance(binding, str):
            self.at(node)
            self.builder.printf(binding.replace("%", "%%") + "\n", [])
            return
        value = self.materialize(binding, node)
        native = value.type
        if native.kind in ("array", "struct"):
            raise self.type_error(node, f"print expects a number or composite, but got "
                                        f"'{native.python_name}'")  # fmt: skip
        scalar = native.element or native
        places = (native.shape or {"quat": [4], "transform": [7]}.get(native.kind, [1]))
        count = places[0] * (places[1] if len(places) == 2 else 1)
        parts = self.components(value, count, node)
        one = self.scalar_format(scalar)
        row = " ".join([one] * places[-1]) + "\n"
        self.at(node)
        self.builder.printf(row * (places[0] if len(places) == 2 else 1), parts)

    @staticmethod
    def scalar_format(scalar):
        if scalar.kind == "int":
            size = "ll" if scalar.width == 64 else ""
            return f"%{size}{'d' if scalar.signed else 'u'}"
        return _FORMATS[scalar.kind]

    def builtin_static(self, node):
        """`wp.static(expr)`: Python's value of an expression."""
        if len(node.args) != 1 or node.keywords:
            raise self.type_error(node, "static expects 1 argument")
        space = dict(self.function.__globals__)
        code = self.function.__code__
        for name, cell in zip(code.co_freevars, self.function.__closure__ or ()):
            try:
                space[name] = cell.cell_contents
            except ValueError:
                continue
        space.update(
            (name, binding) for name, binding in self.env.items() if type(binding) is not Value
        )
        try:
            compiled = compile(ast.Expression(node.args[0]), self.source.file, "eval")
            return self.capture(eval(compiled, space), node)
        except errors.WarpError:
            raise
        except Exception as problem:
            raise self.error(node, f"static expression failed: {problem}") from problem

    def builtin_cast(self, node):
        value, target = self.exactly(node, 2, "cast")
        self.at(node)
        wanted = self.native(target, node)
        return self.builder.bitcast(self.materialize(value, node), wanted)

    def builtin_load(self, node):
        array, *indices = self.element_arguments(node, "load", 0)
        return self.builder.load(array, indices)

    def builtin_store(self, node):
        array, *indices, value = self.element_arguments(node, "store", 1)
        self.builder.store(array, indices, value)

    def element_arguments(self, node, name, extra):
        arguments, keywords = self.arguments(node)
        if keywords or len(arguments) < 2 + extra:
            raise self.type_error(node, f"'{name}' expects an array, indices and values in order")
        values = [self.materialize(argument, node) for argument in arguments]
        self.at(node)
        return values

    def atomic(self, node, kind):
        array, *indices, value = self.element_arguments(node, "atomic_" + kind, 1)
        return self.builder.atomic(kind, array, indices, value)

    def builtin_atomic_add(self, node):
        return self.atomic(node, "add")

    def builtin_atomic_sub(self, node):
        return self.atomic(node, "sub")

    def builtin_atomic_min(self, node):
        return self.atomic(node, "min")

    def builtin_atomic_max(self, node):
        return self.atomic(node, "max")

    def builtin_atomic_and(self, node):
        return self.atomic(node, "and")

    def builtin_atomic_or(self, node):
        return self.atomic(node, "or")

    def builtin_atomic_xor(self, node):
        return self.atomic(node, "xor")

    def builtin_atomic_exch(self, node):
        return self.atomic(node, "exch")

    def builtin_atomic_cas(self, node):
        array, *indices, expected, value = self.element_arguments(node, "atomic_cas", 2)
        return self.builder.atomic_cas(array, indices, expected, value)

    # Types.

    def native(self, dtype, node):
        """The compiler's type for a Python type."""
        try:
            return types.native_type(dtype)
        except TypeError as problem:
            raise self.type_error(node, str(problem)) from None

    def call_type(self, kind, node):
        """A conversion or a constructor."""
        if kind in _MISUSED:
            raise self.unsupported(node, _MISUSED[kind])
        if kind is type:
            (binding,) = self.exactly(node, 1, "type")
            return self.type_of(binding, node)
        if kind is tuple:
            (binding,) = self.exactly(node, 1, "tuple")
            if type(binding) is not tuple:
                raise self.type_error(node, f"expects a tuple, but got '{self.type_name(binding)}'")
            return binding
        if types.is_struct(kind):
            return self.call_struct(kind, node)
        if types.type_is_composite(kind):
            arguments, keywords = self.arguments(node)
            return self.construct(self.native(kind, node), arguments, keywords, node)
        if types.type_is_scalar(kind):
            return self.call_scalar(self.native(kind, node), node)
        raise self.type_error(node, f"the type '{kind.__name__}' cannot be called in a kernel")

    def type_of(self, binding, node):
        python_types = {bool: types.bool, int: types.int32, float: types.float32}
        if type(binding) in python_types:
            return python_types[type(binding)]
        if type(binding) is Value:
            return types.dtype_of(binding.type)
        raise self.type_error(node, f"no type of {names.describe(binding)}")

    def call_scalar(self, native, node):
        """`float(x)`, `wp.uint8(x)`; a literal is taken at full precision."""
        if not node.args and not node.keywords:
            self.at(node)
            return self.builder.zero(native)
        (binding,) = self.exactly(node, 1, native.python_name)
        if isinstance(binding, types.scalar_base):
            binding = binding.value
        if type(binding) in (int, float, builtins.bool):
            self.at(node)
            return self.builder.constant(native, binding)
        value = self.materialize(binding, node.args[0])
        if value.type.kind not in ("bool", "int", "float"):
            raise self.type_error(
                node,
                f"cannot convert '{value.type.python_name}' to '{native.python_name}'",
            )
        self.at(node)
        return self.builder.cast(value, native)

    def construct(self, native, arguments, keywords, node):
        """A vector, matrix, quaternion or transform. Literals take the component type."""
        if keywords:
            arguments = arguments + self.composite_keywords(native, keywords, node)
        element = native.element
        values = []
        for argument in arguments:
            if isinstance(argument, (int, float)) and not isinstance(argument, Value):
                self.at(node)
                values.append(self.builder.constant(element, argument))
            else:
                values.append(self.materialize(argument, node))
        self.at(node)
        if len(values) == 1 and values[0].type.kind == native.kind and values[0].type != native:
            return self.builder.cast(values[0], native)
        if native.kind == "mat" and self.are_columns(native, values):
            rows, columns = native.shape
            turned = self.composite_type([columns, rows], element)
            stacked = self.builder.construct(turned, values)
            return self.builder.builtin("transpose", [stacked])[0][0]
        return self.builder.construct(native, values)

    @staticmethod
    def are_columns(native, values):
        """Vectors given to a matrix constructor are its columns."""
        rows, columns = native.shape
        return len(values) == columns and all(
            value.type.kind == "vec" and value.type.shape == [rows] for value in values
        )

    def composite_keywords(self, native, keywords, node):
        orders = {"quat": ("x", "y", "z", "w"), "transform": ("p", "q"), "vec": ("x", "y", "z", "w")}
        keywords = {key: value for key, value in keywords.items() if key != "dtype"}
        order = [key for key in orders.get(native.kind, ()) if key in keywords]
        if len(order) != len(keywords):
            unknown = next(key for key in keywords if key not in order)
            raise self.type_error(
                node, f"'{native.python_name}' has no parameter '{unknown}'"
            )
        return [keywords[key] for key in order]

    def call_struct(self, kind, node):
        """`Struct()` is all zero; fields may be given in order or by name."""
        native = self.native(kind, node)
        arguments, keywords = self.arguments(node)
        fields = native.fields
        if len(arguments) > len(fields):
            raise self.type_error(
                node, f"struct '{kind.__name__}' has {len(fields)} fields, but got {len(arguments)}"
            )
        given = {name: argument for (name, _), argument in zip(fields, arguments)}
        for name, binding in keywords.items():
            if name in given or name not in dict(fields):
                raise self.type_error(node, f"bad field '{name}' for struct '{kind.__name__}'")
            given[name] = binding
        values = []
        for name, field in fields:
            if name in given:
                values.append(self.materialize(given[name], node))
            else:
                values.append(self.zero(field, name, node))
        self.at(node)
        return self.builder.struct_create(native, values)

    # Constructors by builtin name.

    def builtin_vector(self, node):
        arguments, keywords = self.arguments(node)
        length, dtype = keywords.pop("length", None), keywords.pop("dtype", None)
        element = self.component_type(arguments, dtype, node)
        if length is None:
            length = sum(
                part.type.shape[0] if type(part) is Value and part.type.kind == "vec" else 1
                for part in arguments
            )
        return self.construct(self.composite_type([length], element), arguments, keywords, node)

    def builtin_matrix(self, node):
        arguments, keywords = self.arguments(node)
        shape, dtype = keywords.pop("shape", None), keywords.pop("dtype", None)
        element = self.component_type(arguments, dtype, node)
        if shape is None:
            side = round(len(arguments) ** 0.5)
            shape = (side, side)
        return self.construct(self.composite_type(list(shape), element), arguments, keywords, node)

    def component_type(self, arguments, dtype, node):
        if dtype is not None:
            return self.native(dtype, node)
        for argument in arguments:
            if type(argument) is Value:
                return argument.type.element or argument.type
        if any(type(argument) is float for argument in arguments):
            return FLOAT32
        return INT32 if arguments else FLOAT32

    def of_family(self, node, family):
        arguments, keywords = self.arguments(node)
        element = self.component_type(arguments, keywords.pop("dtype", None), node)
        native = type(element).parse(f"!warp.{family}<{element}>")
        return self.construct(native, arguments, keywords, node)

    def builtin_quaternion(self, node):
        return self.of_family(node, "quat")

    def builtin_transformation(self, node):
        return self.of_family(node, "transform")

    def identity(self, node, family, components):
        arguments, keywords = self.arguments(node)
        dtype = keywords.get("dtype", arguments[0] if arguments else float)
        element = self.native(dtype, node)
        native = type(element).parse(f"!warp.{family}<{element}>")
        return self.construct(native, components, {}, node)

    def builtin_quat_identity(self, node):
        return self.identity(node, "quat", [0, 0, 0, 1])

    def builtin_transform_identity(self, node):
        return self.identity(node, "transform", [0, 0, 0, 0, 0, 0, 1])

    def builtin_identity(self, node):
        arguments, keywords = self.arguments(node)
        given = dict(zip(("n", "dtype"), arguments)) | keywords
        if type(given.get("n")) is not int or "dtype" not in given:
            raise self.type_error(node, "identity expects `n` and `dtype` known at compile time")
        n = given["n"]
        native = self.composite_type([n, n], self.native(given["dtype"], node))
        return self.construct(native, [int(i % (n + 1) == 0) for i in range(n * n)], {}, node)

    def builtin_matrix_from_rows(self, node):
        arguments = [self.materialize(binding, node) for binding in self.arguments(node)[0]]
        native = self.composite_type(
            [len(arguments), arguments[0].type.shape[0]], arguments[0].type.element
        )
        self.at(node)
        return self.builder.construct(native, arguments)

    def builtin_matrix_from_cols(self, node):
        rows = self.builtin_matrix_from_rows(node)
        return self.builder.builtin("transpose", [rows])[0][0]


names.SPECIAL_BUILTINS.update(
    name.removeprefix("builtin_") for name in dir(Calls) if name.startswith("builtin_")
)
