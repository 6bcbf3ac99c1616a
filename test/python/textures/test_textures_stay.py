"""The texture data that kernels read cannot be replaced, where it would lead beyond its texels."""

import copy

import numpy as np
import pytest

import warp as wp

SHAPES = {wp.Texture1D: (5,), wp.Texture2D: (4, 5), wp.Texture3D: (3, 4, 5)}
VALUES = {
    **dict.fromkeys(("width", "height", "depth", "num_channels", "levels"), 10**8),
    **dict.fromkeys(("kind", "filter", "mip_filter"), 77),
    **dict.fromkeys(("address_u", "address_v", "address_w"), -1),
    "normalized": True,
    "texels": None,
}


@wp.struct
class Scene:
    image: wp.Texture2D
    scale: float


@wp.kernel
def middle(scene: Scene, out: wp.array(dtype=float)):
    out[0] = wp.texture_sample(scene.image, wp.vec2(0.5, 0.5), dtype=float) * scene.scale


def texture(kind=wp.Texture2D, device="cpu"):
    return kind(np.ones(SHAPES[kind], np.float32), device=device)


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("name", VALUES)
def test_attributes_are_read_only(device, kind, name):
    """The texture, an empty one and one in a struct refuse another value and keep theirs."""
    scene = Scene(image=texture(device=device), scale=2.0)
    for one in (texture(kind, device), kind(), scene.image):
        old = getattr(one, name)
        with pytest.raises(AttributeError, match=f"'{name}' of a 'Texture.D' cannot be replaced"):
            setattr(one, name, VALUES[name])
        assert getattr(one, name) is old or getattr(one, name) == old


def test_other_attributes_are_refused():
    for name in ("widht", "dtype", "device", "filter_mode", "id", "num_mip_levels"):
        with pytest.raises(AttributeError):
            setattr(texture(), name, 1)


def test_textures_are_assigned_and_copied_as_a_whole(device):
    scene = Scene(scale=3.0)
    out = wp.zeros(1, dtype=float, device=device)
    for value in (2.0, 5.0):
        scene.image = wp.Texture2D(np.full((6, 7), value, np.float32), device=device)
        wp.launch(middle, 1, inputs=[scene, out], device=device)
        assert out.numpy()[0] == 3.0 * value
    other = wp.Texture2D().assign(scene.image)
    for one in (other, copy.copy(scene.image), scene.to(device).image, scene.image.to(device)):
        assert (one.width, one.height) == (7, 6) and (one.numpy() == 5.0).all()


@pytest.mark.parametrize(
    "shape, dtype", [((4, 6), "f4"), ((5, 4), "f4"), ((20,), "f4"), ((4, 5), "i4")]
)
def test_copies_to_numpy_of_another_shape_or_type_are_refused(device, shape, dtype):
    with pytest.raises(ValueError):
        texture(device=device).copy_to(np.zeros(shape, dtype))
    target = np.zeros((4, 5), np.float32)
    texture(device=device).copy_to(target)
    assert (target == 1.0).all()
