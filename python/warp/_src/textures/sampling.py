"""`wp.texture_sample`, in the kernel language.

Texel i of n is at (i + 1/2) / n, or at i + 1/2 without normalised coordinates. Between texels
`LINEAR` weighs the nearest ones; derivatives follow for the coordinates. A level of detail above 0
reads level `lod` of a mip chain, the nearest one or, with `LINEAR`, between two; then there is a
derivative for it, too. Coordinates that are not normalised are those of the finest level.

A coordinate that is no number has no texel, nor has infinity on an axis that repeats: the result is
NaN.

Values and derivatives are made of differences of texels, which keep the digits in which neighbours
differ. Weights give both where texels are so large that differences may overflow.
"""

from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.textures.texture import Texture1D, Texture2D, Texture3D
from warp._src.types.dtypes import vec2f, vec3f, vec4f
from warp._src.types.native import ArrayType
from warp._src.types.scalars import float32

# Kernels have no `in`.
# ruff: noqa: SIM109

# The values of TextureAddressMode and TextureFilterMode.
WRAP, CLAMP, MIRROR = 0, 1, 2
LINEAR = 1
NAN = float("nan")
# To subtract less than this from a float32 never overflows: half of the last bit of the largest.
REMOVABLE = 2.0**103
# Differences of texels, and theirs, overflow for none whose absolute values have a smaller sum.
SUBTRACTABLE = 2.0**126


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


def _lost(x: float, mode: int):
    """Has a coordinate no place on its axis?"""
    return wp.isnan(x) or (wp.isinf(x) and (mode == WRAP or mode == MIRROR))


def _lost1(t: Texture1D, u: float):
    return lost(u, t.address_u)


def _lost2(t: Texture2D, uv: vec2f):
    return lost(uv[0], t.address_u) or lost(uv[1], t.address_v)


def _lost3(t: Texture3D, uvw: vec3f):
    return lost(uvw[0], t.address_u) or lost(uvw[1], t.address_v) or lost(uvw[2], t.address_w)


def _nearest(x: float, extent: int, mode: int, normalized: bool):
    return place(int(wp.floor(position(x, extent, mode, normalized))), extent, mode)


def _between(x: float, extent: int, mode: int, normalized: bool):
    """The texels on both sides, and how far the coordinate is from the first to the second."""
    t = position(x, extent, mode, normalized) - 0.5
    if mode == CLAMP:
        t = wp.clamp(t, 0.0, float(extent - 1))
    i = int(wp.floor(t))
    return place(i, extent, mode), place(i + 1, extent, mode), t - float(i)


def _texel(t: ArrayType(float32, 1), at: int, row: int, x: int, width: int, n: int, c: int):
    """Channel c of n of texel x of a row, of a level that begins at texel `at`; 0 outside."""
    if row < 0 or x < 0 or c >= n:
        return 0.0
    return t[(at + row * width + x) * n + c]


def _row(y: int, z: int, height: int):
    return wp.where(y < 0 or z < 0, -1, z * height + y)


def _halved(extent: int, level: int):
    """An extent of a level."""
    return wp.max(extent >> level, 1)


def _start(width: int, height: int, depth: int, level: int):
    """The first texel of a level."""
    count = int(0)
    for i in range(level):
        count += halved(width, i) * halved(height, i) * halved(depth, i)
    return count


def _scaled(x: float, extent: int, of_level: int, normalized: bool):
    """A coordinate in a level."""
    return wp.where(normalized or extent == of_level, x, x * float(of_level) / float(extent))


def _mixed(a: float, b: float, x: float):
    if wp.abs(a) + wp.abs(b) < SUBTRACTABLE:
        return a + x * (b - a)
    return (1.0 - x) * a + x * b


def _sheared(a: float, b: float, c: float, d: float, x: float, y: float):
    """Between four corners, by differences."""
    return a + x * (b - a) + y * ((c - a) + x * ((d - c) - (b - a)))


def _weighted(a: float, b: float, c: float, d: float, x: float, y: float):
    """Between four corners, by weights."""
    return (1.0 - y) * ((1.0 - x) * a + x * b) + y * ((1.0 - x) * c + x * d)


def _size(a: float, b: float, c: float, d: float):
    return wp.abs(a) + wp.abs(b) + wp.abs(c) + wp.abs(d)


def _closest1(t: Texture1D, u: float, c: int, level: int):
    w = halved(t.width, level)
    x = nearest(scaled(u, t.width, w, t.normalized), w, t.address_u, t.normalized)
    return texel(t.texels, start(t.width, 1, 1, level), 0, x, w, t.num_channels, c)


