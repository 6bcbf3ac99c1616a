"""Copies of all texels of a texture."""

from __future__ import annotations

from warp._src import errors
from warp._src.argument_kinds import ARRAY, DATA
from warp._src.arguments import checked
from warp._src.arrays.array import array
from warp._src.arrays.casts import components_of
from warp._src.textures import texels


class TextureCopies:
    """Mixin of `Texture`."""

    __slots__ = ()

    @checked(src=DATA)
    def copy_from(self, src) -> None:
        """Sets all texels from a texture, an array or a NumPy array of the same shape and type.

        From memory of the same device, a graph that is being captured can hold it.

        Raises:
            RuntimeError: the texture has a mip chain.
            ValueError: shape or type differ.
        """
        self._check_single()
        if isinstance(src, TextureCopies):
            src._check_single()
            self._check_texels(src._shape(), src.kind, what="texture")
            self.texels.assign(src.texels)
            if self._is_whole():
                self._whole.assign(src._whole)
            return
        if isinstance(src, array) and src.device == self.device and src.is_contiguous:
            values = self._components(src, "source")
            texels.read(values, texels.KINDS[self.kind][1], self.texels)
            if self._is_whole():
                self._whole.assign(values)
            return
        values, kind = texels.numbers_of(src)
        extents, channels = self._split(values.shape)
        self._check_texels((*extents, channels), kind)
        self.texels.assign(texels.texels_of(values, kind).reshape(-1))
        if self._is_whole():
            self._whole.assign(values.reshape(-1))

    @checked(dst=ARRAY)
    def copy_to(self, dst) -> None:
        """Writes all texels into a texture, an array or a NumPy array of the same shape.

        Raises:
            RuntimeError: the texture has a mip chain.
            ValueError: shape or type differ.
        """
        self._check_single()
        if isinstance(dst, TextureCopies):
            dst.copy_from(self)
        elif not isinstance(dst, array):
            values, kind = texels.numbers_of(dst)
            extents, channels = self._split(values.shape)
            self._check_texels((*extents, channels), kind, role="destination")
            dst[...] = self.numpy().reshape(dst.shape)
        elif dst.device == self.device and dst.is_contiguous:
            values = self._components(dst, "destination")
            if self._is_whole():
                values.assign(self._whole)
            else:
                texels.write(self.texels, texels.KINDS[self.kind][1], values)
        else:
            values, target = self.numpy(), dst._host_view()
            if values.size != target.size:
                raise ValueError(
                    f"expects a destination of {values.size} numbers, but got {target.size}"
                )
            dst.assign(values.reshape(target.shape))

    def _components(self, one, role):
        """The numbers of a packed array in a row, if they are as many and of the type of texels."""
        extents, channels = self._split((*one.shape, *getattr(one.dtype, "_shape_", ())))
        values = components_of(one)
        self._check_texels((*extents, channels), texels.kind_of(values.dtype), role=role)
        return values

    def _check_single(self):
        if self.is_mipmapped:
            raise errors.WarpError(
                "the levels of a mip chain belong to the data that they were made of and are not "
                "copied, make another texture"
            )

    def _check_texels(self, shape, kind, what="array", role="source"):
        own = self._shape()
        if tuple(shape) != own:
            short = own if own[-1] > 1 else own[:-1]
            other = tuple(shape) if shape[-1] > 1 else tuple(shape[:-1])
            whose = "shape for copy: texture"
            if what == "texture":
                whose = "shapes for copy: destination"
            raise ValueError(f"Incompatible {what} {whose} shape={short}, {role} shape={other}")
        if kind != self.kind:
            raise ValueError(
                f"Incompatible {what} data type for copy: texture dtype={self.dtype.__name__}, "
                f"{role} dtype={texels.KINDS[kind][0].__name__}"
            )
