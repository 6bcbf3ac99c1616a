"""Control flow made structured, and which names it carries.

The dialect has `if`, `for` and `while` with carried values, and no jumps. This file rewrites the
statements of a function, once per code object and without knowing any type:

* `break`, `continue` and `return` become assignments to hidden flags, and the result of the
  function becomes a hidden variable. Where one branch of an `if` always leaves, the rest of the
  statements moves into the other branch, so that no flag is needed; else the flags guard the rest.
* Each node learns which names are live after it, so that branches and loops carry just those.

Hidden names contain a space and cannot clash with the user's.
"""

from __future__ import annotations

import ast

from warp._src.kernels.texts import children

RESULT = "return value"
RETURNED = "return taken"


class Node:
    """A step of a function. `syntax` is the statement it comes from.

    gen: names read before they are assigned. kill: names assigned on every path. defs: names
    assigned on some path. fresh: those of them that get another value, not `x += ...`. parts: names
    of which a component may be assigned. live: names read afterwards.
    """

    __slots__ = ("defs", "fresh", "gen", "kill", "live", "parts", "syntax")

    def __init__(self, syntax):
        self.syntax = syntax
        self.gen = self.kill = self.defs = self.fresh = self.parts = self.live = frozenset()


class Simple(Node):
    """A statement without control flow."""

    __slots__ = ()


class Return(Node):
    __slots__ = ()


class Flag(Node):
    """Assignment of a hidden flag."""

    __slots__ = ("name", "value")

    def __init__(self, syntax, name, value):
        super().__init__(syntax)
        self.name = name
        self.value = value
        self.kill = self.defs = self.fresh = frozenset((name,))


class If(Node):
    """A branch on an expression, or, if `flags` is set, on none of the flags being set."""

    __slots__ = ("flags", "orelse", "then")

    def __init__(self, syntax, then, orelse, flags=()):
        super().__init__(syntax)
        self.then = then
        self.orelse = orelse
        self.flags = flags


class Loop(Node):
    """A `for` or `while`; `exits` are the flags that end it early."""

    __slots__ = ("body", "exits", "head")

    def __init__(self, syntax, body, exits):
        super().__init__(syntax)
        self.body = body
        self.exits = exits
        self.head = frozenset()


class Plan:
    """The rewritten body of a function.

    changed_names: names of which a component or field may be assigned somewhere. updated: the
    arguments that calls update.
    """

    __slots__ = (
        *("always_returns", "body", "changed_names", "local_names"),
        *("returns_value", "updated"),
    )


def plan_of(source, updated_arguments, outputs=()) -> Plan:
    """The plan of a function's source, made once.

    `updated_arguments(call)` gives the arguments that a call updates; `outputs` are names that are
    read when the function has ended.
    """
    if source.plan is None:
        body = source.tree.body
        rewriter = _Rewriter()
        plan = Plan()
        plan.always_returns = rewriter.leaves(body)[1]
        plan.returns_value = _returns_value(body)
        plan.body = rewriter.block(body, 0)
        analysis = _Analysis(updated_arguments, source.words())
        _, _, plan.local_names, plan.changed_names, _ = analysis.gather(plan.body)
        plan.updated = analysis.updated
        needed = (RESULT,) if plan.returns_value else ()
        if plan.returns_value and not plan.always_returns:
            needed = (RESULT, RETURNED)
        analysis.liveness(plan.body, frozenset((*needed, *outputs)))
        source.plan = plan
    return source.plan


def _returns_value(statements) -> bool:
    for statement in statements:
        if isinstance(statement, ast.Return) and statement.value is not None:
            return True
        if isinstance(statement, (ast.If, ast.For, ast.While)) and _returns_value(
            statement.body + statement.orelse
        ):
            return True
    return False


