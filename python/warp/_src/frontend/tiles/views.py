"""Views of tiles: other names for elements of the tile that a variable holds.

A view keeps the variable and a path into it: parts, and whole tiles in another order (`Seen`). It
is read from what the variable holds now, and what is assigned to it goes to the variable. Once the
variable gets another tile, its views stay with the one they are of.
"""

from __future__ import annotations

import ast
import math

from warp._src.frontend.bindings import INT32, TileView, Value
from warp._src.frontend.tiles.arguments import TileTopic
from warp._src.frontend.tiles.places import Selection


class Seen:
    """All elements of a tile in another order: kind `transpose`, `reshape` or `broadcast`, shape
    of the view, and the operation's axes."""

    __slots__ = ("axes", "kind", "shape")

    def __init__(self, kind, shape, axes=()):
        self.kind, self.shape, self.axes = kind, shape, axes


class TileViews(TileTopic):
    """Reads and writes tiles through views."""

    def of(self, binding, target):
        """The slot of a tile that an expression names, or None if no variable holds it."""
        if type(binding) is TileView:
            return binding.slot
        if isinstance(target, ast.Name) and type(binding) is Value:
            slot = self.context.slots.of(target)
            return slot if slot.name is not None else None
        return None

    def seen(self, tile, given, node, kind, shape, axes=()):
        """The view of a whole tile; a new tile if no variable holds it.

        tile, given: its value, and the argument that it is as binding and syntax.
        """
        slot = self.of(*given)
        step = Seen(kind, shape, axes)
        if slot is None:
            return self.read(tile, step, node)
        text = "x".join(map(str, shape))
        native = type(slot.type).parse(f"!warp.tile<{text} x {slot.type.element}>")
        return self.placed(slot.extended(("tile", step), native), node)

    def placed(self, slot, node):
        """The view of a place, which its call may stand for where it is changed."""
        made = TileView(slot)
        self.context.tiles.placed[node] = slot
        return made

    def read(self, tile, step, node):
        options = {"axes": step.axes} if step.axes else {}
        return self.make(step.kind, [tile], node, shape=step.shape, **options)

    # Writing.

    def written(self, whole, step, rest, value, node, kind):
        """A tile with what a path selects replaced, or updated by `kind`."""
        if rest and getattr(step, "kind", None) == "broadcast":
            (_, inner), *others = rest
            step, rest = self.before_repeats(whole, inner, node), tuple(others)
        if rest and type(step) is Selection and step.full is None:
            return self.context.tiles.places.changed(whole, step, rest, value, node, kind)
        if rest:
            part = self.context.tiles.places.read(whole, step, node)
            value = self.context.slots.with_part(part, rest, value, node, kind)
            kind = "assign"
        if type(step) is Selection:
            return self.context.tiles.places.written(whole, step, value, node, kind)
        value = self.fitted(whole, step, value, node)
        if step.kind != "broadcast":
            axes = {"axes": step.axes} if step.axes else {}
            return self.make(step.kind, [value], node, shape=list(whole.type.shape), **axes)
        if kind == "assign":
            return self.last(whole, value, node)
        return self.updated(whole, value, node, kind)

    def fitted(self, whole, step, value, node):
        """The right side of an assignment to a view, as a tile of its shape."""
        element = whole.type.element
        if value.type.kind != "tile":
            return self.make("splat", [value], node, shape=list(step.shape), element=element)
        if list(value.type.shape) == list(step.shape):
            return value
        if math.prod(value.type.shape) != math.prod(step.shape):
            raise self.context.value_error(
                node,
                f"a tile of shape {tuple(value.type.shape)} does not fit a view of shape "
                f"{tuple(step.shape)}",
            )
        return self.make("reshape", [value], node, shape=list(step.shape))

    def before_repeats(self, whole, inner, node):
        """An element of a tile that is seen more than once, as a place in the tile."""
        if type(inner) is not Selection or inner.full is not None:
            raise self.context.error(
                node,
                "cannot assign to a part of a tile that is seen more than once",
                "assign to the tile that was broadcast",
            )
        shape = whole.type.shape
        offsets = inner.offsets[len(inner.offsets) - len(shape) :]
        zero = self.builder.constant(INT32, 0)
        return Selection([zero if n == 1 else at for n, at in zip(shape, offsets, strict=True)])

    def repeated(self, whole, seen):
        """The axes of a broadcast tile along which elements repeat."""
        lead = len(seen) - len(whole.type.shape)
        return [a for a, n in enumerate(seen) if a < lead or whole.type.shape[a - lead] != n]

    def last(self, whole, value, node):
        """The value with the highest index, of those for one element."""
        seen = value.type.shape
        repeated = self.repeated(whole, seen)
        full = [1 if axis in repeated else extent for axis, extent in enumerate(seen)]
        offsets = [
            self.builder.constant(INT32, extent - 1 if axis in repeated else 0)
            for axis, extent in enumerate(seen)
        ]
        steps = [1] * len(seen)
        value = self.make("slice", [value, *offsets], node, shape=full, axes=steps)
        return self.make("reshape", [value], node, shape=list(whole.type.shape))

    def updated(self, whole, value, node, kind):
        """Adds all values for one element to it, or subtracts them."""
        for axis in reversed(self.repeated(whole, value.type.shape)):
            value = self.make("reduce", [value], node, kind="add", axis=axis)
        if list(value.type.shape) != list(whole.type.shape):
            value = self.make("reshape", [value], node, shape=list(whole.type.shape))

        def step(old, sum_of_values):
            name = {"add": "add", "sub": "sub"}[kind]
            return self.builder.builtin(name, [old, sum_of_values])[0][0]

        return self.mapped([whole, value], step, node)

    @staticmethod
    def repeats(slot):
        """True if elements of a view are seen more than once."""
        return any(step == "tile" and getattr(key, "kind", None) == "broadcast"
                   for step, key in slot.path)  # fmt: skip

    # Variables that get another tile.

    def keep(self, name):
        """Leaves the views of a variable with the tile that it has, before it gets another."""
        env = self.context.env
        views = [one for one, b in env.items() if type(b) is TileView and b.slot.name == name]
        for one in views:
            view = env[one]
            if len(views) == 1:
                # Nothing else is left that names the tile.
                env[one] = self.context.slots.read(view.slot, self.context.node)
            else:
                env[one] = self.fixed(view)

    def fixed(self, view):
        """A view of what a variable holds now, which can only be read."""
        slot = view.slot
        root = self.context.env.get(slot.name, slot.value)
        return TileView(type(slot)(slot.type, value=root, path=slot.path))

    def keep_all(self, names):
        """The same before a branch or loop that gives variables another tile on some path."""
        env = self.context.env
        for one, binding in list(env.items()):
            if type(binding) is TileView and binding.slot.name in names:
                env[one] = self.fixed(binding)
