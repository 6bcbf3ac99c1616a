"""`wp.Texture1D`, `wp.Texture2D`, `wp.Texture3D`: regular grids of numbers, read between points.

To a kernel a texture is a struct of an array of float32 texels and of how it is read; the functions
that read it are in `sampling`. So devices, graphs, structs and arrays of textures need nothing of
their own, and a GPU computes what the CPU does; its texture units are not used.
"""

from __future__ import annotations

import enum

from warp._src import errors
from warp._src.arrays.array import array
from warp._src.types import dtypes, scalars
from warp._src.types.native import ArrayType
from warp._src.types.numpy_types import dtype_from_numpy
from warp._src.types.structs import StructInstance, make_struct


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


# Types of texels, and by what integers are divided; of 32 bits they stay as they are.
_KINDS = (
    (scalars.uint8, 255.0),
    (scalars.uint16, 65535.0),
    (scalars.float32, None),
    (scalars.int8, 127.0),
    (scalars.int16, 32767.0),
    (scalars.float16, None),
    (scalars.uint32, None),
    (scalars.int32, None),
)
_KIND_BY_TYPE = {dtype: number for number, (dtype, _) in enumerate(_KINDS)}
_FIELDS = {
    "texels": ArrayType(scalars.float32, 1),
    **dict.fromkeys(("width", "height", "depth", "num_channels", "kind"), scalars.int32),
    **dict.fromkeys(("filter", "address_u", "address_v", "address_w"), scalars.int32),
    "normalized": scalars.bool,
}
_AXES = ("width", "height", "depth")


class Texture(StructInstance):
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
        num_mip_levels: 1, the only number that there is.
        device: where the texels live.

    Raises:
        TypeError, ValueError: data or modes do not fit.
    """

    def __init__(self, *args, **options):
        if type(self) is Texture:
            raise TypeError("make a `wp.Texture1D`, `wp.Texture2D` or `wp.Texture3D`")
        super().__init__()
        if not args and not options:
            # What a field of a struct holds before it is set: nothing, which reads as zero.
            return
        order = ("data", *_AXES[: self.ndim], *_OPTIONS)
        if len(args) > len(order):
            raise TypeError(f"'{type(self).__name__}' takes at most {len(order)} arguments")
        given = dict(zip(order, args, strict=False))
        for name in options:
            if name in given or name not in order:
                problem = "twice" if name in given else "unknown"
                raise TypeError(f"'{type(self).__name__}': argument '{name}' is {problem}")
        self._make(**given, **options)

    def _make(self, data=None, device=None, dtype=None, num_channels=0, **options):
        extents = [options.pop(name, 0) for name in _AXES[: self.ndim]][::-1]
        if options.pop("num_mip_levels", 1) != 1 or options.pop("cuda_array", 0):
            raise errors.WarpError("mip levels and CUDA arrays are not in this package yet")
        if data is None:
            channels = num_channels or 1
            kind = _kind(scalars.float32 if dtype is None else dtypes.canonical(dtype))
            self._set_shape(*_checked_shape(extents, channels), kind)
            self.texels = array(
                shape=self._count(), dtype=scalars.float32, device=device
            )  # fmt: skip
            self.texels.zero_()
        else:
            if device is None and isinstance(data, array):
                device = data.device
            values, kind = _numbers(data)
            extents, channels = self._split(values.shape)
            self._set_shape(extents, channels, kind)
            self.texels = array(_read(values, kind).reshape(-1), device=device)
        self._set_modes(**options)

    def _split(self, shape):
        """Extents and channels of data of a shape."""
        if len(shape) == self.ndim:
            return _checked_shape(shape, 1)
        if len(shape) != self.ndim + 1:
            raise ValueError(
                f"'{type(self).__name__}' expects data with {self.ndim} dimensions, and perhaps "
                f"one for channels, but got shape {tuple(shape)}"
            )
        return _checked_shape(shape[:-1], shape[-1])

    def _set_shape(self, extents, channels, kind):
        for name, extent in zip(_AXES, [*extents[::-1], 1, 1], strict=False):
            setattr(self, name, int(extent))
        self.num_channels, self.kind = channels, kind

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
        whole = self.dtype in (scalars.int32, scalars.uint32)
        if filter_mode is None:
            filter_mode = TextureFilterMode.CLOSEST if whole else TextureFilterMode.LINEAR
        self.filter = TextureFilterMode(filter_mode)
        if whole and self.filter == TextureFilterMode.LINEAR:
            raise ValueError("textures of 32-bit integers are read with `CLOSEST` only")
        modes = address_mode if isinstance(address_mode, (tuple, list)) else [address_mode] * 3
        if len(modes) < self.ndim:
            raise ValueError(f"expects {self.ndim} address modes, but got {len(modes)}")
        for axis, name in zip("uvw"[: self.ndim], modes, strict=False):
            own = by_axis.get(f"address_mode_{axis}")
            setattr(self, f"address_{axis}", TextureAddressMode(name if own is None else own))
        self.normalized = bool(normalized_coords)

    @property
    def dtype(self):
        """The type of a texel's number, as it was given."""
        return _KINDS[self.kind][0]

    @property
    def device(self):
        return self.texels.device

    @property
    def filter_mode(self) -> TextureFilterMode:
        return TextureFilterMode(self.filter)

    @property
    def normalized_coords(self) -> bool:
        return bool(self.normalized)

    @property
    def address_mode_u(self) -> TextureAddressMode:
        return TextureAddressMode(self.address_u)

    @property
    def address_mode_v(self) -> TextureAddressMode:
        return TextureAddressMode(self.address_v)

    @property
    def address_mode_w(self) -> TextureAddressMode:
        return TextureAddressMode(self.address_w)

    @property
    def num_mip_levels(self) -> int:
        return 1

    @property
    def is_mipmapped(self) -> bool:
        return False

    @property
    def id(self) -> int:
        """Address of the texels, 0 for a texture without."""
        return 0 if self.texels is None else self.texels.ptr or 0

    def copy_from(self, src) -> None:
        """Sets all texels from a texture, an array or a NumPy array of the same shape and type."""
        if isinstance(src, Texture):
            src = src.numpy()
        values, kind = _numbers(src)
        extents, channels = self._split(values.shape)
        shape = (*extents, channels)
        if shape != self._shape() or kind != self.kind:
            raise ValueError(
                f"expects texels of shape {self._shape()} and '{self.dtype.__name__}', but got "
                f"{shape} and '{_KINDS[kind][0].__name__}'"
            )
        self.texels.assign(_read(values, kind).reshape(-1))

    def copy_to(self, dst) -> None:
        """Writes all texels into a texture, an array or a NumPy array of the same shape."""
        if isinstance(dst, Texture):
            dst.copy_from(self)
        elif isinstance(dst, array):
            dst.assign(self.numpy().reshape(dst._host_view().shape))
        else:
            dst[...] = self.numpy().reshape(dst.shape)

    def numpy(self):
        """The texels as a NumPy array of their type, with a last dimension for several channels."""
        import numpy

        dtype, most = _KINDS[self.kind]
        values = self.texels.numpy()
        if most is not None:
            values = numpy.rint(values.astype(numpy.float64) * most)
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


