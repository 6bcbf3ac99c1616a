"""Expressions: syntax nodes to bindings."""

from __future__ import annotations

import ast
import operator
import types as python_types

from warp._src import errors, types
from warp._src.frontend import names
from warp._src.frontend.emitter import BOOL, INT32, EmitterBase, Value
from warp._src.frontend.names import BuiltinRef

_BINARY = {
    ast.Add: "add",
    ast.Sub: "sub",
    ast.Mult: "mul",
    ast.MatMult: "mul",
    ast.Div: "div",
    ast.FloorDiv: "floordiv",
    ast.Mod: "mod",
    ast.Pow: "pow",
    ast.LShift: "lshift",
    ast.RShift: "rshift",
    ast.BitAnd: "bit_and",
    ast.BitOr: "bit_or",
    ast.BitXor: "bit_xor",
}
_COMPARE = {
    ast.Lt: ("lt", operator.lt),
    ast.LtE: ("le", operator.le),
    ast.Gt: ("gt", operator.gt),
    ast.GtE: ("ge", operator.ge),
    ast.Eq: ("eq", operator.eq),
    ast.NotEq: ("ne", operator.ne),
}
_COMPARE_WORDS = {ast.Is: "is", ast.IsNot: "is not", ast.In: "in", ast.NotIn: "not in"}
# What Python's integers give where kernels give the same.
_FOLD = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.FloorDiv: lambda a, b: a // b if b else 0,
    ast.Div: lambda a, b: _truncated(a, b) if b else 0,
    ast.Mod: lambda a, b: a - b * _truncated(a, b) if b else 0,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.BitXor: operator.xor,
}
_NUMBERS = (int, float, bool)
COMPONENTS = {"x": 0, "y": 1, "z": 2, "w": 3}
_UNSUPPORTED = {
    "JoinedStr": "an f-string",
    "Lambda": "a lambda",
    "List": "a list",
    "Dict": "a dictionary",
    "Set": "a set",
    "ListComp": "a list comprehension",
    "SetComp": "a set comprehension",
    "DictComp": "a dictionary comprehension",
    "GeneratorExp": "a generator expression",
    "NamedExpr": "an assignment expression (`:=`)",
    "Await": "`await`",
    "Yield": "`yield`",
    "YieldFrom": "`yield from`",
    "Starred": "`*` outside a call",
}


def _truncated(a, b):
    quotient = abs(a) // abs(b)
    return quotient if (a < 0) == (b < 0) else -quotient


class ArrayAttribute:
    """`a.shape` or `a.strides` of an array value, before it is indexed."""

    __slots__ = ("array", "name")

    def __init__(self, array, name):
        self.array = array
        self.name = name


