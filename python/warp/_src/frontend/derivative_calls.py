"""Derivatives in kernels: `wp.grad`, `wp.hessian`, `wp.fixed_point`.

A function that is differentiated is translated once more, with structs passed field by field. One
that has a derivative of its own brings it along (`custom_derivatives`); others are differentiated
by the compiler where `vjp` or `jvp` says so.
"""

from __future__ import annotations

from warp._src.derivatives.functions import Hessian, check_no_struct_of_arrays, is_differentiable
from warp._src.frontend import functions
from warp._src.frontend.bindings import Record
from warp._src.frontend.context import Part
from warp._src.kernels.function import Function
from warp._src.types import dtypes


def _parts(binding) -> tuple:
    return binding.parts if type(binding) is Record else binding


class DerivativeCalls(Part):
    """Translates calls of derivatives."""

    # Derivatives that are called.

    def call_derivative(self, derivative, node):
        """`wp.grad(f)(...)` and `wp.hessian(f)(...)`."""
        arguments, keywords = self.context.constructors.arguments(node)
        if isinstance(derivative, Hessian):
            return self.call_hessian(derivative, arguments, keywords, node)
        made, bound, values = self.differentiated(derivative.func, arguments, keywords, node)
        seeds = [
            self.builder.constant(native, 1.0)
            for native in made.results
            if is_differentiable(native)
        ]
        if not seeds:
            raise self.context.type_error(
                node, f"{derivative!r}: no result is a float or made of floats"
            )
        count = getattr(derivative, "count", None)
        return self.cotangents(made, bound, values, seeds, False, node, count)

    def cotangents(self, made, bound, values, seeds, arrays, node, count=None):
        """Results of `vjp`, as one binding per argument, of all or the first ones."""
        self.context.at(node)
        results = iter(self.builder.vjp(made.symbol, values, seeds, arrays))
        bindings = [
            self.cotangent(shape, binding, results, node)
            for shape, binding in [*zip(made.arguments, bound, strict=True)][:count]
            if not functions.is_static(binding)
        ]
        if count is not None:
            return tuple(bindings)
        return bindings[0] if len(bindings) == 1 else tuple(bindings)

    def cotangent(self, shape, binding, results, node):
        if type(shape) in (tuple, Record):
            pairs = zip(_parts(shape), _parts(binding), strict=True)
            return tuple([self.cotangent(s, b, results, node) for s, b in pairs])
        native = self.context.static_type(binding)
        if native.kind == "array":
            return 0
        if native.kind == "struct":
            check_no_struct_of_arrays(native, "an argument", self.context.source.place(node))
        return self.struct_cotangent(native, results)

    def struct_cotangent(self, native, results):
        if native.kind == "struct":
            parts = [self.struct_cotangent(field, results) for _, field in native.fields]
            return self.builder.struct_create(native, parts)
        return next(results) if is_differentiable(native) else self.builder.zero(native)

    def differentiated(self, function, arguments, keywords, node):
        """A function to differentiate: its translation, the arguments, and their values."""
        if not isinstance(function, Function):
            return self.wrapped_builtin(function, arguments, keywords, node)
        overload, bound = self.context.user_calls.select(function, arguments, keywords, node)
        made = self.context.user_calls.specialize(overload, bound, node, apart=True, owner=function)
        if function.has_derivative:
            self.context.custom_derivatives.derive(function, overload, made, bound, node)
            if function.pullback is not None and type(made.shape) is tuple:
                made = made.without_residuals()
        values = []
        for binding in bound:
            if not functions.is_static(binding):
                self.context.user_calls.take_apart(binding, node, values)
        return made, bound, values

    def wrapped_builtin(self, builtin, arguments, keywords, node):
        """A function that calls a builtin."""
        name = getattr(builtin, "key", None) or builtin.name
        if keywords or any(type(argument) is tuple for argument in arguments):
            raise self.context.type_error(
                node, f"derivatives of '{name}' expect arguments in order"
            )
        values = [self.context.materialize(argument, node) for argument in arguments]
        natives = [value.type for value in values]
        key = (name, *natives)
        if key not in self.context.session.calls:
            symbol = self.context.session.symbol(f"{name}_builtin")
            self.context.at(node)
            inner = self.builder.begin_function(symbol, ["x"] * len(natives), natives, False)
            results = self.builder.builtin(name, inner)[0]
            self.builder.end_function(results)
            shape = None if len(results) == 1 else (None,) * len(results)
            made = functions.Specialization(symbol, shape)
            made.arguments, made.results = [None] * len(natives), [r.type for r in results]
            self.context.session.calls[key] = made
        return self.context.session.calls[key], values, values

    def call_hessian(self, derivative, arguments, keywords, node):
        made, _, values = self.differentiated(derivative.func, arguments, keywords, node)
        native = values[0].type if values else None
        scalar = native is not None and native.kind == "float"
        vector = native is not None and native.kind == "vec" and native.element.kind == "float"
        if not (scalar or vector) or type(made.arguments[0]) is not type(None):
            raise self.context.type_error(
                node, f"{derivative!r} expects a float or a vector of floats as first argument"
            )
        element = native if scalar else native.element
        if made.results != [element]:
            shown = ", ".join(result.python_name for result in made.results)
            raise self.context.type_error(
                node, f"{derivative!r} expects one result of type '{element.python_name}', "
                f"but got '({shown})'",
            )  # fmt: skip
        symbol = self.gradient_function(made, native, [v.type for v in values], node)
        self.context.at(node)
        one, zero = self.builder.constant(element, 1.0), self.builder.constant(element, 0.0)
        if scalar:
            return self.builder.jvp(symbol, values, [one])[0]
        count = native.shape[0]
        components = []
        for row in range(count):
            seed = [one if column == row else zero for column in range(count)]
            seed = self.builder.construct(native, seed)
            found = self.builder.jvp(symbol, values, [seed])[0]
            components += self.context.slices.components(found, count, node)
        matrix = dtypes.native_type(dtypes.matrix((count, count), dtypes.dtype_of(element)))
        return self.builder.construct(matrix, components)

    def gradient_function(self, made, native, natives, node):
        """A function that gives the gradient by the first argument."""
        key = ("gradient", made.symbol)
        if key not in self.context.session.calls:
            symbol = self.context.session.symbol(f"{made.symbol}_gradient")
            self.context.at(node)
            values = self.builder.begin_function(symbol, ["x"] * len(natives), natives, False)
            one = self.builder.constant(made.results[0], 1.0)
            self.builder.end_function(self.builder.vjp(made.symbol, values, [one], False)[:1])
            self.context.session.calls[key] = symbol
        return self.context.session.calls[key]

    # Builtins of the library of the kernel language.

    def builtin_pulled_back(self, node):
        """`pulled_back(f, arrays, cotangent, *arguments)`: the arguments' cotangents, a tuple."""
        arguments, _ = self.context.constructors.arguments(node)
        function, arrays, seed, *rest = arguments
        made, bound, values = self.differentiated(function, rest, {}, node)
        seeds = [self.context.materialize(seed, node)]
        found = self.cotangents(made, bound, values, seeds, arrays, node)
        return found if len(bound) > 1 else (found,)

    def builtin_fixed_point(self, node):
        from warp._src.language.fixed_point import FIXED_POINT

        arguments, keywords = self.context.constructors.arguments(node)
        if keywords or len(arguments) < 2 or not isinstance(arguments[0], Function):
            raise self.context.type_error(
                node, "fixed_point expects a function, where to start, and parameters"
            )
        start = self.context.materialize(arguments[1], node)
        if start.type.kind not in ("float", "vec", "mat", "quat") or not is_differentiable(
            start.type
        ):
            raise self.context.type_error(
                node,
                f"fixed_point expects to start at floats, but got '{start.type.python_name}'",
            )
        given = [arguments[0], start, tuple(arguments[2:])]
        return self.context.user_calls.call_function(FIXED_POINT, given, {}, node)
