"""Annotations of parameters that are tiles, `wp.tile[float, 16, 16]`, or stacks of a block."""

from __future__ import annotations

import typing

from warp._src.types import native
from warp._src.types.vectors import unwrapped


class TileType:
    """Type of a tile, for parameters and results of `@wp.func`.

    Attributes:
        dtype: element type, or `typing.Any`.
        shape: 1 to 4 extents; each an int, or `typing.Any` for any. `typing.Any` leaves all of it
            open.
        storage: "register"; where a tile is kept is the compiler's choice.

    Raises:
        TypeError: extents are not what they should be, or there is no such element type.
    """

    __slots__ = ("dtype", "shape")
    _wp_tile_ = True
    storage = "register"

    def __init__(self, dtype, shape):
        self.dtype = dtype if dtype is typing.Any else native.canonical(dtype)
        if len(shape) == 1 and isinstance(shape[0], tuple):
            shape = shape[0]
        elif not shape:
            self.shape = typing.Any
            return
        self.shape = unwrapped(tuple(shape))
        are_extents = all(
            one is typing.Any or (isinstance(one, int) and one > 0) for one in self.shape
        )
        if not 1 <= len(self.shape) <= 4 or not are_extents:
            raise TypeError(
                f"wp.tile[dtype, ...] expects 1 to 4 positive extents, but got {self.shape}"
            )

    @property
    def is_open(self) -> bool:
        """True if something of it is left to the call."""
        return self.shape is typing.Any or typing.Any in (self.dtype, *self.shape)

    @property
    def _native_(self) -> str:
        extents = "x".join(map(str, self.shape))
        return f"!warp.tile<{extents} x {native.native_text(self.dtype)}>"

    def fits(self, found) -> bool:
        """True if a type of the compiler is one that an open annotation asks for."""
        if found.kind == "tile" and self.shape is typing.Any:
            return self.dtype in (typing.Any, native.dtype_of(found.element))
        return (
            found.kind == "tile"
            and len(found.shape) == len(self.shape)
            and all(a in (typing.Any, b) for a, b in zip(self.shape, found.shape, strict=True))
            and self.dtype in (typing.Any, native.dtype_of(found.element))
        )

    def __eq__(self, other):
        if not isinstance(other, TileType):
            return NotImplemented
        return (self.dtype, self.shape) == (other.dtype, other.shape)

    def __hash__(self):
        return hash((TileType, self.dtype, self.shape))

    def __repr__(self):
        parts = [
            native.type_repr(self.dtype),
            *map(str, () if self.shape is typing.Any else self.shape),
        ]
        return f"wp.tile[{', '.join(parts)}]"


def declared_tile(dtype, shape, storage="register"):
    """The type that `wp.tile(dtype=..., shape=..., storage=...)` names outside of kernels."""
    if storage not in ("register", "shared"):
        raise TypeError(f"wp.tile expects 'register' or 'shared' as storage, but got {storage!r}")
    if shape is typing.Any:
        return TileType(dtype, ())
    extents = tuple(shape) if isinstance(shape, (list, tuple)) else (shape,)
    return TileType(dtype, (extents,))


class TileStackType:
    """Type of a stack that a block has together: `wp.tile_stack(capacity=64, dtype=int)`.

    Attributes:
        capacity: the most elements that it holds, a positive int.
        dtype: type of an element.

    Raises:
        TypeError: there is no such element type.
        ValueError: the capacity is no positive integer.
    """

    __slots__ = ("capacity", "dtype")
    # Like the kinds of the compiler's types, and like other annotations that are none of them.
    kind = "tile stack"
    is_open = True

    def __init__(self, capacity, dtype):
        if typing.get_origin(capacity) is typing.Literal:
            capacity = unwrapped((capacity,))[0]
        capacity = getattr(capacity, "value", capacity)
        if type(capacity) is not int or capacity < 1:
            raise ValueError(
                f"wp.tile_stack(capacity, dtype) expects a positive integer as capacity, but got "
                f"{capacity!r}"
            )
        self.capacity = capacity
        self.dtype = native.canonical(dtype)

    def fits(self, found) -> bool:
        """True if a type of the compiler is this one: it has none for stacks."""
        return False

    def __eq__(self, other):
        if not isinstance(other, TileStackType):
            return NotImplemented
        return (self.dtype, self.capacity) == (other.dtype, other.capacity)

    def __hash__(self):
        return hash((TileStackType, self.dtype, self.capacity))

    def __repr__(self):
        name = native.type_repr(self.dtype)
        return f"wp.tile_stack[{name}, {self.capacity}]"
