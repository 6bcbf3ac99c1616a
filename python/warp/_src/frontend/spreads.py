"""Expansion of `*`: the parts of a tuple, vector, matrix, or of a slice of an array."""

from __future__ import annotations

import ast

from warp._src import errors
from warp._src.frontend.bindings import INT32, Value
from warp._src.frontend.context import Part
from warp._src.types import dtypes


class Spreads(Part):
    """Translates starred expressions."""

    def spread(self, node):
        """Bindings of a starred expression."""
        if isinstance(node.value, ast.Subscript) and isinstance(node.value.slice, ast.Slice):
            base = self.context.expressions.expr(node.value.value)
            if type(base) is Value and base.type.kind == "array":
                return self.spread_array(base, node.value.slice, node)
            binding = self.context.access.subscript(base, node.value.slice, node.value)
        else:
            binding = self.context.expressions.expr(node.value)
        if type(binding) is tuple:
            return binding
        if isinstance(binding, dtypes.Composite):
            binding = self.context.materialize(binding, node)
        if type(binding) is Value and binding.type.kind == "array":
            raise self.context.type_error(
                node,
                "the elements that `*` takes from an array must be known at compile time",
                "write `*a[0:3]`",
            )
        if type(binding) is Value and binding.type.kind in ("vec", "quat", "transform"):
            native = binding.type
            count = {"quat": 4, "transform": 7}.get(native.kind) or native.shape[0]
            self.context.at(node)
            indices = [self.builder.constant(INT32, i) for i in range(count)]
            return tuple([self.builder.extract(binding, [index]) for index in indices])
        if type(binding) is Value and binding.type.kind == "mat":
            self.context.at(node)
            rows = [self.builder.constant(INT32, i) for i in range(binding.type.shape[0])]
            return tuple([self.builder.extract(binding, [row]) for row in rows])
        raise self.context.type_error(
            node,
            f"expects a tuple or vector after `*`, but got '{self.context.type_name(binding)}'",
            code="starred",
        )

    def spread_bound(self, node) -> int:
        """A bound of `*a[i:j]`, which says how many values there are."""
        try:
            return self.context.access.constant_int(node, "the bound of `*a[i:j]`")
        except errors.WarpCodegenTypeError as problem:
            raise self.context.error(
                node,
                problem.message,
                kind=errors.WarpCodegenValueError,
                code="slice-constant",
            ) from None

    def spread_array(self, array, item, node):
        """The elements of `*a[0:3]`: loads, or views of an array of several dimensions."""
        bounds = [
            default if part is None else self.spread_bound(part)
            for part, default in ((item.lower, 0), (item.upper, None), (item.step, 1))
        ]
        low, high, step = bounds
        if high is None or low < 0 or high < 0 or step <= 0:
            code = "unpack-negative"
            if high is None:
                code = "unpack-end"
            elif low >= 0 and high >= 0:
                code = "unpack-step"
            raise self.context.error(
                node,
                "`*` of a part of an array expects bounds of at least 0 and an end",
                "write `*a[0:3]`",
                errors.WarpCodegenValueError,
                code=code,
            )
        self.context.at(node)
        read = self.builder.load if array.type.rank == 1 else self.builder.view
        return tuple([read(array, [self.builder.constant(INT32, i)]) for i in range(*bounds)])
