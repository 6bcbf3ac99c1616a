"""Values and types of what names in a kernel are bound to."""

from __future__ import annotations

import enum
import math

from warp._src import errors
from warp._src.frontend import names
from warp._src.frontend.bindings import (
    BOOL,
    INT32,
    LocalArray,
    NativeType,
    Parts,
    Record,
    TileStack,
    TileView,
    Value,
    is_table,
)
from warp._src.language.builtins import Builtin
from warp._src.types import dtypes
from warp._src.types.composites import scalars_of
from warp._src.types.scalars import fits_64_bits


def _hint_of(binding) -> str | None:
    """How a kernel uses an object that is no value."""
    if is_table(binding):
        return "index the array: it is a table of constants"
    return "pass arrays and structs as kernel arguments" if hasattr(binding, "dtype") else None


class Values:
    """The methods of a translator that make values of bindings."""

    def capture(self, value, node):
        """Binding of a Python object that a kernel refers to."""
        kind = type(value)
        if kind in (bool, int, float, str) or kind is Value:
            return value
        if isinstance(value, Builtin):
            return names.BuiltinRef(value.key)
        if isinstance(value, enum.Enum):
            if isinstance(value, int):
                return int(value)
            return value
        if isinstance(value, int):
            return int(value)
        if isinstance(value, float):
            return float(value)
        if kind.__module__ == "numpy" and hasattr(value, "item") and not hasattr(value, "__len__"):
            return value.item()
        return value

    def materialize(self, binding, node):
        """The SSA value of a binding."""
        kind = type(binding)
        if kind is Value:
            return binding
        if kind is bool:
            return self.builder.constant(BOOL, binding)
        if kind is int:
            return self.integer(binding, node)
        if kind is float:
            return self.builder.constant(self.literal_type, binding)
        return self.materialize_object(binding, node)

    def integer(self, number, node):
        """An `int32` constant; a number that does not fit is an error."""
        if not -(2**31) <= number < 2**31:
            wide = "wp.int64" if -(2**63) <= number < 2**63 else "wp.uint64"
            raise self.error(
                node,
                f"integer {number} does not fit 'int32'",
                f"use `{wide}({number})`" if fits_64_bits(number) else None,
                errors.WarpCodegenOverflowError,
            )
        return self.builder.constant(INT32, number)

    def materialize_object(self, binding, node):
        kind = type(binding)
        if isinstance(binding, dtypes.scalar_base):
            self.at(node)
            return self.builder.constant(dtypes.native_type(kind), binding.value)
        if kind is TileView:
            return self.slots.read(binding.slot, node)
        if kind is LocalArray:
            raise self.type_error(
                node,
                "an array of a thread cannot be used here",
                "index it, or pass it to functions",
            )
        if kind is TileStack:
            raise self.type_error(
                node, "a stack cannot be used here", "pass it to `wp.tile_stack_pop` or its like"
            )
        if isinstance(binding, dtypes.Composite):
            if not binding._length_:
                raise self.type_error(node, "expects a value, but got a slice without components")
            self.at(node)
            native = dtypes.native_type(kind)
            element = native.element
            parts = [self.builder.constant(element, c) for c in scalars_of(binding)]
            return self.builder.construct(native, parts)
        if kind is tuple:
            raise self.type_error(node, "expects a value, but got a tuple")
        if kind is Record:
            raise self.type_error(
                node,
                f"expects a value, but got '{binding.python_name}'",
                "evaluate it at a sample, as in `f(s)`",
            )
        if binding is None:
            raise self.type_error(node, "expects a value, but got 'None'")
        if dtypes.is_struct(kind):
            return self.materialize_struct(binding, node)
        what = names.describe(binding)
        raise self.type_error(
            node,
            f"expects a value, but got {what}",
            _hint_of(binding),
            code="external-reference",
            facts={"kind": type(binding)},
        )

    def materialize_struct(self, binding, node):
        self.at(node)
        native = dtypes.native_type(type(binding))
        fields = []
        for name, field in native.fields:
            part = getattr(binding, name)
            if field.kind == "array":
                raise self.type_error(
                    node,
                    f"field '{name}' of a captured struct is an array",
                    "pass it as an argument",
                )
            fields.append(self.convert_constant(part, field, node))
        return self.builder.struct_create(native, fields)

    def static_type(self, binding):
        """Native type that a binding has or would get, or None; a type stands for its values."""
        kind = type(binding)
        if kind is Value:
            return binding.type
        if kind is NativeType:
            return binding
        if kind in (LocalArray, TileStack, Record):
            return None
        if kind is TileView:
            return binding.type
        plain = {bool: BOOL, int: INT32, float: self.literal_type}.get(kind)
        if plain is not None or kind is tuple or isinstance(binding, type):
            return plain
        try:
            return dtypes.native_type(kind)
        except TypeError:
            return None

    def convert_constant(self, binding, native, node):
        """Like `materialize`, but a plain number takes the given scalar type.

        Raises:
            WarpCodegenTypeError: the number is a float and the type is not, or it is neither 0 nor
                1 and the type is boolean.
            WarpCodegenOverflowError: the number is out of the type's range.
        """
        if type(binding) not in (int, float, bool) or native.kind not in ("bool", "int", "float"):
            return self.materialize(binding, node)
        is_float = native.kind == "float"
        if (type(binding) is float and not is_float) or (
            native.kind == "bool" and binding not in (0, 1)
        ):
            raise self.changes(binding, native, node)
        self.at(node)
        made = self.builder.constant(native, binding)
        if is_float and math.isinf(made.constant()) and not math.isinf(binding):
            raise self.error(
                node,
                f"number {binding} does not fit '{native.python_name}'",
                f"use `wp.{native.python_name}({binding})` for infinity",
                errors.WarpCodegenOverflowError,
            )
        return made

    def changes(self, number, native, node):
        """The error for a number that a type would change."""
        name = native.python_name
        call = {"int32": "int", "bool": "bool"}.get(name, f"wp.{name}")
        return self.type_error(
            node, f"expects '{name}', but got {number}", f"use `{call}({number})`"
        )

    def flatten(self, binding, node, into):
        """Appends the values of a binding; gives its shape for `unflatten`."""
        if type(binding) is tuple:
            return tuple([self.flatten(part, node, into) for part in binding])
        if type(binding) is Record:
            parts = tuple([self.flatten(part, node, into) for part in binding.parts])
            return Record(binding.description, parts)
        if type(binding) is LocalArray:
            into += binding.parts
            return LocalArray(binding.shape, binding.element, len(binding.parts), binding.is_copy)
        if type(binding) is TileStack:
            into += binding.parts
            return TileStack(binding.type)
        into.append(self.materialize(binding, node))
        return None

    def unflatten(self, shape, values):
        """Rebuilds a binding from an iterator over values."""
        if type(shape) is tuple:
            return tuple([self.unflatten(part, values) for part in shape])
        if type(shape) is Record:
            parts = tuple([self.unflatten(part, values) for part in shape.parts])
            return Record(shape.description, parts)
        if type(shape) is LocalArray:
            parts = [next(values) for _ in range(shape.parts)]
            return LocalArray(shape.shape, shape.element, parts, shape.is_copy)
        if type(shape) is TileStack:
            return TileStack(shape.type, [next(values), next(values)])
        if type(shape) is Parts:
            parts = [self.unflatten(part, values) for part in shape.parts]
            return self.builder.struct_create(shape.native, parts)
        return next(values)

    def type_name(self, binding) -> str:
        """Python's name for the type of a binding, for messages."""
        if type(binding) is Value:
            return binding.type.python_name
        if type(binding) in (NativeType, LocalArray, TileStack, Record):
            return binding.python_name
        if type(binding) is TileView:
            return binding.type.python_name
        if type(binding) is tuple:
            return "tuple(" + ", ".join(map(self.type_name, binding)) + ")"
        return names.literal_name(binding)
