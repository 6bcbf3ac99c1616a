"""Annotations of parameters that are tiles: `wp.tile[float, 16, 16]`."""

from __future__ import annotations

import typing

from warp._src.types import native
from warp._src.types.vectors import unwrapped


class TileType:
    """Type of a tile, for parameters and results of `@wp.func`.

    Attributes:
        dtype: element type, or `typing.Any`.
        shape: 1 to 4 extents; each an int, or `typing.Any` for any. None leaves all of it open.

    Raises:
        TypeError: extents are not what they should be, or there is no such element type.
    """

    __slots__ = ("dtype", "shape")

    def __init__(self, dtype, shape):
        self.dtype = dtype if dtype is typing.Any else native.canonical(dtype)
        if len(shape) == 1 and isinstance(shape[0], tuple):
            shape = shape[0]
        elif not shape:
            self.shape = None
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
        """Whether something of it is left to the call."""
        return self.shape is None or typing.Any in (self.dtype, *self.shape)

    @property
    def _native_(self) -> str:
        extents = "x".join(map(str, self.shape))
        return f"!warp.tile<{extents} x {native.native_text(self.dtype)}>"

    def fits(self, found) -> bool:
        """Whether a type of the compiler is one that an open annotation asks for."""
        if found.kind == "tile" and self.shape is None:
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
        parts = [getattr(self.dtype, "__name__", str(self.dtype)), *map(str, self.shape or ())]
        return f"wp.tile[{', '.join(parts)}]"
