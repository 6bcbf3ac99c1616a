"""Textures against NumPy: addressing, filters, channels, types, gradients, structs."""

import numpy as np
import pytest

import warp as wp

WRAP, CLAMP, MIRROR, BORDER = wp.TextureAddressMode
CLOSEST, LINEAR = wp.TextureFilterMode
CLASSES = {1: wp.Texture1D, 2: wp.Texture2D, 3: wp.Texture3D}


@wp.kernel
def read1(t: wp.Texture1D, at: wp.array(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = wp.texture_sample(t, at[i], dtype=float)


@wp.kernel
def read2(t: wp.Texture2D, at: wp.array(dtype=wp.vec2), out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = wp.texture_sample(t, at[i], dtype=float)


@wp.kernel
def read3(t: wp.Texture3D, at: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = wp.texture_sample(t, at[i], dtype=float)


KERNELS = {1: read1, 2: read2, 3: read3}


def texel(data, index, modes):
    """A texel by numbers that may be outside; axes as in `data`."""
    inside = []
    for i, extent, mode in zip(index, data.shape, modes, strict=True):
        if mode == CLAMP:
            i = min(max(i, 0), extent - 1)
        elif mode == WRAP:
            i = i % extent
        elif mode == MIRROR:
            i = i % (2 * extent)
            i = i if i < extent else 2 * extent - 1 - i
        elif not 0 <= i < extent:
            return 0.0
        inside.append(i)
    return float(data[tuple(inside)])


def expected(data, at, modes, filter_mode):
    """Reading in float64; `at` in texels, last axis first, as (u, v, w)."""
    found = []
    for point in np.atleast_2d(at.reshape(len(at), -1)).astype(np.float64)[:, ::-1]:
        if filter_mode == CLOSEST:
            found.append(texel(data, [int(np.floor(x)) for x in point], modes))
            continue
        low = np.floor(point - 0.5)
        rest, total = point - 0.5 - low, 0.0
        for corner in np.ndindex(*(2,) * len(point)):
            weight = np.prod([r if c else 1 - r for r, c in zip(rest, corner, strict=True)])
            total += weight * texel(data, [int(a) + c for a, c in zip(low, corner)], modes)
        found.append(total)
    return np.array(found)


@pytest.mark.parametrize("ndim", [1, 2, 3])
@pytest.mark.parametrize("filter_mode", [CLOSEST, LINEAR])
@pytest.mark.parametrize("mode", [WRAP, CLAMP, MIRROR, BORDER])
def test_coordinates_without_a_place(ndim, filter_mode, mode, device):
    """NaN has none, and infinity none where an axis repeats; elsewhere it is beyond the edge."""
    data = np.arange(1.0, 4.0**ndim + 1.0, dtype=np.float32).reshape((4,) * ndim)
    texture = CLASSES[ndim](
        data, filter_mode=filter_mode, address_mode=(mode,) * ndim, device=device
    )
    at = np.full((4 * ndim, ndim), 0.625)
    for axis in range(ndim):
        at[4 * axis : 4 * axis + 4, axis] = [np.nan, -np.inf, np.inf, -3.0]
    dtype = (float, wp.vec2, wp.vec3)[ndim - 1]
    given = wp.array(np.squeeze(at, 1) if ndim == 1 else at, dtype=dtype, device=device)
    out = wp.zeros(len(at), device=device)
    wp.launch(KERNELS[ndim], len(at), [texture, given, out], device=device)
    missing, low, high, outside = out.numpy().reshape(ndim, 4).T
    assert np.isnan(missing).all()
    if mode in (WRAP, MIRROR):
        assert np.isnan(low).all() and np.isnan(high).all()
    else:
        np.testing.assert_array_equal(low, outside)
        assert (high == 0.0).all() if mode == BORDER else (high >= low).all()


@pytest.mark.parametrize("ndim", [1, 2, 3])
@pytest.mark.parametrize("filter_mode", [CLOSEST, LINEAR])
@pytest.mark.parametrize("mode", [WRAP, CLAMP, MIRROR, BORDER])
@pytest.mark.parametrize("normalized", [False, True])
def test_reading(ndim, filter_mode, mode, normalized, device):
    rng = np.random.default_rng(ndim)
    shape = (3, 4, 5)[-ndim:]
    data = rng.standard_normal(shape).astype(np.float32)
    modes = (mode, CLAMP, WRAP)[:ndim]
    # Multiples of 1/64 are exact in either kind of coordinates.
    at = rng.integers(-640, 960, (200, ndim)) / 64.0 + 1 / 128
    texture = CLASSES[ndim](
        data, filter_mode=filter_mode, address_mode=modes, normalized_coords=normalized,
        device=device,
    )  # fmt: skip
    scale = np.array(shape[::-1]) if normalized else 1.0
    given = (at / scale).astype(np.float32)
    points = wp.array(given[:, 0] if ndim == 1 else given, device=device, dtype=KERNEL_TYPE[ndim])
    out = wp.zeros(200, dtype=float, device=device)
    wp.launch(KERNELS[ndim], 200, [texture, points, out], device=device)
    wanted = expected(data, at, modes[::-1], filter_mode)
    np.testing.assert_allclose(out.numpy(), wanted, atol=2e-5)


KERNEL_TYPE = {1: float, 2: wp.vec2, 3: wp.vec3}


def test_gradient_of_coordinates(device):
    data = np.random.default_rng(1).standard_normal((4, 5)).astype(np.float32)
    texture = wp.Texture2D(data, address_mode=WRAP, device=device)
    at = np.array([[0.31, 0.42], [0.95, 0.03], [-1.27, 2.63]])
    points = wp.array(at, dtype=wp.vec2, requires_grad=True, device=device)
    out = wp.zeros(3, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch(read2, 3, [texture, points, out], device=device)
    tape.backward(grads={out: wp.ones(3, device=device)})
    scale, step, wanted = np.array([5.0, 4.0]), 1e-6, np.zeros((3, 2))
    for axis in range(2):
        shift = step * np.eye(2)[axis]
        ends = [expected(data, (at + s) * scale, (WRAP, WRAP), LINEAR) for s in (shift, -shift)]
        wanted[:, axis] = (ends[0] - ends[1]) / (2 * step)
    np.testing.assert_allclose(points.grad.numpy(), wanted, rtol=1e-4, atol=1e-4)


def test_arguments_by_position_and_what_cuda_has(device):
    data = np.arange(4, dtype=np.float32)
    args = (0, 0, None, CLOSEST, WRAP, WRAP)
    texture = wp.Texture1D(data, *args, True, 1, None, device)
    assert texture.normalized_coords and texture.address_mode_u == WRAP and texture.width == 4
    flat = wp.Texture2D(data.reshape(2, 2), 0, *args, WRAP, False, 1, None, device)
    assert not flat.normalized_coords and flat.address_mode_v == WRAP
    with pytest.raises(TypeError, match="argument 'address_mode_v' is unknown"):
        wp.Texture1D(data, address_mode_v=WRAP, device=device)
    with pytest.raises(RuntimeError, match="textures over CUDA arrays are not in this package"):
        wp.Texture1D(cuda_array=8, width=4, device=device)
    problem = "only supported for CUDA textures"
    if wp.get_device(device).is_cuda:
        problem = "textures are arrays in linear memory, see `texels`"
    for name in ("cuda_array", "cuda_texture", "cuda_surface"):
        with pytest.raises(RuntimeError, match=problem):
            getattr(texture, name)
