"""Derivatives in kernels: functions with one of their own, and `wp.grad`, `wp.hessian`.

A function whose derivative matters here is translated once more, with structs passed field by
field (`Parts`), because only floats and composites of floats have cotangents. One with a derivative
of its own names it (`set_pullback`) and stays a call until the engine has met it; others are
differentiated by the compiler where `vjp` or `jvp` says so. Signatures are in
lib/Compiler/BuilderDerivatives.cpp.
"""

from __future__ import annotations

from warp._src import derivatives, errors, types
from warp._src.derivatives import is_differentiable
from warp._src.frontend import functions
from warp._src.frontend.functions import NOTHING, overload_of
from warp._src.frontend.pullbacks import mismatch, pullback_of
from warp._src.frontend.references import References
from warp._src.frontend.user_calls import Parts


class Derivatives(References):
    """Translates calls that involve derivatives."""

    def call_custom(self, function, overload, bound, node):
        """Calls a function that has a derivative of its own."""
        made = self.specialize(overload, bound, node, apart=True, owner=function)
        self.derive(function, overload, made, bound, node)
        values = []
        for binding in bound:
            if not functions.is_static(binding):
                self.take_apart(binding, node, values)
        self.at(node)
        results = iter(self.builder.call(made.symbol, values))
        if made.shape is NOTHING:
            return None
        binding = self.unflatten(made.shape, results)
        if function.pullback is not None and type(binding) is tuple:
            return binding[0]
        return binding

    # What belongs to a function.

    def derive(self, function, overload, made, bound, node):
        """Attaches the derivative to a translated function; done once."""
        if made.symbol in self.session.derived:
            return
        self.session.derived.add(made.symbol)
        results = self.natives_of(made)
        if function.pullback is not None:
            self.attach_pullback(function, made, bound, results, node)
        given = [*bound, *results]
        chosen = self.registered(function.pullbacks, given)
        if chosen is not None:
            natives = [self.static_type(binding) for binding in bound]
            pullback = pullback_of(chosen, overload, natives)
            attached = self.specialize(pullback, given, node, apart=True)
            self.builder.set_pullback(made.symbol, attached.symbol, 0)
        elif function.pullbacks and len(function.overloads) == 1:
            raise mismatch(function, overload_of(function.pullbacks[0]), "func_grad", results)
        if function.pushforward is not None:
            self.attach_pushforward(function, made, bound, results, chosen is None, node)
        replay = self.registered(function.replays, bound)
        if replay is not None:
            self.attach_replay(function, replay, made, bound, results, node)

    def registered(self, candidates, given):
        """The last registered function that takes these arguments."""
        for function in reversed(candidates):
            parameters = overload_of(function).parameters
            pairs = zip(parameters, given, strict=False)
            if len(parameters) == len(given) and all(p.accepts(self, b) for p, b in pairs):
                return function
        return None

    def attach_replay(self, function, replay, made, bound, results, node):
        overload = overload_of(replay)
        attached = self.specialize(overload, bound, node, apart=True)
        found = self.natives_of(attached)
        if found != results:
            shown = [", ".join(n.python_name for n in natives) for natives in (results, found)]
            raise errors.WarpCodegenTypeError(
                f"'{replay.__name__}' does not fit '{function.key}': expects results "
                f"'({shown[0]})', but got '({shown[1]})'",
                **overload.source.place(overload.source.tree),
            )
        self.builder.set_replay(made.symbol, attached.symbol)

    def attach_pullback(self, function, made, bound, results, node):
        """Builds the derivative of `wp.custom_vjp` around the user's pullback."""
        value, residuals = results[0], self.spread_types(results[1:])
        forms = [[*bound, *residuals, value]]
        if residuals:
            forms.insert(0, [*residuals, value])
        pullback = function.pullback
        chosen = [form for form in forms if self.takes(pullback, form)]
        if not chosen:
            shown = " or ".join(f"({', '.join(map(self.type_name, form))})" for form in forms)
            raise self.type_error(
                node, f"pullback '{pullback.key}' of '{function.key}' expects to take {shown}"
            )
        arguments, kept, seeds = [], [], []
        shapes = [
            binding if functions.is_static(binding) else self.types_of(binding, arguments, True)
            for binding in bound
        ]
        kept_shapes = [self.types_of(native, kept, True) for native in residuals]
        seed_shape = self.types_of(value, seeds, True)
        natives = [*arguments, *kept, *filter(is_differentiable, seeds)]
        symbol = self.session.symbol(f"{pullback.key}_pullback")
        self.at(node)
        values = iter(self.builder.begin_function(symbol, ["x"] * len(natives), natives, False))
        inputs = [
            shape if functions.is_static(shape) else self.unflatten(shape, values)
            for shape in shapes
        ]
        inputs = [*inputs, *(self.unflatten(shape, values) for shape in kept_shapes)]
        inputs.append(self.unflatten(seed_shape, values))
        given = inputs if len(chosen[0]) == len(inputs) else inputs[len(bound) :]
        returned = []
        result = self.call_function(pullback, given, {}, node)
        if result is not None:
            self.take_apart(result, node, returned)
        returned = [v for v in returned if is_differentiable(v.type)]
        self.builder.end_function(returned)
        wanted = [native for native in arguments if is_differentiable(native)]
        self.check_returned(
            function, pullback, "pullback", "cotangent per argument", wanted, returned
        )
        self.builder.set_pullback(made.symbol, symbol, len(kept))

    def attach_pushforward(self, function, made, bound, results, is_alone, node):
        """Builds the derivative of `wp.custom_jvp` around the user's pushforward.

        is_alone: no `@wp.func_grad` belongs to the function.
        """
        pushforward = function.pushforward
        arguments, wanted = [], []
        shapes = [
            binding if functions.is_static(binding) else self.types_of(binding, arguments, True)
            for binding in bound
        ]
        self.types_of(tuple(results if function.pullback is None else results[:1]), wanted, True)
        wanted = [native for native in wanted if is_differentiable(native)]
        tangents = [native for native in arguments if is_differentiable(native)]
        form = [*bound, *tangents]
        if not self.takes(pushforward, form):
            raise self.type_error(
                node,
                f"pushforward '{pushforward.key}' of '{function.key}' expects to take "
                f"({', '.join(map(self.type_name, form))})",
            )
        symbol = self.session.symbol(f"{pushforward.key}_pushforward")
        natives = [*arguments, *tangents]
        self.at(node)
        values = iter(self.builder.begin_function(symbol, ["x"] * len(natives), natives, False))
        inputs = [
            shape if functions.is_static(shape) else self.unflatten(shape, values)
            for shape in shapes
        ]
        returned = []
        result = self.call_function(pushforward, [*inputs, *values], {}, node)
        if result is not None:
            self.take_apart(result, node, returned)
        returned = [v for v in returned if is_differentiable(v.type)]
        self.builder.end_function(returned)
        self.check_returned(
            function, pushforward, "pushforward", "tangent per result", wanted, returned
        )
        self.builder.set_pushforward(made.symbol, symbol)
        if function.pullback is None and is_alone:
            self.builder.set_pullback(
                made.symbol, self.transposed(symbol, arguments, tangents, wanted, node), 0
            )

    def transposed(self, symbol, arguments, tangents, results, node):
        """The pullback that belongs to a pushforward: its derivative by the tangents."""
        made = self.session.symbol(f"{symbol}_transposed")
        natives = [*arguments, *results]
        self.at(node)
        values = self.builder.begin_function(made, ["x"] * len(natives), natives, False)
        given = [*values[: len(arguments)], *(self.builder.zero(native) for native in tangents)]
        found = self.builder.vjp(symbol, given, list(values[len(arguments) :]), False)
        self.builder.end_function(list(found[len(tangents) :]))
        return made

    def takes(self, function, given) -> bool:
        return any(
            type(overload_of(f).bind(self, given, {}, None)) is list for f in function.overloads
        )

    def spread_types(self, natives):
        """Types of residuals, those in tuples one by one."""
        found = []
        for native in natives:
            found += self.spread_types(native) if type(native) is tuple else [native]
        return found

    def check_returned(self, function, derivative, name, what, wanted, returned):
        given = [value.type for value in returned]
        if wanted != given:
            shown = [", ".join(n.python_name for n in natives) for natives in (wanted, given)]
            source = overload_of(derivative.func).source
            raise errors.WarpCodegenTypeError(
                f"{name} '{derivative.key}' of '{function.key}' expects to return one {what} of "
                f"floats, '({shown[0]})', but returns '({shown[1]})'",
                **source.place(source.tree),
            )

    # Derivatives that are called.

    def call_derivative(self, derivative, node):
        """`wp.grad(f)(...)` and `wp.hessian(f)(...)`."""
        arguments, keywords = self.arguments(node)
        if isinstance(derivative, derivatives.Hessian):
            return self.call_hessian(derivative, arguments, keywords, node)
        made, bound, values = self.differentiated(derivative.func, arguments, keywords, node)
        seeds = [
            self.builder.constant(native, 1.0)
            for native in made.results
            if is_differentiable(native)
        ]
        if not seeds:
            raise self.type_error(node, f"{derivative!r}: no result is a float or made of floats")
        return self.cotangents(made, bound, values, seeds, False, node)

    def cotangents(self, made, bound, values, seeds, arrays, node):
        """What `vjp` gives, as one binding per argument."""
        self.at(node)
        results = iter(self.builder.vjp(made.symbol, values, seeds, arrays))
        bindings = [
            self.cotangent(shape, binding, results, node)
            for shape, binding in zip(made.arguments, bound, strict=True)
            if not functions.is_static(binding)
        ]
        return bindings[0] if len(bindings) == 1 else tuple(bindings)

    def cotangent(self, shape, binding, results, node):
        if type(shape) is tuple:
            return tuple(
                [self.cotangent(s, b, results, node) for s, b in zip(shape, binding, strict=True)]
            )
        native = self.static_type(binding)
        if native.kind == "array":
            return 0
        if native.kind == "struct":
            derivatives.check_no_struct_of_arrays(native, "an argument", self.source.place(node))
        return self.struct_cotangent(native, results)

    def struct_cotangent(self, native, results):
        if native.kind == "struct":
            parts = [self.struct_cotangent(field, results) for _, field in native.fields]
            return self.builder.struct_create(native, parts)
        return next(results) if is_differentiable(native) else self.builder.zero(native)

    def differentiated(self, function, arguments, keywords, node):
        """A function to differentiate: its translation, the arguments, and their values."""
        if not hasattr(function, "overloads"):
            return self.wrapped_builtin(function, arguments, keywords, node)
        overload, bound = self.select(function, arguments, keywords, node)
        made = self.specialize(overload, bound, node, apart=True, owner=function)
        if function.has_derivative:
            self.derive(function, overload, made, bound, node)
            if function.pullback is not None and type(made.shape) is tuple:
                made = made.without_residuals()
        values = []
        for binding in bound:
            if not functions.is_static(binding):
                self.take_apart(binding, node, values)
        return made, bound, values

    def wrapped_builtin(self, builtin, arguments, keywords, node):
        """A function that calls a builtin."""
        name = getattr(builtin, "key", None) or builtin.name
        if keywords or any(type(argument) is tuple for argument in arguments):
            raise self.type_error(node, f"derivatives of '{name}' expect arguments in order")
        values = [self.materialize(argument, node) for argument in arguments]
        natives = [value.type for value in values]
        key = (name, *natives)
        if key not in self.session.calls:
            symbol = self.session.symbol(f"{name}_builtin")
            self.at(node)
            inner = self.builder.begin_function(symbol, ["x"] * len(natives), natives, False)
            results = self.builder.builtin(name, inner)[0]
            self.builder.end_function(results)
            shape = None if len(results) == 1 else (None,) * len(results)
            made = functions.Specialization(symbol, shape)
            made.arguments, made.results = [None] * len(natives), [r.type for r in results]
            self.session.calls[key] = made
        return self.session.calls[key], values, values

    def call_hessian(self, derivative, arguments, keywords, node):
        made, bound, values = self.differentiated(derivative.func, arguments, keywords, node)
        native = values[0].type if values else None
        scalar = native is not None and native.kind == "float"
        vector = native is not None and native.kind == "vec" and native.element.kind == "float"
        if not (scalar or vector) or type(made.arguments[0]) is not type(None):
            raise self.type_error(
                node, f"{derivative!r} expects a float or a vector of floats as first argument"
            )
        element = native if scalar else native.element
        if made.results != [element]:
            shown = ", ".join(result.python_name for result in made.results)
            raise self.type_error(
                node, f"{derivative!r} expects one result of type '{element.python_name}', "
                f"but got '({shown})'",
            )  # fmt: skip
        symbol = self.gradient_function(made, native, [v.type for v in values], node)
        self.at(node)
        one, zero = self.builder.constant(element, 1.0), self.builder.constant(element, 0.0)
        if scalar:
            return self.builder.jvp(symbol, values, [one])[0]
        count = native.shape[0]
        components = []
        for row in range(count):
            seed = [one if column == row else zero for column in range(count)]
            seed = self.builder.construct(native, seed)
            found = self.builder.jvp(symbol, values, [seed])[0]
            components += self.components(found, count, node)
        matrix = types.native_type(types.matrix((count, count), types.dtype_of(element)))
        return self.builder.construct(matrix, components)

    def gradient_function(self, made, native, natives, node):
        """A function that gives the gradient by the first argument."""
        key = ("gradient", made.symbol)
        if key not in self.session.calls:
            symbol = self.session.symbol(f"{made.symbol}_gradient")
            self.at(node)
            values = self.builder.begin_function(symbol, ["x"] * len(natives), natives, False)
            one = self.builder.constant(made.results[0], 1.0)
            self.builder.end_function(self.builder.vjp(made.symbol, values, [one], False)[:1])
            self.session.calls[key] = symbol
        return self.session.calls[key]

    # What the library of the kernel language is written with.

    def builtin_pulled_back(self, node):
        """`pulled_back(f, arrays, cotangent, *arguments)`: the arguments' cotangents, a tuple."""
        arguments, _ = self.arguments(node)
        function, arrays, seed, *rest = arguments
        made, bound, values = self.differentiated(function, rest, {}, node)
        seeds = [self.materialize(seed, node)]
        found = self.cotangents(made, bound, values, seeds, arrays, node)
        return found if len(bound) > 1 else (found,)

    def builtin_fixed_point(self, node):
        from warp._src.fixed_point import FIXED_POINT

        arguments, keywords = self.arguments(node)
        if keywords or len(arguments) < 2 or not hasattr(arguments[0], "overloads"):
            raise self.type_error(
                node, "fixed_point expects a function, where to start, and parameters"
            )
        start = self.materialize(arguments[1], node)
        if start.type.kind not in ("float", "vec", "mat", "quat") or not is_differentiable(
            start.type
        ):
            raise self.type_error(
                node,
                f"fixed_point expects to start at floats, but got '{start.type.python_name}'",
            )
        given = [arguments[0], start, tuple(arguments[2:])]
        return self.call_function(FIXED_POINT, given, {}, node)

    # Types.

    def natives_of(self, made):
        """Types of the results of a function, as a list of what it returns."""
        if made.shape is NOTHING:
            return []
        natives = iter(made.results)
        found = self.native_of(made.shape, natives)
        return list(found) if type(found) is tuple else [found]

    def native_of(self, shape, natives):
        if type(shape) is tuple:
            return tuple([self.native_of(part, natives) for part in shape])
        if type(shape) is Parts:
            for part in shape.parts:
                self.native_of(part, natives)
            return shape.native
        return next(natives)
