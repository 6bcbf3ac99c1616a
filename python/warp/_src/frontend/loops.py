"""Loops: `for` over a range and `while`, with the values they carry.

A loop gets the current values of the names that its body assigns and that are read later. A name
that has no value yet when the loop begins is *pending*: at the first place inside where its old
value matters (a branch that assigns it on one side only) its type is known, and it becomes a
carried value that starts at zero. If there is no such place it leaves the loop as a late value.

A `for` with `break` or `return` inside becomes a loop that counts trips and tests the exit flags.
"""

from __future__ import annotations

import ast

from warp._src import errors
from warp._src.frontend.bindings import INT32, LocalArray, TileStack, TileView, Value
from warp._src.frontend.context import Part
from warp._src.frontend.control import If, Loop
from warp._src.kernels import texts

_MISSING = object()


class LoopFrame:
    """A loop being translated.

    names, shapes, inits: names carried from the start, how they are built from values, the values.
    pending: names without a value yet. promoted: (name, shape, values at the start of the body).
    level: position among the builder's open loops. before, lines: what held when it began.
    """

    __slots__ = (
        "before", "inits", "level", "lines", "names", "node", "pending", "promoted", "shapes"
    )  # fmt: skip

    def __init__(self, node, before, lines):
        self.node = node
        self.before = before
        self.lines = lines
        self.level = -1
        self.promoted = []
        self.inits = []


