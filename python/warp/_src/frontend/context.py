"""What all parts of the translator share: bindings, constants, errors.

A name in a kernel is bound to one of

* a native `Value`: an SSA value of the module under construction;
* a Python `int`, `float` or `bool`: a literal or captured constant. It becomes `int32`, `float32`
  or `bool` where a value is needed, and stays a number where a constant is (`range`, indices);
* a tuple of bindings;
* any other Python object, known at compile time: a function, type, module, string, enum.

The translator has no type rules. It asks the builder, and turns what the builder reports into an
error at the syntax node it was working on.
"""

from __future__ import annotations

import enum

from warp import _native
from warp._src import errors
from warp._src.frontend import names
from warp._src.language.builtins import Builtin
from warp._src.types import dtypes
from warp._src.types.composites import scalars_of

Value = _native.Value
NativeType = _native.Type
BOOL = _native.Type.parse("i1")
INT32 = _native.Type.parse("si32")
FLOAT32 = _native.Type.parse("f32")
_MISSING = object()


def note_of_call(source, node) -> str:
    """What an error in a function tells of a call of it."""
    return f"called from '{source.name}' at {source.file}:{source.line(node)}"


class Session:
    """State shared by the functions of one kernel."""

    __slots__ = (
        *("active", "builder", "callers", "calls", "debug", "derived", "handles", "is_ragged"),
        *("max_unroll", "memories", "parameters", "statics", "sums_winding", "taken", "threads"),
        "tile_builder",
    )

    def __init__(self, builder, max_unroll=16):
        self.builder = builder
        self.max_unroll = max_unroll
        # Finished functions by overload and argument types, and symbol names in use.
        self.calls = {}
        self.taken = {}
        # Functions whose own derivative, if they have one, has been attached.
        self.derived = set()
        # Functions being translated, outermost first, and where each but the first is called:
        # source and syntax.
        self.active = []
        self.callers = []
        # Each `wp.static` that was evaluated: function, expression, names and what it gave.
        self.statics = []
        # The kernel's arguments by name, and the kinds of those that are handles of geometry.
        self.parameters = {}
        self.handles = {}
        # Whether something asks for winding numbers, of which meshes are to know.
        self.sums_winding = False
        # Threads of the blocks that the kernel is for, and what builds tiles once there is one.
        self.threads = 1
        self.is_ragged = False
        self.tile_builder = None
        # Arrays in memory of the thread so far.
        self.memories = 0

    def next_memory(self) -> int:
        """A number for another piece of memory of the thread."""
        self.memories += 1
        return self.memories

    @property
    def tiles(self):
        """The builder of tiles; the kernel is one for blocks from here on."""
        if self.tile_builder is None:
            self.tile_builder = _native.TileBuilder(self.builder)
            self.tile_builder.set_block_threads(self.threads, self.is_ragged)
        return self.tile_builder

    def block_threads(self) -> int:
        """Threads of a block; code depends on it."""
        self.tiles  # noqa: B018
        return self.threads

    def notes_of_calls(self) -> tuple:
        """Where the functions being translated are called, the innermost first."""
        return tuple(note_of_call(*caller) for caller in reversed(self.callers))

    def symbol(self, name: str) -> str:
        """A name for a function that no other function of the module has."""
        count = self.taken.get(name, 0)
        self.taken[name] = count + 1
        return f"{name}_{count}" if count else name


class LocalArray:
    """An array of one thread: its shape, the type of an element, and the vectors that hold it.

    is_copy: it is a part of another one and only to be read. As a shape for `unflatten` the vectors
    are left out.
    """

    __slots__ = ("element", "is_copy", "parts", "shape")
    # Like the kinds of the compiler's types.
    kind = "local array"

    def __init__(self, shape, element, parts=(), is_copy=False):
        self.shape = shape
        self.element = element
        self.parts = parts
        self.is_copy = is_copy

    def __eq__(self, other):
        if type(other) is not LocalArray:
            return NotImplemented
        return self.shape == other.shape and self.element == other.element

    def __hash__(self):
        return hash((self.shape, self.element))

    @property
    def python_name(self):
        return f"fixedarray(shape={self.shape}, dtype={self.element.python_name})"


