"""`wp.texture_sample`, in the kernel language.

Texel i of n is at (i + 1/2) / n, or at i + 1/2 without normalised coordinates. Between texels
`LINEAR` weighs the nearest ones; derivatives follow for the coordinates.
"""

from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.textures.texture import Texture1D, Texture2D, Texture3D
from warp._src.types.dtypes import vec2f, vec3f, vec4f
from warp._src.types.native import ArrayType
from warp._src.types.scalars import float32

# Kernels have no `in`.
# ruff: noqa: SIM109

# Of TextureAddressMode and TextureFilterMode.
WRAP, CLAMP, MIRROR = 0, 1, 2
LINEAR = 1


def _place(i: int, extent: int, mode: int):
    """The texel that is read for number i of an axis; -1 for none."""
    if mode == CLAMP:
        return wp.clamp(i, 0, extent - 1)
    if mode == WRAP or mode == MIRROR:
        period = extent * wp.where(mode == MIRROR, 2, 1)
        j = i % period
        if j < 0:
            j += period
        return wp.where(j < extent, j, period - 1 - j)
    return wp.where(i >= 0 and i < extent, i, -1)


def _position(x: float, extent: int, mode: int, normalized: bool):
    """A coordinate in texels, so near that it can be an integer."""
    size = float(extent)
    if mode == WRAP or mode == MIRROR:
        period = wp.where(normalized, 1.0, size) * wp.where(mode == MIRROR, 2.0, 1.0)
        x = wp.mod(x, period)
    if normalized:
        x = x * size
    # Far outside, the edge and the border look the same from everywhere.
    return wp.clamp(x, -2.0 * size - 2.0, 2.0 * size + 2.0)


def _nearest(x: float, extent: int, mode: int, normalized: bool):
    return place(int(wp.floor(position(x, extent, mode, normalized))), extent, mode)


def _between(x: float, extent: int, mode: int, normalized: bool):
    """The texels on both sides, and how far the coordinate is from the first to the second."""
    t = position(x, extent, mode, normalized) - 0.5
    if mode == CLAMP:
        t = wp.clamp(t, 0.0, float(extent - 1))
    i = int(wp.floor(t))
    return place(i, extent, mode), place(i + 1, extent, mode), t - float(i)


def _texel(texels: ArrayType(float32, 1), row: int, x: int, width: int, channels: int, c: int):
    """Channel c of texel x of a row; 0 outside."""
    if row < 0 or x < 0 or c >= channels:
        return 0.0
    return texels[(row * width + x) * channels + c]


def _row(y: int, z: int, height: int):
    return wp.where(y < 0 or z < 0, -1, z * height + y)


def _channel1(t: Texture1D, u: float, c: int):
    w, n = t.width, t.num_channels
    if w == 0:
        return 0.0
    if t.filter == LINEAR:
        x0, x1, fx = between(u, w, t.address_u, t.normalized)
        return wp.lerp(texel(t.texels, 0, x0, w, n, c), texel(t.texels, 0, x1, w, n, c), fx)
    return texel(t.texels, 0, nearest(u, w, t.address_u, t.normalized), w, n, c)


def _along(t: Texture3D, y: int, z: int, x0: int, x1: int, fx: float, c: int):
    line, w, n = row(y, z, t.height), t.width, t.num_channels
    return wp.lerp(texel(t.texels, line, x0, w, n, c), texel(t.texels, line, x1, w, n, c), fx)


def _channel2(t: Texture2D, uv: vec2f, c: int):
    w, n = t.width, t.num_channels
    if w == 0:
        return 0.0
    if t.filter == LINEAR:
        x0, x1, fx = between(uv[0], w, t.address_u, t.normalized)
        y0, y1, fy = between(uv[1], t.height, t.address_v, t.normalized)
        low = wp.lerp(texel(t.texels, y0, x0, w, n, c), texel(t.texels, y0, x1, w, n, c), fx)
        high = wp.lerp(texel(t.texels, y1, x0, w, n, c), texel(t.texels, y1, x1, w, n, c), fx)
        return wp.lerp(low, high, fy)
    x = nearest(uv[0], w, t.address_u, t.normalized)
    y = nearest(uv[1], t.height, t.address_v, t.normalized)
    return texel(t.texels, y, x, w, n, c)


def _channel3(t: Texture3D, uvw: vec3f, c: int):
    w, n = t.width, t.num_channels
    if w == 0:
        return 0.0
    if t.filter == LINEAR:
        x0, x1, fx = between(uvw[0], w, t.address_u, t.normalized)
        y0, y1, fy = between(uvw[1], t.height, t.address_v, t.normalized)
        z0, z1, fz = between(uvw[2], t.depth, t.address_w, t.normalized)
        near = wp.lerp(along(t, y0, z0, x0, x1, fx, c), along(t, y1, z0, x0, x1, fx, c), fy)
        far = wp.lerp(along(t, y0, z1, x0, x1, fx, c), along(t, y1, z1, x0, x1, fx, c), fy)
        return wp.lerp(near, far, fz)
    x = nearest(uvw[0], w, t.address_u, t.normalized)
    y = nearest(uvw[1], t.height, t.address_v, t.normalized)
    z = nearest(uvw[2], t.depth, t.address_w, t.normalized)
    return texel(t.texels, row(y, z, t.height), x, w, n, c)


place, position = Function(_place, "place"), Function(_position, "position")
nearest, between = Function(_nearest, "nearest"), Function(_between, "between")
texel, row, along = Function(_texel, "texel"), Function(_row, "row"), Function(_along, "along")


def _overloads(texture, coordinates, channel):
    """Reading 1, 2 or 4 channels of one kind of textures."""

    def _one(tex: texture, at: coordinates, dtype: type[float32], lod: float = -1.0):
        return channel(tex, at, 0)

    def _two(tex: texture, at: coordinates, dtype: type[vec2f], lod: float = -1.0):
        return vec2f(channel(tex, at, 0), channel(tex, at, 1))

    def _four(tex: texture, at: coordinates, dtype: type[vec4f], lod: float = -1.0):
        return vec4f(
            channel(tex, at, 0), channel(tex, at, 1), channel(tex, at, 2), channel(tex, at, 3)
        )

    return _one, _two, _four


texture_sample = None
for _texture, _coordinates, _function in (
    (Texture1D, float32, _channel1),
    (Texture2D, vec2f, _channel2),
    (Texture3D, vec3f, _channel3),
):
    for _overload in _overloads(_texture, _coordinates, Function(_function, "channel")):
        if texture_sample is None:
            texture_sample = Function(_overload, "texture_sample")
        else:
            texture_sample.add_overload(_overload)
texture_sample.__module__ = "warp"
