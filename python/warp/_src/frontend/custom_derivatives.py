"""Functions with a derivative of their own, in kernels.

Such a function is translated once more, with structs passed field by field (`Parts`), because only
floats and composites of floats have cotangents. It names its derivative (`set_pullback`,
`set_pushforward`, `set_replay`) and stays a call until the engine has met it. Signatures are in
lib/Compiler/BuilderDerivatives.cpp.
"""

from __future__ import annotations

from warp._src import errors
from warp._src.derivatives.functions import is_differentiable
from warp._src.frontend import functions
from warp._src.frontend.bindings import Parts
from warp._src.frontend.context import Part
from warp._src.frontend.functions import NOTHING, overload_of
from warp._src.frontend.pullbacks import mismatch, pullback_of


class CustomDerivatives(Part):
    """Translates calls of such functions."""

    def call_custom(self, function, overload, bound, node):
        """Calls a function that has a derivative of its own."""
        made = self.context.user_calls.specialize(overload, bound, node, apart=True, owner=function)
        self.derive(function, overload, made, bound, node)
        values = []
        for binding in bound:
            if not functions.is_static(binding):
                self.context.user_calls.take_apart(binding, node, values)
        self.context.at(node)
        results = iter(self.builder.call(made.symbol, values))
        if made.shape is NOTHING:
            return None
        binding = self.context.unflatten(made.shape, results)
        if function.pullback is not None and type(binding) is tuple:
            return binding[0]
        return binding

    # Derivatives of a function.

    def derive(self, function, overload, made, bound, node):
        """Attaches the derivative to a translated function; done once."""
        if made.symbol in self.context.session.derived:
            return
        self.context.session.derived.add(made.symbol)
        results = self.natives_of(made)
        if function.pullback is not None:
            self.attach_pullback(function, made, bound, results, node)
        given = [*bound, *results]
        chosen = self.registered(function.pullbacks, given)
        if chosen is not None:
            natives = [self.context.static_type(binding) for binding in bound]
            pullback = pullback_of(chosen, overload, natives)
            attached = self.context.user_calls.specialize(pullback, given, node, apart=True)
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
            if len(parameters) == len(given) and all(p.accepts(self.context, b) for p, b in pairs):
                return function
        return None

    def attach_replay(self, function, replay, made, bound, results, node):
        overload = overload_of(replay)
        attached = self.context.user_calls.specialize(overload, bound, node, apart=True)
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
            shown = " or ".join(
                f"({', '.join(map(self.context.type_name, form))})" for form in forms
            )
            raise self.context.type_error(
                node, f"pullback '{pullback.key}' of '{function.key}' expects to take {shown}"
            )
        arguments, kept, seeds = [], [], []
        shapes = [
            binding
            if functions.is_static(binding)
            else self.context.user_calls.types_of(binding, arguments, True)
            for binding in bound
        ]
        kept_shapes = [self.context.user_calls.types_of(native, kept, True) for native in residuals]
        seed_shape = self.context.user_calls.types_of(value, seeds, True)
        natives = [*arguments, *kept, *filter(is_differentiable, seeds)]
        symbol = self.context.session.symbol(f"{pullback.key}_pullback")
        self.context.at(node)
        values = iter(self.builder.begin_function(symbol, ["x"] * len(natives), natives, False))
        inputs = [
            shape if functions.is_static(shape) else self.context.unflatten(shape, values)
            for shape in shapes
        ]
        inputs = [*inputs, *(self.context.unflatten(shape, values) for shape in kept_shapes)]
        inputs.append(self.context.unflatten(seed_shape, values))
        given = inputs if len(chosen[0]) == len(inputs) else inputs[len(bound) :]
        returned = []
        result = self.context.user_calls.call_function(pullback, given, {}, node)
        if result is not None:
            self.context.user_calls.take_apart(result, node, returned)
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
            binding
            if functions.is_static(binding)
            else self.context.user_calls.types_of(binding, arguments, True)
            for binding in bound
        ]
        self.context.user_calls.types_of(
            tuple(results if function.pullback is None else results[:1]), wanted, True
        )
        wanted = [native for native in wanted if is_differentiable(native)]
        tangents = [native for native in arguments if is_differentiable(native)]
        form = [*bound, *tangents]
        if not self.takes(pushforward, form):
            raise self.context.type_error(
                node,
                f"pushforward '{pushforward.key}' of '{function.key}' expects to take "
                f"({', '.join(map(self.context.type_name, form))})",
            )
        symbol = self.context.session.symbol(f"{pushforward.key}_pushforward")
        natives = [*arguments, *tangents]
        self.context.at(node)
        values = iter(self.builder.begin_function(symbol, ["x"] * len(natives), natives, False))
        inputs = [
            shape if functions.is_static(shape) else self.context.unflatten(shape, values)
            for shape in shapes
        ]
        returned = []
        result = self.context.user_calls.call_function(pushforward, [*inputs, *values], {}, node)
        if result is not None:
            self.context.user_calls.take_apart(result, node, returned)
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
        made = self.context.session.symbol(f"{symbol}_transposed")
        natives = [*arguments, *results]
        self.context.at(node)
        values = self.builder.begin_function(made, ["x"] * len(natives), natives, False)
        given = [*values[: len(arguments)], *(self.builder.zero(native) for native in tangents)]
        found = self.builder.vjp(symbol, given, list(values[len(arguments) :]), False)
        self.builder.end_function(list(found[len(tangents) :]))
        return made

    def takes(self, function, given) -> bool:
        return any(
            type(overload_of(f).bind(self.context, given, {}, None)) is list
            for f in function.overloads
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
