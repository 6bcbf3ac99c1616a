"""Slices of vectors and matrices as targets: `v[0:2] = w`, `m[:, j] += c`."""

from __future__ import annotations

import ast

from warp._src import errors
from warp._src.frontend.access import places_of
from warp._src.frontend.bindings import INT32
from warp._src.frontend.context import Part
from warp._src.frontend.indexed import array_of
from warp._src.frontend.slots import ATOMIC


class Slices(Part):
    """Translates assignments to slices."""

    def sliced(self, target):
        """The place that is sliced, and the selected indices of each of its axes."""
        slot = self.context.slots.of(target.value)
        if array_of(slot.type) is not None:
            raise self.context.unsupported(
                target, "assignment to a slice of an array", "use a loop"
            )
        items = target.slice.elts if isinstance(target.slice, ast.Tuple) else [target.slice]
        return slot, self.context.access.selections(slot.type, items, target)

    def assign(self, target, binding, node):
        """`v[0:2] = w` and `m[:, j] = c` of a local or an element; a scalar fills."""
        slot, selections = self.sliced(target)
        self.write(slot, selections, self.context.materialize(binding, node), target)

    def write(self, slot, selections, value, target):
        places = places_of(selections)
        parts = self.components(value, len(places), target, slot.type.element)
        if slot.is_shared:
            # Other threads may change the other components.
            for place, part in zip(places, parts, strict=True):
                self.context.slots.write(self.component(slot, place), part, target)
            return
        whole = self.context.slots.read(slot, target)
        self.context.at(target)
        for place, part in zip(places, parts, strict=True):
            whole = self.builder.insert(whole, place, part)
        self.context.slots.write(slot, whole, target)

    def component(self, slot, place):
        """The place of a component, or of a row."""
        return slot.extended(("index", place), self.builder.part_type(slot.type, place))

    def update(self, node):
        """`v[0:2] += w`; components of an array's element are updated one by one if atomic."""
        target, op = node.target, node.op
        slot, selections = self.sliced(target)
        right = self.context.materialize(self.context.expressions.expr(node.value), node.value)
        composite = right.type.kind not in ("bool", "int", "float")
        is_tile = slot.is_shared and slot.array is None
        if composite and (slot.is_atomic(op) or (is_tile and type(op) in ATOMIC)):
            places = places_of(selections)
            parts = self.components(right, len(places), target)
            self.context.at(node)
            for place, part in zip(places, parts, strict=True):
                one = self.component(slot, place)
                if is_tile:
                    self.context.targets.update_element(one, op, part, node)
                    continue
                view = self.context.slots.view(one)
                self.builder.atomic(ATOMIC[type(op)], view, slot.indices, part)
            return
        whole = self.context.slots.read(slot, target)
        left = self.context.access.selected(whole, selections, target)
        self.write(slot, selections, self.context.expressions.binary(node, op, left, right), target)

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
                code="slice-components",
                facts={"count": count, "shown": shown},
            )
        raise self.context.value_error(
            node,
            f"expects '{shown}' for components of a slice, but got '{native.python_name}'",
            code="slice-value",
            facts={"count": count, "shown": shown},
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
                code="slice-count" if native.kind == "vec" else "slice-value",
                facts={"got": len(places), "count": count, "shown": native.element.python_name},
            )
        return [self.builder.extract(value, place) for place in places]
