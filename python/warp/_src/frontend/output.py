"""Printing, checks that print what they find, and stops for debuggers."""

from __future__ import annotations

import re

from warp._src.frontend.context import Part
from warp._src.frontend.indexed import array_of

_CONVERSION = re.compile(r"%%|%[^a-zA-Z%]*(?:hh|ll|[hlzjt])?[a-zA-Z]")
_FORMATS = {"bool": "%d", "int": "%d", "float": "%g"}
# A call of `printf` takes this many numbers.
_MOST = 32


class Output(Part):
    """Translates calls that write to standard output or stop the program."""

    def builtin_printf(self, node):
        arguments, keywords = self.context.constructors.arguments(node)
        if keywords or not arguments or not isinstance(arguments[0], str):
            called = getattr(node.func, "id", None) or getattr(node.func, "attr", "printf")
            raise self.context.type_error(
                node,
                "printf expects a format string first",
                code="printf-format" if called != "printf" else None,
            )
        texts = iter([argument for argument in arguments[1:] if isinstance(argument, str)])
        values = [
            self.context.materialize(argument, node)
            for argument in arguments[1:]
            if not isinstance(argument, str)
        ]
        # A string argument is known here, so it becomes part of the format.
        spliced = _CONVERSION.sub(
            lambda found: next(texts, "%s").replace("%", "%%") if found[0] == "%s" else found[0],
            arguments[0],
        )
        if next(texts, None) is not None:
            raise self.context.type_error(node, "printf has more strings than `%s` conversions")
        if len(values) > _MOST:
            raise self.context.error(
                node,
                f"printf expects at most {_MOST} values, but got {len(values)}",
                "print in several calls",
                code="printf-count",
                facts={"most": _MOST},
            )
        self.context.at(node)
        self.builder.printf(spliced, values)

    def builtin_print(self, node):
        """`print(x)`: components separated by spaces, and a new line."""
        (binding,) = self.context.constructors.exactly(node, 1, "print")
        if isinstance(binding, str):
            self.context.at(node)
            self.builder.printf(binding.replace("%", "%%") + "\n", [])
            return
        self.print_value(self.context.materialize(binding, node), node)

    def print_value(self, value, node):
        """A number, composite or struct; of an array its extents."""
        native = value.type
        if native.kind == "tile":
            self.context.tiles.printing.printed(value, node)
            return
        array = array_of(native)
        if array is not None:
            extents = self.context.indexed.extents(value, node)
            shown = ", ".join(["%d"] * len(extents)) + ("," if len(extents) == 1 else "")
            element = array.element.python_name
            self.builder.printf(f"array(shape=({shown}), dtype={element})\n", extents)
            return
        if native.kind == "struct":
            for name, _ in native.fields:
                self.context.at(node)
                self.builder.printf(f"{native.python_name}.{name}: ", [])
                self.print_value(self.builder.struct_get(value, name), node)
            return
        if native.kind == "bool":
            self.print_bool(value, node)
            return
        scalar = native.element or native
        parts = self.parts(value, node)
        columns = native.shape[-1] if native.shape else len(parts)
        row = " ".join([self.scalar_format(scalar)] * columns) + "\n"
        self.context.at(node)
        self.print_pieces([(row, parts[at : at + columns]) for at in range(0, len(parts), columns)])

    def print_bool(self, value, node):
        self.context.at(node)
        self.builder.begin_if(value)
        self.builder.printf("True\n", [])
        self.builder.begin_else()
        self.builder.printf("False\n", [])
        self.builder.end_if([], [])

    @staticmethod
    def scalar_format(scalar):
        if scalar.kind == "int":
            size = "ll" if scalar.width == 64 else ""
            return f"%{size}{'d' if scalar.signed else 'u'}"
        return _FORMATS[scalar.kind]

    # Checks.

    def builtin_breakpoint(self, node):
        self.context.constructors.exactly(node, 0, "breakpoint")
        from warp._src.frontend.native_calls import stop

        stop(self.context, node)

    def expect(self, node, name, failure, left, right):
        """Prints both operands where the comparison `failure` is true."""
        left, right = self.compared([left, right], node)
        title = f"Error, {name}() failed:\n"
        failed = self.context.expressions.operator(node, failure, left, right)
        self.builder.begin_if(failed)
        if left.type.kind == "bool":
            self.builder.begin_if(left)
            self.builder.printf(f"{title}\t Expected: {failure == 'eq'}\n\t Actual: True\n", [])
            self.builder.begin_else()
            self.builder.printf(f"{title}\t Expected: {failure != 'eq'}\n\t Actual: False\n", [])
            self.builder.end_if([], [])
        else:
            self.print_pieces(
                [(title, []), *self.pieces("\t Expected: ", right, node)],
                self.pieces("\t Actual: ", left, node),
            )
        self.builder.end_if([], [])

    def expect_near(self, node, left, right, tolerance):
        """Components differ by at most `tolerance`; NaN is near to nothing."""
        left, right = self.compared([left, right], node)
        scalar = left.type.element or left.type
        if scalar.kind != "float":
            raise self.context.type_error(
                node, f"'expect_near' expects floats, but got '{left.type.python_name}'"
            )
        tolerance = self.context.convert_constant(tolerance, scalar, node)
        self.context.at(node)
        gap, near = self.gap(left, right, tolerance, node)
        self.builder.begin_if(self.context.expressions.operator(node, "unot", near))
        label = "Absolute" if left.type == scalar else "Max absolute"
        self.print_pieces(
            self.pieces("Error, expect_near() failed with tolerance ", tolerance, node),
            self.pieces("    Expected: ", right, node),
            self.pieces("    Actual: ", left, node),
            self.pieces(f"    {label} difference: ", gap, node),
        )
        self.builder.end_if([], [])

    def gap(self, left, right, tolerance, node):
        """The largest difference of two components, and whether all are near."""
        gap = near = None
        count = len(self.parts(left, node))
        for one, other in zip(
            self.context.slices.components(left, count, node),
            self.context.slices.components(right, count, node),
            strict=True,
        ):
            difference = self.context.expressions.operator(
                node, "abs", self.context.expressions.operator(node, "sub", one, other)
            )
            close = self.context.expressions.operator(node, "le", difference, tolerance)
            # Infinities of one sign have no difference.
            close = self.context.expressions.operator(
                node, "bit_or", close, self.context.expressions.operator(node, "eq", one, other)
            )
            gap = (
                difference
                if gap is None
                else self.context.expressions.operator(node, "max", gap, difference)
            )
            near = (
                close
                if near is None
                else self.context.expressions.operator(node, "bit_and", near, close)
            )
        return gap, near

    def compared(self, operands, node):
        """The operands of a check; a plain number takes the type of the other one."""
        left, right = operands
        for one, other in ((left, right), (right, left)):
            native = self.context.static_type(other)
            if native is not None and type(one) in (int, float) and type(other) is not type(one):
                left, right = (
                    self.context.convert_constant(binding, native, node)
                    if binding is one
                    else self.context.materialize(binding, node)
                    for binding in operands
                )
                break
        left, right = self.context.materialize(left, node), self.context.materialize(right, node)
        if left.type != right.type or left.type.kind in ("array", "struct"):
            raise self.context.type_error(
                node,
                f"expects two numbers or composites of one type to compare, but got "
                f"'{left.type.python_name}' and '{right.type.python_name}'",
                code="compare-types",
            )
        return left, right

    def parts(self, value, node):
        native = value.type
        places = native.shape or {"quat": [4], "transform": [7]}.get(native.kind, [1])
        return self.context.slices.components(
            value, places[0] * (places[1] if len(places) == 2 else 1), node
        )

    def pieces(self, label, value, node):
        """A line that shows a value, as formats with their numbers."""
        native = value.type
        one = self.scalar_format(native.element or native)
        parts = self.parts(value, node)
        if native.kind == "transform":
            shape = [f"({one} {one} {one})", f" ({one} {one} {one} {one})\n"]
            return [(label + shape[0], parts[:3]), (shape[1], parts[3:])]
        if native.kind == "quat":
            return [(label + " ".join([one] * 4) + "\n", parts)]
        if native.kind not in ("vec", "mat"):
            return [(f"{label}{one}\n", parts)]
        length = native.shape[-1]
        rows = [parts[start : start + length] for start in range(0, len(parts), length)]
        lines = [(f"{one} " * length + "\n", row) for row in rows]
        return [(label, []), *lines]

    def print_pieces(self, *lines):
        """Prints all in as few calls as there may be, so that threads mix as little."""
        text, numbers = "", []
        for format, parts in (piece for line in lines for piece in line):
            if len(numbers) + len(parts) > _MOST:
                self.builder.printf(text, numbers)
                text, numbers = "", []
            text += format
            numbers += parts
        self.builder.printf(text, numbers)
