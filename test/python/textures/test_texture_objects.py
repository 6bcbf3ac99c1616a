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
    with pytest.raises(ValueError, match=r"\(2, 3, 1\) and 'uint8', but got \(3, 2, 1\)"):
        second.copy_from(data.T)


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
        ({"data": np.zeros((2, 2), "f4"), "num_mip_levels": 2}, "mip levels"),
    ],
)
def test_bad_arguments(arguments, message):
    with pytest.raises((TypeError, ValueError, RuntimeError), match=message):
        wp.Texture2D(**arguments, device="cpu")
