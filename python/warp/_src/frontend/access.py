"""Attributes and subscripts: components, fields, array elements, views and slices."""

from __future__ import annotations

import ast
import enum
import types as python_types

from warp._src import errors
from warp._src.derivatives.functions import adjoint
from warp._src.frontend import names, struct_classes
from warp._src.frontend.bindings import INT32, LocalArray, TileView, Value, is_table
from warp._src.frontend.context import Part
from warp._src.frontend.indexed import array_of
from warp._src.frontend.names import BuiltinRef
from warp._src.types import dtypes

COMPONENTS = {"x": 0, "y": 1, "z": 2, "w": 3}
# Hints for attributes that arrays have in Python only.
_OF_ARRAYS = {
    "ptr": "pass the array itself, or a view of it",
    "strides": "index the array, or pass the numbers as arguments",
    "grad": "pass the gradient as an argument of its own",
}


def is_shape(node) -> bool:
    """True if an expression is written as `a.shape`."""
    return isinstance(node, ast.Attribute) and node.attr == "shape"


def places_of(selections) -> list[list]:
    """The indices of each selected component, in row-major order."""
    places = [[]]
    for choices, _ in selections:
        places = [prefix + [choice] for prefix in places for choice in choices]
    return places


class Access(Part):
    """Translates `a.b` and `a[b]`."""

    def expr_Attribute(self, node):
        member = self.enum_member(node.value)
        if member is not None and hasattr(member, node.attr):
            return self.context.capture(getattr(member, node.attr), node)
        return self.attribute(self.context.expressions.expr(node.value), node.attr, node)

    def enum_member(self, node):
        """The member that `Class.NAME` stands for, which `expr` would turn into its value."""
        if not isinstance(node, ast.Attribute):
            return None
        root = node.value
        while isinstance(root, ast.Attribute):
            root = root.value
        if not isinstance(root, ast.Name) or type(self.context.env.get(root.id)) is Value:
            return None
        owner = self.context.expressions.expr(node.value)
        if isinstance(owner, type) and issubclass(owner, enum.Enum):
            return getattr(owner, node.attr, None)
        return None

    def attribute(self, base, name, node):
        if type(base) is Value:
            return self.value_attribute(base, name, node)
        if isinstance(base, python_types.ModuleType):
            return self.context.capture(
                names.module_attribute(self.context, base, name, node), node
            )
        if type(base) is LocalArray:
            return self.context.local_arrays.attribute(base, name, node)
        if type(base) is TileView:
            return self.context.tiles.attribute(base.type, name, node)
        if isinstance(base, (tuple, BuiltinRef)):
            raise self.no_attribute(base, name, node)
        if name == "dtype" and isinstance(base, (bool, int, float, dtypes.scalar_base)):
            return dtypes.canonical(type(base))
        if isinstance(base, dtypes.Composite):
            return self.value_attribute(self.context.materialize(base, node), name, node)
        if dtypes.type_is_composite(base) and name in ("dtype", "length", "shape"):
            extents = {"length": base._length_, "shape": base._shape_}
            return extents.get(name, base._wp_scalar_type_)
        if dtypes.is_struct(type(base)) and name in type(base)._wp_fields_:
            return self.struct_constant(type(base)._wp_fields_[name], getattr(base, name))
        try:
            return self.context.capture(getattr(base, name), node)
        except AttributeError:
            raise self.context.error(
                node,
                f"{names.describe(base)} has no attribute '{name}'",
                kind=errors.WarpCodegenAttributeError,
                code="attribute-constant",
                facts={"name": name, "base": str(base)},
            ) from None

    def field(self, base, name, node):
        """A field of a struct, or an attribute of its class."""
        try:
            return self.builder.struct_get(base, name)
        except errors.WarpCodegenAttributeError as problem:
            found = struct_classes.member(self.context, base.type, name, node)
            if found is not None:
                return self.context.capture(found, node)
            held = dtypes.dtype_of(base.type)
            spelled = f"{held.__module__}.{held.__name__}"
            owner = ast.unparse(node.value)
            problem.coded("attribute", name=name, owner=owner, dtype=spelled)
            raise

    @staticmethod
    def struct_constant(dtype, number):
        """A field of a captured struct; a number keeps the type of the field."""
        if not dtypes.type_is_scalar(dtype) or isinstance(number, dtypes.scalar_base):
            return number
        return number if dtype in (dtypes.bool, dtypes.int32, dtypes.float32) else dtype(number)

    def value_attribute(self, base, name, node):
        native = base.type
        kind = native.kind
        self.context.at(node)
        if kind == "tile":
            return self.context.tiles.attribute(native, name, node)
        array = array_of(native)
        if kind == "struct" and array is None:
            return self.field(base, name, node)
        if array is not None:
            if name == "shape":
                return self.context.indexed.extents(base, node)
            if name == "ndim":
                return array.rank
            if name == "dtype":
                return struct_classes.dtype_of(self.context, array.element, node)
            if name == "size":
                return self.array_size(base, node)
            if name == "strides" and kind == "array":
                return tuple([self.builder.stride(base, axis) for axis in range(array.rank)])
            if name == "ptr" and kind == "array":
                return self.builder.pointer(base)
        if kind in ("vec", "quat") and name in COMPONENTS:
            index = COMPONENTS[name]
            if index < (native.shape[0] if kind == "vec" else 4):
                return self.builder.extract(base, [self.builder.constant(INT32, index)])
        if kind == "transform" and name in ("p", "q"):
            part = "transform_get_translation" if name == "p" else "transform_get_rotation"
            return self.builder.builtin(part, [base])[0][0]
        if name == "length" and kind == "vec":
            return native.shape[0]
        if name == "shape" and kind in ("vec", "mat"):
            return tuple(native.shape)
        if name == "dtype" and kind in ("bool", "int", "float", "vec", "mat", "quat", "transform"):
            return dtypes.dtype_of(native.element or native)
        raise self.no_attribute(base, name, node)

    def no_attribute(self, base, name, node):
        is_array = type(base) is Value and array_of(base.type) is not None
        return self.context.error(
            node,
            f"'{self.context.type_name(base)}' has no attribute '{name}'",
            _OF_ARRAYS.get(name) if is_array else None,
            errors.WarpCodegenAttributeError,
            code="attribute" if isinstance(node, ast.Attribute) else None,
            facts={
                "name": name,
                "owner": ast.unparse(getattr(node, "value", node)),
                "dtype": self.context.type_name(base),
            },
        )

    def array_size(self, array, node):
        size, *others = self.context.indexed.extents(array, node)
        for extent in others:
            size = self.builder.builtin("mul", [size, extent])[0][0]
        return size

    def expr_Subscript(self, node):
        found = self.context.tables.chain(node)
        if found is not None:
            return found
        base = self.context.expressions.expr(node.value)
        if is_table(base):
            items = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            return self.context.tables.read(base, self.context.tables.indices(items), node)
        kinds = (Value, tuple, dtypes.Composite, LocalArray, TileView)
        if isinstance(base, type) or not isinstance(base, kinds):
            return self.static_subscript(base, node)
        return self.subscript(base, node.slice, node)

    def static_subscript(self, base, node):
        """A subscripted type, as in `wp.array[float]`."""
        if base is adjoint:
            raise self.context.error(
                node,
                "`wp.adjoint` can be used in functions with `@wp.func_grad` only, for parameters",
            )
        if not callable(base):
            raise self.context.type_error(
                node,
                f"{names.describe(base)} cannot be indexed in a kernel",
                "pass an array, or use a tuple of constants",
                code="external-reference",
                facts={"kind": type(base)},
            )
        index = self.context.expressions.expr(node.slice)
        try:
            return base[index]
        except Exception:
            raise self.context.type_error(
                node, f"{names.describe(base)} cannot be indexed in a kernel"
            ) from None

    def subscript(self, base, index, node):
        if type(base) is tuple:
            if is_shape(node.value) and self.is_missing_axis(base, index):
                return 0
            return self.tuple_item(base, index, node)
        if type(base) is LocalArray:
            items = index.elts if isinstance(index, ast.Tuple) else [index]
            return self.context.local_arrays.subscript(base, items, node)
        if isinstance(base, dtypes.Composite):
            base = self.context.materialize(base, node)
        items = index.elts if isinstance(index, ast.Tuple) else [index]
        kind = base.type.kind
        if kind == "tile":
            return self.context.tiles.places.subscript(base, items, node)
        if kind == "array" or array_of(base.type) is not None:
            return self.array_item(base, items, node)
        if kind in ("vec", "mat", "quat", "transform"):
            if any(isinstance(item, ast.Slice) for item in items):
                return self.composite_slice(base, items, node)
            indices = [self.index(item) for item in items]
            self.context.at(node)
            return self.builder.extract(base, indices)
        raise self.context.type_error(node, f"'{self.context.type_name(base)}' cannot be indexed")

    def is_missing_axis(self, shape, index):
        """True if `a.shape[k]` asks for a dimension, up to the fourth, that the array lacks."""
        if isinstance(index, ast.Slice):
            return False
        known = self.context.expressions.expr(index)
        known = known.constant() if type(known) is Value else getattr(known, "value", known)
        return isinstance(known, int) and len(shape) <= known < 4

    def index(self, node):
        """An index as an SSA value; its type is checked by the builder."""
        return self.context.expressions.value(node)

    def tuple_item(self, base, index, node):
        if isinstance(index, ast.Slice):
            bounds = [
                None if part is None else self.constant_int(part, "the bound of a tuple's slice")
                for part in (index.lower, index.upper, index.step)
            ]
            return base[slice(*bounds)]
        tables = self.context.tables
        indices = tables.indices(index.elts if isinstance(index, ast.Tuple) else [index])
        if len(indices) > 1 or not tables.is_known(indices[0]):
            for read in (self.chosen_number, tables.read):
                chosen = read(base, indices, node)
                if chosen is not None:
                    return chosen
        position = self.constant_of(indices[0], index, "the index of a tuple")
        if not -len(base) <= position < len(base):
            raise self.index_error(index, position, len(base), "index")
        return base[position]

    def chosen_number(self, base, indices, node):
        """One of several integers, as extents are, at an index known at run time; else None."""
        if not base or any(type(one) is not Value or one.type != INT32 for one in base):
            return None
        binding = indices[0]
        if len(indices) > 1 or binding.type.kind != "int":
            return None
        self.context.at(node)
        place = self.builder.position(binding, len(base))
        found = self.builder.constant(INT32, 0)
        for number, one in enumerate(base):
            here = self.builder.cast(self.builder.constant(INT32, number), place.type)
            is_here = self.context.expressions.operator(node, "eq", place, here)
            found = self.context.expressions.operator(node, "where", is_here, one, found)
        return found

    def index_error(self, node, index, extent, what):
        return self.context.error(
            node,
            f"{what} {index} is out of range for {extent} elements",
            kind=errors.WarpCodegenIndexError,
        )

    def constant_int(self, node, what) -> int:
        return self.constant_of(self.context.expressions.expr(node), node, what)

    def constant_of(self, binding, node, what) -> int:
        if type(binding) is Value:
            known = binding.constant()
            if isinstance(known, int):
                return int(known)
        elif isinstance(binding, (int, dtypes.scalar_base)):
            return int(getattr(binding, "value", binding))
        raise self.context.type_error(node, f"{what} must be an integer known at compile time")

    def array_item(self, array, items, node):
        """An element if all dimensions are indexed, else a view."""
        rank = array_of(array.type).rank
        if len(items) > rank:
            raise self.context.error(
                node,
                f"expects at most {rank} {'index' if rank == 1 else 'indices'} for "
                f"'{self.context.type_name(array)}', but got {len(items)}",
                kind=errors.WarpCodegenIndexError,
                code="index-count",
            )
        if any(isinstance(item, ast.Slice) for item in items):
            return self.array_slice(array, items, node)
        indices = [self.index(item) for item in items]
        return self.part(array, indices, node)

    def part(self, array, indices, node):
        """An element, or a view if there are more dimensions than indices."""
        self.context.at(node)
        if len(indices) == array_of(array.type).rank:
            return self.builder.load(*self.context.indexed.resolved(array, indices, node))
        if array.type.kind == "struct":
            return self.context.indexed.indexed_view(array, indices, node)
        return self.builder.view(array, indices)

    def array_slice(self, array, items, node):
        """Slices, and plain indices, which leave their dimension out."""
        if array.type.kind == "struct":
            raise self.context.unsupported(
                node, "a slice of an indexed array", "slice the array behind it"
            )
        plain = 0
        while not isinstance(items[plain], ast.Slice):
            plain += 1
        leading = [self.index(item) for item in items[:plain]]
        self.context.at(node)
        if leading:
            array = self.builder.view(array, leading)
        axis = 0
        for item in items[plain:]:
            if isinstance(item, ast.Slice):
                array = self.builder.slice(array, axis, *self.slice_bounds(item, node))
                axis += 1
            else:
                array = self.builder.index_dim(array, axis, self.index(item))
        return array

    def slice_bounds(self, item, node) -> list:
        """Start, stop and step; None stands for the defaults of a step of 1."""
        bounds = [
            None if part is None else self.context.expressions.value(part)
            for part in (item.lower, item.upper, item.step)
        ]
        self.context.at(node)
        if bounds[2] is None:
            return bounds
        step = bounds[2].constant()
        if step == 0:
            raise self.zero_step(item)
        if step is None:
            zero = self.builder.cast(self.builder.constant(INT32, 0), bounds[2].type)
            moves = self.context.expressions.operator(node, "ne", bounds[2], zero)
            self.context.at(node)
            self.builder.require(moves, "slice step is zero")
        ends = [self.builder.constant(INT32, end) for end in (0, 2**31 - 1, -(2**31))]
        for i in range(2):
            if bounds[i] is not None:
                continue
            if step is not None:
                bounds[i] = ends[i] if step > 0 else ends[i + 1]
            else:
                zero = self.builder.cast(ends[0], bounds[2].type)
                backwards = self.context.expressions.operator(node, "lt", bounds[2], zero)
                bounds[i] = self.context.expressions.operator(
                    node, "where", backwards, ends[i + 1], ends[i]
                )
        return bounds

    def zero_step(self, node):
        return self.context.error(
            node,
            "slice step is zero",
            kind=errors.WarpCodegenValueError,
            code="array-slice-step",
        )

    def slice_range(self, item, extent, node) -> range:
        """Positions selected by a constant slice or index of a composite."""
        what = "the bound of a vector's slice"
        bounds = [
            None if part is None else self.constant_int(part, what)
            for part in (item.lower, item.upper, item.step)
        ]
        if bounds[2] == 0:
            raise self.zero_step(node)
        return range(extent)[slice(*bounds)]

    def selections(self, native, items, node):
        """For each axis of a composite: the chosen indices, and whether the axis remains."""
        shape = native.shape or {"quat": [4], "transform": [7]}.get(native.kind)
        if shape is None:
            raise self.context.type_error(node, f"'{native.python_name}' cannot be sliced")
        if len(items) > len(shape):
            raise self.context.error(
                node,
                f"expects at most {len(shape)} indices for '{native.python_name}', "
                f"but got {len(items)}",
                kind=errors.WarpCodegenIndexError,
            )
        chosen = []
        for axis, extent in enumerate(shape):
            item = items[axis] if axis < len(items) else ast.Slice()
            if isinstance(item, ast.Slice):
                positions = self.slice_range(item, extent, node)
                chosen.append(([self.builder.constant(INT32, i) for i in positions], True))
            else:
                chosen.append(([self.index(item)], False))
        return chosen

    def composite_slice(self, base, items, node):
        """A copy of the selected components, as a vector or matrix."""
        return self.selected(base, self.selections(base.type, items, node), node)

    def selected(self, base, selections, node):
        """The components at `selections`; a constant without components if there are none."""
        self.context.at(node)
        values = [self.builder.extract(base, place) for place in places_of(selections)]
        lengths = [len(choices) for choices, remains in selections if remains]
        if not values:
            dtype = dtypes.dtype_of(base.type.element)
            return (
                dtypes.vector(0, dtype) if len(lengths) == 1 else dtypes.matrix((0, 0), dtype)
            )()
        return self.builder.construct(self.composite_type(lengths, base.type.element), values)

    def composite_type(self, lengths, element):
        shape = "x".join(map(str, lengths))
        family = "vec" if len(lengths) == 1 else "mat"
        return type(element).parse(f"!warp.{family}<{shape} x {element}>")