class _Rewriter:
    """Statements to nodes."""

    def __init__(self):
        self._leaves = {}

    def leaves(self, statements) -> tuple[frozenset, bool]:
        """How statements may leave ("break", "continue", "return") and whether they always do."""
        may = frozenset()
        for statement in statements:
            kinds, always = self._leaves_one(statement)
            may |= kinds
            if always:
                return may, True
        return may, False

    def _leaves_one(self, statement):
        kind = type(statement)
        if kind is ast.Return:
            return frozenset(("return",)), True
        if kind is ast.Break:
            return frozenset(("break",)), True
        if kind is ast.Continue:
            return frozenset(("continue",)), True
        if kind not in (ast.If, ast.For, ast.While):
            return frozenset(), False
        found = self._leaves.get(id(statement))
        if found is None:
            found = self._leaves[id(statement)] = self._leaves_compound(statement, kind)
        return found

    def _leaves_compound(self, statement, kind):
        body, always = self.leaves(statement.body)
        if kind is ast.If:
            orelse, orelse_always = self.leaves(statement.orelse)
            return body | orelse, always and orelse_always
        endless = (
            kind is ast.While
            and isinstance(statement.test, ast.Constant)
            and bool(statement.test.value)
            and "break" not in body
        )
        return body & {"return"}, endless and "return" in body

    def block(self, statements, depth) -> list[Node]:
        nodes = []
        for index, statement in enumerate(statements):
            kind = type(statement)
            rest = statements[index + 1 :]
            if kind is ast.Return:
                nodes.append(Return(statement))
                nodes.append(Flag(statement, RETURNED, True))
                break
            if kind in (ast.Break, ast.Continue):
                nodes.append(Flag(statement, _flag(kind.__name__.lower(), depth), True))
                break
            if kind is ast.If:
                if self._branch(statement, rest, depth, nodes):
                    break
            elif kind in (ast.For, ast.While):
                self._loop(statement, depth, nodes)
                may, always = self._leaves_one(statement)
                if always:
                    break
                if may and rest:
                    nodes.append(self._guard(statement, may, rest, depth))
                    break
            else:
                nodes.append(Simple(statement))
        return nodes

    def _branch(self, statement, rest, depth, nodes) -> bool:
        """Appends an `if`; true if it took the rest of the statements."""
        then_may, then_always = self.leaves(statement.body)
        else_may, else_always = self.leaves(statement.orelse)
        then, orelse = statement.body, statement.orelse
        if then_always and not else_always:
            orelse = orelse + rest
        elif else_always and not then_always:
            then = then + rest
        nodes.append(If(statement, self.block(then, depth), self.block(orelse, depth)))
        if then_always or else_always:
            return True
        may = then_may | else_may
        if may and rest:
            nodes.append(self._guard(statement, may, rest, depth))
            return True
        return False

    def _guard(self, statement, kinds, rest, depth):
        flags = tuple(_flag(kind, depth) for kind in sorted(kinds))
        return If(statement, self.block(rest, depth), [], flags)

    def _loop(self, statement, depth, nodes):
        may, _ = self.leaves(statement.body)
        body = self.block(statement.body, depth + 1)
        if "continue" in may:
            body.insert(0, Flag(statement, _flag("continue", depth + 1), False))
        exits = []
        if "break" in may:
            exits.append(_flag("break", depth + 1))
            nodes.append(Flag(statement, exits[0], False))
        if "return" in may:
            exits.append(RETURNED)
        nodes.append(Loop(statement, body, tuple(exits)))


def _flag(kind, depth):
    return RETURNED if kind == "return" else f"{kind} {depth}"


