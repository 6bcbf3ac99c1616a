"""Bindings: the values of names in a kernel.

A name in a kernel is bound to one of

* a native `Value`: an SSA value of the module under construction;
* a Python `int`, `float` or `bool`: a literal or captured constant. It becomes `int32`, `float32`
  or `bool` where a value is needed, and stays a number where a constant is (`range`, indices);
* a tuple of bindings;
* a `Record`: a description known at compile time, and bindings that are its parts;
* a NumPy array: a table of constants, which counts by its contents;
* any other Python object, known at compile time: a function, type, module, string, enum.
"""

from __future__ import annotations

from warp import _native

Value = _native.Value
NativeType = _native.Type
BOOL = _native.Type.parse("i1")
INT32 = _native.Type.parse("si32")
FLOAT32 = _native.Type.parse("f32")


def is_table(binding) -> bool:
    """True for a NumPy array of one or more dimensions, which is a table of constants."""
    kind = type(binding)
    return kind.__name__ == "ndarray" and kind.__module__ == "numpy" and binding.ndim > 0


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


class Record:
    """A description and its parts. As a shape for `unflatten`, the parts are shapes."""

    __slots__ = ("description", "parts")

    def __init__(self, description, parts):
        self.description = description
        self.parts = parts

    @property
    def python_name(self):
        return str(self.description)
