"""Branches: nodes of a plan to structured operations whose results are what the sides assign.

A branch is translated with a copy of the environment; names that end up bound differently and are
read later become results of the operation. A name that one side leaves unassigned has its old value
there: that of the enclosing loop's last iteration, or zero.
"""

from __future__ import annotations

from warp._src import errors
from warp._src.frontend.bindings import LocalArray, TileStack, TileView, Value
from warp._src.frontend.context import Part, is_constant
from warp._src.frontend.control import RESULT, RETURNED, Flag, If, Loop, Return, Simple

_MISSING = object()


class Branches(Part):
    """Translates `if` nodes, and expressions that evaluate one of two sides."""

    def block(self, nodes):
        for node in nodes:
            kind = type(node)
            if kind is Simple:
                self.context.statements.statement(node.syntax)
            elif kind is If:
                self.keep_views(node)
                self.branch(node)
            elif kind is Loop:
                self.keep_views(node)
                self.context.loops.loop(node)
            elif kind is Flag:
                self.context.env[node.name] = node.value
            elif kind is Return:
                self.context.statements.return_statement(node.syntax)

    def keep_views(self, node):
        """Views stay with the tile that they are of, whichever path gives the variable another."""
        if any(type(binding) is TileView for binding in self.context.env.values()):
            self.context.tiles.views.keep_all(node.fresh)

    # Branches.

    def branch(self, node: If):
        if node.flags:
            condition = self.none_set(node.flags, node.syntax)
        else:
            test = node.syntax.test
            condition = self.context.expressions.truth(self.context.expressions.expr(test), test)
        if type(condition) is bool:
            self.block(node.then if condition else node.orelse)
            return
        self.context.at(node.syntax)
        self.builder.begin_if(condition)
        before = self.context.env
        lines = self.context.lines
        self.context.env, self.context.lines = dict(before), dict(lines)
        self.block(node.then)
        for name in sorted(node.defs & node.live & self.context.env.keys()):
            self.context.env[name] = self.settled(self.context.env[name], node.syntax)
        then, then_lines = self.context.env, self.context.lines
        self.builder.begin_else()
        self.context.env, self.context.lines = dict(before), dict(lines)
        self.block(node.orelse)
        orelse, else_lines = self.context.env, self.context.lines
        changed = [
            name
            for name in {**then, **orelse}
            if name in node.live and then.get(name, _MISSING) is not orelse.get(name, _MISSING)
        ]
        self.context.env = before
        self.context.lines = {**then_lines, **else_lines}
        lines = (then_lines, else_lines)
        self.mark_returns(node)
        self.merge(node.syntax, changed, then, orelse, lines)
        for name in node.live:
            if name not in changed and name in then:
                before[name] = then[name]

    def settled(self, binding, syntax):
        """A binding whose constants are values that are made here, not where branches meet."""
        if type(binding) is tuple:
            return tuple([self.settled(part, syntax) for part in binding])
        return self.context.materialize(binding, syntax) if is_constant(binding) else binding

    def mark_returns(self, node):
        """Notes for kernels with tiles what threads do that have not returned."""
        if self.context.session.tile_builder is None or not self.context.is_kernel:
            return
        if self.returns(node.then):
            self.context.session.tile_builder.mark_stays(True)
        elif set(node.flags) == {RETURNED} or self.returns(node.orelse):
            self.context.session.tile_builder.mark_stays(False)

    @staticmethod
    def returns(nodes):
        """True if that is the last of the steps."""
        return bool(nodes) and type(nodes[-1]) is Flag and nodes[-1].name == RETURNED

    def none_set(self, flags, syntax):
        """True if no flag is set."""
        condition = True
        for flag in flags:
            value = self.context.env.get(flag, False)
            if type(value) is bool:
                if value:
                    return False
                continue
            known = value.constant()
            if known is not None:
                if known:
                    return False
                continue
            self.context.at(syntax)
            clear = self.builder.builtin("unot", [value])[0][0]
            if condition is True:
                condition = clear
            else:
                condition = self.builder.builtin("bit_and", [condition, clear])[0][0]
        return condition

    def merge(self, syntax, changed, then, orelse, lines):
        """Closes an `if` and binds the names that differ over its branches."""
        then_values, else_values, shapes = [], [], []
        for name in changed:
            left, right = then.get(name, _MISSING), orelse.get(name, _MISSING)
            if left is _MISSING or right is _MISSING:
                known = right if left is _MISSING else left
                other = self.before_assignment(name, known, syntax)
                left, right = (other, known) if left is _MISSING else (known, other)
                if left is right:
                    # The branch saw the loop's value that was just introduced.
                    self.context.env[name] = left
            if self.same_constant(left, right):
                self.context.env[name] = left
                shapes.append(_MISSING)
                continue
            shapes.append(self.pair(name, left, right, syntax, lines, then_values, else_values))
        self.context.at(syntax)
        results = iter(self.builder.end_if(then_values, else_values))
        for name, shape in zip(changed, shapes, strict=False):
            if shape is not _MISSING:
                self.context.env[name] = self.context.unflatten(shape, results)

    @staticmethod
    def same_constant(left, right):
        kind = type(left)
        if kind is not type(right) or kind in (Value, tuple, LocalArray, TileStack):
            return False
        try:
            return bool(left == right)
        except Exception:
            return False

    def pair(self, name, left, right, syntax, lines, then_values, else_values):
        """Appends both sides of a name; gives their shape."""
        left_values, right_values = [], []
        try:
            shape = self.context.flatten(left, syntax, left_values)
            other = self.context.flatten(right, syntax, right_values)
        except errors.WarpCodegenTypeError:
            raise self.branches_differ(name, left, right, syntax, lines) from None
        types = [value.type for value in left_values]
        if shape != other or types != [value.type for value in right_values]:
            raise self.branches_differ(name, left, right, syntax, lines)
        then_values += left_values
        else_values += right_values
        return shape

    def branches_differ(self, name, left, right, syntax, lines):
        left_type, right_type = self.context.type_name(left), self.context.type_name(right)
        if name == RESULT:
            return self.context.type_error(
                syntax,
                f"'{self.context.source.name}' returns '{left_type}' in one branch "
                f"and '{right_type}' in the other",
                notes=self.return_notes(),
            )
        places = [
            f"'{name}' is '{kind}' at line {side[name]}"
            for side, kind in zip(lines, (left_type, right_type), strict=False)
            if name in side
        ]
        return self.context.type_error(
            syntax,
            f"'{name}' is '{left_type}' in one branch and '{right_type}' in the other",
            self.conversion_hint(left_type, right_type),
            notes=places,
        )

    def return_notes(self):
        return [f"returns '{shown}' at line {line}" for line, shown in self.context.returned]

    @staticmethod
    def conversion_hint(left, right):
        both = {left, right}
        if both == {"int32", "float32"}:
            return "use `float(...)` for the integer"
        return None

    def branch_value(self, node, condition, then, orelse):
        """Value of one of two expressions, of which only one is evaluated."""
        before = self.context.env
        self.context.at(node)
        self.builder.begin_if(condition)
        self.context.env = dict(before)
        left = then()
        left_values = []
        left_shape = self.context.flatten(left, node, left_values)
        left_env = self.context.env
        self.context.at(node)
        self.builder.begin_else()
        self.context.env = dict(before)
        right = orelse()
        right_values = []
        right_shape = self.context.flatten(right, node, right_values)
        right_env = self.context.env
        self.context.env = before
        if left_shape != right_shape or [v.type for v in left_values] != [
            v.type for v in right_values
        ]:
            raise self.context.expressions.branch_types_differ(node, left, right)
        # Builtins that update a variable may have done so on one side.
        changed = [name for name in before if left_env[name] is not right_env[name]]
        for name in changed:
            left_values.append(self.context.materialize(left_env[name], node))
            right_values.append(self.context.materialize(right_env[name], node))
        self.context.at(node)
        results = iter(self.builder.end_if(left_values, right_values))
        binding = self.context.unflatten(left_shape, results)
        for name in changed:
            before[name] = next(results)
        return binding

    def before_assignment(self, name, known, syntax):
        """Value of a name on a path that has not assigned it: the loop's, or zero."""
        values = []
        shape = self.context.flatten(known, syntax, values)
        self.context.at(syntax)
        olds = None
        for frame in self.context.frames:
            # A branch within this one may have asked before.
            known = [heads for promoted, _, heads in frame.promoted if promoted == name]
            if known:
                olds = known[0]
                continue
            if olds is None:
                olds = [self.builder.zero(value.type) for value in values]
            if name in frame.pending:
                olds = [self.builder.carry(frame.level, old) for old in olds]
                frame.pending.discard(name)
                frame.promoted.append((name, shape, olds))
        if olds is None:
            olds = [self.builder.zero(value.type) for value in values]
        return self.context.unflatten(shape, iter(olds))