def _closest2(t: Texture2D, uv: vec2f, c: int, level: int):
    w, h = halved(t.width, level), halved(t.height, level)
    x = nearest(scaled(uv[0], t.width, w, t.normalized), w, t.address_u, t.normalized)
    y = nearest(scaled(uv[1], t.height, h, t.normalized), h, t.address_v, t.normalized)
    return texel(t.texels, start(t.width, t.height, 1, level), y, x, w, t.num_channels, c)


def _closest3(t: Texture3D, uvw: vec3f, c: int, level: int):
    w, h, d = halved(t.width, level), halved(t.height, level), halved(t.depth, level)
    x = nearest(scaled(uvw[0], t.width, w, t.normalized), w, t.address_u, t.normalized)
    y = nearest(scaled(uvw[1], t.height, h, t.normalized), h, t.address_v, t.normalized)
    z = nearest(scaled(uvw[2], t.depth, d, t.normalized), d, t.address_w, t.normalized)
    at = start(t.width, t.height, t.depth, level)
    return texel(t.texels, at, row(y, z, h), x, w, t.num_channels, c)


def _linear1(t: Texture1D, u: float, c: int, level: int, zero: float):
    w, n = halved(t.width, level), t.num_channels
    at = start(t.width, 1, 1, level)
    x0, x1, x = between(scaled(u, t.width, w, t.normalized), w, t.address_u, t.normalized)
    a = texel(t.texels, at, 0, x0, w, n, c) - zero
    b = texel(t.texels, at, 0, x1, w, n, c) - zero
    return mixed(a, b, x)


def _linear2(t: Texture2D, uv: vec2f, c: int, level: int, zero: float):
    w, h, n = halved(t.width, level), halved(t.height, level), t.num_channels
    at = start(t.width, t.height, 1, level)
    x0, x1, x = between(scaled(uv[0], t.width, w, t.normalized), w, t.address_u, t.normalized)
    y0, y1, y = between(scaled(uv[1], t.height, h, t.normalized), h, t.address_v, t.normalized)
    near0 = texel(t.texels, at, y0, x0, w, n, c) - zero
    near1 = texel(t.texels, at, y0, x1, w, n, c) - zero
    far0 = texel(t.texels, at, y1, x0, w, n, c) - zero
    far1 = texel(t.texels, at, y1, x1, w, n, c) - zero
    if size(near0, near1, far0, far1) < SUBTRACTABLE:
        return sheared(near0, near1, far0, far1, x, y)
    return weighted(near0, near1, far0, far1, x, y)


def _linear3(t: Texture3D, uvw: vec3f, c: int, level: int, zero: float):
    w, h, d = halved(t.width, level), halved(t.height, level), halved(t.depth, level)
    n, at = t.num_channels, start(t.width, t.height, t.depth, level)
    x0, x1, x = between(scaled(uvw[0], t.width, w, t.normalized), w, t.address_u, t.normalized)
    y0, y1, y = between(scaled(uvw[1], t.height, h, t.normalized), h, t.address_v, t.normalized)
    z0, z1, z = between(scaled(uvw[2], t.depth, d, t.normalized), d, t.address_w, t.normalized)
    near0, near1, far0, far1 = row(y0, z0, h), row(y1, z0, h), row(y0, z1, h), row(y1, z1, h)
    a0 = texel(t.texels, at, near0, x0, w, n, c) - zero
    b0 = texel(t.texels, at, near0, x1, w, n, c) - zero
    c0 = texel(t.texels, at, near1, x0, w, n, c) - zero
    d0 = texel(t.texels, at, near1, x1, w, n, c) - zero
    a1 = texel(t.texels, at, far0, x0, w, n, c) - zero
    b1 = texel(t.texels, at, far0, x1, w, n, c) - zero
    c1 = texel(t.texels, at, far1, x0, w, n, c) - zero
    d1 = texel(t.texels, at, far1, x1, w, n, c) - zero
    if size(a0, b0, c0, d0) + size(a1, b1, c1, d1) < SUBTRACTABLE:
        step = sheared(a1 - a0, b1 - b0, c1 - c0, d1 - d0, x, y)
        return sheared(a0, b0, c0, d0, x, y) + z * step
    near, far = weighted(a0, b0, c0, d0, x, y), weighted(a1, b1, c1, d1, x, y)
    return (1.0 - z) * near + z * far


place, position = Function(_place, "place"), Function(_position, "position")
lost = Function(_lost, "lost")
nearest, between = Function(_nearest, "nearest"), Function(_between, "between")
texel, row = Function(_texel, "texel"), Function(_row, "row")
halved, start = Function(_halved, "halved"), Function(_start, "start")
scaled, mixed = Function(_scaled, "scaled"), Function(_mixed, "mixed")
sheared, weighted = Function(_sheared, "sheared"), Function(_weighted, "weighted")
size = Function(_size, "size")


