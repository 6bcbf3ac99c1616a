"""The path tracer against closed forms and against quadrature in float64."""

import numpy as np
import pytest

import warp as wp

WHITE = {"top": (1.0,) * 3, "horizon": (1.0,) * 3, "ground": (1.0,) * 3}
BLACK = {"top": (0.0,) * 3, "horizon": (0.0,) * 3, "ground": (0.0,) * 3}
CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
FACES = np.array(
    [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4]
    + [1, 5, 7, 1, 7, 3]
)


def scene_of(device, sky=WHITE, size=24, **camera):
    scene = wp.render.Scene(size, size, device=device)
    scene.set_sky(**sky)
    scene.set_camera(**{"eye": (0.0, 0.5, 4.0), "target": (0.0, 0.0, 0.0), **camera})
    return scene


def floor(scene, **material):
    return scene.add_height_field(np.zeros((2, 2)), (-50, -50), (50, 50), **material)


def middle(scene, samples):
    """The mean of the pixels in the middle of a narrow view."""
    scene.accumulate(samples)
    return scene.radiance().mean(axis=(0, 1))


@pytest.mark.parametrize("material", [{"specular": 0.0}, {"transmission": 1.0}])
def test_white_bodies_vanish_in_a_white_furnace(device, material):
    scene = scene_of(device)
    scene.depth = 64
    scene.add_spheres([[0, 0, 0]], 1.0, color=(1, 1, 1), **material)
    scene.add_mesh(CUBE * 0.4 + [1.2, 0, 0], FACES, smooth=False, color=(1, 1, 1), **material)
    scene.accumulate(4)
    # Paths that total reflection keeps in the cube for 64 bounces are cut.
    off = np.abs(scene.radiance() - 1.0).max(axis=-1)
    assert np.quantile(off, 0.9) < 2e-5
    assert scene.radiance().max() < 1.0 + 2e-5


def albedo_by_quadrature(f0, alpha, cosine, metal):
    """Directional albedo of microfacets (f0 metal) or of a coat on a white base, in float64."""
    n = 1200
    mu = (np.arange(n) + 0.5) / n
    phi = (np.arange(n) + 0.5) / n * 2.0 * np.pi
    mu, phi = np.meshgrid(mu, phi, indexing="ij")
    wo = np.array([np.sqrt(1.0 - cosine**2), 0.0, cosine])
    s = np.sqrt(1.0 - mu**2)
    wi = np.stack([s * np.cos(phi), s * np.sin(phi), mu], -1)
    h = wi + wo
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    d = 1.0 / (
        np.pi * alpha**2 * ((h[..., 0] ** 2 + h[..., 1] ** 2) / alpha**2 + h[..., 2] ** 2) ** 2
    )
    lam = [0.5 * (np.sqrt(1.0 + alpha**2 * (1.0 - c**2) / c**2) - 1.0) for c in (cosine, mu)]
    grazing = 1.0 if metal else min(1.0, 50.0 * f0)
    fresnel = lambda c: f0 + (grazing - f0) * (1.0 - c) ** 5  # noqa: E731
    value = fresnel((wi * h).sum(-1)) * d / ((1.0 + lam[0] + lam[1]) * 4.0 * cosine)
    if not metal:
        value = value + (1.0 - fresnel(cosine)) * (1.0 - fresnel(mu)) * mu / np.pi
    return value.mean() * 2.0 * np.pi


@pytest.mark.parametrize("metal", [True, False])
@pytest.mark.parametrize("roughness", [0.4, 0.9])
@pytest.mark.parametrize("cosine", [0.95, 0.4])
def test_directional_albedo_is_the_integral(device, metal, roughness, cosine):
    sine = np.sqrt(1.0 - cosine**2)
    scene = scene_of(device, eye=(0.0, 4.0 * cosine, 4.0 * sine), fov=0.5)
    f0 = 0.9 if metal else 0.04
    options = {"color": (0.9,) * 3, "metallic": 1.0} if metal else {"color": (1,) * 3}
    floor(scene, roughness=roughness, **options)
    scene.depth = 1
    found = middle(scene, 64)[0]
    expected = albedo_by_quadrature(f0, roughness**2, cosine, metal)
    assert expected < 1.0
    assert found == pytest.approx(expected, abs=4e-3)


