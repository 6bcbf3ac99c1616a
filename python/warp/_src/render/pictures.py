"""Pixels as PNG files.

Format: Portable Network Graphics (third edition), W3C 2025, sections 5 and 11.
"""

from __future__ import annotations

import struct
import zlib

from warp.extend import checked
from warp.extend.kinds import NUMBERS

# Colour types by the number of channels.
_COLOURS = {1: 0, 2: 4, 3: 2, 4: 6}
_EXTENTS = 1 << 31


@checked(pixels=NUMBERS)
def save_picture(path, pixels) -> None:
    """Writes pixels as a PNG file.

    Args:
        path: of the file.
        pixels: array (wp.array, NumPy or nested lists) of shape (height, width) or (height, width,
            channels), the first row on top. Channels are grey, grey and alpha, red-green-blue, or
            these and alpha; vectors of these lengths count as channels. Bytes are written as they
            are, floats from 0 to 1 are scaled to bytes and rounded; what is outside becomes 0 or
            255, and NaN 0.

    Raises:
        ValueError: there are no pixels, or the shape is another one.
        TypeError: the pixels are neither bytes nor floats.
    """
    values = _bytes_of(pixels)
    height, width, channels = values.shape
    header = struct.pack(">IIBBBBB", width, height, 8, _COLOURS[channels], 0, 0, 0)
    # Each row starts with its filter, which is none.
    rows = b"".join(b"\0" + row.tobytes() for row in values)
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        parts = ((b"IHDR", header), (b"IDAT", zlib.compress(rows, 6)), (b"IEND", b""))
        for name, content in parts:
            file.write(struct.pack(">I", len(content)) + name + content)
            file.write(struct.pack(">I", zlib.crc32(name + content)))


def _bytes_of(pixels):
    """Pixels as bytes of shape (height, width, channels)."""
    import numpy

    values = pixels.numpy() if hasattr(pixels, "numpy") else numpy.asarray(pixels)
    if values.ndim == 2:
        values = values[:, :, None]
    if values.ndim != 3 or values.shape[2] not in _COLOURS:
        raise ValueError(
            f"expects pixels of shape (height, width) or (height, width, 1 to 4), but got "
            f"{values.shape}"
        )
    if not 0 < min(values.shape[:2]) <= max(values.shape[:2]) < _EXTENTS:
        raise ValueError(f"expects a picture with pixels, but got shape {values.shape}")
    if values.dtype.kind == "f":
        clipped = numpy.clip(numpy.nan_to_num(values.astype(numpy.float64)), 0.0, 1.0)
        return numpy.rint(255.0 * clipped).astype(numpy.uint8)
    if values.dtype != numpy.uint8:
        raise TypeError(f"expects pixels as bytes or floats, but got '{values.dtype}'")
    return values
