"""What can be assigned: names, components, fields, array elements and slots of elements.

A target is resolved to a `Slot`: a root (a local name, or an array element) and a path of fields
and indices into it. Values are values here, so assigning a part of a local rebinds the name to a
new value; assigning a part of an element stores only that part, through a component view.
"""

from __future__ import annotations

import ast

from warp._src import errors
from warp._src.derivatives.functions import Gradient
from warp._src.frontend.access import COMPONENTS, places_of
from warp._src.frontend.context import INT32, LocalArray, Part, TileView, Value
from warp._src.frontend.indexed import array_of
from warp._src.kernels.function import Function
from warp._src.types import dtypes

_ATOMIC = {
    ast.Add: "add",
    ast.Sub: "sub",
    ast.BitAnd: "and",
    ast.BitOr: "or",
    ast.BitXor: "xor",
}


class Slot:
    """A place that can be read and written.

    name: local variable, or None. array, indices: array element, or None.
    value: the root's value, when it is already known. path: ("field", name) and ("index", values).
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


class Targets(Part):
    """Translates assignments."""

    def assign_target(self, target, binding, node):
        kind = type(target)
        if kind is ast.Name:
            self.context.assign_name(target.id, binding, node)
        elif kind in (ast.Tuple, ast.List):
            self.unpack(target, binding, node)
        elif kind is ast.Subscript and self.has_slice(target) and not self.is_tile(target.value):
            self.assign_slice(target, binding, node)
        elif kind in (ast.Attribute, ast.Subscript):
            self.write(self.slot(target), binding, target)
        else:
            raise self.context.unsupported(target, f"assignment to `ast.{kind.__name__}`")

    def unpack(self, target, binding, node):
        for item in target.elts:
            if isinstance(item, ast.Starred):
                raise self.context.unsupported(item, "unpacking with `*`")
        if type(binding) is not tuple:
            if type(binding) is Value and binding.type.kind in ("vec", "quat"):
                count = (binding.type.shape or [4])[0]
                self.context.at(node)
                binding = tuple(
                    self.builder.extract(binding, [self.builder.constant(INT32, i)])
                    for i in range(count)
                )
            else:
                raise self.context.type_error(
                    target,
                    f"expects a tuple to unpack, but got '{self.context.type_name(binding)}'",
                )
        if len(binding) != len(target.elts):
            raise self.context.error(
                target,
                f"expects {len(target.elts)} values to unpack, but got {len(binding)}",
                kind=errors.WarpCodegenValueError,
            )
        for item, part in zip(target.elts, binding, strict=False):
            self.assign_target(item, part, item)

    # Slots.

    def slot(self, node) -> Slot:
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
            return self.attribute_slot(self.slot(node.value), node)
        if kind is ast.Subscript:
            if getattr(node.value, "attr", None) == "adjoint":
                # An error, which says where `wp.adjoint` may be used.
                self.context.expressions.expr(node)
            return self.subscript_slot(self.slot(node.value), node)
        if kind is ast.Call and self.changed_slot(node) is not None:
            return self.changed_slot(node)
        value = self.context.expressions.value(node)
        return Slot(value.type, value=value)

    def attribute_slot(self, base, node):
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

    def subscript_slot(self, base, node):
        native = base.type
        items = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if type(native) is LocalArray:
            return self.local_slot(base, native, items, node)
        if native.kind == "tile":
            part, selected = self.context.tiles.places.part(native, items, node)
            return base.extended(("tile", part), selected)
        known = array_of(native)
        if known is not None:
            array = self.read(base, node)
            if len(items) > known.rank or self.has_slice(node):
                value = self.context.access.array_item(array, items, node)
                return Slot(value.type, value=value)
            indices = [self.context.access.index(item) for item in items]
            if len(items) < known.rank:
                view = self.context.access.part(array, indices, node)
                return Slot(view.type, value=view)
            array, indices = self.context.indexed.resolved(array, indices, node)
            return Slot(known.element, array=array, indices=indices)
        indices = [self.context.access.index(item) for item in items]
        self.context.at(node)
        part = self.builder.part_type(native, indices)
        return base.extended(("index", indices), part)

    def local_slot(self, base, array, items, node):
        """An element of a thread's array; of `a[i][j]` the first index waits for the second."""
        step, given = base.path[-1] if base.path else (None, None)
        first = given if step == "row" else []
        if self.has_slice(node) or len(first) + len(items) > len(array.shape):
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
            # What the variable holds now, which its views share.
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
        slot = self.changed_slot(place)
        if slot is not None:
            self.write(slot, binding, node)

    def changed_slot(self, place):
        """The place that an argument names; None for the result of a call, nobody's variable,
        unless that is a view of one."""
        if isinstance(place, ast.Call):
            tiles = vars(self.context).get("tiles")
            return tiles and tiles.placed.get(place)
        return self.slot(place)

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
        value = self.context.materialize(binding, node)
        self.context.at(node)
        if slot.array is None:
            root = self.context.env[slot.name]
            root = root if type(root) in (Value, LocalArray) else slot.value
            self.context.env[slot.name] = self.with_part(root, slot.path, value, node, kind)
            if getattr(getattr(root, "type", None), "kind", None) == "tile":
                self.context.tiles.changed.add(slot.name)
            self.context.lines[slot.name] = self.context.source.line(node)
        elif any(step == "part" for step, _ in slot.path):
            old = self.builder.load(slot.array, slot.indices)
            self.builder.store(
                slot.array, slot.indices, self.with_part(old, slot.path, value, node)
            )
        else:
            view = self.slot_view(slot)
            wanted = array_of(view.type)
            if slot.path and wanted is not None and value.type != wanted.element:
                shown, given = wanted.element.python_name, value.type.python_name
                raise self.context.type_error(
                    node,
                    f"expects '{shown}' for this part of the element, but got '{given}'",
                    also=f"Composite slot assignment expects value of type {shown}, got {given}",
                )
            self.builder.store(view, slot.indices, value)

    def slot_view(self, slot):
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

    # Slices.

    @staticmethod
    def has_slice(target):
        items = target.slice.elts if isinstance(target.slice, ast.Tuple) else [target.slice]
        return any(isinstance(item, ast.Slice) for item in items)

    def slice_slot(self, target):
        """The place that is sliced, and the selected indices of each of its axes."""
        slot = self.slot(target.value)
        if array_of(slot.type) is not None:
            raise self.context.unsupported(
                target, "assignment to a slice of an array", "use a loop"
            )
        items = target.slice.elts if isinstance(target.slice, ast.Tuple) else [target.slice]
        return slot, self.context.access.selections(slot.type, items, target)

    def assign_slice(self, target, binding, node):
        """`v[0:2] = w` and `m[:, j] = c` of a local or an element; a scalar fills."""
        slot, selections = self.slice_slot(target)
        value = self.context.materialize(binding, node)
        self.write_slice(slot, selections, self.read(slot, target), value, target)

    def write_slice(self, slot, selections, whole, value, target):
        places = places_of(selections)
        element = getattr(whole.type, "element", None)
        parts = self.components(value, len(places), target, element)
        self.context.at(target)
        for place, part in zip(places, parts, strict=True):
            whole = self.builder.insert(whole, place, part)
        self.write(slot, whole, target)

    def update_slice(self, node):
        """`v[0:2] += w`; components of an array's element are updated one by one if atomic."""
        target, op = node.target, node.op
        slot, selections = self.slice_slot(target)
        right = self.context.materialize(self.context.expressions.expr(node.value), node.value)
        composite = right.type.kind not in ("bool", "int", "float")
        if slot.array is not None and composite and self.is_atomic(slot, op):
            places = places_of(selections)
            parts = self.components(right, len(places), target)
            self.context.at(node)
            view = self.slot_view(slot)
            for place, part in zip(places, parts, strict=True):
                element = self.builder.component_view(view, place)
                self.builder.atomic(_ATOMIC[type(op)], element, slot.indices, part)
            return
        whole = self.read(slot, target)
        left = self.context.access.selected(whole, selections, target)
        self.write_slice(
            slot, selections, whole, self.context.expressions.binary(node, op, left, right), target
        )

    def check_slice_value(self, native, count, element, node):
        """Checks that a number or the components of a value are of the element's type."""
        is_number = native.kind in ("bool", "int", "float")
        given = native if is_number else getattr(native, "element", None)
        if given is None or given == element:
            return
        shown = element.python_name
        if native.kind == "vec":
            raise self.context.value_error(
                node,
                f"expects components of '{shown}' for a slice, but got '{native.python_name}'",
                also=f"The provided vector is expected to be of length {count} with dtype {shown}.",
            )
        raise self.context.value_error(
            node,
            f"expects '{shown}' for components of a slice, but got '{native.python_name}'",
            also=f"The provided value is expected to be a vector of length {count}, with dtype "
            f"{shown}.",
        )

    def components(self, value, count, node, element=None):
        """The components of a value in row-major order, of a type if one is given; a scalar
        repeats."""
        native = value.type
        if element is not None:
            self.check_slice_value(native, count, element, node)
        self.context.at(node)
        if native.kind in ("bool", "int", "float"):
            return [value] * count
        shape = native.shape or {"quat": [4], "transform": [7]}.get(native.kind)
        if shape is None:
            raise self.context.type_error(node, f"cannot assign '{native.python_name}' to a slice")
        places = [[]]
        for extent in shape:
            places = [
                prefix + [self.builder.constant(INT32, i)]
                for prefix in places
                for i in range(extent)
            ]
        if len(places) != count:
            raise self.context.error(
                node,
                f"slice has {count} components, but '{native.python_name}' has {len(places)}",
                kind=errors.WarpCodegenValueError,
                also=f"The length of the provided vector ({len(places)}) isn't compatible with the "
                f"given slice (expected {count})."
                if native.kind == "vec"
                else f"The provided value is expected to be a vector of length {count}, with dtype "
                f"{native.element.python_name}.",
            )
        return [self.builder.extract(value, place) for place in places]

    # Augmented assignment.

    def augmented(self, node):
        target, op = node.target, node.op
        if isinstance(target, ast.Name):
            left = self.context.read_name(target.id, target)
            if isinstance(left, Gradient):
                raise self.context.type_error(
                    node,
                    f"'{target.id}' is a derivative, a function, and cannot be changed",
                    also=f"Cannot reassign local '{target.id}' that is bound to wp.grad(...)",
                )
            if self.is_tile(target, left):
                self.update_whole(node, self.slot(target))
                return
            self.context.assign_name(
                target.id,
                self.context.expressions.binary(
                    node, op, left, self.context.expressions.expr(node.value)
                ),
                node,
            )
            return
        is_slice = isinstance(target, ast.Subscript) and self.has_slice(target)
        if is_slice and not self.is_tile(target.value):
            self.update_slice(node)
            return
        slot = self.slot(target)
        right = self.context.materialize(self.context.expressions.expr(node.value), node.value)
        if self.update_by_own(slot, op, right, node):
            return
        if slot.array is not None and self.is_atomic(slot, op):
            self.context.at(node)
            self.builder.atomic(_ATOMIC[type(op)], self.slot_view(slot), slot.indices, right)
            return
        if slot.name is None and slot.array is None:
            self.write(slot, right, node)
        if self.update_tile(slot, op, right, node):
            return
        left = self.read(slot, target)
        self.write(slot, self.context.expressions.binary(node, op, left, right), node)

    def update_by_own(self, slot, op, right, node) -> bool:
        """Updates a place by the user's function for the operator; False if there is none."""
        expressions = self.context.expressions
        name = expressions.name_of(op)
        if not isinstance(self.context.function.__globals__.get(name), Function):
            return False
        operands = [self.read(slot, node.target), right]
        own = expressions.own_operator(name, operands, node)
        if own is None:
            return False
        self.write(slot, self.context.user_calls.call_function(own, operands, {}, node), node)
        return True

    def is_tile(self, target, binding=None):
        """Whether a name is that of a tile or of a view of one."""
        if not isinstance(target, ast.Name):
            return False
        if binding is None:
            binding = self.context.env.get(target.id)
        return getattr(getattr(binding, "type", None), "kind", None) == "tile"

    def update_whole(self, node, slot):
        """`t += u`: it is the tile that changes, whoever else has it."""
        right = self.context.expressions.expr(node.value)
        if self.context.tiles.views.repeats(slot) and type(node.op) in (ast.Add, ast.Sub):
            self.write(slot, right, node, _ATOMIC[type(node.op)])
            return
        made = self.context.expressions.binary(node, node.op, self.read(slot, node), right)
        made = self.context.materialize(made, node)
        if made.type != slot.type:
            raise self.context.type_error(
                node,
                f"a tile of type '{slot.type.python_name}' cannot become "
                f"'{made.type.python_name}' in place",
            )
        self.write(slot, made, node)

    def update_tile(self, slot, op, right, node):
        """`t[i] += x`, which threads of a block may do to one element; false for other slots."""
        step, part = slot.path[-1] if slot.path else (None, None)
        if step != "tile" or getattr(part, "full", part) is not None or slot.name is None:
            return False
        if any(step != "tile" for step, _ in slot.path):
            return False
        if type(op) not in _ATOMIC or right.type != slot.type:
            return False
        scalar = slot.type.element or slot.type
        if scalar.kind not in ("int", "bool") and type(op) not in (ast.Add, ast.Sub):
            raise self.context.type_error(
                node,
                f"bits of elements of type '{slot.type.python_name}' cannot be combined",
                also="bitwise inplace operators do not support Warp struct tiles"
                if scalar.kind == "struct"
                else None,
            )
        self.write(slot, right, node, _ATOMIC[type(op)])
        return True

    @staticmethod
    def is_atomic(slot, op):
        """Whether an update of an element is atomic."""
        if type(op) not in _ATOMIC or any(step == "part" for step, _ in slot.path):
            return False
        native = slot.type
        scalar = native.element if native.element is not None else native
        if scalar.kind == "int":
            return True
        return scalar.kind == "float" and type(op) in (ast.Add, ast.Sub)
