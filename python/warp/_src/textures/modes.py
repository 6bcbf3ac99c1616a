"""Texture modes: filtering, addressing, and filtering between mip levels."""

from __future__ import annotations

import enum


class TextureFilterMode(enum.IntEnum):
    """How a texture is read between its points."""

    CLOSEST = 0
    LINEAR = 1


class TextureAddressMode(enum.IntEnum):
    """How a texture is read outside: again, its edge, mirrored, or zero."""

    WRAP = 0
    CLAMP = 1
    MIRROR = 2
    BORDER = 3


class TextureModes:
    """Mixin of `Texture`."""

    __slots__ = ()

    @property
    def filter_mode(self) -> TextureFilterMode:
        """How levels are sampled: `CLOSEST` or `LINEAR`."""
        return TextureFilterMode(self.filter)

    @property
    def normalized_coords(self) -> bool:
        """True if coordinates go from 0 to 1, or over texels."""
        return bool(self.normalized)

    @property
    def address_mode_u(self) -> TextureAddressMode:
        """The texels outside along the first coordinate."""
        return TextureAddressMode(self.address_u)

    @property
    def address_mode_v(self) -> TextureAddressMode:
        """The texels outside along the second coordinate."""
        return TextureAddressMode(self.address_v)

    @property
    def address_mode_w(self) -> TextureAddressMode:
        """The texels outside along the third coordinate."""
        return TextureAddressMode(self.address_w)

    @property
    def mip_filter_mode(self) -> TextureFilterMode:
        """How samples of two levels become one."""
        return TextureFilterMode(self.mip_filter)

    @property
    def num_mip_levels(self) -> int:
        """How many levels there are, the finest included."""
        return self.levels

    @property
    def is_mipmapped(self) -> bool:
        """True if there is more than one level."""
        return self.levels > 1


def mode_of(kind, value, what):
    """The mode of a kind that has a value.

    Raises:
        ValueError: there is none.
    """
    try:
        return kind(value)
    except ValueError:
        known = ", ".join(f"{one.name} ({int(one)})" for one in kind)
        raise ValueError(f"Invalid texture {what} mode: {value}, expects {known}") from None
