"""Conversions and constructors: calls of scalar, composite and struct types."""

from __future__ import annotations

import builtins

from warp._src import errors
from warp._src.frontend import names, struct_classes
from warp._src.frontend.bindings import BOOL, FLOAT32, INT32, Value
from warp._src.frontend.context import Part
from warp._src.frontend.local_arrays import LocalPointer
from warp._src.types import dtypes
from warp._src.types.scalars import fits_64_bits

_MISUSED = {range: "a range outside `for`", reversed: "`reversed` outside `for`"}

# The classes that all vectors have, and so on, are called like the builtin of that name.
_FAMILIES = {
    dtypes.vec: "builtin_vector",
    dtypes.mat: "builtin_matrix",
    dtypes.Quaternion: "builtin_quaternion",
    dtypes.Transformation: "builtin_transformation",
}


class Constructors(Part):
    """Translates calls that make a value of a named type."""

    def arguments(self, node):
        """Bindings of positional and keyword arguments."""
        positional, keywords = self.context.binder.arguments(node)
        return [one for one, _ in positional], {name: one for name, (one, _) in keywords.items()}

    def exactly(self, node, count, name):
        arguments, keywords = self.arguments(node)
        if keywords:
            unknown = next(iter(keywords))
            raise self.context.type_error(node, f"'{name}' has no parameter '{unknown}'")
        if len(arguments) != count:
            raise self.context.type_error(
                node,
                f"'{name}' expects {count} argument{'s' if count != 1 else ''}, "
                f"but got {len(arguments)}",
            )
        return arguments

    def native(self, dtype, node):
        """The compiler's type for a Python type."""
        try:
            return dtypes.native_type(dtype)
        except TypeError as problem:
            raise self.context.type_error(node, str(problem)) from None

    def call_type(self, kind, node):
        """A conversion or a constructor."""
        if kind in _MISUSED:
            raise self.context.unsupported(node, _MISUSED[kind])
        if kind is type:
            (binding,) = self.exactly(node, 1, "type")
            return self.type_of(binding, node)
        if kind is slice:
            arguments = self.arguments(node)[0]
            if node.keywords or not 1 <= len(arguments) <= 3:
                raise self.context.type_error(node, "'slice' expects 1 to 3 arguments")
            return slice(*arguments)
        if kind is tuple:
            (binding,) = self.exactly(node, 1, "tuple")
            if type(binding) is not tuple:
                raise self.context.type_error(
                    node, f"expects a tuple, but got '{self.context.type_name(binding)}'"
                )
            return binding
        if dtypes.is_struct(kind):
            return self.call_struct(kind, node)
        if dtypes.type_is_array(kind):
            return self.array_at(node)
        if kind in _FAMILIES:
            return getattr(self, _FAMILIES[kind])(node)
        if dtypes.type_is_composite(kind):
            if kind._length_ == 0 and not node.args and not node.keywords:
                return kind()
            arguments, keywords = self.arguments(node)
            return self.construct(self.native(kind, node), arguments, keywords, node)
        if dtypes.type_is_scalar(kind):
            if kind is float and self.context.literals_follow and len(node.args) == 1:
                # A variable that starts as a literal.
                (binding,) = self.exactly(node, 1, "float")
                if type(binding) is float:
                    return self.context.materialize(binding, node)
            return self.call_scalar(self.native(kind, node), node)
        raise self.context.type_error(
            node, f"the type '{kind.__name__}' cannot be called in a kernel"
        )

    def type_of(self, binding, node):
        if type(binding) in (builtins.bool, int, float):
            return dtypes.canonical(type(binding))
        if type(binding) is Value:
            return struct_classes.dtype_of(self.context, binding.type, node)
        raise self.context.type_error(node, f"no type of {names.describe(binding)}")

    def call_scalar(self, native, node):
        """`float(x)`, `wp.uint8(x)`; a literal is taken at full precision."""
        if not node.args and not node.keywords:
            self.context.at(node)
            return self.builder.zero(native)
        (binding,) = self.exactly(node, 1, native.python_name)
        if isinstance(binding, dtypes.scalar_base):
            binding = binding.value
        written = self.context.literal(binding)
        if written is not None and native.kind == "float":
            binding = written
        if type(binding) in (int, float, builtins.bool):
            is_integer = type(binding) is int and native.kind == "int"
            if is_integer and fits_64_bits(binding):
                # An explicit conversion keeps the low bits, as that of a variable does. No variable
                # has more than 64.
                binding &= (1 << native.width) - 1
                if native.signed and binding >> (native.width - 1):
                    binding -= 1 << native.width
            self.context.at(node)
            return self.builder.constant(native, binding)
        value = self.context.materialize(binding, node.args[0])
        if value.type.kind not in ("bool", "int", "float"):
            raise self.context.type_error(
                node,
                f"cannot convert '{value.type.python_name}' to '{native.python_name}'",
            )
        self.context.at(node)
        return self.builder.cast(value, native)

    def construct(self, native, arguments, keywords, node):
        """A vector, matrix, quaternion or transform. Literals take the component type."""
        if keywords:
            arguments = arguments + self.composite_keywords(native, keywords, node)
        element = native.element
        values = []
        for argument in arguments:
            if isinstance(argument, (int, float)):
                if element.kind == "int" and argument % 1 != 0:
                    raise self.context.changes(argument, element, node)
                self.context.at(node)
                values.append(self.builder.constant(element, argument))
            else:
                values.append(self.constant_component(argument, element, node))
        self.context.at(node)
        if native.kind == "transform" and [value.type.shape for value in values] == [[3]]:
            unit = type(element).parse(f"!warp.quat<{element}>")
            values.append(self.construct(unit, [0, 0, 0, 1], {}, node))
        if len(values) == 1 and values[0].type.kind == native.kind and values[0].type != native:
            try:
                return self.builder.cast(values[0], native)
            except errors.WarpCodegenError as problem:
                problem.coded("components", native=native, given=[values[0].type])
                raise
        if native.kind == "mat" and len(values) > 1 and values[0].type.kind == "vec":
            raise self.context.type_error(
                node,
                f"'{native.python_name}' cannot be made from vectors",
                "use `wp.matrix_from_rows(...)` or `wp.matrix_from_cols(...)`",
            )
        try:
            return self.builder.construct(native, values)
        except errors.WarpCodegenError as problem:
            given = [value.type for value in values]
            problem.coded("components", native=native, given=given)
            raise

    def constant_component(self, argument, element, node):
        """A component; a constant held by a variable is converted like the literal it was."""
        argument = self.context.literal_as(element, argument, node)
        value = self.context.materialize(argument, node)
        if value.type != element and value.type in (INT32, FLOAT32):
            known = self.context.literal(value)
            known = value.constant() if known is None else known
            fits = element.kind == "float" or (element.kind == "int" and value.type == INT32)
            if known is not None and fits:
                self.context.at(node)
                return self.builder.constant(element, known)
        return value

    def composite_keywords(self, native, keywords, node):
        orders = {
            "quat": ("x", "y", "z", "w"),
            "transform": ("p", "q"),
            "vec": ("x", "y", "z", "w"),
        }
        shape = keywords.get("shape", keywords.get("length"))
        if shape is not None and native.shape:
            shape = list(shape) if isinstance(shape, tuple) else [shape]
            if shape != list(native.shape):
                raise self.context.type_error(
                    node, f"'{native.python_name}' is not of shape {shape}"
                )
        given = ("dtype", "shape", "length") if native.shape else ("dtype",)
        keywords = {key: value for key, value in keywords.items() if key not in given}
        order = [key for key in orders.get(native.kind, ()) if key in keywords]
        if len(order) != len(keywords):
            unknown = next(key for key in keywords if key not in order)
            raise self.context.type_error(
                node, f"'{native.python_name}' has no parameter '{unknown}'"
            )
        return [keywords[key] for key in order]

    def call_struct(self, kind, node):
        """`Struct()` is all zero; fields may be given in order or by name."""
        native = self.native(kind, node)
        arguments, keywords = self.arguments(node)
        fields = native.fields
        if len(arguments) > len(fields):
            raise self.context.type_error(
                node, f"struct '{kind.__name__}' has {len(fields)} fields, but got {len(arguments)}"
            )
        given = {name: argument for (name, _), argument in zip(fields, arguments, strict=False)}
        for name, binding in keywords.items():
            if name in given or name not in dict(fields):
                raise self.context.type_error(
                    node, f"bad field '{name}' for struct '{kind.__name__}'"
                )
            given[name] = binding
        values = []
        for name, field in fields:
            if name in given:
                values.append(self.context.materialize(given[name], node))
            else:
                self.context.at(node)
                values.append(self.builder.zero(field))
        self.context.at(node)
        return self.builder.struct_create(native, values)

    def array_at(self, node):
        """`wp.array(ptr=..., shape=..., dtype=...)`: a packed array at an address.

        `grad`, which functions of the package give, is the address of its gradients, or 0.
        """
        arguments, keywords = self.arguments(node)
        grad = keywords.pop("grad", None)
        if arguments or set(keywords) != {"ptr", "shape", "dtype"}:
            raise self.context.type_error(
                node, "an array in a kernel is made of `ptr`, `shape` and `dtype`, by name"
            )
        shape = keywords["shape"]
        element = self.native(keywords["dtype"], node)
        if isinstance(keywords["ptr"], LocalPointer):
            array = keywords["ptr"].array
            return self.context.local_arrays.reinterpreted(array, shape, element, node)
        extents = [
            self.context.materialize(extent, node)
            for extent in (shape if type(shape) is tuple else (shape,))
        ]
        address = self.convert(keywords["ptr"], node)
        native = type(element).parse(f"!warp.array<{len(extents)} x {element}>")
        self.context.at(node)
        gradients = None if grad is None else self.convert(grad, node)
        return self.builder.array_at(native, address, extents, gradients)

    def convert(self, binding, node):
        """An address, which may be a number known at compile time."""
        if isinstance(binding, int):
            self.context.at(node)
            return self.builder.constant(self.native(dtypes.uint64, node), binding)
        return self.context.materialize(binding, node)

    # Constructors by builtin name.

    def builtin_vector(self, node):
        arguments, keywords = self.arguments(node)
        length, dtype = keywords.pop("length", None), keywords.pop("dtype", None)
        element = self.component_type(arguments, dtype, node)
        if length is None and not arguments:
            raise self.context.type_error(
                node,
                "vector expects components or `length`",
                code="vector-length",
            )
        if length is None:
            length = sum(
                part.type.shape[0] if type(part) is Value and part.type.kind == "vec" else 1
                for part in arguments
            )
        elif length == 0:
            # Programs make one where a constant says that there is nothing to keep.
            length = 1
        return self.construct(
            self.context.access.composite_type([length], element), arguments, keywords, node
        )

    def builtin_matrix(self, node):
        arguments, keywords = self.arguments(node)
        shape, dtype = keywords.pop("shape", None), keywords.pop("dtype", None)
        element = self.component_type(arguments, dtype, node)
        if shape is None and not arguments:
            raise self.context.type_error(node, "matrix expects components or `shape`")
        if shape is None:
            side = round(len(arguments) ** 0.5)
            if side * side != len(arguments) and not any(
                type(part) is Value and part.type.kind == "mat" for part in arguments
            ):
                raise self.context.type_error(
                    node,
                    f"{len(arguments)} components make no square matrix",
                    "give its `shape`",
                    code="matrix-shape",
                )
            shape = (side, side)
        return self.construct(
            self.context.access.composite_type(list(shape), element), arguments, keywords, node
        )

    def component_type(self, arguments, dtype, node):
        if dtype is not None:
            return self.native(dtype, node)
        for argument in arguments:
            if type(argument) is Value:
                return argument.type.element or argument.type
        if any(type(argument) is float for argument in arguments):
            return self.context.literal_type
        if arguments and all(type(argument) is bool for argument in arguments):
            return BOOL
        return INT32 if arguments else self.context.literal_type

    def of_family(self, node, family, element, components, keywords=None):
        native = type(element).parse(f"!warp.{family}<{element}>")
        return self.construct(native, components, keywords, node)

    def call_family(self, node, family):
        arguments, keywords = self.arguments(node)
        element = self.component_type(arguments, keywords.pop("dtype", None), node)
        return self.of_family(node, family, element, arguments, keywords)

    def builtin_quaternion(self, node):
        return self.call_family(node, "quat")

    def builtin_transformation(self, node):
        return self.call_family(node, "transform")

    def identity(self, node, n, element):
        native = self.context.access.composite_type([n, n], element)
        return self.construct(native, [int(i % (n + 1) == 0) for i in range(n * n)], {}, node)

    def from_rows(self, node, rows):
        natives = [row.type for row in rows]
        if not rows or natives[0].kind != "vec" or natives != natives[:1] * len(rows):
            shown = ", ".join(f"'{native.python_name}'" for native in natives)
            raise self.context.type_error(node, f"expects vectors of one type, but got ({shown})")
        first = natives[0]
        native = self.context.access.composite_type([len(rows), first.shape[0]], first.element)
        self.context.at(node)
        return self.builder.construct(native, rows)
