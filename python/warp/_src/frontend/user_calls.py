"""Calls of the user's functions: choice of the overload, and its translation on the first call."""

from __future__ import annotations

from warp._src import errors
from warp._src.derivatives.functions import is_differentiable
from warp._src.frontend import functions
from warp._src.frontend.bindings import LocalArray, Parts, Record, TileStack, Value, is_table
from warp._src.frontend.context import Part
from warp._src.frontend.control import plan_of
from warp._src.frontend.functions import NOTHING, Specialization
from warp._src.frontend.session import note_of_call
from warp._src.frontend.updates import updated_arguments

# Calls of a function within itself, each for other types or functions than those around it.
_MOST_LEVELS = 16


class UserCalls(Part):
    """Translates calls of `@wp.func` functions."""

    def call_function(self, function, arguments, keywords, node):
        overload, bound = self.select(function, arguments, keywords, node)
        if function.has_derivative:
            return self.context.custom_derivatives.call_custom(function, overload, bound, node)
        made = self.specialize(overload, bound, node)
        values = []
        for binding in bound:
            if not functions.is_static(binding):
                self.context.flatten(binding, node, values)
        self.context.at(node)
        results = iter(self.builder.call(made.symbol, values))
        result = None if made.shape is NOTHING else self.context.unflatten(made.shape, results)
        for position, name, shape in made.updated:
            array = self.context.unflatten(shape, results)
            self.context.local_arrays.update(node, position, name, array)
        return result

    def select(self, function, arguments, keywords, node, by_reference=False):
        """The first overload that takes the arguments, concrete ones before generic ones.

        by_reference: parameters may be references.
        """
        overloads = [functions.overload_of(f) for f in function.overloads]
        if len(overloads) > 1:
            overloads.sort(key=lambda overload: overload.generic)
        reasons = []
        for overload in overloads:
            bound = overload.bind(self.context, arguments, keywords, node)
            if type(bound) is list:
                if overload.references and (function.has_derivative or not by_reference):
                    raise self.no_references(function, overload, node)
                return overload, bound
            reasons.append(f"{overload.declaration(function.key)}: {bound}")
        shown = [f"'{self.context.type_name(argument)}'" for argument in arguments]
        shown += [f"{name}='{self.context.type_name(one)}'" for name, one in keywords.items()]
        shown = ", ".join(shown)
        if len(reasons) == 1:
            message = f"cannot call '{function.key}' with ({shown}): {bound}"
            notes = (f"declared as {overloads[0].declaration(function.key)}",)
        else:
            message = f"no overload of '{function.key}' takes ({shown})"
            notes = tuple(reasons)
        raise self.context.type_error(
            node, message, self.call_hint(overloads, arguments), notes,
            code="overload", facts={"name": function.key, "types": shown.replace("'", "")},
        )  # fmt: skip

    def no_references(self, function, overload, node):
        return self.context.type_error(
            node,
            f"'{function.key}' has parameters by reference; it can be called by its "
            "own name alone, and has no derivative of its own",
            notes=(f"declared as {overload.declaration(function.key)}",),
        )

    def call_hint(self, overloads, arguments):
        """The conversion, if one argument of one overload needs it."""
        if len(overloads) != 1:
            return None
        for parameter, binding in zip(overloads[0].parameters, arguments, strict=False):
            if parameter.native is None or parameter.accepts(self.context, binding):
                continue
            if parameter.native.kind in ("int", "float", "bool") and type(binding) is not tuple:
                name = parameter.native.python_name
                return f"use `{'float' if name == 'float32' else f'wp.{name}'}(...)`"
        return None

    def default_value(self, parameter, node):
        """A parameter's default as a binding of the declared type."""
        binding = self.context.capture(parameter.default, node)
        if parameter.native is not None and type(binding) in (int, float, bool):
            return self.context.convert_constant(binding, parameter.native, node)
        return binding

    def specialize(self, overload, bound, node, apart=False, owner=None) -> Specialization:
        """The overload translated for the types of these arguments.

        apart: pass structs field by field. owner: the function, if it may have a derivative.
        """
        key = (overload, apart, owner, *map(self.signature_of, bound))
        calls = self.context.session.calls
        if key in calls:
            return calls[key]
        session = self.context.session
        active, callers = session.active, session.callers
        self.check_recursion(overload, key in session.unfinished, node)
        session.unfinished.add(key)
        active.append(overload)
        callers.append((self.context.source, node))
        try:
            made = calls[key] = self.translate(overload, bound, apart)
        except errors.WarpError as problem:
            problem.notes = (*problem.notes, note_of_call(*callers.pop()))
            raise
        session.unfinished.remove(key)
        active.pop()
        callers.pop()
        return made

    def signature_of(self, binding):
        """The part of a binding that a specialisation depends on."""
        if type(binding) is Value:
            return binding.type
        if type(binding) is tuple:
            return tuple(map(self.signature_of, binding))
        if type(binding) is Record:
            return binding.description, *map(self.signature_of, binding.parts)
        if type(binding) is LocalArray:
            return LocalArray(binding.shape, binding.element)
        if type(binding) is TileStack:
            return TileStack(binding.type)
        if is_table(binding):
            return binding.shape, binding.dtype.str, binding.tobytes()
        if functions.is_static(binding):
            return getattr(binding, "name", None) or binding
        return self.context.static_type(binding)

    def check_recursion(self, overload, is_unfinished, node):
        """A function may call itself for other types or functions, if that ends."""
        active = self.context.session.active
        if not is_unfinished and active.count(overload) < _MOST_LEVELS:
            return
        chain = [o.function.__name__ for o in active[active.index(overload) :]]
        chain.append(overload.function.__name__)
        raise self.context.error(
            node,
            f"recursion is not supported in kernels: {' -> '.join(chain)}",
            "use a loop",
        )

    def translate(self, overload, bound, apart) -> Specialization:
        inner = type(self.context)(self.context.session, overload.function, overload.source, False)
        inner.result_type = overload.result
        hidden = getattr(overload, "hidden", ())
        references = dict(overload.references)
        references.update(
            (position, parameter.name)
            for position, (parameter, binding) in enumerate(
                zip(overload.parameters, bound, strict=False)
            )
            if type(binding) is LocalArray or self.is_tile(binding)
        )
        plan_of(
            overload.source,
            updated_arguments(overload.function, self.builder.inout_arguments),
            [*(name for name, *_ in hidden), *overload.outputs],
        )
        arg_names, arg_types, shapes = [], [], []
        for parameter, binding in zip(overload.parameters, bound, strict=False):
            if functions.is_static(binding):
                shapes.append(NOTHING)
                continue
            natives = []
            shapes.append(self.types_of(binding, natives, apart))
            arg_names += [parameter.name] * len(natives)
            arg_types += natives
        symbol = self.context.session.symbol(overload.function.__name__)
        inner.at(overload.source.tree)
        values = iter(self.builder.begin_function(symbol, arg_names, arg_types, False))
        line = overload.source.line(overload.source.tree)
        for parameter, shape, binding in zip(overload.parameters, shapes, bound, strict=False):
            value = binding if shape is NOTHING else inner.unflatten(shape, values)
            inner.env[parameter.name] = value
            inner.lines[parameter.name] = line
        inner.find_literal_type()
        given = [inner.env[name] for name in references.values()]
        inner.user_calls.start_adjoints(hidden)
        try:
            result = inner.statements.body()
        except errors.WarpError as problem:
            raise inner.locate(problem) from problem.__cause__
        results = inner.user_calls.adjoints(hidden)
        shape = NOTHING
        if overload.source.plan.returns_value and result is not None:
            flatten = inner.user_calls.take_apart if apart else inner.flatten
            shape = flatten(result, overload.source.tree, results)
        updated = inner.user_calls.take_updates(references, given, results)
        self.builder.end_function(results)
        types = [value.type for value in results]
        return Specialization(symbol, shape, shapes, types, updated)

    def take_updates(self, references, given, into):
        """Appends the values of references that were assigned; gives position, name and shape."""
        updated = []
        for (position, name), value in zip(references.items(), given, strict=True):
            last = self.context.env[name]
            if self.is_tile(value) and name not in self.context.tiles.changed:
                # Another tile of that name is the function's own.
                continue
            if last is not value:
                shape = self.context.flatten(last, self.context.source.tree, into)
                updated.append((position, name, shape))
        return updated

    @staticmethod
    def is_tile(binding):
        """True if it is a tile, a part of one, or a stack; functions get these by reference."""
        kind = getattr(getattr(binding, "type", None), "kind", None)
        return kind in ("tile", "tile stack")

    def start_adjoints(self, hidden):
        """Gives the hidden names of a pullback their first values."""
        for name, path, native in hidden:
            if native.kind == "array":
                root, *fields = path.split(".")
                array = self.context.env[root]
                for field in fields:
                    array = self.builder.struct_get(array, field)
                if native.element.kind != "struct" and not is_differentiable(native.element):
                    continue
                self.context.env[name] = self.builder.grad(array)
            elif is_differentiable(native):
                self.context.env[name] = self.builder.zero(native)
            self.context.lines[name] = self.context.source.line(self.context.source.tree)

    def adjoints(self, hidden):
        """The cotangents that a pullback returns."""
        if hidden and self.context.source.plan.returns_value:
            raise self.context.error(
                self.context.source.tree,
                f"'{self.context.source.name}' is a `@wp.func_grad` function, "
                "which returns nothing",
                "add to `wp.adjoint[...]`",
            )
        return [
            self.context.materialize(self.context.env[name], self.context.source.tree)
            for name, _, native in hidden
            if is_differentiable(native)
        ]

    # Structs field by field.

    def types_of(self, binding, into, apart):
        """Appends the types of a binding's values; gives its shape for `unflatten`."""
        if type(binding) is tuple:
            return tuple([self.types_of(part, into, apart) for part in binding])
        if type(binding) is Record:
            parts = tuple([self.types_of(part, into, apart) for part in binding.parts])
            return Record(binding.description, parts)
        if type(binding) is LocalArray:
            into += [part.type for part in binding.parts]
            return LocalArray(binding.shape, binding.element, len(binding.parts), binding.is_copy)
        if type(binding) is TileStack:
            into += [part.type for part in binding.parts]
            return TileStack(binding.type)
        native = self.context.static_type(binding)
        if native is None:
            native = self.context.materialize(binding, self.context.node).type
        if apart and native.kind == "struct":
            parts = [self.types_of(field, into, apart) for _, field in native.fields]
            return Parts(native, parts)
        into.append(native)
        return None

    def take_apart(self, binding, node, into):
        """Like `flatten`, with structs as their fields."""
        if type(binding) is tuple:
            return tuple([self.take_apart(part, node, into) for part in binding])
        if type(binding) is Record:
            parts = tuple([self.take_apart(part, node, into) for part in binding.parts])
            return Record(binding.description, parts)
        if type(binding) in (LocalArray, TileStack):
            return self.context.flatten(binding, node, into)
        value = self.context.materialize(binding, node)
        if value.type.kind != "struct":
            into.append(value)
            return None
        self.context.at(node)
        parts = [
            self.take_apart(self.builder.struct_get(value, name), node, into)
            for name, _ in value.type.fields
        ]
        return Parts(value.type, parts)
