"""Calls of builtins by the signatures of their records.

The generated table (`warp._src.builtin_calls`) has for each builtin its parameters, with types that
letters tie together, the conditions on them, and the call. The binder gives arguments to
parameters, converts and checks them, makes the call, and writes new values of `inout` parameters
back. An entry of the table is resolved at the first call of its builtin in a process.
"""

from __future__ import annotations

import ast

from warp import config
from warp._src.builtin_calls import CALLS
from warp._src.frontend import names
from warp._src.frontend.context import Part
from warp._src.frontend.parameters import Parameter

_RESOLVED: dict[str, list[Overload]] = {}
# Functions whose result has no gradient with NVIDIA Warp.
_WITHOUT_GRADIENT = frozenset(
    (
        *("tile_arange", "tile_diag_add", "tile_max", "tile_min", "tile_reduce"),
        *("tile_scan_exclusive", "tile_scan_inclusive", "tile_scan_max_inclusive"),
        "tile_scan_min_inclusive",
    )
)


class Overload:
    """One overload of a builtin, as the binder uses it.

    Attributes:
        parameters: in order.
        order: those that arguments go to by position, up to a variadic one.
        names: of these. least: how many have no default.
        following: those that arguments go to by position behind a variadic one.
        by_name: the parameters by their names.
        variadic: the one that takes any number of arguments, or None.
        updated: the `inout` parameters.
        letters, requirements, has_result, expand: as in the table.
    """

    __slots__ = (
        *("by_name", "expand", "following", "has_result", "least", "letters", "names", "order"),
        *("parameters", "requirements", "updated", "variadic"),
    )

    def __init__(self, parameters, letters, requirements, has_result, expand):
        self.parameters = [Parameter(*one) for one in parameters]
        self.letters, self.requirements = letters, requirements
        self.has_result, self.expand = has_result, expand
        self.by_name = {one.name: one for one in self.parameters}
        self.updated = [one for one in self.parameters if one.kind == "inout"]
        self.variadic, self.order, self.following = None, [], []
        for one in self.parameters:
            if one.kind == "*":
                self.variadic = one
            elif one.kind != "keyword":
                (self.order if self.variadic is None else self.following).append(one)
        self.names = [one.name for one in self.order]
        self.least = sum(one.default is ... for one in self.parameters)

    def shown(self) -> str:
        """The parameters as a caller sees them."""
        return f"({', '.join(one.shown() for one in self.parameters)})"


class Call:
    """The state of one call.

    Attributes:
        context: the translator; its parts are attributes of the call, too.
        builder, node: of the translator, and the syntax of the call.
        name: of the builtin.
        given: (binding, syntax) by the name of the parameter; a list of them for a variadic one.
        values: converted arguments so far, by the name of the parameter.
        letters: types, extents and shapes that letters of the signature stand for.
        overload: the overload that was chosen.
    """

    __slots__ = ("builder", "context", "given", "letters", "name", "node", "overload", "values")

    def __init__(self, context, name, node, overload, given):
        self.context, self.builder = context, context.builder
        self.name, self.node, self.overload, self.given = name, node, overload, given
        self.letters, self.values = {}, {}

    def __getattr__(self, part):
        return getattr(self.context, part)

    # Functions that calls in records use.

    def make(self, operation, *operands, **options):
        """The result of `warp.tile_<operation>`; None of one that only writes."""
        self.context.at(self.node)
        results = self.context.session.tiles.make(operation, list(operands), **options)
        return results[0] if results else None

    def builtin(self, name, *operands):
        """The result of a builtin of the registry."""
        return self.context.calls.apply_builtin(name, list(operands), self.node)

    def argument(self, name):
        """An argument as (binding, syntax)."""
        return self.given[name]

    def fits(self, inner, outer) -> bool:
        """True if a shape is within another one."""
        return all(a <= b for a, b in zip(inner, outer, strict=True))

    def seen(self, name, kind, shape, axes=()):
        """A view of the tile that is the argument of a name."""
        tile, given = self.values[name], self.given[name]
        return self.context.tiles.views.seen(tile, given, self.node, kind, shape, axes)

    def constant(self, native, number):
        self.context.at(self.node)
        return self.builder.constant(native, number)

    def zero(self, native):
        self.context.at(self.node)
        return self.builder.zero(native)

    # Errors, at the argument that they are about.

    def place(self, name):
        """The syntax of an argument; that of the call if it was not given."""
        given = self.given.get(name)
        return given[1] if type(given) is tuple else self.node

    def error(self, parameter, kind, message, hint=None, **coded):
        """An error about the `type` or the `value` of an argument."""
        make = self.context.type_error if kind == "type" else self.context.value_error
        text = f"{self.name}() {message}"
        return make(self.place(parameter.name), text, hint, **coded)

    def unexpected(self, parameter, noun, found, hint=None, kind="type", **coded):
        """The error for an argument, a type or binding, that is not what a noun says."""
        shown = self.context.type_name(found)
        message = f"expects {noun} as '{parameter.name}', but got '{shown}'"
        return self.error(parameter, kind, message, hint, **coded)


class Update:
    """A new value of an `inout` argument that updates elements of a tile: `kind` says how."""

    __slots__ = ("kind", "value")

    def __init__(self, value, kind):
        self.value, self.kind = value, kind


