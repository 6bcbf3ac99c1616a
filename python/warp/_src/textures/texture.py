"""`wp.Texture1D`, `wp.Texture2D`, `wp.Texture3D`: regular grids of numbers, read between points.

To a kernel a texture is a struct of an array of float32 texels and of how it is read; the functions
that read it are in `sampling`. So devices, graphs, structs and arrays of textures need nothing of
their own, and a GPU computes what the CPU does; its texture units are not used. Levels of a mip
chain (`mips`) lie one behind the other, the finest first. For 32-bit integers, which float32 does
not hold, there is a second array with the numbers themselves.
"""

from __future__ import annotations

import typing

from warp._src import errors
from warp._src.arrays.array import array
from warp._src.textures import mips, texels
from warp._src.textures.copies import TextureCopies
from warp._src.textures.mips import numpy
from warp._src.textures.modes import (
    TextureAddressMode,
    TextureFilterMode,
    TextureModes,
    mode_of,
)
from warp._src.types import dtypes, scalars
from warp._src.types.native import ArrayType
from warp._src.types.structs import StructInstance, make_struct

_FIELDS = {
    "texels": ArrayType(scalars.float32, 1),
    **dict.fromkeys(("width", "height", "depth", "num_channels", "kind"), scalars.int32),
    **dict.fromkeys(("filter", "address_u", "address_v", "address_w"), scalars.int32),
    **dict.fromkeys(("levels", "mip_filter"), scalars.int32),
    "normalized": scalars.bool,
}
_AXES = ("width", "height", "depth")