def _kind(dtype) -> int:
    if dtype not in _KIND_BY_TYPE:
        known = ", ".join(f"'{known.__name__}'" for known, _ in _KINDS)
        raise TypeError(f"textures hold {known}, but got '{dtypes.type_repr(dtype)}'")
    return _KIND_BY_TYPE[dtype]


def _checked_shape(extents, channels):
    count = channels
    for extent in extents:
        count *= extent
    if min(extents) < 1:
        raise ValueError(f"expects extents of at least 1, but got {tuple(extents)}")
    if channels not in (1, 2, 4):
        raise ValueError(f"expects 1, 2 or 4 channels, but got {channels}")
    if count >= 1 << 31:
        raise ValueError(f"a texture has less than 2^31 numbers, but {tuple(extents)} has more")
    return tuple(extents), channels


def _numbers(data):
    """A NumPy array of the data, and the kind of its type."""
    import numpy

    values = data.numpy() if isinstance(data, array) else numpy.asarray(data)
    try:
        return values, _kind(dtype_from_numpy(values.dtype))
    except KeyError:
        raise TypeError(f"textures hold numbers, but got '{values.dtype}'") from None


def _read(values, kind):
    """The numbers that kernels read for values of a kind."""
    import numpy

    most = _KINDS[kind][1]
    if most is None:
        return values.astype(numpy.float32)
    return numpy.maximum((values / most).astype(numpy.float32), numpy.float32(-1))


def _make_class(ndim):
    name = f"Texture{ndim}D"
    about = {"__module__": "warp", "__qualname__": name, "__doc__": Texture.__doc__, "ndim": ndim}
    return make_struct(name, _FIELDS, Texture, about)


Texture1D, Texture2D, Texture3D = map(_make_class, (1, 2, 3))