class Loops(Part):
    """Translates `for` and `while` nodes."""

    # Loops around the place that are repeated for static expressions.
    unrolled = 0

    def loop(self, node: Loop):
        syntax = node.syntax
        is_for = isinstance(syntax, ast.For)
        if syntax.orelse:
            word = "for" if is_for else "while"
            raise self.context.unsupported(
                syntax.orelse[0], f"the `else` of a `{word}` loop", "set a flag before `break`"
            )
        if not is_for:
            self.while_loop(node)
            return
        query = self.context.geometry.query_of(syntax.iter)
        if query is not None:
            self.context.geometry.query_loop(node, *query)
            return
        bounds = self.range_bounds(syntax.iter)
        self.free_targets(syntax.target)
        if all(type(bound) is int for bound in bounds):
            static = range(*bounds)
            if not static:
                return
            few = len(static) <= self.context.session.max_unroll
            if self.varies_static(syntax) or (few and self.indexes_tuples(syntax)):
                self.unroll(node, static)
                return
        if node.exits:
            self.for_with_exits(node, bounds)
            return
        self.counted_for(node, bounds)
        if self.unrolled and all(type(bound) is int for bound in bounds):
            self.keep_last(syntax, range(*bounds))

    def keep_last(self, syntax, static):
        """Makes the counter a constant after its loop: a static expression may use it."""
        stored = {
            item.id
            for statement in syntax.body
            for item in texts.walk(statement)
            if isinstance(item, ast.Name) and not isinstance(item.ctx, ast.Load)
        }
        if isinstance(syntax.target, ast.Name) and syntax.target.id not in stored:
            self.context.env[syntax.target.id] = static[-1]

    def free_targets(self, target):
        """Lets a loop count with a name that something else than an integer had so far."""
        for name in self.target_names(target):
            old = self.context.static_type(self.context.env.get(name, 0))
            if old is None or old.kind != "int":
                del self.context.env[name]

    # Carried values.

    def open_frame(self, node: Loop, targets=frozenset()) -> LoopFrame:
        frame = LoopFrame(node, self.context.env, dict(self.context.lines))
        frame.names, frame.pending = self.carried(node, targets)
        frame.shapes = [
            self.context.flatten(self.context.env[name], node.syntax, frame.inits)
            for name in frame.names
        ]
        return frame

    def carried(self, node: Loop, targets):
        """Names carried around a loop: with a value already, and pending."""
        known, pending = [], set()
        for name in sorted((node.defs | node.parts) & node.head):
            binding = self.context.env.get(name, _MISSING)
            if binding is _MISSING:
                if name in node.defs:
                    pending.add(name)
            elif name in targets and name not in node.live:
                continue
            elif type(binding) is TileView and name not in node.fresh:
                # Its variable is carried, and the place in it stays.
                continue
            elif name in node.defs or self.may_change_part(binding):
                known.append(name)
        return known, pending

    @staticmethod
    def may_change_part(binding):
        return type(binding) in (LocalArray, TileStack) or (
            type(binding) is Value and binding.type.kind != "array"
        )

    def bind(self, names, shapes, values):
        values = iter(values)
        for name, shape in zip(names, shapes, strict=False):
            self.context.env[name] = self.context.unflatten(shape, values)

    def head_scope(self, frame, heads):
        """Environment at the start of an iteration."""
        self.context.env = dict(frame.before)
        self.bind(frame.names, frame.shapes, heads)

    def body_scope(self, frame, heads):
        frame.level = self.builder.loop_depth - 1
        self.context.frames.append(frame)
        self.context.env = dict(self.context.env)
        self.bind(frame.names, frame.shapes, heads)

    def yields(self, frame):
        """Values of the carried names now, checked against those at the start."""
        values = []
        for name, shape in zip(frame.names, frame.shapes, strict=False):
            found = []
            same = self.context.flatten(self.context.env[name], frame.node.syntax, found) == shape
            expected = frame.inits[len(values) : len(values) + len(found)]
            self.check_type_kept(frame, name, shape, same, found, expected)
            values += found
        return values

    def check_type_kept(self, frame, name, shape, same, found, expected):
        if same and [v.type for v in found] == [v.type for v in expected]:
            return
        before = self.context.type_name(expected[0]) if shape is None else "tuple"
        after = self.context.type_name(self.context.env[name])
        notes = []
        if name in frame.lines:
            notes.append(f"'{name}' is '{before}' at line {frame.lines[name]}")
        if name in self.context.lines:
            notes.append(f"'{name}' is '{after}' at line {self.context.lines[name]}")
        raise self.context.type_error(
            frame.node.syntax,
            f"'{name}' is '{before}' before the loop and '{after}' after an iteration",
            self.context.branches.conversion_hint(before, after) or "keep one type in the loop",
            notes=notes,
        )

    def final_values(self, frame):
        """Values at the end of the body: carried, late; and the names and shapes of both."""
        node = frame.node
        for name in sorted(frame.pending):
            # An outer loop's old value is what remains if this loop makes no trip.
            if name in self.context.env and any(
                name in outer.pending for outer in self.context.frames[:-1]
            ):
                self.context.branches.before_assignment(name, self.context.env[name], node.syntax)
        values = self.yields(frame)
        names, shapes = list(frame.names), list(frame.shapes)
        for name, shape, heads in frame.promoted:
            found = []
            same = self.context.flatten(self.context.env[name], node.syntax, found) == shape
            self.check_type_kept(frame, name, shape, same, found, heads)
            values += found
            names.append(name)
            shapes.append(shape)
        late = []
        for name in sorted(frame.pending):
            if name in self.context.env and name in node.live:
                names.append(name)
                shapes.append(self.context.flatten(self.context.env[name], node.syntax, late))
        self.context.frames.pop()
        self.context.at(node.syntax)
        return values, late, names, shapes

    def leave(self, frame, names, shapes, results):
        self.context.env = frame.before
        self.bind(names, shapes, results)

    # for

    def counted_for(self, node: Loop, bounds):
        syntax = node.syntax
        low, high, step = self.common_bounds(bounds, syntax)
        frame = self.open_frame(node, self.target_names(syntax.target))
        self.context.at(syntax)
        counter, *heads = self.builder.begin_for(low, high, step, frame.inits)
        self.body_scope(frame, heads)
        self.context.targets.assign_target(syntax.target, counter, syntax.target)
        self.context.branches.block(node.body)
        values, late, names, shapes = self.final_values(frame)
        self.leave(frame, names, shapes, self.builder.end_for(values, late))

    def for_with_exits(self, node: Loop, bounds):
        """A loop with `break` or `return`: counts trips and tests the flags."""
        syntax, builder = node.syntax, self.builder
        low, high, step = self.common_bounds(bounds, syntax)
        frame = self.open_frame(node, self.target_names(syntax.target))
        self.context.at(syntax)
        trips = builder.trip_count(low, high, step)
        zero, one = builder.constant(trips.type, 0), builder.constant(trips.type, 1)
        trip, *heads = builder.begin_while([zero, *frame.inits])
        self.head_scope(frame, heads)
        more = builder.builtin("lt", [trip, trips])[0][0]
        clear = self.context.branches.none_set(node.exits, syntax)
        if clear is not True:
            more = builder.builtin("bit_and", [more, self.context.materialize(clear, syntax)])[0][0]
        trip, *heads = builder.while_condition(more, [trip, *heads])
        self.body_scope(frame, heads)
        offset = builder.cast(trip, low.type)
        if step.constant() != 1:
            offset = builder.builtin("mul", [offset, step])[0][0]
        counter = builder.builtin("add", [low, offset])[0][0]
        self.context.targets.assign_target(syntax.target, counter, syntax.target)
        self.context.branches.block(node.body)
        values, late, names, shapes = self.final_values(frame)
        following = builder.builtin("add", [trip, one])[0][0]
        results = builder.end_while([following, *values], late)
        self.leave(frame, names, shapes, results[1:])

    def unroll(self, node: Loop, static):
        """Repeats the body with the counter known at compile time."""
        guarded = If(node.syntax, node.body, [], node.exits)
        guarded.live = node.head
        self.unrolled += 1
        for position in static:
            self.context.targets.assign_target(node.syntax.target, position, node.syntax.target)
            if node.exits:
                self.context.branches.branch(guarded)
            else:
                self.context.branches.block(node.body)
        self.unrolled -= 1

    def indexes_tuples(self, syntax):
        """True if a body may need the counter at compile time as index of a tuple."""
        return any(
            isinstance(item, ast.Subscript) and self.is_tuple(item.value)
            for item in texts.walk(syntax)
        )

    def varies_static(self, syntax):
        """True if a `wp.static` in a body uses a name that the loop changes: the counter, or what
        is assigned, which have to be known at compile time then."""
        if "static" not in self.context.source.words():
            return False
        changed, used = set(), set()
        for item in texts.walk(syntax):
            if isinstance(item, ast.Name) and not isinstance(item.ctx, ast.Load):
                changed.add(item.id)
            elif isinstance(item, ast.Call):
                name = getattr(item.func, "attr", None) or getattr(item.func, "id", None)
                if name == "static":
                    used.update(one.id for one in texts.walk(item) if isinstance(one, ast.Name))
        return not used.isdisjoint(changed)

    def is_tuple(self, node):
        """True if a name or attribute is a tuple now."""
        if isinstance(node, ast.Attribute) and node.attr == "shape":
            return True
        root = node
        while isinstance(root, ast.Attribute):
            root = root.value
        if not isinstance(root, ast.Name):
            return False
        if root is node and root.id in self.context.env:
            return type(self.context.env[root.id]) is tuple
        if root.id in self.context.env or root.id in self.context.source.plan.local_names:
            return False
        try:
            return type(self.context.expressions.expr(node)) is tuple
        except errors.WarpError:
            return False

    @staticmethod
    def target_names(target):
        return {item.id for item in texts.walk(target) if isinstance(item, ast.Name)}

    # range

    def range_bounds(self, node):
        """Bindings of start, stop and step of `range(...)`, maybe reversed."""
        if isinstance(node, ast.Call) and not node.keywords:
            function = self.context.expressions.expr(node.func)
            if function is reversed and len(node.args) == 1:
                return self.reversed_bounds(self.range_bounds(node.args[0]), node)
            if function is range:
                return self.range_arguments(node)
        raise self.context.unsupported(
            node, "a loop over anything but `range(...)`", "use `for i in range(len(a))`"
        )

    def range_arguments(self, node):
        arguments = []
        for argument in node.args:
            if isinstance(argument, ast.Starred):
                arguments += self.context.spreads.spread(argument)
            else:
                arguments.append(self.range_argument(argument))
        if not 1 <= len(arguments) <= 3:
            raise self.context.type_error(
                node, f"range expects 1 to 3 arguments, but got {len(arguments)}"
            )
        if len(arguments) == 1:
            arguments = [0, *arguments]
        if len(arguments) == 2:
            arguments = [*arguments, 1]
        if type(arguments[2]) is int and arguments[2] == 0:
            raise self.context.error(node, "range step is zero", kind=errors.WarpCodegenValueError)
        return arguments

    def range_argument(self, node):
        """A Python int if known at compile time, else an integer value."""
        binding = self.context.expressions.expr(node)
        if type(binding) in (int, bool):
            return int(binding)
        value = self.context.materialize(binding, node)
        if value.type.kind != "int":
            raise self.context.type_error(
                node,
                f"range expects integers, but got '{value.type.python_name}'",
                "use `int(...)`",
            )
        known = value.constant() if value.type == INT32 else None
        return value if known is None else int(known)

    def reversed_bounds(self, bounds, node):
        if all(type(bound) is int for bound in bounds):
            turned = range(*bounds)[::-1]
            return [turned.start, turned.stop, turned.step]
        if type(bounds[2]) is not int or bounds[2] != 1:
            return self.reversed_steps(bounds, node)
        low, high, _ = self.common_bounds(bounds, node)
        self.context.at(node)
        one = self.builder.constant(low.type, 1)
        last = self.builder.builtin("sub", [high, one])[0][0]
        stop = self.builder.builtin("sub", [low, one])[0][0]
        return [last, stop, -1]

    def reversed_steps(self, bounds, node):
        """`low, low + step, ...` from its last number down (or up) to `low`."""
        low, high, step = self.common_bounds(bounds, node)
        if not low.type.signed:
            raise self.context.unsupported(node, "reversing an unsigned range whose step is not 1")
        self.context.at(node)
        trips = self.builder.cast(self.builder.trip_count(low, high, step), low.type)
        length = self.context.expressions.operator(node, "mul", trips, step)
        stop = self.context.expressions.operator(node, "sub", low, step)
        last = self.context.expressions.operator(node, "add", stop, length)
        return [last, stop, self.context.expressions.operator(node, "neg", step)]

    def common_bounds(self, bounds, node):
        """Bounds as values of one type: literals follow the dynamic ones."""
        dynamic = [bound for bound in bounds if type(bound) is Value]
        native = dynamic[0].type if dynamic else INT32
        for bound in dynamic:
            if bound.type != native:
                raise self.context.type_error(
                    node,
                    f"range expects bounds of one type, but got '{native.python_name}' "
                    f"and '{bound.type.python_name}'",
                )
        self.context.at(node)
        return [
            bound if type(bound) is Value else self.builder.constant(native, bound)
            for bound in bounds
        ]

    # while

    def while_loop(self, node: Loop):
        syntax = node.syntax
        frame = self.open_frame(node)
        self.context.at(syntax)
        heads = self.builder.begin_while(frame.inits)
        self.head_scope(frame, heads)
        condition = self.while_test(node, syntax)
        forwarded = self.yields(frame)
        self.context.at(syntax)
        heads = self.builder.while_condition(condition, forwarded)
        self.body_scope(frame, heads)
        self.context.branches.block(node.body)
        values, late, names, shapes = self.final_values(frame)
        self.leave(frame, names, shapes, self.builder.end_while(values, late))

    def while_test(self, node, syntax):
        """The condition of an iteration: no exit flag, then the test."""

        def test():
            return self.context.expressions.truth(
                self.context.expressions.expr(syntax.test), syntax.test
            )

        condition = self.context.branches.none_set(node.exits, syntax)
        if condition is True:
            condition = test()
        elif condition is not False:
            pure = self.context.expressions.is_cheap(syntax.test)
            condition = self.context.expressions.both(syntax.test, condition, test, pure)
        return self.context.materialize(condition, syntax.test)
