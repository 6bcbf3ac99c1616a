"""Pixels as PNG files, and by Pillow and ffmpeg as other formats and films.

Format: Portable Network Graphics (third edition), W3C 2025, sections 5 and 11.
"""

from __future__ import annotations

import os
import struct
import zlib

from warp.extend import checked, errors
from warp.extend.kinds import COUNT, NUMBER, NUMBERS, PATH

# Colour types by the number of channels.
_COLOURS = {1: 0, 2: 4, 3: 2, 4: 6}
_EXTENTS = 1 << 31
_STILLS = {".jpg": "JPEG", ".jpeg": "JPEG", ".gif": "GIF", ".webp": "WEBP", ".bmp": "BMP"}
_STILLS |= {".tif": "TIFF", ".tiff": "TIFF"}


@checked(path=PATH, pixels=NUMBERS, quality=COUNT)
def save_picture(path, pixels, quality: int = 92) -> None:
    """Writes pixels as a picture; the ending of the name gives the format.

    Args:
        path: of the file. `.png`, or no ending, is PNG; JPEG, GIF, WebP, BMP and TIFF need Pillow.
        pixels: array (wp.array, NumPy or nested lists) of shape (height, width) or (height, width,
            channels), the first row on top. Channels are grey, grey and alpha, red-green-blue, or
            these and alpha; vectors of these lengths count as channels. Bytes are written as they
            are, floats from 0 to 1 are scaled to bytes and rounded; what is outside becomes 0 or
            255, and NaN 0.
        quality: of JPEG and WebP, 1 to 100.

    Raises:
        ValueError: there are no pixels, the shape is another one, or the format has no writer or
            no alpha channel.
        TypeError: the pixels are neither bytes nor floats.
        ImportError: the format needs Pillow and it is not installed.
    """
    values = _bytes_of(pixels)
    ending = os.path.splitext(os.fspath(path))[1].lower()
    if ending in ("", ".png"):
        _write_png(path, values)
        return
    if ending not in _STILLS:
        known = ", ".join(("'.png'", *(f"'{name}'" for name in _STILLS)))
        raise ValueError(f"expects a picture's name to end in one of {known}, but got '{ending}'")
    if ending in (".jpg", ".jpeg", ".bmp") and values.shape[2] in (2, 4):
        raise ValueError(f"expects pixels without alpha for '{ending}', but got {values.shape}")
    image = _pillow(f"a picture as '{ending}'")
    picture = image.fromarray(values[:, :, 0] if values.shape[2] == 1 else values)
    options = {"quality": quality} if _STILLS[ending] in ("JPEG", "WEBP") else {}
    picture.save(path, _STILLS[ending], **options)


@checked(path=PATH, fps=NUMBER, quality=COUNT)
def save_movie(path, frames, fps: float = 25.0, quality: int = 80) -> None:
    """Writes frames as a film.

    Args:
        path: of the file, `.gif` or `.webp` by Pillow, `.mp4` by imageio-ffmpeg.
        frames: pictures of one shape, as of `save_picture`; any iterable.
        fps: frames a second. Viewers of GIF show whole hundredths of a second.
        quality: 1 to 100, not for GIF.

    Raises:
        ValueError: there are no frames, they differ in shape, or the ending is another one.
        ImportError: the package that the format needs is not installed.
    """
    ending = os.path.splitext(os.fspath(path))[1].lower()
    if ending not in (".gif", ".webp", ".mp4"):
        raise ValueError(
            f"expects a film's name to end in '.gif', '.webp' or '.mp4', but got '{ending}'"
        )
    if not fps > 0.0:
        raise ValueError(f"expects a positive number of frames a second, but got {fps}")
    import numpy

    pictures = [_color(_bytes_of(frame)) for frame in frames]
    if not pictures:
        raise ValueError("expects one or more frames, but got none")
    for number, picture in enumerate(pictures):
        if picture.shape != pictures[0].shape:
            raise ValueError(
                f"expects frames of shape {pictures[0].shape}, but frame {number} has "
                f"{picture.shape}"
            )
    if ending == ".mp4":
        _write_mp4(path, pictures, fps, quality)
        return
    image = _pillow(f"a film as '{ending}'")
    images = [image.fromarray(picture) for picture in pictures]
    if ending == ".gif":
        # One palette for all frames: still parts do not flicker, and frames compress.
        some = pictures[:: max(1, len(pictures) // 8)]
        palette = image.fromarray(numpy.concatenate(some)).quantize(256)
        images = [each.quantize(palette=palette, dither=image.Dither.NONE) for each in images]
    images[0].save(
        path,
        {".gif": "GIF", ".webp": "WEBP"}[ending],
        save_all=True,
        append_images=images[1:],
        duration=round(1000.0 / fps),
        loop=0,
        **({"quality": quality, "method": 4} if ending == ".webp" else {"optimize": True}),
    )


def _pillow(purpose):
    try:
        from PIL import Image
    except ImportError as error:
        raise errors.absent("pillow", purpose) from error
    return Image


def _write_png(path, values):
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


def _write_mp4(path, pictures, fps, quality):
    try:
        import imageio_ffmpeg as ffmpeg
    except ImportError as error:
        raise errors.absent("imageio-ffmpeg", "a film as '.mp4'") from error
    height, width = pictures[0].shape[:2]
    if height % 2 or width % 2:
        raise ValueError(f"expects even numbers of pixels for '.mp4', but got {width} x {height}")
    writer = ffmpeg.write_frames(
        os.fspath(path), (width, height), fps=fps, quality=quality / 10.0, macro_block_size=2
    )
    writer.send(None)
    try:
        for picture in pictures:
            writer.send(picture.tobytes())
    finally:
        writer.close()


def _color(values):
    """Pixels as red, green and blue."""
    import numpy

    if values.shape[2] <= 2:
        return numpy.repeat(values[:, :, :1], 3, axis=2)
    return numpy.ascontiguousarray(values[:, :, :3])


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