class TileStack:
    """A stack that a block has together: a tile of elements, and how many there are, in one too.

    type: capacity and element type. As a shape for `unflatten` the tiles are left out.
    """

    __slots__ = ("parts", "type")

    def __init__(self, stack_type, parts=()):
        self.type = stack_type
        self.parts = parts

    def __eq__(self, other):
        return type(other) is TileStack and self.type == other.type

    def __hash__(self):
        return hash((TileStack, self.type))

    @property
    def python_name(self):
        return repr(self.type)


class TileView:
    """A part of a tile that a variable holds: the place, as what can be assigned to."""

    __slots__ = ("slot",)

    def __init__(self, slot):
        self.slot = slot

    @property
    def type(self):
        return self.slot.type


class Parts:
    """Shape of a struct that is passed field by field."""

    __slots__ = ("native", "parts")

    def __init__(self, native, parts):
        self.native = native
        self.parts = parts


class Context:
    """What the parts of a translator share: the state of translating one function.

    `Translator`, which is what there is, has the parts too, under the names of their files.
    """

    def __init__(self, session: Session, function, source, is_kernel: bool):
        self.session = session
        self.builder = session.builder
        self.function = function
        self.source = source
        self.is_kernel = is_kernel
        self.env = {}
        # Line of the last assignment of each name, for messages.
        self.lines = {}
        # By identity of constants that variables hold: the constant, and the number as written.
        self.literals: dict = {}
        # Loops around the place that is being translated, outermost first.
        self.frames = []
        self.node = source.tree
        self.captured = {}
        # Native types of the declared results, and the returns so far as (line, type).
        self.result_type = None
        self.returned = []

    # Places and errors.

    def at(self, node):
        """What the builder makes next comes from this node."""
        self.node = node
        self.builder.set_location(
            self.source.encoded_file, node.lineno + self.source.line_offset, node.col_offset + 1
        )

    def error(self, node, message, hint=None, kind=errors.WarpCodegenError, notes=(), also=None):
        """The exception for a message about a node."""
        return kind(message, hint=hint, notes=notes, also=also, **self.source.place(node))

    def type_error(self, node, message, hint=None, notes=(), also=None):
        return self.error(node, message, hint, errors.WarpCodegenTypeError, notes, also)

    def value_error(self, node, message, hint=None, also=None):
        return self.error(node, message, hint, errors.WarpCodegenValueError, also=also)

    def unsupported(self, node, what, hint=None, also=None):
        return self.error(node, f"{what} is not supported in kernels", hint, also=also)

    def locate(self, error: errors.WarpError):
        """Completes an error of the builder with the place in the source."""
        if error.end_column:
            return error
        place = self.source.place(self.node)
        # The first line says what is wrong, and after `; ` the fix; overloads follow.
        message, _, details = error.message.partition("\n")
        message, _, fix = message.partition("; use ")
        hint = f"use {fix}" if fix else error.hint
        notes = (*error.notes, details.strip()) if details else error.notes
        return type(error)(message, hint=hint, notes=notes, also=error.also, **place)

    # Constants.

    def capture(self, value, node):
        """Binding of a Python object that a kernel refers to."""
        kind = type(value)
        if kind in (bool, int, float, str) or kind is Value:
            return value
        if isinstance(value, Builtin):
            return names.BuiltinRef(value.key)
        if isinstance(value, enum.Enum):
            if isinstance(value, int):
                return int(value)
            return value
        if isinstance(value, int):
            return int(value)
        if isinstance(value, float):
            return float(value)
        if kind.__module__ == "numpy" and hasattr(value, "item") and not hasattr(value, "__len__"):
            return value.item()
        return value

    def materialize(self, binding, node):
        """The SSA value of a binding."""
        kind = type(binding)
        if kind is Value:
            return binding
        if kind is bool:
            return self.builder.constant(BOOL, binding)
        if kind is int:
            return self.integer(binding, node)
        if kind is float:
            return self.builder.constant(FLOAT32, binding)
        return self.materialize_object(binding, node)

    def integer(self, number, node):
        """An `int32` constant; a number that does not fit is an error."""
        if not -(2**31) <= number < 2**31:
            wide = "wp.int64" if -(2**63) <= number < 2**63 else "wp.uint64"
            raise self.error(
                node,
                f"integer {number} does not fit 'int32'",
                f"use `{wide}({number})`" if -(2**63) <= number < 2**64 else None,
                errors.WarpCodegenOverflowError,
            )
        return self.builder.constant(INT32, number)

    def materialize_object(self, binding, node):
        kind = type(binding)
        if isinstance(binding, dtypes.scalar_base):
            self.at(node)
            return self.builder.constant(dtypes.native_type(kind), binding.value)
        if kind is TileView:
            return self.targets.read(binding.slot, node)
        if kind is LocalArray:
            raise self.type_error(
                node,
                "an array of a thread cannot be used here",
                "index it, or pass it to functions",
            )
        if kind is TileStack:
            raise self.type_error(
                node, "a stack cannot be used here", "pass it to `wp.tile_stack_pop` or its like"
            )
        if isinstance(binding, dtypes.Composite):
            if not binding._length_:
                raise self.type_error(node, "expects a value, but got a slice without components")
            self.at(node)
            native = dtypes.native_type(kind)
            element = native.element
            parts = [self.builder.constant(element, c) for c in scalars_of(binding)]
            return self.builder.construct(native, parts)
        if kind is tuple:
            raise self.type_error(node, "expects a value, but got a tuple")
        if binding is None:
            raise self.type_error(node, "expects a value, but got 'None'")
        if dtypes.is_struct(kind):
            return self.materialize_struct(binding, node)
        what = names.describe(binding)
        raise self.type_error(
            node,
            f"expects a value, but got {what}",
            "pass arrays and structs as kernel arguments" if hasattr(binding, "dtype") else None,
            also=names.external_words(binding),
        )

    def materialize_struct(self, binding, node):
        self.at(node)
        native = dtypes.native_type(type(binding))
        fields = []
        for name, field in native.fields:
            part = getattr(binding, name)
            if field.kind == "array":
                raise self.type_error(
                    node,
                    f"field '{name}' of a captured struct is an array",
                    "pass it as an argument",
                )
            fields.append(self.convert_constant(part, field, node))
        return self.builder.struct_create(native, fields)

    def static_type(self, binding):
        """Native type that a binding has or would get, or None; a type stands for its values."""
        kind = type(binding)
        if kind is Value:
            return binding.type
        if kind is NativeType:
            return binding
        if kind in (LocalArray, TileStack):
            return None
        if kind is TileView:
            return binding.type
        plain = {bool: BOOL, int: INT32, float: FLOAT32}.get(kind)
        if plain is not None or kind is tuple or isinstance(binding, type):
            return plain
        try:
            return dtypes.native_type(kind)
        except TypeError:
            return None

    def convert_constant(self, binding, native, node):
        """Like `materialize`, but a plain number takes the given scalar type."""
        if type(binding) in (int, float, bool) and native.kind in ("bool", "int", "float"):
            self.at(node)
            return self.builder.constant(native, binding)
        return self.materialize(binding, node)

    # Bindings as lists of values.

    def flatten(self, binding, node, into):
        """Appends the values of a binding; gives its shape for `unflatten`."""
        if type(binding) is tuple:
            return tuple([self.flatten(part, node, into) for part in binding])
        if type(binding) is LocalArray:
            into += binding.parts
            return LocalArray(binding.shape, binding.element, len(binding.parts), binding.is_copy)
        if type(binding) is TileStack:
            into += binding.parts
            return TileStack(binding.type)
        into.append(self.materialize(binding, node))
        return None

    def unflatten(self, shape, values):
        """Rebuilds a binding from an iterator over values."""
        if type(shape) is tuple:
            return tuple([self.unflatten(part, values) for part in shape])
        if type(shape) is LocalArray:
            parts = [next(values) for _ in range(shape.parts)]
            return LocalArray(shape.shape, shape.element, parts, shape.is_copy)
        if type(shape) is TileStack:
            return TileStack(shape.type, [next(values), next(values)])
        if type(shape) is Parts:
            parts = [self.unflatten(part, values) for part in shape.parts]
            return self.builder.struct_create(shape.native, parts)
        return next(values)

    def type_name(self, binding) -> str:
        """Python's name for the type of a binding, for messages."""
        if type(binding) is Value:
            return binding.type.python_name
        if type(binding) in (NativeType, LocalArray, TileStack):
            return binding.python_name
        if type(binding) is TileView:
            return binding.type.python_name
        if type(binding) is tuple:
            return "tuple(" + ", ".join(map(self.type_name, binding)) + ")"
        return names.literal_name(binding)

    # Names.

    def assign_name(self, name, binding, node):
        if type(binding) is int and not -(2**31) <= binding < 2**31:
            self.integer(binding, getattr(node, "value", node))
        if type(binding) is float:
            number, binding = binding, self.builder.constant(FLOAT32, binding)
            self.literals[id(binding)] = binding, number
        if not self.can_be_bound(binding):
            raise self.type_error(
                node,
                f"{names.describe(binding)} cannot be a variable of a kernel",
                "kernels can capture numbers, vectors, matrices, structs, functions and tuples",
            )
        if type(binding) is TileView and binding.slot.name == name:
            # The variable is no longer that of the whole tile.
            binding = self.materialize(binding, node)
        old = self.env.get(name)
        if old is not None:
            self.check_same_type(name, old, binding, node)
            if type(old) is Value and old.type.kind == "tile":
                self.tiles.views.keep(name)
        self.env[name] = binding
        self.lines[name] = self.source.line(node)

    def literal(self, binding):
        """The number that was assigned to a variable, before it became a `float32`; or None."""
        value, number = self.literals.get(id(binding), (None, None))
        return number if value is binding else None

    @staticmethod
    def can_be_bound(binding):
        if isinstance(binding, (Value, bool, int, float, str, tuple, enum.Enum)):
            return True
        kinds = (
            *(dtypes.scalar_base, dtypes.Composite, names.BuiltinRef),
            *(LocalArray, TileView, TileStack),
        )
        return isinstance(binding, kinds) or callable(binding) or dtypes.is_struct(type(binding))

    def check_same_type(self, name, old, binding, node):
        """A variable keeps its type."""
        before, after = self.static_type(old), self.static_type(binding)
        if {LocalArray, TileStack} & {type(old), type(binding)}:
            before, after = old, binding
            if type(before) is not type(after) or before != after:
                raise self.type_error(
                    node,
                    f"'{name}' is '{self.type_name(old)}' and cannot become "
                    f"'{self.type_name(binding)}'",
                    "use another name",
                )
        if before == after or before is None or after is None:
            return
        if before.kind == after.kind == "array" and before.element == after.element:
            return
        before, after = before.python_name, after.python_name
        hint = None
        if (before, after) == ("int32", "float32"):
            hint = f"declare it as `{name} = float(...)`"
        if before == "float32" and after == "int32":
            hint = "use `float(...)`"
        raise self.type_error(
            node,
            f"'{name}' is '{before}' and cannot become '{after}'",
            hint or "use another name",
            notes=[f"'{name}' is '{before}' at line {self.lines[name]}"],
        )

    def read_name(self, name, node):
        binding = self.env.get(name, _MISSING)
        if binding is not _MISSING:
            return binding
        if name in self.source.plan.local_names:
            hint = None
            if any(name in loop.pending for loop in self.frames):
                hint = "assign it before the loop"
            raise self.error(
                node, f"'{name}' is used before it is assigned", hint, errors.WarpCodegenKeyError
            )
        if name not in self.captured:
            self.captured[name] = self.capture(names.resolve(self, name, node), node)
        return self.captured[name]


class Part:
    """A part of a translator, for one topic.

    Attributes:
        context: the translator.
        builder: its builder.
    """

    __slots__ = ("builder", "context")

    def __init__(self, context):
        self.context = context
        self.builder = context.builder