@pytest.mark.parametrize("aside", [0.0, 1.5])
def test_a_spherical_lamp_lights_by_its_form_factor(device, aside):
    scene = scene_of(device, BLACK, eye=(aside, 3.0, 0.05), target=(aside, 0, 0), fov=0.2)
    scene.set_camera((aside, 3.0, 3.0), (aside, 0.0, 0.0), fov=0.2)
    floor(scene, color=(0.6, 0.6, 0.6), specular=0.0)
    scene.add_spheres([[0, 2.0, -0.5]], 0.5, emission=(10, 5, 1))
    scene.depth = 1
    d2 = aside**2 + 4.0 + 0.25
    factor = 0.25 / d2 * 2.0 / np.sqrt(d2)
    expected = 0.6 * factor * np.array([10.0, 5.0, 1.0])
    np.testing.assert_allclose(middle(scene, 64), expected, rtol=2e-3)


def test_the_sun_lights_by_its_irradiance(device):
    scene = scene_of(device, {"sun": (0.3, 1.0, 0.2)}, eye=(0.0, 3.0, 3.0), fov=0.2)
    scene.sky.zero_()
    floor(scene, color=(0.5, 0.5, 0.5), specular=0.0)
    scene.depth = 1
    direction, radiance, cosine = scene.sun
    solid = 2.0 * np.pi * (1.0 - cosine) * 0.5 * (1.0 + cosine)
    expected = 0.5 / np.pi * radiance * solid * direction[1]
    np.testing.assert_allclose(middle(scene, 16), expected, rtol=2e-3)


def test_a_slab_of_glass_reflects_as_fresnel_says(device):
    sky = np.zeros((2, 1, 3), np.float32)
    sky[0] = 1.0
    scene = scene_of(device, {"image": np.repeat(sky, [64, 64], axis=0)}, fov=0.5)
    scene.set_camera((0.0, 4.0, 0.02), (0.0, 0.0, 0.0), fov=0.5)
    slab = CUBE * [20.0, 0.1, 20.0]
    scene.add_mesh(slab, FACES, smooth=False, transmission=1.0, color=(1, 1, 1))
    scene.depth = 32
    once = 0.04
    assert middle(scene, 256)[0] == pytest.approx(2.0 * once / (1.0 + once), abs=2.5e-3)


def medium_of(scene, density, **options):
    values = np.full((16, 16, 16), density, np.float32)
    volume = wp.Volume.load_from_numpy(
        values, min_world=(-1, -1, -1), voxel_size=2.0 / 15.0, device=scene.device
    )
    scene.add_volume(volume, **options)


def test_smoke_dims_as_beer_says(device):
    scene = scene_of(device, eye=(0.0, 0.0, 4.0), fov=1.0)
    medium_of(scene, 0.5, albedo=(0, 0, 0))
    # Voxels of the border fall off to the background within half a voxel on average.
    length = 2.0 + 2.0 / 15.0
    assert middle(scene, 256)[0] == pytest.approx(np.exp(-0.5 * length), abs=6e-3)


def test_white_smoke_vanishes_in_a_white_furnace(device):
    scene = scene_of(device, eye=(0.0, 0.0, 4.0))
    scene.depth = 200
    medium_of(scene, 1.0, albedo=(1, 1, 1), asymmetry=0.5)
    scene.accumulate(8)
    np.testing.assert_allclose(scene.radiance(), 1.0, atol=1e-4)


def test_instances_are_copies(device):
    pictures = []
    turn = np.array([[0.0, 0.0, 1.0], [0.0, 2.0, 0.0], [-1.0, 0.0, 0.0]])
    for placed in (False, True):
        scene = scene_of(device, {})
        where = np.eye(4)
        where[:3, :3], where[:3, 3] = turn, (0.2, 0.1, 0.3)
        if placed:
            scene.add_mesh(CUBE * 0.5, FACES, transforms=where)
        else:
            scene.add_mesh((CUBE * 0.5) @ turn.T + where[:3, 3], FACES)
        scene.accumulate(64)
        pictures.append(scene.radiance())
    # Rounding sends a path elsewhere now and then: means agree, and nearly all of the pixels.
    off = np.abs(pictures[0] - pictures[1]).max(axis=-1)
    assert np.quantile(off, 0.9) < 0.05
    np.testing.assert_allclose(pictures[0].mean(), pictures[1].mean(), rtol=5e-3)
