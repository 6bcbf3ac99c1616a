"""Places that can be read and written: names, components, fields, elements and slots of elements.

Values are values here, so assigning a part of a local rebinds the name to a new value; assigning a
part of an element stores only that part, through a component view.
"""

from __future__ import annotations

import ast

from warp._src import errors
from warp._src.frontend.access import COMPONENTS
from warp._src.frontend.bindings import INT32, LocalArray, TileView, Value
from warp._src.frontend.context import Part
from warp._src.frontend.indexed import array_of
from warp._src.types import dtypes

ATOMIC = {
    ast.Add: "add",
    ast.Sub: "sub",
    ast.BitAnd: "and",
    ast.BitOr: "or",
    ast.BitXor: "xor",
}


def has_slice(target) -> bool:
    """True if one of the indices of a subscript is a slice."""
    items = target.slice.elts if isinstance(target.slice, ast.Tuple) else [target.slice]
    return any(isinstance(item, ast.Slice) for item in items)


class Slot:
    """A place that can be read and written.

    name: local variable, or None. array, indices: array element, or None.
    value: the root's value, when it is already known. path: ("field", name), ("index", values) and
    ("part", name) of a transform.
    type: native type at the end of the path.
    """

    __slots__ = ("array", "indices", "name", "path", "type", "value")

    def __init__(self, native, name=None, value=None, array=None, indices=(), path=()):
        self.type = native
        self.name = name
        self.value = value
        self.array = array
        self.indices = indices
        self.path = path

    def extended(self, step, native):
        return Slot(native, self.name, self.value, self.array, self.indices, (*self.path, step))

    @property
    def is_shared(self) -> bool:
        """True if other threads have the element, too: of an array or of a tile."""
        return self.array is not None or any(step == "tile" for step, _ in self.path)

    def is_atomic(self, op) -> bool:
        """True if an operator updates the place, of an array's element, atomically."""
        if self.array is None or type(op) not in ATOMIC:
            return False
        scalar = self.type.element if self.type.element is not None else self.type
        if scalar.kind == "int":
            return True
        return scalar.kind == "float" and type(op) in (ast.Add, ast.Sub)


