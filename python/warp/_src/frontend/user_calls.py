"""Calls of the user's functions: choice of the overload, and its translation on the first call."""

from __future__ import annotations

from warp._src import errors
from warp._src.frontend import functions
from warp._src.frontend.control import plan_of
from warp._src.frontend.emitter import Value
from warp._src.frontend.functions import NOTHING, Specialization
from warp._src.frontend.targets import Targets


class UserCalls(Targets):
    """Translates calls of `@wp.func` functions."""

    def call_function(self, function, arguments, keywords, node):
        overload, bound = self.select(function, arguments, keywords, node)
        made = self.specialize(overload, bound, node)
        values = []
        for binding in bound:
            if not functions.is_static(binding):
                self.flatten(binding, node, values)
        self.at(node)
        results = iter(self.builder.call(made.symbol, values))
        return None if made.shape is NOTHING else self.unflatten(made.shape, results)

    def select(self, function, arguments, keywords, node):
        """The first overload that takes the arguments, concrete ones before generic ones."""
        overloads = [functions.overload_of(f) for f in function.overloads]
        if len(overloads) > 1:
            overloads.sort(key=lambda overload: overload.generic)
        reasons = []
        for overload in overloads:
            bound = overload.bind(self, arguments, keywords, node)
            if type(bound) is list:
                return overload, bound
            reasons.append(f"{overload}: {bound}")
        shown = ", ".join(f"'{self.type_name(argument)}'" for argument in arguments)
        if len(reasons) == 1:
            message = f"cannot call '{function.key}' with ({shown}): {bound}"
            notes = (f"declared as {overloads[0]}",)
        else:
            message = f"no overload of '{function.key}' takes ({shown})"
            notes = tuple(reasons)
        raise self.type_error(node, message, self.call_hint(overloads, arguments), notes)

    def call_hint(self, overloads, arguments):
        """The conversion, if one argument of one overload needs it."""
        if len(overloads) != 1:
            return None
        for parameter, binding in zip(overloads[0].parameters, arguments, strict=False):
            if parameter.native is None or parameter.accepts(self, binding):
                continue
            if parameter.native.kind in ("int", "float", "bool") and type(binding) is not tuple:
                name = parameter.native.python_name
                return f"use `{'float' if name == 'float32' else f'wp.{name}'}(...)`"
        return None

    def default_value(self, parameter, node):
        """A parameter's default as a binding of the declared type."""
        binding = self.capture(parameter.default, node)
        if parameter.native is not None and type(binding) in (int, float, bool):
            return self.convert_constant(binding, parameter.native, node)
        return binding

    def specialize(self, overload, bound, node) -> Specialization:
        """The overload translated for the types of these arguments."""
        key = (overload, *map(self.signature_of, bound))
        calls = self.session.calls
        if key in calls:
            return calls[key]
        self.check_recursion(overload, node)
        self.session.active.append(overload)
        try:
            made = calls[key] = self.translate(overload, bound)
        except errors.WarpError as problem:
            where = f"{self.source.file}:{self.source.line(node)}"
            problem.notes = (*problem.notes, f"called from '{self.source.name}' at {where}")
            raise
        self.session.active.pop()
        return made

    def signature_of(self, binding):
        """What a specialisation depends on."""
        if type(binding) is Value:
            return binding.type
        if type(binding) is tuple:
            return tuple(map(self.signature_of, binding))
        if functions.is_static(binding):
            return getattr(binding, "name", None) or binding
        return self.static_type(binding)

    def check_recursion(self, overload, node):
        active = self.session.active
        if overload not in active:
            return
        chain = [o.function.__name__ for o in active[active.index(overload) :]]
        chain.append(overload.function.__name__)
        raise self.error(
            node,
            f"recursion is not supported in kernels: {' -> '.join(chain)}",
            "use a loop",
        )

    def translate(self, overload, bound) -> Specialization:
        emitter = type(self)(self.session, overload.function, overload.source, False)
        emitter.result_type = overload.result
        plan_of(overload.source, self.builder.inout_arguments)
        arg_names, arg_types, shapes = [], [], []
        for parameter, binding in zip(overload.parameters, bound, strict=False):
            if functions.is_static(binding):
                shapes.append(NOTHING)
                continue
            values = []
            shapes.append(self.flatten(binding, overload.source.tree, values))
            for value in values:
                arg_names.append(parameter.name)
                arg_types.append(value.type)
        symbol = self.session.symbol(overload.function.__name__)
        emitter.at(overload.source.tree)
        values = iter(self.builder.begin_function(symbol, arg_names, arg_types, False))
        line = overload.source.line(overload.source.tree)
        for parameter, shape, binding in zip(overload.parameters, shapes, bound, strict=False):
            value = binding if shape is NOTHING else emitter.unflatten(shape, values)
            emitter.env[parameter.name] = value
            emitter.lines[parameter.name] = line
        try:
            result = emitter.body()
        except errors.WarpError as problem:
            raise emitter.locate(problem) from problem.__cause__
        results = []
        shape = NOTHING
        if overload.source.plan.returns_value:
            shape = emitter.flatten(result, overload.source.tree, results)
        self.builder.end_function(results)
        return Specialization(symbol, shape)