def _readers(texture, coordinates, closest, linear, placeless):
    """Reading one channel, of the finest level and at a level of detail."""
    closest, linear = Function(closest, "closest"), Function(linear, "linear")
    placeless = Function(placeless, "placeless")

    def _of_level(t: texture, at: coordinates, c: int, level: int):
        if t.width == 0:
            return 0.0
        if t.filter == LINEAR:
            return linear(t, at, c, level, 0.0)
        return closest(t, at, c, level)

    of_level = Function(_of_level, "of_level")

    def _finest(t: texture, at: coordinates, c: int):
        return wp.where(placeless(t, at), NAN, of_level(t, at, c, 0))

    def _at_detail(t: texture, at: coordinates, c: int, lod: float):
        if placeless(t, at):
            return NAN
        if not lod >= 0.0 or t.levels < 2:
            return of_level(t, at, c, 0)
        top = t.levels - 1
        place = wp.min(lod, float(top))
        if t.mip_filter != LINEAR:
            return of_level(t, at, c, int(wp.floor(place + 0.5)))
        fine = wp.min(int(wp.floor(place)), top - 1)
        share = place - float(fine)
        # The common part of texels is taken off before levels are compared.
        zero = closest(t, at, c, fine)
        if t.filter != LINEAR:
            return mixed(zero, closest(t, at, c, fine + 1), share)
        if not wp.abs(zero) < REMOVABLE:
            zero = 0.0
        low, high = linear(t, at, c, fine, zero), linear(t, at, c, fine + 1, zero)
        return zero + mixed(low, high, share)

    return Function(_finest, "finest"), Function(_at_detail, "at_detail")


def _finest_overloads(texture, coordinates, read):
    """Reading 1, 2 or 4 channels of one kind of textures."""

    def _one(tex: texture, at: coordinates, dtype: type[float32]):
        return read(tex, at, 0)

    def _two(tex: texture, at: coordinates, dtype: type[vec2f]):
        return vec2f(read(tex, at, 0), read(tex, at, 1))

    def _four(tex: texture, at: coordinates, dtype: type[vec4f]):
        return vec4f(read(tex, at, 0), read(tex, at, 1), read(tex, at, 2), read(tex, at, 3))

    return _one, _two, _four


def _overloads(texture, coordinates, read):
    """The same at a level of detail; programs that name none have no code of it."""

    def _one(tex: texture, at: coordinates, dtype: type[float32], lod: float):
        return read(tex, at, 0, lod)

    def _two(tex: texture, at: coordinates, dtype: type[vec2f], lod: float):
        return vec2f(read(tex, at, 0, lod), read(tex, at, 1, lod))

    def _four(tex: texture, at: coordinates, dtype: type[vec4f], lod: float):
        return vec4f(
            read(tex, at, 0, lod),
            read(tex, at, 1, lod),
            read(tex, at, 2, lod),
            read(tex, at, 3, lod),
        )

    return _one, _two, _four


def _flat2(channels, finest, at_detail):
    """The same with numbers in place of a vector of coordinates."""

    def _read(tex: Texture2D, u: float, v: float, dtype: type[channels]):
        return finest(tex, vec2f(u, v), dtype)

    def _read_detail(tex: Texture2D, u: float, v: float, dtype: type[channels], lod: float):
        return at_detail(tex, vec2f(u, v), dtype, lod)

    return _read, _read_detail


def _flat3(channels, finest, at_detail):
    def _read(tex: Texture3D, u: float, v: float, w: float, dtype: type[channels]):
        return finest(tex, vec3f(u, v, w), dtype)

    def _read_detail(
        tex: Texture3D, u: float, v: float, w: float, dtype: type[channels], lod: float
    ):
        return at_detail(tex, vec3f(u, v, w), dtype, lod)

    return _read, _read_detail


def _all_overloads():
    for texture, coordinates, closest, linear, placeless, flat in (
        (Texture1D, float32, _closest1, _linear1, _lost1, None),
        (Texture2D, vec2f, _closest2, _linear2, _lost2, _flat2),
        (Texture3D, vec3f, _closest3, _linear3, _lost3, _flat3),
    ):
        finest, at_detail = _readers(texture, coordinates, closest, linear, placeless)
        plain = _finest_overloads(texture, coordinates, finest)
        detailed = _overloads(texture, coordinates, at_detail)
        yield from (*plain, *detailed)
        if flat is not None:
            for channels, *pair in zip((float32, vec2f, vec4f), plain, detailed, strict=True):
                yield from flat(channels, *(Function(one, "texture_sample") for one in pair))


_first, *_others = _all_overloads()
texture_sample = Function(_first, "texture_sample")
for _overload in _others:
    texture_sample.add_overload(_overload)
texture_sample.__module__ = "warp"
FUNCTIONS = {"texture_sample": texture_sample}