class _Analysis:
    """Fills in the name sets of nodes."""

    def __init__(self, updated_arguments, words):
        self.updated_arguments = updated_arguments
        self.updated = set()
        # Names of what may be a view of a tile, with the names that the tile may have.
        self.views = {}
        self.may_have_tiles = any("tile" in word or word == "Any" for word in words)

    def gather(self, nodes) -> tuple[frozenset, ...]:
        """gen, kill, defs, parts and fresh of a list, children first."""
        gen, kill, defs, parts, fresh = set(), set(), set(), set(), set()
        for node in nodes:
            self._gather_one(node)
            gen |= node.gen - kill
            kill |= node.kill
            defs |= node.defs
            parts |= node.parts
            fresh |= node.fresh
        return tuple(map(frozenset, (gen, kill, defs, parts, fresh)))

    def _gather_one(self, node):
        kind = type(node)
        if kind is Simple or kind is Return:
            uses, defs, parts = set(), set(), set()
            self._scan(node.syntax, uses, defs, parts)
            if kind is Return:
                defs.add(RESULT)
            node.gen = frozenset(uses)
            node.kill = node.defs = frozenset(defs)
            if not isinstance(node.syntax, ast.AugAssign):
                node.fresh = node.defs
            node.parts = frozenset(parts)
        elif kind is If:
            uses, defs, parts = set(node.flags), set(), set()
            if not node.flags:
                self._scan(node.syntax.test, uses, defs, parts)
            then, orelse = self.gather(node.then), self.gather(node.orelse)
            node.gen = then[0] | orelse[0] | uses
            node.kill = then[1] & orelse[1]
            node.defs = then[2] | orelse[2]
            node.parts = then[3] | orelse[3] | parts
            node.fresh = then[4] | orelse[4]
        elif kind is Loop:
            self._gather_loop(node)

    def _gather_loop(self, node):
        syntax = node.syntax
        uses, defs, parts = set(node.exits), set(), set()
        body = self.gather(node.body)
        targets = set()
        if isinstance(syntax, ast.For):
            self._scan(syntax.iter, uses, defs, parts)
            self._scan(syntax.target, uses, targets, parts)
        else:
            self._scan(syntax.test, uses, defs, parts)
        node.gen = frozenset(uses | (body[0] - targets))
        node.defs = body[2] | targets
        node.parts = body[3] | parts
        node.fresh = body[4] | targets

    def liveness(self, nodes, live):
        for node in reversed(nodes):
            node.live = live
            if type(node) is If:
                self.liveness(node.then, live)
                self.liveness(node.orelse, live)
            elif type(node) is Loop:
                node.head = live | node.gen
                self.liveness(node.body, node.head)
            live = (live - node.kill) | node.gen

    def _scan(self, node, uses, defs, parts):
        """Names an expression or statement reads, assigns, or assigns a part of."""
        pending = [node]
        while pending:
            node = pending.pop()
            kind = type(node)
            if kind is ast.Constant:
                continue
            if kind is ast.Name:
                if type(node.ctx) is ast.Load:
                    uses.add(node.id)
                    if self.views:
                        self._add_viewed(node, uses)
                else:
                    defs.add(node.id)
                continue
            if kind is ast.Attribute or kind is ast.Subscript:
                if type(node.ctx) is ast.Store:
                    _add_base(node, parts)
                    self._add_viewed(node, parts)
                pending.append(node.value)
                if kind is ast.Subscript:
                    pending.append(node.slice)
                continue
            # The order of parts does not matter: views are noted by statements alone.
            if kind is ast.BinOp:
                pending += (node.left, node.right)
                continue
            if kind is ast.Compare:
                pending.append(node.left)
                pending += node.comparators
                continue
            if kind is ast.AugAssign:
                _add_base(node.target, uses)
                self._add_viewed(node.target, uses)
                self._add_viewed(node.target, parts)
            elif kind is ast.Call:
                for argument in self.updated_arguments(node):
                    _add_base(argument, parts)
                    self.updated.add(argument)
                    self._add_viewed(argument, parts)
                pending.append(node.func)
                pending += node.args
                pending += [keyword.value for keyword in node.keywords]
                continue
            elif kind is ast.Assign:
                self._note_view(node)
                pending += node.targets
                pending.append(node.value)
                continue
            pending += children(node)

    def _note_view(self, node):
        """Remembers that `view = tile[i]` or `view = wp.tile_view(tile, ...)`."""
        target, value = node.targets[0], node.value
        is_view = isinstance(target, ast.Name) and isinstance(value, (*_VIEWS, ast.Name))
        if not is_view or not self.may_have_tiles:
            return
        base = set()
        _add_base(value, base)
        self.views.setdefault(target.id, set()).update(base)

    def _add_viewed(self, argument, names):
        """A use or a change of a view is one of its tile."""
        if not self.views:
            return
        found, seen = set(), set()
        _add_base(argument, found)
        while found:
            name = found.pop()
            new = self.views.get(name, set()) - seen
            seen |= new
            found |= new
        names |= seen


def name_of(function):
    """The last name in what a call calls."""
    return getattr(function, "attr", None) or getattr(function, "id", None) or ""


# Calls that give a view of their first argument, and what is written like one.
_VIEW_CALLS = {"tile_view", "tile_transpose", "tile_reshape", "tile_squeeze", "tile_broadcast"}
_VIEWS = (ast.Attribute, ast.Subscript, ast.Call)


def _add_base(node, names):
    while isinstance(node, _VIEWS):
        if not isinstance(node, ast.Call):
            node = node.value
        elif name_of(node.func) in _VIEW_CALLS and (node.args or node.keywords):
            node = node.args[0] if node.args else node.keywords[0].value
        else:
            return
    if isinstance(node, ast.Name):
        names.add(node.id)