class Expressions(EmitterBase):
    """Methods named after the syntax node they translate."""

    def expr(self, node):
        """Binding of an expression."""
        method = getattr(self, "expr_" + type(node).__name__, None)
        if method is None:
            what = _UNSUPPORTED.get(type(node).__name__, f"`ast.{type(node).__name__}`")
            raise self.unsupported(node, what)
        return method(node)

    def value(self, node):
        """SSA value of an expression."""
        binding = self.expr(node)
        if type(binding) is Value:
            return binding
        if isinstance(binding, ArrayAttribute):
            raise self.type_error(node, f"'{binding.name}' must be indexed with a constant")
        return self.materialize(binding, node)

    def expr_Name(self, node):
        return self.read_name(node.id, node)

    def expr_Constant(self, node):
        value = node.value
        if value is Ellipsis or isinstance(value, (bytes, complex)):
            raise self.unsupported(node, f"a '{type(value).__name__}' literal")
        return value

    def expr_Tuple(self, node):
        parts = []
        for item in node.elts:
            if isinstance(item, ast.Starred):
                parts.extend(self.spread(item))
            else:
                parts.append(self.expr(item))
        return tuple(parts)

    # Operators.

    def expr_BinOp(self, node):
        left = self.expr(node.left)
        right = self.expr(node.right)
        return self.binary(node, node.op, left, right)

    def binary(self, node, op, left, right):
        kind = type(op)
        if type(left) is int and type(right) is int and kind in _FOLD:
            return _FOLD[kind](left, right)
        if type(left) is tuple and type(right) is tuple and kind is ast.Add:
            return left + right
        left = self.materialize(left, node)
        right = self.materialize(right, node)
        return self.operator(node, _BINARY[kind], left, right)

    def operator(self, node, name, *operands):
        """Applies an operator; functions of that name extend it to structs."""
        for operand in operands:
            if operand.type.kind == "struct":
                return self.user_operator(node, name, operands)
        self.at(node)
        return self.builder.builtin(name, operands)[0][0]

    def user_operator(self, node, name, operands):
        function = self.function.__globals__.get(name)
        if function is None or not hasattr(function, "overloads"):
            shown = " and ".join(f"'{self.type_name(v)}'" for v in operands)
            raise self.type_error(
                node,
                f"operator '{name}' is not defined for {shown}",
                f"define `@wp.func def {name}(...)`",
            )
        return self.call_function(function, list(operands), {}, node)

    def expr_UnaryOp(self, node):
        operand = self.expr(node.operand)
        kind = type(node.op)
        if kind is ast.Not:
            operand = self.truth(operand, node.operand)
            if type(operand) is bool:
                return not operand
            self.at(node)
            return self.builder.builtin("unot", [operand])[0][0]
        if type(operand) in (int, float):
            if kind is ast.USub:
                return -operand
            if kind is ast.UAdd:
                return operand
            if type(operand) is int:
                return ~operand
        name = {ast.USub: "neg", ast.UAdd: "pos", ast.Invert: "invert"}[kind]
        return self.operator(node, name, self.materialize(operand, node))

    def expr_Compare(self, node):
        left = self.expr(node.left)
        return self.compare(node, left, node.left, node.ops, node.comparators)

    def compare(self, node, left, left_node, ops, comparators):
        """One comparison of a chain; the others follow if it holds."""
        right_node = comparators[0]
        right = self.expr(right_node)
        first = self.compare_one(node, ops[0], left, right)
        if len(ops) == 1 or first is False:
            return first

        def rest():
            return self.compare(node, right, right_node, ops[1:], comparators[1:])

        if first is True:
            return rest()
        pure = all(self.is_cheap(item) for item in comparators[1:])
        return self.both(node, first, rest, pure)

    def compare_one(self, node, op, left, right):
        kind = type(op)
        if kind not in _COMPARE:
            raise self.unsupported(node, f"the operator `{_COMPARE_WORDS[kind]}`")
        name, fold = _COMPARE[kind]
        static = type(left) is not Value and type(right) is not Value
        if static and type(left) in _NUMBERS and type(right) in _NUMBERS:
            return fold(left, right)
        if static and kind in (ast.Eq, ast.NotEq) and not isinstance(left, types.Composite):
            return fold(left, right)
        left, right = self.materialize(left, node), self.materialize(right, node)
        return self.operator(node, name, left, right)

    # Logic.

    def truth(self, binding, node):
        """A Python bool if known at compile time, else a boolean value."""
        if type(binding) is Value:
            native = binding.type
            if native == BOOL:
                known = binding.constant()
                return binding if known is None else bool(known)
            if native.kind not in ("int", "float"):
                raise self.type_error(
                    node, f"expects a condition, but got '{native.python_name}'"
                )
            self.at(node)
            return self.builder.cast(binding, BOOL)
        if isinstance(binding, (bool, int, float, str, types.scalar_base)) or binding is None:
            return bool(binding)
        raise self.type_error(node, f"expects a condition, but got {names.describe(binding)}")

    def expr_BoolOp(self, node):
        return self.logic(node, node.values, isinstance(node.op, ast.And))

    def logic(self, node, operands, is_and):
        first = self.truth(self.expr(operands[0]), operands[0])
        rest = operands[1:]
        if not rest:
            return first
        if type(first) is bool:
            return self.logic(node, rest, is_and) if first is is_and else first
        pure = all(self.is_cheap(operand) for operand in rest)
        combine = self.both if is_and else self.either
        return combine(node, first, lambda: self.logic(node, rest, is_and), pure)

    def both(self, node, first, rest, pure):
        """`first and rest()`."""
        if pure:
            return self.combine(node, "bit_and", first, rest())
        return self.branch_value(node, first, rest, lambda: False)

    def either(self, node, first, rest, pure):
        """`first or rest()`."""
        if pure:
            return self.combine(node, "bit_or", first, rest())
        return self.branch_value(node, first, lambda: True, rest)

    def combine(self, node, name, first, second):
        if type(second) is bool:
            return first if second is (name == "bit_and") else second
        self.at(node)
        return self.builder.builtin(name, [first, second])[0][0]

    def expr_IfExp(self, node):
        condition = self.truth(self.expr(node.test), node.test)
        if type(condition) is bool:
            return self.expr(node.body if condition else node.orelse)
        pure = self.is_cheap(node.body) and self.is_cheap(node.orelse)
        return self.choose(
            node, condition, lambda: self.expr(node.body), lambda: self.expr(node.orelse), pure
        )

    def choose(self, node, condition, then, orelse, pure):
        """One of two bindings; only the chosen side is evaluated unless both are pure."""
        if not pure:
            return self.branch_value(node, condition, then, orelse)
        left, right = then(), orelse()
        if type(left) is type(right) and type(left) in (bool, int, float) and left == right:
            return left
        if type(left) is tuple or type(right) is tuple:
            raise self.unsupported(node, "a choice between tuples")
        left, right = self.materialize(left, node), self.materialize(right, node)
        self.at(node)
        if left.type != right.type:
            raise self.branch_types_differ(node, left, right)
        return self.builder.builtin("where", [condition, left, right])[0][0]

    def branch_types_differ(self, node, left, right):
        return self.type_error(
            node,
            f"expects both sides of a choice to have one type, but got "
            f"'{self.type_name(left)}' and '{self.type_name(right)}'",
        )

    def is_cheap(self, node) -> bool:
        """Whether evaluating a node always is harmless and costs next to nothing."""
        budget = 6
        stack = [node]
        while stack:
            item = stack.pop()
            kind = type(item)
            budget -= 1
            if budget < -6:
                return False
            if kind is ast.BinOp:
                stack += (item.left, item.right)
            elif kind is ast.UnaryOp:
                stack.append(item.operand)
            elif kind is ast.Compare:
                stack += (item.left, *item.comparators)
            elif kind is ast.BoolOp:
                stack += item.values
            elif kind is ast.Attribute and item.attr in COMPONENTS:
                stack.append(item.value)
            elif kind is ast.Name:
                bound = self.env.get(item.id)
                if type(bound) is Value and bound.type.kind not in ("bool", "int", "float"):
                    return False
            elif kind is not ast.Constant:
                return False
        return True

    # Attributes and subscripts.

    def expr_Attribute(self, node):
        return self.attribute(self.expr(node.value), node.attr, node)

    def attribute(self, base, name, node):
        if type(base) is Value:
            return self.value_attribute(base, name, node)
        if isinstance(base, python_types.ModuleType):
            return self.capture(names.module_attribute(self, base, name, node), node)
        if isinstance(base, (tuple, BuiltinRef, ArrayAttribute)):
            raise self.no_attribute(base, name, node)
        if isinstance(base, types.Composite):
            return self.value_attribute(self.materialize(base, node), name, node)
        try:
            return self.capture(getattr(base, name), node)
        except AttributeError:
            raise self.error(
                node,
                f"{names.describe(base)} has no attribute '{name}'",
                kind=errors.WarpCodegenAttributeError,
            ) from None

    def value_attribute(self, base, name, node):
        native = base.type
        kind = native.kind
        self.at(node)
        if kind == "struct":
            return self.builder.struct_get(base, name)
        if kind == "array":
            if name in ("shape", "strides"):
                return ArrayAttribute(base, name)
            if name == "ndim":
                return native.rank
            if name == "dtype":
                return types.dtype_of(native.element)
            if name == "size":
                return self.array_size(base, native.rank, node)
        if kind in ("vec", "quat") and name in COMPONENTS:
            index = COMPONENTS[name]
            if index < (native.shape[0] if kind == "vec" else 4):
                return self.builder.extract(base, [self.builder.constant(INT32, index)])
        if kind == "transform" and name in ("p", "q"):
            part = "transform_get_translation" if name == "p" else "transform_get_rotation"
            return self.builder.builtin(part, [base])[0][0]
        if name == "dtype" and kind in ("vec", "mat", "quat", "transform"):
            return types.dtype_of(native.element)
        raise self.no_attribute(base, name, node)

    def no_attribute(self, base, name, node):
        return self.error(
            node,
            f"'{self.type_name(base)}' has no attribute '{name}'",
            kind=errors.WarpCodegenAttributeError,
        )

    def array_size(self, array, rank, node):
        size = self.builder.dim(array, 0)
        for axis in range(1, rank):
            size = self.builder.builtin("mul", [size, self.builder.dim(array, axis)])[0][0]
        return size

    def expr_Subscript(self, node):
        base = self.expr(node.value)
        if isinstance(base, type) or (
            type(base) is not Value and not isinstance(base, (tuple, ArrayAttribute, types.Composite))
        ):
            return self.static_subscript(base, node)
        return self.subscript(base, node.slice, node)

    def static_subscript(self, base, node):
        """A subscripted type, as in `wp.array[float]`."""
        index = self.expr(node.slice)
        try:
            return base[index]
        except Exception:
            raise self.type_error(
                node, f"{names.describe(base)} cannot be indexed in a kernel"
            ) from None

    def subscript(self, base, index, node):
        if isinstance(base, ArrayAttribute):
            return self.shape_item(base, index, node)
        if type(base) is tuple:
            return self.tuple_item(base, index, node)
        if isinstance(base, types.Composite):
            base = self.materialize(base, node)
        items = index.elts if isinstance(index, ast.Tuple) else [index]
        kind = base.type.kind
        if kind == "array":
            return self.array_item(base, items, node)
        if kind in ("vec", "mat", "quat", "transform"):
            if any(isinstance(item, ast.Slice) for item in items):
                return self.composite_slice(base, items, node)
            indices = [self.index(item) for item in items]
            self.at(node)
            return self.builder.extract(base, indices)
        raise self.type_error(node, f"'{self.type_name(base)}' cannot be indexed")

    def index(self, node):
        """An index as an SSA value; its type is checked by the builder."""
        return self.value(node)

    def shape_item(self, base, index, node):
        axis = self.constant_int(index, "the axis of a shape")
        rank = base.array.type.rank
        if not -rank <= axis < rank:
            raise self.index_error(index, axis, rank, "axis")
        if base.name == "strides":
            raise self.unsupported(node, "reading strides")
        self.at(node)
        return self.builder.dim(base.array, axis % rank)

    def tuple_item(self, base, index, node):
        if isinstance(index, ast.Slice):
            bounds = [
                None if part is None else self.constant_int(part, "the bound of a tuple's slice")
                for part in (index.lower, index.upper, index.step)
            ]
            return base[slice(*bounds)]
        position = self.constant_int(index, "the index of a tuple")
        if not -len(base) <= position < len(base):
            raise self.index_error(index, position, len(base), "index")
        return base[position]

    def index_error(self, node, index, extent, what):
        return self.error(
            node,
            f"{what} {index} is out of range for {extent} elements",
            kind=errors.WarpCodegenIndexError,
        )

    def constant_int(self, node, what) -> int:
        binding = self.expr(node)
        if type(binding) is Value:
            known = binding.constant()
            if isinstance(known, int):
                return int(known)
        elif isinstance(binding, (int, types.scalar_base)):
            return int(getattr(binding, "value", binding))
        raise self.type_error(node, f"{what} must be an integer known at compile time")

    def array_item(self, array, items, node):
        """An element if all dimensions are indexed, else a view."""
        rank = array.type.rank
        if len(items) > rank:
            raise self.error(
                node,
                f"expects at most {rank} indices for '{self.type_name(array)}', "
                f"but got {len(items)}",
                kind=errors.WarpCodegenIndexError,
            )
        if any(isinstance(item, ast.Slice) for item in items):
            return self.array_slice(array, items, node)
        indices = [self.index(item) for item in items]
        self.at(node)
        if len(indices) == rank:
            return self.builder.load(array, indices)
        return self.builder.view(array, indices)

    def array_slice(self, array, items, node):
        """Leading plain indices, then slices."""
        plain = 0
        while not isinstance(items[plain], ast.Slice):
            plain += 1
        leading = [self.index(item) for item in items[:plain]]
        self.at(node)
        if leading:
            array = self.builder.view(array, leading)
        for axis, item in enumerate(items[plain:]):
            if not isinstance(item, ast.Slice):
                raise self.unsupported(
                    item, "a plain index after a slice", "index first, then slice"
                )
            bounds = [
                None if part is None else self.value(part)
                for part in (item.lower, item.upper, item.step)
            ]
            self.at(node)
            array = self.builder.slice(array, axis, *bounds)
        return array

    def slice_range(self, item, extent, node) -> range:
        """Positions selected by a constant slice or index of a composite."""
        what = "the bound of a vector's slice"
        bounds = [
            None if part is None else self.constant_int(part, what)
            for part in (item.lower, item.upper, item.step)
        ]
        if bounds[2] == 0:
            raise self.error(node, "slice step is zero", kind=errors.WarpCodegenValueError)
        selected = range(extent)[slice(*bounds)]
        if not selected:
            raise self.error(
                node, "slice selects no component", kind=errors.WarpCodegenValueError
            )
        return selected

    def selections(self, native, items, node):
        """For each axis of a composite: the chosen indices, and whether the axis remains."""
        shape = native.shape or {"quat": [4], "transform": [7]}.get(native.kind)
        if shape is None:
            raise self.type_error(node, f"'{native.python_name}' cannot be sliced")
        if len(items) > len(shape):
            raise self.error(
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
        selections = self.selections(base.type, items, node)
        places = [[]]
        for choices, _ in selections:
            places = [prefix + [choice] for prefix in places for choice in choices]
        self.at(node)
        values = [self.builder.extract(base, indices) for indices in places]
        lengths = [len(choices) for choices, remains in selections if remains]
        return self.builder.construct(self.composite_type(lengths, base.type.element), values)

    def composite_type(self, lengths, element):
        shape = "x".join(map(str, lengths))
        family = "vec" if len(lengths) == 1 else "mat"
        return type(element).parse(f"!warp.{family}<{shape} x {element}>")

    def spread(self, node):
        """Bindings of a starred expression."""
        binding = self.expr(node.value)
        if type(binding) is tuple:
            return binding
        if isinstance(binding, types.Composite):
            binding = self.materialize(binding, node)
        if type(binding) is Value and binding.type.kind in ("vec", "quat", "transform"):
            native = binding.type
            count = {"quat": 4, "transform": 7}.get(native.kind) or native.shape[0]
            self.at(node)
            indices = [self.builder.constant(INT32, i) for i in range(count)]
            return tuple([self.builder.extract(binding, [index]) for index in indices])
        raise self.type_error(
            node, f"expects a tuple or vector after `*`, but got '{self.type_name(binding)}'"
        )