class Texture(TextureCopies, TextureModes, StructInstance):
    """Base of the textures.

    Args:
        data: a NumPy array or an array with shape (width,), (height, width) or
            (depth, height, width), and a last dimension for 2 or 4 channels, which may be vectors.
            uint8 and uint16 are read as numbers in [0, 1], int8 and int16 in [-1, 1], the others as
            they are.
        width, height, depth, num_channels, dtype: of a texture of zeros, without data.
        filter_mode: by default `LINEAR`; `CLOSEST` for 32-bit integers.
        address_mode: one, or one for each axis; `address_mode_u` and its like go before it.
        normalized_coords: whether a texture spans [0, 1], rather than [0, extent].
        num_mip_levels: of a mip chain that is made of the data, each level means of pairs of the
            one before; 0 for all, down to one texel.
        mip_filter_mode: whether a level of detail between two levels reads both or the nearer;
            by default both, of 32-bit integers the nearer.
        device: where the texels live.

    Raises:
        TypeError, ValueError: data or modes do not fit.
    """

    # For 32-bit integers, the numbers.
    _whole = None

    def __init__(self, *args, **options):
        if type(self) is Texture:
            raise TypeError("make a `wp.Texture1D`, `wp.Texture2D` or `wp.Texture3D`")
        super().__init__()
        if not args and not options:
            # The value of a struct's field before it is set: nothing, which reads as zero.
            return
        beyond = [f"address_mode_{axis}" for axis in "uvw"[self.ndim :]]
        order = [
            "data", *_AXES[: self.ndim], *(name for name in _OPTIONS if name not in beyond)
        ]  # fmt: skip
        if len(args) > len(order):
            raise TypeError(f"'{type(self).__name__}' takes at most {len(order)} arguments")
        given = dict(zip(order, args, strict=False))
        for name in options:
            if name in given or name not in order:
                problem = "twice" if name in given else "unknown"
                raise TypeError(f"'{type(self).__name__}': argument '{name}' is {problem}")
        self._make(**given, **options)

    def __setattr__(self, name, value):
        if name not in _FIELDS:
            raise AttributeError(f"'{type(self).__name__}' has no attribute '{name}' to set")
        raise AttributeError(
            f"'{name}' of a '{type(self).__name__}' cannot be replaced: texels lie and are read as "
            "it says; make another texture"
        )

    def _set(self, **fields):
        for name, value in fields.items():
            super().__setattr__(name, value)

    def _make(self, data=None, device=None, dtype=None, num_channels=0, **options):
        extents = [options.pop(name, 0) for name in _AXES[: self.ndim]][::-1]
        levels = options.pop("num_mip_levels", 1)
        if options.pop("cuda_array", 0):
            raise errors.WarpError("textures over CUDA arrays are not in this package")
        whole = None
        if data is None:
            if levels != 1:
                raise ValueError("a mip chain is made of data, but none is given")
            channels = num_channels or 1
            kind = texels.kind_of(scalars.float32 if dtype is None else dtypes.canonical(dtype))
            self._set_shape(*texels.checked_shape(extents, channels), kind)
            self._set(texels=_zeros(self._count(), scalars.float32, device))
            if self._is_whole():
                whole = _zeros(self._count(), self.dtype, device)
        else:
            if device is None and isinstance(data, array):
                device = data.device
            values, kind = texels.numbers_of(data)
            extents, channels = self._split(values.shape)
            self._set_shape(extents, channels, kind)
            self._set(levels=mips.count_of(extents, levels))
            chain = mips.chain_of(values, self.ndim, self.levels)
            numbers = numpy().concatenate([one.reshape(-1) for one in chain])
            self._set(texels=array(texels.texels_of(numbers, kind), device=device))
            if self._is_whole():
                whole = array(values.reshape(-1), dtype=self.dtype, device=device)
        object.__setattr__(self, "_whole", whole)
        self._set_modes(**options)

    def _is_whole(self) -> bool:
        """True if texels are integers that float32 does not hold."""
        return self.dtype in (scalars.int32, scalars.uint32)

    def _split(self, shape):
        """Extents and channels of data of a shape."""
        if len(shape) == self.ndim:
            return texels.checked_shape(shape, 1)
        if len(shape) != self.ndim + 1:
            raise ValueError(
                f"'{type(self).__name__}' expects data with {self.ndim} dimensions, and perhaps "
                f"one for channels, but got shape {tuple(shape)}"
            )
        return texels.checked_shape(shape[:-1], shape[-1])

    def _set_shape(self, extents, channels, kind):
        for name, extent in zip(_AXES, [*extents[::-1], 1, 1], strict=False):
            self._set(**{name: int(extent)})
        self._set(num_channels=channels, kind=kind, levels=1)

    def _count(self) -> int:
        return self.width * self.height * self.depth * self.num_channels

    def _set_modes(
        self,
        filter_mode=None,
        address_mode=TextureAddressMode.CLAMP,
        normalized_coords=True,
        mip_filter_mode=None,
        surface_access=False,
        **by_axis,
    ):
        whole = self._is_whole()
        usual = TextureFilterMode.CLOSEST if whole else TextureFilterMode.LINEAR
        filter_mode = usual if filter_mode is None else filter_mode
        self._set(filter=mode_of(TextureFilterMode, filter_mode, "filter"))
        if whole and self.filter == TextureFilterMode.LINEAR:
            raise ValueError(
                "filter_mode: textures of 32-bit integers are read with `CLOSEST` only"
            )
        mip_mode = usual if mip_filter_mode is None else mip_filter_mode
        self._set(mip_filter=mode_of(TextureFilterMode, mip_mode, "mip filter"))
        if whole and self.is_mipmapped and self.mip_filter == TextureFilterMode.LINEAR:
            raise ValueError(
                "mip_filter_mode: levels of 32-bit integers are read with `CLOSEST` only"
            )
        if surface_access and self.is_mipmapped:
            raise ValueError("a texture with a mip chain cannot be written to")
        modes = address_mode if isinstance(address_mode, (tuple, list)) else [address_mode] * 3
        if len(modes) < self.ndim:
            raise ValueError(f"expects {self.ndim} address modes, but got {len(modes)}")
        for axis, name in zip("uvw"[: self.ndim], modes, strict=False):
            own = by_axis.get(f"address_mode_{axis}")
            mode = mode_of(TextureAddressMode, name if own is None else own, "address")
            self._set(**{f"address_{axis}": mode})
        self._set(normalized=bool(normalized_coords))

    @property
    def dtype(self):
        """The type of a texel's number, as it was given."""
        return texels.KINDS[self.kind][0]

    @property
    def device(self):
        """The device that the texture is on."""
        return self.texels.device

    @property
    def cuda_array(self):
        """None of this package has one: texels are the array `texels`.

        Raises:
            RuntimeError: always.
        """
        raise self._no_cuda_object("cuda_array")

    @property
    def cuda_texture(self):
        """As `cuda_array`; kernels take the texture itself.

        Raises:
            RuntimeError: always.
        """
        raise self._no_cuda_object("cuda_texture")

    @property
    def cuda_surface(self):
        """As `cuda_array`; kernels may write to `texels`.

        Raises:
            RuntimeError: always.
        """
        raise self._no_cuda_object("cuda_surface")

    def _no_cuda_object(self, name):
        if self.texels is None or not self.texels.device.is_cuda:
            return errors.WarpError(f"{name} is only supported for CUDA textures.")
        return errors.WarpError(
            f"there is no {name}: textures are arrays in linear memory, see `texels`"
        )

    @property
    def id(self) -> int:
        """Address of the texels, 0 for a texture without."""
        return 0 if self.texels is None else self.texels.ptr or 0

    def numpy(self):
        """The texels as a NumPy array of their type, with a last dimension for several channels.

        For a mip chain these are those of the finest level.
        """
        dtype, most = texels.KINDS[self.kind]
        if self._is_whole():
            values = self._whole.numpy()
        else:
            values = self.texels.numpy()[: self._count()]
        if most is not None:
            values = numpy().rint(values.astype("f8") * most)
        shape = self._shape()
        values = values.astype(dtype._element_)
        return values.reshape(shape if shape[-1] > 1 else shape[:-1])

    def _shape(self) -> tuple:
        extents = [getattr(self, name) for name in _AXES[: self.ndim]][::-1]
        return (*extents, self.num_channels)


_OPTIONS = (
    *("num_channels", "dtype", "filter_mode", "address_mode", "address_mode_u"),
    *("address_mode_v", "address_mode_w", "normalized_coords", "num_mip_levels"),
    *("mip_filter_mode", "device", "surface_access", "cuda_array"),
)


def _zeros(count, dtype, device):
    made = array(shape=count, dtype=dtype, device=device)
    made.zero_()
    return made


def _make_class(ndim):
    name = f"Texture{ndim}D"
    about = {"__module__": "warp", "__qualname__": name, "__doc__": Texture.__doc__, "ndim": ndim}
    return make_struct(name, _FIELDS, Texture, about)


if typing.TYPE_CHECKING:

    class Texture1D(Texture): ...

    class Texture2D(Texture): ...

    class Texture3D(Texture): ...

else:
    Texture1D, Texture2D, Texture3D = map(_make_class, (1, 2, 3))