class Binder(Part):
    """Translates calls of builtins whose records have a call."""

    def call(self, name, node):
        """The result of a call; updates the variables that its `inout` arguments name."""
        overloads = _RESOLVED.get(name)
        if overloads is None:
            overloads = _RESOLVED[name] = [Overload(*one) for one in CALLS[name]]
        positional, keywords = self.arguments(node)
        overload, given, problem = _chosen(overloads, positional, keywords)
        if problem is not None:
            raise self.wrong_arguments(name, overload, problem, positional, keywords, node)
        call = Call(self.context, name, node, overload, given)
        values = [one.value(call) for one in overload.parameters]
        letters = [call.letters.get(letter) for letter in overload.letters]
        for condition, message, is_type, hint, peer in overload.requirements:
            if not condition(call, *values, *letters):
                error = self.context.type_error if is_type else self.context.value_error
                text = f"{name}() {message(call, *values, *letters)}"
                code = "requirement" if peer else None
                raise error(node, text, hint, code=code, facts={"sentence": peer})
        self.context.at(node)
        result = overload.expand(call, *values, *letters)
        if overload.updated:
            result = self.write_back(call, result)
        if name in _WITHOUT_GRADIENT and config.peer_tile_gradients:
            return self.context.tiles.elements.constant(result, node)
        return result

    def write_back(self, call, result):
        """Gives what `inout` arguments name the values that follow the result."""
        updated = call.overload.updated
        updates = result if len(updated) > 1 or call.overload.has_result else (result,)
        if call.overload.has_result:
            result, *updates = updates
        else:
            result = None
        for parameter, update in zip(updated, updates, strict=True):
            place = call.place(parameter.name)
            if parameter.type == "stack":
                call.tiles.stacks.write(place, update, call.node)
            elif type(update) is Update:
                slot = self.context.slots.changed(place)
                self.context.slots.write(slot, update.value, call.node, update.kind)
            else:
                self.context.slots.write_back(place, update, call.node)
        return result

    def arguments(self, node):
        """Positional arguments as (binding, syntax), and those by name."""
        expr = self.context.expressions.expr
        positional = []
        for argument in node.args:
            if isinstance(argument, ast.Starred):
                spread = self.context.spreads.spread(argument)
                positional += [(binding, argument) for binding in spread]
            else:
                positional.append((expr(argument), argument))
        keywords = {}
        for keyword in node.keywords:
            if keyword.arg is None:
                raise self.context.unsupported(keyword.value, "`**` in a call")
            keywords[keyword.arg] = (expr(keyword.value), keyword.value)
        return positional, keywords

    def wrong_arguments(self, name, overload, problem, positional, keywords, node):
        """The error for an argument that has no parameter, or a parameter without an argument."""
        kind, which = problem
        error = self.context.type_error
        shown = f"the parameters are {overload.shown()}"
        if kind == "missing":
            return error(
                node, f"{name}() expects the argument '{which}'", shown,
                code="argument-missing", facts={"name": name, "which": which},
            )  # fmt: skip
        if kind == "twice":
            return error(keywords[which][1], f"{name}() got '{which}' by position and by name")
        if kind == "unknown":
            hint = names.proposal(which, overload.by_name) or shown
            return error(keywords[which][1], f"{name}() has no parameter '{which}'", hint)
        most = len(overload.order)
        return error(
            positional[most][1] if most < len(positional) else node,
            f"{name}() expects {f'at most {most}' if most else 'no'} "
            f"argument{'s' if most != 1 else ''} by position, but got {len(positional)}",
            shown if overload.parameters else None,
        )


def _chosen(overloads, positional, keywords):
    """The overload that arguments fit, or the one to report errors about; then as `_bound`."""
    found = {}
    for overload in overloads:
        given, problem = _bound(overload, positional, keywords)
        if problem is None and (
            len(overloads) == 1
            or all(one.accepts(given[one.name][0]) for one in overload.order if one.name in given)
        ):
            return overload, given, None
        found.setdefault(problem and problem[0], (overload, given, problem))
    return found.get(None) or found.get("missing") or (overload, given, problem)


def _bound(overload, positional, keywords):
    """Arguments by the names of parameters, and (kind, name) of the first problem, or None."""
    given = dict(zip(overload.names, positional, strict=False))
    count, variadic = len(positional), overload.variadic
    # Parameters without a default come first.
    if not keywords and variadic is None and overload.least <= count <= len(overload.names):
        return given, None
    rest = positional[len(overload.names) :]
    if variadic is not None:
        by_name = overload.by_name
        others = []
        if variadic.takes_names:
            others = [keywords[name] for name in sorted(set(keywords) - set(by_name))]
            keywords = {name: given for name, given in keywords.items() if name in by_name}
        following = [one for one in overload.following if one.name not in keywords]
        count = variadic.count(given, rest, following)
        taken, behind = rest[:count], rest[count:]
        if len(behind) > len(following):
            return given, ("many", None)
        given.update(zip([one.name for one in following], behind, strict=False))
        given[variadic.name] = [*taken, *others]
    elif rest:
        return given, ("many", None)
    for name, binding in keywords.items():
        if name not in overload.by_name:
            return given, ("unknown", name)
        if name in given:
            return given, ("twice", name)
        given[name] = binding
    for parameter in overload.parameters:
        if parameter.default is ... and parameter.name not in given and parameter.kind != "*":
            return given, ("missing", parameter.name)
    return given, None
