"""Linear reading of texels whose differences overflow float32, against float64."""

import numpy as np
import pytest

import warp as wp

CLASSES = {1: wp.Texture1D, 2: wp.Texture2D, 3: wp.Texture3D}
POINTS = {1: float, 2: wp.vec2, 3: wp.vec3}


def reader(texture, points):
    def read(
        t: texture,
        at: wp.array(dtype=points),
        lod: wp.array(dtype=float),
        out: wp.array(dtype=float),
    ):
        i = wp.tid()
        out[i] = wp.texture_sample(t, at[i], dtype=float, lod=lod[i])

    return wp.kernel(read, module="unique")


def weighted(data, at):
    """Sums of texels by weights, the coordinates in texels and as axes of `data`."""
    low = np.clip(np.floor(at - 0.5), 0, np.array(data.shape) - 2).astype(int)
    rest = np.clip(at - 0.5 - low, 0.0, 1.0)
    total = np.zeros(len(at))
    for corner in np.ndindex(*(2,) * data.ndim):
        weights = np.where(corner, rest, 1.0 - rest).prod(axis=1)
        total += weights * data[tuple((low + corner).T)]
    return total


def sample(data, at, lod, device, **modes):
    """Values and gradients of the coordinates and levels; `at` in texels, last axis first."""
    ndim = data.ndim
    texture = CLASSES[ndim](
        data.astype(np.float32), address_mode=wp.TextureAddressMode.CLAMP,
        normalized_coords=False, device=device, **modes,
    )  # fmt: skip
    given = at[:, 0] if ndim == 1 else at[:, ::-1]
    points = wp.array(given, dtype=POINTS[ndim], requires_grad=True, device=device)
    levels = wp.array(lod, dtype=float, requires_grad=True, device=device)
    out = wp.zeros(len(at), requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch(reader(CLASSES[ndim], POINTS[ndim]), len(at), [texture, points, levels, out],
                  device=device)  # fmt: skip
    tape.backward(grads={out: wp.ones(len(at), device=device)})
    slopes = points.grad.numpy().reshape(len(at), ndim)[:, ::-1]
    return out.numpy(), slopes, levels.grad.numpy()


@pytest.mark.parametrize("ndim", [1, 2, 3])
@pytest.mark.parametrize("size", [1.0, 1e37, 3.3e38])
def test_values(ndim, size, device):
    rng = np.random.default_rng(ndim)
    data = size * rng.choice([-1.0, 1.0, 0.5], (4,) * ndim)
    at = rng.uniform(0.0, 4.0, (300, ndim)).astype(np.float32)
    values, _, _ = sample(data, at, np.zeros(300), device)
    wanted = weighted(data.astype(np.float32).astype(np.float64), at.astype(np.float64))
    np.testing.assert_allclose(values, wanted, rtol=0, atol=2e-6 * size)


@pytest.mark.parametrize("ndim", [1, 2, 3])
def test_gradients_that_a_float_holds(ndim, device):
    """Texels along one axis alone, 3.2e38 apart: differences of the others are zero."""
    axis = ndim - 1
    data = np.zeros((2,) * ndim)
    data[(..., 0)], data[(..., 1)] = 1.2e38, -2e38
    at = np.full((3, ndim), 1.0)
    at[:, axis] = [0.75, 1.0, 1.25]
    values, slopes, _ = sample(data, at, np.zeros(3), device)
    np.testing.assert_allclose(values, [0.4e38, -0.4e38, -1.2e38], rtol=1e-6)
    wanted = np.zeros((3, ndim))
    wanted[:, axis] = -3.2e38
    np.testing.assert_allclose(slopes, wanted, rtol=1e-6, atol=1e32)


@pytest.mark.parametrize("filter_mode", list(wp.TextureFilterMode))
def test_between_levels(filter_mode, device):
    """The coarse level of one texel is the mean, 0 of these, so its distance is that of a texel."""
    data = np.array([3e38, -3e38, 3e38, -3e38]).reshape(2, 2)
    at = np.array([[0.5, 0.5], [0.5, 1.5]])
    values, _, slopes = sample(
        data, at, [0.25, 0.75], device, filter_mode=filter_mode, num_mip_levels=2,
        mip_filter_mode=wp.TextureFilterMode.LINEAR,
    )  # fmt: skip
    np.testing.assert_allclose(values, [0.75 * 3e38, 0.25 * -3e38], rtol=1e-6)
    np.testing.assert_allclose(slopes, [-3e38, 3e38], rtol=1e-6)
