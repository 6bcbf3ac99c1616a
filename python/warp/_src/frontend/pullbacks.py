"""`@wp.func_grad` functions: parameters, and what `wp.adjoint[x]` stands for.

Each scalar or composite that a parameter holds (itself, or a field of it) gets a hidden local that
starts at zero, so that updates in branches and loops are carried like those of any variable; each
array gets the array of its gradients. `wp.adjoint[x.vec][0]` is rewritten to component 0 of the
hidden local of `x.vec`. Hidden names contain a space and cannot clash with the user's.
"""

from __future__ import annotations

import ast
import copy

from warp._src import errors
from warp._src.frontend.functions import Overload, overload_of
from warp._src.frontend.source import Source


def leaves(native, path) -> list:
    """(path, type) of a value or, of a struct, its innermost fields."""
    if native.kind != "struct":
        return [(path, native)]
    return [leaf for name, field in native.fields for leaf in leaves(field, f"{path}.{name}")]


def hidden_name(path) -> str:
    return f"adjoint of {path}"


class PullbackOverload(Overload):
    """A `@wp.func_grad` function of a function with these parameters.

    hidden: (name, path, type) of each leaf of the function's parameters.
    """

    def __init__(self, function, count, natives):
        super().__init__(function)
        self.result = None
        self.count = count
        parameters = [parameter.name for parameter in self.parameters[:count]]
        found = [
            leaf
            for name, native in zip(parameters, natives, strict=True)
            if native is not None
            for leaf in leaves(native, name)
        ]
        self.hidden = [(hidden_name(path), path, native) for path, native in found]
        original = self.source
        rewriter = _AdjointNames(original, parameters, {path for path, _ in found})
        tree = rewriter.visit(copy.deepcopy(original.tree))
        self.source = Source(tree, original.file, original.line_offset, original.name)


class _AdjointNames(ast.NodeTransformer):
    """Replaces `wp.adjoint[...]` by hidden names."""

    def __init__(self, source, parameters, paths):
        self.source = source
        self.parameters = parameters
        self.paths = paths

    def visit_Subscript(self, node):
        replaced = self.replace(node)
        if replaced is node and _is_adjoint(node.value):
            return self.within(node.slice, node.ctx)
        return self.generic_visit(node) if replaced is node else replaced

    def visit_Attribute(self, node):
        replaced = self.replace(node)
        return self.generic_visit(node) if replaced is node else replaced

    def replace(self, node):
        """The hidden name, if the node stands for a whole leaf."""
        path = self.path_of(node)
        if path not in self.paths:
            return node
        return ast.copy_location(ast.Name(hidden_name(path), node.ctx), node)

    def path_of(self, node):
        """The path of `wp.adjoint[path]` and of fields that follow it."""
        if isinstance(node, ast.Subscript) and _is_adjoint(node.value):
            return self.path(node.slice)
        if isinstance(node, ast.Attribute):
            base = self.path_of(node.value)
            return f"{base}.{node.attr}" if base and base not in self.paths else None
        return None

    def path(self, node):
        """The path that a name and fields of it make; None for other expressions."""
        if isinstance(node, ast.Name):
            return node.id
        if isinstance(node, ast.Attribute):
            base = self.path(node.value)
            return f"{base}.{node.attr}" if base and base not in self.paths else None
        return None

    def within(self, node, context):
        """`wp.adjoint[x[i]]`: the part of the adjoint that the expression is of `x`."""
        path = self.path(node)
        if path in self.paths:
            return ast.copy_location(ast.Name(hidden_name(path), context), node)
        if isinstance(node, (ast.Attribute, ast.Subscript)):
            part = copy.copy(node)
            part.value = self.within(node.value, ast.Load())
            part.ctx = context
            return part
        raise errors.WarpCodegenKeyError(
            f"`wp.adjoint` expects a parameter of the function that '{self.source.name}' is the "
            f"derivative of, but got '{ast.unparse(node)}'",
            hint=f"there are: {', '.join(self.parameters)}",
            **self.source.place(node),
        )


def _is_adjoint(node) -> bool:
    name = getattr(node, "attr", None) or getattr(node, "id", None)
    return name == "adjoint"


def pullback_of(function, overload, natives) -> PullbackOverload:
    """A `@wp.func_grad` function for an overload, made once per types of the parameters."""
    made = function.__dict__.setdefault("_warp_pullbacks", {})
    key = (overload, *natives)
    if key not in made:
        made[key] = PullbackOverload(function, len(overload.parameters), natives)
    return made[key]


def check_parameters(forward_fn, function, name) -> None:
    """Rejects a derivative whose parameters cannot be those of any overload."""
    given = overload_of(function)
    exact = name == "func_replay"
    for candidate in map(overload_of, forward_fn.overloads):
        count = len(candidate.parameters)
        fits = len(given.parameters) == count if exact else len(given.parameters) >= count
        pairs = zip(given.parameters, candidate.parameters, strict=False)
        if fits and all(a.native == b.native or None in (a.native, b.native) for a, b in pairs):
            return
    raise mismatch(forward_fn, given, name, [])


def mismatch(forward_fn, given, name, results):
    """The error for a derivative with parameters that do not fit."""
    expected = [
        expected_signature(candidate, given.function.__name__, results, name)
        for candidate in map(overload_of, forward_fn.overloads)
    ]
    shown = expected[0] if len(expected) == 1 else "one of " + ", ".join(expected)
    return errors.WarpCodegenTypeError(
        f"'{given.function.__name__}' does not fit '{forward_fn.key}': expects '{shown}', "
        f"but got '{given.declaration(given.function.__name__)}'",
        hint=None if name == "func_replay" else "cotangents of the results come last",
        **given.source.place(given.source.tree),
    )


def expected_signature(overload, key, results, name) -> str:
    parts = list(map(str, overload.parameters))
    if name == "func_grad":
        known = results or overload.result
        if known is None:
            parts.append("cotangents of the results")
        else:
            parts += [
                f"adj_ret{i if len(known) > 1 else ''}: "
                f"{native.python_name if native is not None else 'Any'}"
                for i, native in enumerate(known)
            ]
    return f"{key}({', '.join(parts)})"