class Slots(Part):
    """Resolves, reads and writes places."""

    def of(self, node) -> Slot:
        """The place that an expression names."""
        kind = type(node)
        if kind is ast.Name:
            binding = self.context.read_name(node.id, node)
            if type(binding) is LocalArray:
                name = node.id if node.id in self.context.env else None
                return Slot(binding, name=name, value=binding)
            if type(binding) is TileView:
                return binding.slot
            if type(binding) is not Value and not isinstance(binding, dtypes.Composite):
                raise self.context.type_error(node, f"cannot assign to a part of '{node.id}'")
            value = self.context.materialize(binding, node)
            name = node.id if node.id in self.context.env else None
            return Slot(value.type, name=name, value=value)
        if kind is ast.Attribute:
            return self.attribute(self.of(node.value), node)
        if kind is ast.Subscript:
            if getattr(node.value, "attr", None) == "adjoint":
                # An error, which says where `wp.adjoint` may be used.
                self.context.expressions.expr(node)
            return self.subscript(self.of(node.value), node)
        if kind is ast.Call and self.changed(node) is not None:
            return self.changed(node)
        value = self.context.expressions.value(node)
        return Slot(value.type, value=value)

    def attribute(self, base, node):
        native, name = base.type, node.attr
        if type(native) is LocalArray:
            value = self.context.local_arrays.attribute(native, name, node)
            return Slot(self.context.static_type(value), value=value)
        if native.kind == "struct":
            for field, field_type in native.fields:
                if field == name:
                    return base.extended(("field", name), field_type)
            # The builder's error lists the fields.
            self.context.at(node)
            self.builder.struct_get(self.read(base, node), name)
        if native.kind in ("vec", "quat") and name in COMPONENTS:
            position = COMPONENTS[name]
            if position < (native.shape or [4])[0]:
                index = self.builder.constant(INT32, position)
                return base.extended(("index", [index]), native.element)
        if native.kind == "transform" and name in ("p", "q"):
            text = (
                f"!warp.vec<3 x {native.element}>"
                if name == "p"
                else f"!warp.quat<{native.element}>"
            )
            return base.extended(("part", name), type(native).parse(text))
        if native.kind == "array":
            raise self.context.unsupported(node, f"assignment to '{name}' of an array")
        raise self.context.error(
            node,
            f"'{native.python_name}' has no attribute '{name}'",
            kind=errors.WarpCodegenAttributeError,
        )

    def subscript(self, base, node):
        native = base.type
        items = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if type(native) is LocalArray:
            return self.local(base, native, items, node)
        if native.kind == "tile":
            part, selected = self.context.tiles.places.part(native, items, node)
            return base.extended(("tile", part), selected)
        known = array_of(native)
        if known is not None:
            array = self.read(base, node)
            if len(items) > known.rank or has_slice(node):
                value = self.context.access.array_item(array, items, node)
                return Slot(value.type, value=value)
            indices = [self.context.access.index(item) for item in items]
            if len(items) < known.rank:
                view = self.context.access.part(array, indices, node)
                return Slot(view.type, value=view)
            for index in indices:
                if index.type.kind != "int":
                    raise self.context.type_error(
                        node,
                        f"array index must be an integer, but got '{index.type.python_name}'",
                        hint="use `int(...)`",
                        code="array-slot-index",
                    )
            array, indices = self.context.indexed.resolved(array, indices, node)
            return Slot(known.element, array=array, indices=indices)
        indices = [self.context.access.index(item) for item in items]
        self.context.at(node)
        part = self.builder.part_type(native, indices)
        return base.extended(("index", indices), part)

    def local(self, base, array, items, node):
        """An element of a thread's array; of `a[i][j]` the first index waits for the second."""
        step, given = base.path[-1] if base.path else (None, None)
        first = given if step == "row" else []
        if has_slice(node) or len(first) + len(items) > len(array.shape):
            value = self.context.expressions.expr(node)
            return Slot(self.context.static_type(value) or value, value=value)
        indices = [*first, *(self.context.expressions.expr(item) for item in items)]
        path = base.path[:-1] if step == "row" else base.path
        slot = Slot(array, base.name, base.value, path=path)
        if len(indices) < len(array.shape):
            return slot.extended(("row", indices), array)
        number = self.context.local_arrays.number(array, indices, node)
        return slot.extended(("element", number), array.element)

    def read(self, slot, node):
        """Value of a slot."""
        self.context.at(node)
        value = slot.value
        if slot.array is not None:
            value = self.builder.load(slot.array, slot.indices)
        elif slot.name is not None and slot.path and slot.path[0][0] == "tile":
            # The value that the variable holds now, which its views share.
            value = self.context.env.get(slot.name, value)
        return self.read_path(value, slot.path, node)

    def read_path(self, value, path, node):
        for step, key in path:
            if step == "field":
                value = self.builder.struct_get(value, key)
            elif step == "index":
                value = self.builder.extract(value, key)
            elif step == "tile":
                value = self.context.tiles.places.read(value, key, node)
            elif step == "element":
                value = self.context.local_arrays.read(value, key, node)
            elif step == "row":
                raise self.context.error(node, "index all dimensions of a thread's array")
            else:
                value = self.context.access.value_attribute(value, key, node)
        return value

    def write_back(self, place, binding, node):
        """Gives what an argument names the value that a call has left in it."""
        slot = self.changed(place)
        if slot is not None:
            self.write(slot, binding, node)

    def changed(self, place):
        """The place that an argument names; None for the result of a call, nobody's variable,
        unless that is a view of one."""
        if isinstance(place, ast.Call):
            tiles = vars(self.context).get("tiles")
            return tiles and tiles.placed.get(place)
        return self.of(place)

    def write(self, slot, binding, node, kind="assign"):
        """Assigns to a place; `kind` is how elements of tiles are updated."""
        if slot.name is None and slot.array is None:
            if slot.path and slot.path[0][0] == "tile":
                raise self.context.error(
                    node,
                    "cannot assign to a view of a tile that its variable no longer holds",
                    "take the view of the new tile",
                )
            if array_of(slot.type) is not None:
                raise self.context.type_error(
                    node,
                    f"cannot assign to a whole '{slot.type.python_name}'",
                    "index every dimension",
                )
            raise self.context.type_error(node, "expects a variable or array element to assign to")
        value = self.context.literal_as(slot.type, binding, node)
        value = self.context.materialize(value, node)
        self.context.at(node)
        if slot.array is None:
            root = self.context.env[slot.name]
            root = root if type(root) in (Value, LocalArray) else slot.value
            self.context.env[slot.name] = self.with_part(root, slot.path, value, node, kind)
            if getattr(getattr(root, "type", None), "kind", None) == "tile":
                self.context.tiles.changed.add(slot.name)
            self.context.lines[slot.name] = self.context.source.line(node)
        else:
            view = self.view(slot)
            wanted = array_of(view.type)
            if slot.path and wanted is not None and value.type != wanted.element:
                shown, given = wanted.element.python_name, value.type.python_name
                raise self.context.type_error(
                    node,
                    f"expects '{shown}' for this part of the element, but got '{given}'",
                    code="slot-type",
                    facts={"shown": shown, "given": given},
                )
            self.builder.store(view, slot.indices, value)

    def view(self, slot):
        """The array whose elements are the slot's part of each element."""
        view = slot.array
        for _, key in slot.path:
            view = self.builder.component_view(view, key)
        return view

    def with_part(self, whole, path, value, node, kind="assign"):
        """A value with the part at the end of a path replaced."""
        if not path:
            return value
        (step, key), rest = path[0], path[1:]
        if step == "tile":
            return self.context.tiles.views.written(whole, key, rest, value, node, kind)
        if rest:
            value = self.with_part(self.read_path(whole, path[:1], node), rest, value, node)
        if step == "field":
            return self.builder.struct_set(whole, key, value)
        if step == "index":
            return self.builder.insert(whole, key, value)
        if step == "element":
            return self.context.local_arrays.written(whole, key, value, node)
        if step == "row":
            raise self.context.error(node, "index all dimensions of a thread's array to assign")
        name = "transform_set_translation" if key == "p" else "transform_set_rotation"
        return self.builder.builtin(name, [whole, value])[1][0][1]
