"""Textures as objects: types of texels, channels, structs, copies, bad input."""

import numpy as np
import pytest

import warp as wp

WRAP, CLAMP, MIRROR, BORDER = wp.TextureAddressMode
CLOSEST, LINEAR = wp.TextureFilterMode


@wp.kernel
def read1(t: wp.Texture1D, at: wp.array(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = wp.texture_sample(t, at[i], dtype=float)


@pytest.mark.parametrize(
    "dtype,most",
    [("u1", 255), ("u2", 65535), ("i1", 127), ("i2", 32767), ("f2", 1), ("u4", 1), ("i4", 1)],
)
def test_types_of_texels(dtype, most, device):
    low = -most if dtype[0] == "i" and most > 1 else 0
    data = np.linspace(low, most if most > 1 else 100, 7).astype(dtype)
    texture = wp.Texture1D(data, filter_mode=CLOSEST, normalized_coords=False, device=device)
    at = wp.array(np.arange(7) + 0.5, dtype=float, device=device)
    out = wp.zeros(7, dtype=float, device=device)
    wp.launch(read1, 7, [texture, at, out], device=device)
    np.testing.assert_allclose(out.numpy(), data / most, rtol=1e-6)
    np.testing.assert_array_equal(texture.numpy(), data)
    assert texture.dtype.__name__ == wp.dtype_from_numpy(data.dtype).__name__


def test_channels_structs_and_textures_without_texels(device):
    @wp.struct
    class Surface:
        color: wp.Texture2D
        none: wp.Texture1D
        scale: float

    @wp.kernel
    def shade(s: wp.array(dtype=Surface), out: wp.array(dtype=wp.vec4)):
        t = s[0].color
        c = wp.texture_sample(t, wp.vec2(0.5, 0.5), dtype=wp.vec4)
        pair = wp.texture_sample(t, wp.vec2(0.5, 0.5), dtype=wp.vec2)
        out[0] = s[0].scale * c
        out[1] = wp.vec4(pair[0], pair[1], float(t.width), float(t.height))
        out[2][0] = 1.0 + wp.texture_sample(s[0].none, 0.3, dtype=float)

    data = np.arange(24, dtype=np.float32).reshape(2, 3, 4)
    surface = Surface()
    surface.color = wp.Texture2D(data, device=device)
    surface.scale = 2.0
    out = wp.zeros(3, dtype=wp.vec4, device=device)
    wp.launch(shade, 1, [wp.array([surface], dtype=Surface, device=device), out], device=device)
    middle = data.mean(axis=(0, 1))
    np.testing.assert_allclose(
        out.numpy(), [2 * middle, [*middle[:2], 3.0, 2.0], [1, 0, 0, 0]], rtol=1e-6
    )


def test_copies(device):
    data = np.arange(6, dtype=np.uint8).reshape(2, 3)
    first = wp.Texture2D(data, device=device)
    second = wp.Texture2D(width=3, height=2, dtype=wp.uint8, device=device)
    second.copy_from(first)
    back = wp.zeros((2, 3), dtype=wp.uint8, device=device)
    second.copy_to(back)
    np.testing.assert_array_equal(back.numpy(), data)
    with pytest.raises(ValueError, match=r"shape=\(2, 3\), source shape=\(3, 2\)"):
        second.copy_from(data.T)
    other = wp.Texture2D(np.zeros((7, 9), np.float32), device=device)
    with pytest.raises(ValueError, match=r"destination shape=\(.*source shape=\(7, 9\)"):
        second.copy_from(other)


def test_not_a_number_stays_inside(device):
    data = np.ones(4, dtype=np.float32)
    bad = wp.array([np.nan, np.inf, -np.inf, 1e30], dtype=float, device=device)
    for mode in (WRAP, CLAMP, MIRROR, BORDER):
        for filter_mode in (CLOSEST, LINEAR):
            t = wp.Texture1D(data, address_mode=mode, filter_mode=filter_mode, device=device)
            out = wp.zeros(4, device=device)
            wp.launch(read1, 4, [t, bad, out], device=device)
            found = out.numpy()
            assert np.all(np.isnan(found) | (found == 0) | (found == 1))


@pytest.mark.parametrize(
    "arguments,message",
    [
        ({"data": np.zeros((2, 2, 2, 2), "f4")}, "2 dimensions"),
        ({"data": np.zeros((2, 2, 3), "f4")}, "1, 2 or 4 channels"),
        ({"data": np.zeros((0, 2), "f4")}, "extents of at least 1"),
        ({"data": np.zeros((2, 2), "i4"), "filter_mode": LINEAR}, "`CLOSEST` only"),
        ({"data": np.zeros((2, 2), "f4"), "address_mode": (WRAP,)}, "2 address modes"),
        ({"data": np.zeros((2, 2), "f4"), "colour": 1}, "'colour' is unknown"),
        ({"data": np.zeros((2, 2), "f8")}, "textures hold 'uint8'"),
        ({"data": np.zeros((2, 2), "f4"), "num_mip_levels": 3}, "is 0 to 2, not 3"),
        ({"width": 2, "height": 2, "num_mip_levels": 2}, "made of data"),
        ({"data": np.zeros((2, 2), "f4"), "filter_mode": 7}, "Invalid texture filter mode: 7"),
    ],
)
def test_bad_arguments(arguments, message):
    with pytest.raises((TypeError, ValueError, RuntimeError), match=message):
        wp.Texture2D(**arguments, device="cpu")


@wp.kernel
def read_levels(
    t: wp.Texture2D,
    at: wp.array(dtype=wp.vec2),
    lod: wp.array(dtype=float),
    out: wp.array(dtype=float),
):
    i = wp.tid()
    out[i] = wp.texture_sample(t, at[i], dtype=float, lod=lod[i])


@wp.kernel
def read_flat(t: wp.Texture3D, at: wp.array(dtype=wp.vec3), out: wp.array(dtype=wp.vec2)):
    p = at[wp.tid()]
    out[wp.tid()] = wp.texture_sample(t, p[0], p[1], p[2], dtype=wp.vec2)


def halved(level):
    """Means of 2 x 2, of even extents."""
    return level.reshape(level.shape[0] // 2, 2, level.shape[1] // 2, 2).mean(axis=(1, 3))


def bilinear(level, u, v):
    """Between texels, in float64; coordinates in [0, 1], clamped."""
    h, w = level.shape
    x, y = np.clip(u * w - 0.5, 0, w - 1), np.clip(v * h - 0.5, 0, h - 1)
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    k, m = np.minimum(i + 1, w - 1), np.minimum(j + 1, h - 1)
    low = level[j, i] * (1 - x + i) + level[j, k] * (x - i)
    high = level[m, i] * (1 - x + i) + level[m, k] * (x - i)
    return low * (1 - y + j) + high * (y - j)


def levels_case(device, offset=0.0, **modes):
    rng = np.random.default_rng(4)
    data = (offset + rng.integers(-64, 64, (16, 8))).astype(np.float32)
    chain = [data.astype(np.float64)]
    while min(chain[-1].shape) > 1:
        chain.append(halved(chain[-1]).astype(np.float32).astype(np.float64))
    t = wp.Texture2D(data, num_mip_levels=len(chain), device=device, **modes)
    uv = rng.random((200, 2)).astype(np.float32)
    lod = rng.uniform(-0.5, 4.0, 200).astype(np.float32)
    return t, chain, uv, lod


def test_levels_of_coordinates_without_a_place(device):
    t, _, _, _ = levels_case(device)
    at = wp.array([[np.nan, 0.5], [0.5, np.nan], [0.5, 0.5]], dtype=wp.vec2, device=device)
    levels, out = wp.full(3, 1.5, device=device), wp.zeros(3, device=device)
    wp.launch(read_levels, 3, [t, at, levels], [out], device=device)
    assert np.isnan(out.numpy()).tolist() == [True, True, False]


def test_levels(device):
    t, chain, uv, lod = levels_case(device)
    assert t.num_mip_levels == 4 and t.is_mipmapped and t.mip_filter_mode == LINEAR
    at, levels = wp.array(uv, dtype=wp.vec2, device=device), wp.array(lod, device=device)
    out = wp.zeros(200, device=device)
    wp.launch(read_levels, 200, [t, at, levels], [out], device=device)
    read = np.array([bilinear(level, *uv.astype(np.float64).T) for level in chain])
    place = np.clip(lod.astype(np.float64), 0, 3)
    fine = np.minimum(place.astype(int), 2)
    one = np.arange(200)
    expected = read[fine, one] * (1 - place + fine) + read[fine + 1, one] * (place - fine)
    np.testing.assert_allclose(out.numpy(), expected, atol=64 * 4e-6)
    t, _, _, _ = levels_case(device, mip_filter_mode=CLOSEST)
    wp.launch(read_levels, 200, [t, at, levels], [out], device=device)
    nearest = read[np.floor(place + 0.5).astype(int), one]
    np.testing.assert_allclose(out.numpy(), nearest, atol=64 * 4e-6)


def test_nearest_texels_of_both_levels(device):
    """The filter of texels says nothing of that between levels."""
    data = np.arange(16, dtype=np.float32).reshape(4, 4) ** 2
    t = wp.Texture2D(data, filter_mode=CLOSEST, num_mip_levels=2, device=device)
    assert t.mip_filter_mode == LINEAR
    uv, lod = np.full((5, 2), 0.4, np.float32), np.linspace(0.0, 1.0, 5, dtype=np.float32)
    at, levels = wp.array(uv, dtype=wp.vec2, device=device), wp.array(lod, device=device)
    out = wp.zeros(5, device=device)
    wp.launch(read_levels, 5, [t, at, levels], [out], device=device)
    np.testing.assert_allclose(out.numpy(), (1 - lod) * data[1, 1] + lod * data[:2, :2].mean())


@pytest.mark.parametrize("offset", [0.0, 2.0**21])
def test_slopes_keep_their_digits_beside_an_offset(device, offset):
    """A common part of all texels does not take digits from derivatives."""
    t, chain, uv, lod = levels_case(device, offset)
    lod = np.clip(lod, 0.1, 2.9)
    at = wp.array(uv, dtype=wp.vec2, device=device, requires_grad=True)
    levels = wp.array(lod, device=device, requires_grad=True)
    out = wp.zeros(200, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(read_levels, 200, [t, at, levels], [out], device=device)
    tape.backward(grads={out: wp.ones(200, device=device)})
    u, v = uv.astype(np.float64).T
    read = np.array([bilinear(level - offset, u, v) for level in chain])
    fine = lod.astype(int)
    one = np.arange(200)
    share = lod.astype(np.float64) - fine
    slope = read[fine + 1, one] - read[fine, one]
    np.testing.assert_allclose(levels.grad.numpy(), slope, atol=1e-3)
    h = 1e-6
    steps = []
    for du, dv in ((h, 0), (0, h)):
        ends = [
            np.array([bilinear(one - offset, u + s * du, v + s * dv) for one in chain])
            for s in (1, -1)
        ]
        rates = (ends[0] - ends[1]) / (2 * h)
        steps.append(rates[fine, one] * (1 - share) + rates[fine + 1, one] * share)
    found = at.grad.numpy()
    # Central differences across an edge between cells are no slopes.
    near = np.abs(found - np.array(steps).T) <= 2e-2 + 1e-4 * np.abs(found)
    assert near.mean() > 0.99


def test_coordinates_one_by_one(device):
    data = np.random.default_rng(1).random((3, 4, 5, 2), np.float32)
    t = wp.Texture3D(data, device=device, filter_mode=CLOSEST)
    index = np.indices((3, 4, 5)).reshape(3, -1)
    at = ((index[::-1].T + 0.5) / [5, 4, 3]).astype(np.float32)
    out = wp.zeros(60, dtype=wp.vec2, device=device)
    wp.launch(read_flat, 60, [t, wp.array(at, dtype=wp.vec3, device=device)], [out], device=device)
    np.testing.assert_array_equal(out.numpy(), data.reshape(60, 2))


def test_copies_of_whole_numbers_are_exact(device):
    data = np.array([[1, 2, 3, 16777217], [5, 6, 7, 4294967295]], np.uint32)
    t = wp.Texture2D(data, device=device)
    back = wp.zeros((2, 4), dtype=wp.uint32, device=device)
    t.copy_to(back)
    np.testing.assert_array_equal(back.numpy(), data)
    other = wp.Texture2D(width=4, height=2, dtype=wp.uint32, device=device)
    other.copy_from(back)
    np.testing.assert_array_equal(other.numpy(), data)
    narrow = wp.Texture1D(np.array([-128, -127, 0, 127], np.int8), device=device)
    numbers = wp.array([-127, 5, -128, 100], dtype=wp.int8, device=device)
    narrow.copy_from(numbers)
    np.testing.assert_allclose(narrow.texels.numpy(), np.maximum([-1, 5 / 127, -1, 100 / 127], -1))


def test_levels_are_not_copied(device):
    t, _, _, _ = levels_case(device)
    with pytest.raises(RuntimeError, match="levels of a mip chain"):
        t.copy_from(np.zeros((16, 8), np.float32))
