"""Texels as kernels read them, and the numbers that users have, on the host and on devices."""

from __future__ import annotations

from warp._src import errors
from warp._src.arrays import hooks
from warp._src.arrays.array import array
from warp._src.arrays.casts import cast
from warp._src.textures.mips import numpy
from warp._src.types import dtypes, scalars
from warp._src.types.numpy_types import dtype_from_numpy

# Types of texels, and by what integers are divided; of 32 bits they stay as they are.
KINDS = (
    (scalars.uint8, 255.0),
    (scalars.uint16, 65535.0),
    (scalars.float32, None),
    (scalars.int8, 127.0),
    (scalars.int16, 32767.0),
    (scalars.float16, None),
    (scalars.uint32, None),
    (scalars.int32, None),
)
_NUMBER_OF = {dtype: number for number, (dtype, _) in enumerate(KINDS)}


def kind_of(dtype) -> int:
    if dtype not in _NUMBER_OF:
        known = ", ".join(f"'{known.__name__}'" for known, _ in KINDS)
        raise TypeError(f"textures hold {known}, but got '{dtypes.type_repr(dtype)}'")
    return _NUMBER_OF[dtype]


def checked_shape(extents, channels):
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


def numbers_of(data):
    """A NumPy array of the data, and the kind of its type."""
    try:
        values = data.numpy() if isinstance(data, array) else numpy().asarray(data)
    except (TypeError, ValueError) as error:
        raise errors.WarpArgumentError(f"expects an array of numbers, but {error}") from None
    try:
        return values, kind_of(dtype_from_numpy(values.dtype))
    except KeyError:
        raise TypeError(f"textures hold numbers, but got '{values.dtype}'") from None


def texels_of(values, kind):
    """The numbers that kernels read for values of a kind."""
    most = KINDS[kind][1]
    if most is None:
        return values.astype("f4")
    return numpy().maximum((values / most).astype("f4"), numpy().float32(-1))


def read(source, most, target) -> None:
    """Writes the float32 texels of numbers.

    Args:
        source: packed array of numbers.
        most: what integers are divided by, None for numbers that stay as they are.
        target: packed array of as many float32.
    """
    if most is None:
        return cast(source, target)
    _apply(source, target, f"wp.max(kind(wp.float64(x0) / wp.float64({most})), kind(-1.0))", most)


def write(source, most, target) -> None:
    """Writes the numbers that float32 texels stand for; the arguments are those of `read`."""
    if most is None:
        return cast(source, target)
    _apply(source, target, f"kind(wp.rint(wp.float64(x0) * wp.float64({most})))", most)


def _apply(source, target, expression, most):
    from warp._src.language import namespace

    kind = target.dtype
    name = f"texels_{kind.__name__}_{int(most)}"
    names = {"kind": kind, "wp": namespace}
    hooks.apply(name, expression, names, name, [(None, source)], target, False, None, None)
